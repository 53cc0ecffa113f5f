"""Paired ratios: two ways of doing one thing, in short alternating slices, compared slice by slice.

On a shared machine only ratios taken this way are repeatable (reference/performance.md).
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Spread:
    """The median of some figures, and the tenth and ninetieth percentile around it."""

    median: float
    p10: float
    p90: float
    count: int

    def text(self, digits: int = 2, unit: str = "") -> str:
        """Return `0.97 [0.95 .. 0.99]`."""
        low, mid, high = (f"{value:.{digits}f}" for value in (self.p10, self.median, self.p90))
        return f"{mid}{unit} [{low} .. {high}]"


def spread(figures: Sequence[float]) -> Spread:
    """Return median, p10 and p90; between two figures the percentile is interpolated."""
    if not figures:
        raise ValueError("no figures")
    if len(figures) == 1:
        return Spread(figures[0], figures[0], figures[0], 1)
    tenths = statistics.quantiles(figures, n=10, method="inclusive")
    return Spread(statistics.median(figures), tenths[0], tenths[-1], len(figures))


def alternate(
    ours: Callable[[], float], reference: Callable[[], float], pairs: int
) -> list[tuple[float, float]]:
    """Return (ours, reference) of each pair; who goes first changes, so that a drift favours nobody."""
    figures = []
    for turn in range(pairs):
        if turn % 2:
            theirs, mine = reference(), ours()
        else:
            mine, theirs = ours(), reference()
        figures.append((mine, theirs))
    return figures


def ratios(figures: Sequence[tuple[float, float]]) -> Spread:
    """Return ours / reference, pair by pair; a pair whose reference did nothing is left out."""
    return spread([mine / theirs for mine, theirs in figures if theirs > 0])


def percentile(figures: Sequence[float], share: float) -> float:
    """Return the smallest figure that at least `share` of all do not exceed; 0 when there are none."""
    ordered = sorted(figures)
    return ordered[max(0, -(-len(ordered) * share // 1).__int__() - 1)] if ordered else 0.0
