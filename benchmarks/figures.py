"""What a measurement is asked and what it answers; figures taken in pairs.

On a shared machine only ratios are repeatable whose two sides were taken in short alternating slices.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Self

NOT_MEASURED: Final = "not measured"


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure: pairs of slices, rounds of windows and their seconds, program starts, a minute."""

    pairs: int
    rounds: int
    window_s: int
    starts: int
    minute_s: int
    scans_a_day: int  # of the simulated 24 hours


FULL: Final = Effort(pairs=25, rounds=5, window_s=3, starts=11, minute_s=60, scans_a_day=86_400)
QUICK: Final = Effort(pairs=7, rounds=1, window_s=3, starts=3, minute_s=5, scans_a_day=4_000)


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


@dataclass(frozen=True, slots=True)
class Figure:
    """One case of a target. `number`, in the unit of its aim, is held against it; None: not measured.

    `at_limit`: the machine itself takes most of the time there is; an aim that is missed then is its doing.
    """

    case: str
    value: str
    number: float | None = None
    note: str = ""
    at_limit: bool = False

    @classmethod
    def of(
        cls, case: str, share: Spread, digits: int = 2, unit: str = "", note: str = "", at_limit: bool = False
    ) -> Self:
        """Return the median as the number."""
        return cls(case, share.text(digits, unit), share.median, note, at_limit)

    @classmethod
    def missing(cls, case: str, why: str) -> Self:
        """Return that there is no figure, and why."""
        return cls(case, NOT_MEASURED, note=why)


def spread(figures: Sequence[float]) -> Spread:
    """Return median, p10 and p90; between two figures the percentile is interpolated."""
    if not figures:
        raise ValueError("no figures")
    if len(figures) == 1:
        return Spread(figures[0], figures[0], figures[0], 1)
    tenths = statistics.quantiles(figures, n=10, method="inclusive")
    return Spread(statistics.median(figures), tenths[0], tenths[-1], len(figures))


Pairs = Sequence[tuple[float, float]]


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


def ratios(figures: Pairs) -> Spread:
    """Return ours / reference, pair by pair; a pair whose reference did nothing is left out."""
    return spread([mine / theirs for mine, theirs in figures if theirs > 0])


def against(figures: Pairs, digits: int, unit: str, factor: float = 1.0) -> str:
    """Return `ours against reference` in words, both times the factor."""
    columns = (spread([factor * figure for figure in column]) for column in zip(*figures, strict=True))
    return " against ".join(column.text(digits, unit) for column in columns)


def percentile(figures: Sequence[float], share: float) -> float:
    """Return the smallest figure that at least `share` of all do not exceed; 0 when there are none."""
    ordered = sorted(figures)
    return ordered[max(0, -(-len(ordered) * share // 1).__int__() - 1)] if ordered else 0.0
