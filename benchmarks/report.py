"""The figures in words: a line each on the screen, a table in docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from benchmarks.figures import Figure
from benchmarks.targets import Target

Measured = Sequence[tuple[Target, Sequence[Figure]]]

LATER: Final = "not measured yet (later issue)"
SKIPPED: Final = "left out in this run"
VERDICT: Final = {True: "reached", False: "not reached", None: ""}
INTRODUCTION: Final = """# Benchmarks

Written by `make bench`. Every ratio is taken in short alternating slices of one run, ours against its
reference: the median of the pairs [10th .. 90th percentile]. Only such ratios mean something on another
machine; absolute figures stand in the notes and are no promise. Targets (design section 7) are aims, not
gates: what is reached is reported as it is.

An overrun is the engine's when more processor time than an interval was used from the end of the scan before
to the end of this one, work between the scans included; with less the scan would have ended in time, had it
not waited for the processor: that overrun is the machine's.
"""


def lines(target: Target, figures: Sequence[Figure]) -> list[str]:
    """Return the screen's lines for one target."""
    if not figures:
        return [f"{target.name:4} {target.promise}: {_nothing(target)}"]
    return [f"{target.name:4} {target.promise}", *(f"       {_words(figure)}" for figure in figures)]


def _nothing(target: Target) -> str:
    return LATER if target.measure is None else SKIPPED


def _words(figure: Figure) -> str:
    aim = f"  aim {figure.aim}: {VERDICT[figure.held]}" if figure.aim else ""
    return f"{figure.case:42} {figure.value}{aim}" + (f"  ({figure.note})" if figure.note else "")


def markdown(facts: Iterable[str], measured: Measured, command: str) -> str:
    """Return the page: machine facts, every target, every figure."""
    rows = ["| target | case | reached | aim | | notes |", "| --- | --- | --- | --- | --- | --- |"]
    for target, figures in measured:
        rows.append(
            f"| **{target.name}** | *{target.promise}* | {'' if figures else _nothing(target)} | | | |"
        )
        for figure in figures:
            verdict = VERDICT[figure.held]
            rows.append(f"| | {figure.case} | {figure.value} | {figure.aim} | {verdict} | {figure.note} |")
    machine = "\n".join(f"* {fact}" for fact in facts)
    table = "\n".join(rows)
    return f"{INTRODUCTION}\n## Machine\n\n{machine}\n* command: `{command}`\n\n## Figures\n\n{table}\n"
