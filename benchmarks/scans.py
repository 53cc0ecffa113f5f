"""What the engine wrote about its scans, and who is to blame for those that overran.

An overrun is the engine's own when it used more processor time than an interval between the end of the scan
before and the end of this one. With less than that it would have ended in time, had it not waited for the
processor: such an overrun is the machine's. Work between the scans is held against the engine too.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final, Self

from benchmarks.figures import Figure, percentile

LATE_NS: Final = 100_000  # what waking up may take is not held against the work before it
NEARLY_ALL: Final = 0.9


@dataclass(frozen=True, slots=True)
class Scan:
    """One scan, in ns: when it began on the monotonic clock, how late, its length, processor time used."""

    began: int
    late: int
    length: int
    used: int

    def overran(self, interval: int) -> bool:
        """Return whether it ended after the next one was due."""
        return self.late + self.length > interval


@dataclass(frozen=True, slots=True)
class Scans:
    """All scans of one engine, from its start to its end; `interval` in ns."""

    mode: str
    interval: int
    scans: tuple[Scan, ...]

    @classmethod
    def read(cls, timing: Path, interval: int) -> Self:
        """Read the file that the engine has written at its end."""
        record = json.loads(timing.read_text())
        return cls(record["mode"], interval, tuple(Scan(*scan) for scan in record["scans"]))

    def between(self, begin: int, end: int) -> Scans:
        """Return those that began between two moments of the monotonic clock."""
        return Scans(self.mode, self.interval, tuple(s for s in self.scans if begin <= s.began < end))

    def late_us(self, share: float) -> float:
        """Return a percentile of the lateness, in us."""
        return _us([scan.late for scan in self.scans], share)

    @property
    def latest_us(self) -> float:
        """Return by how much the latest scan began late, in us."""
        return max((scan.late / 1000 for scan in self.scans), default=0.0)

    @property
    def overruns(self) -> int:
        """Return how many scans ended after the next one was due."""
        return sum(scan.overran(self.interval) for scan in self.scans)

    @property
    def own_overruns(self) -> int:
        """Return how many of them were the engine's own doing."""
        return sum(scan.overran(self.interval) and scan.used > self.interval for scan in self.scans)

    @property
    def late_after_work(self) -> int:
        """Return how many began late because the engine was at work between the scans when they were due.

        It has not slept in such a gap: of its length nearly all is processor time.
        """
        return sum(
            scan.late > LATE_NS
            and scan.used - scan.length > NEARLY_ALL * (scan.began - before.began - before.length)
            for before, scan in pairwise(self.scans)
        )

    def words(self) -> str:
        """Return p50 and p99 of lateness, length and processor time."""
        columns = (
            ("late", [scan.late for scan in self.scans]),
            ("scan", [scan.length for scan in self.scans]),
            ("processor time", [scan.used for scan in self.scans]),
        )
        return "; ".join(
            f"{name} p50 {_us(ns, 0.5):.0f} us, p99 {_us(ns, 0.99):.0f} us" for name, ns in columns
        )

    def blame(self) -> str:
        """Return in words who caused the overruns."""
        return f"{self.own_overruns} by the engine, {self.overruns - self.own_overruns} by the machine"


def overruns(case: str, scans: Scans, at_limit: bool = False) -> Figure:
    """Return who overran; the engine's own are what counts."""
    note = f"of {len(scans.scans)} scans; {scans.words()}"
    return Figure(f"{case}: overruns", scans.blame(), scans.own_overruns, note, at_limit)


def _us(ns: Sequence[int], share: float) -> float:
    return percentile(ns, share) / 1000
