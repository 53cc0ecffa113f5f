"""How punctual the scans are: lateness of each start, length of each scan, overruns."""

from __future__ import annotations

import json
from collections import deque
from pathlib import Path
from typing import Final

from trcvtui.files import write_file
from trcvtui.rig import clock
from trcvtui.rig.snapshots import EngineTiming

KEPT: Final = 1000


class Punctuality:
    """The last thousand scans' lateness and length, in ns, and the overruns since the start."""

    def __init__(self, mode: str) -> None:
        self._mode = mode
        self._late: deque[int] = deque(maxlen=KEPT)
        self._length: deque[int] = deque(maxlen=KEPT)
        self._scans = 0
        self._overruns = 0
        self._sorted_at = 0
        self._percentiles = (0, 0, 0)
        self._every: list[tuple[int, int, int, int]] | None = None
        self._used = 0  # processor time when the last scan ended

    def keep_every(self) -> None:
        """Keep every scan from now on, for `write_to`."""
        self._every, self._used = [], clock.used_ns()

    def write_to(self, path: Path) -> None:
        """Write every kept scan as JSON: [began on the monotonic clock, late, length, used], all in ns.

        `used` is the processor time from the end of the scan before to the end of this one.
        """
        kept = {"mode": self._mode, "overruns": self._overruns, "scans": self._every}
        write_file(path, json.dumps(kept), "timing", is_own=True)

    def scanned(self, due: int, began: int, ended: int, interval: int) -> None:
        """Count one scan; it overran when it ended after the next one was due."""
        self._scans += 1
        self._late.append(began - due)
        self._length.append(ended - began)
        if ended > due + interval:
            self._overruns += 1
        if self._every is not None:
            before, self._used = self._used, clock.used_ns()
            self._every.append((began, began - due, ended - began, self._used - before))

    def summary(self) -> EngineTiming:
        """Return the percentiles of what is kept; they are found anew when enough of it is new."""
        if self._scans - self._sorted_at >= len(self._late) // 8:
            self._sorted_at = self._scans
            late, length = sorted(self._late), sorted(self._length)
            self._percentiles = _at(late, 0.50), _at(late, 0.99), _at(length, 0.99)
        return EngineTiming(self._scans, self._overruns, *self._percentiles, self._mode)


def _at(ordered: list[int], share: float) -> int:
    return ordered[min(len(ordered) - 1, int(len(ordered) * share))] if ordered else 0
