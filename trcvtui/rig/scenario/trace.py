"""The STATUS of one instance, scan by scan, as runs: since the last `trace`, and over the whole scenario.

Bounds, an instance: MOST_RUNS_SINCE runs of the newest scans (64 bytes each, 6.4 MB), MOST_RUNS_TOLD runs of
the oldest. A run is any number of equal scans, so an instance that waits costs nothing, however long.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import islice
from typing import Final

from trcvtui.rig.commands.trace_pattern import ANY, Run, Scan, TracePattern, collapse, matches

MOST_RUNS_SINCE: Final = 100_000
MOST_RUNS_TOLD: Final = 5000


@dataclass(frozen=True, slots=True)
class Section:
    """The scans between two `trace`; `lost` of them, the oldest, are no longer kept."""

    runs: tuple[Run, ...]
    lost: int

    def fits(self, pattern: TracePattern) -> bool:
        """Return whether the pattern describes all scans; what is lost can only be any scans."""
        return (not self.lost or pattern.atoms[0] == ANY) and matches(pattern, self.runs)

    def __str__(self) -> str:
        """Return the scans in the notation of a pattern."""
        lost = f"{self.lost} older scans, no longer kept ({MOST_RUNS_SINCE} changes are), then "
        return lost * bool(self.lost) + collapse(self.runs)


class Trace:
    """What the called scans of one instance have shown."""

    def __init__(self) -> None:
        self._since: deque[Run] = deque()
        self._lost = 0
        self._told: list[Run] = []
        self._is_cut = False
        self._known: dict[Scan, Scan] = {}  # equal scans share one tuple

    def add(self, scan: Scan) -> None:
        """Append one called scan."""
        scan = self._known.setdefault(scan, scan)
        if not _went_on(self._since, scan):
            self._since.append((scan, 1))
            if len(self._since) > MOST_RUNS_SINCE:
                self._lost += self._since.popleft()[1]
        if not self._is_cut and not _went_on(self._told, scan):
            self._is_cut = len(self._told) == MOST_RUNS_TOLD
            if not self._is_cut:
                self._told.append((scan, 1))

    def take(self) -> Section:
        """Return the scans since the last time, and begin anew."""
        section = Section(tuple(self._since), self._lost)
        self._since.clear()
        self._lost = 0
        return section

    def newest(self, most: int) -> str:
        """Return the newest runs in the notation of a pattern, `...` for those before them."""
        kept = self._since if self._is_cut else self._told
        runs = list(islice(reversed(kept), most))[::-1]
        older = self._is_cut or len(kept) > most
        return "... " * older + (collapse(runs) if runs else "")

    def __str__(self) -> str:
        """Return the scans of the whole scenario in the notation of a pattern, `...` where they are cut."""
        return (collapse(self._told) if self._told else "") + " ..." * self._is_cut


def _went_on(runs: deque[Run] | list[Run], scan: Scan) -> bool:
    """Make the last run one scan longer when it is a run of this scan."""
    if not runs or runs[-1][0] != scan:
        return False
    runs[-1] = (scan, runs[-1][1] + 1)
    return True
