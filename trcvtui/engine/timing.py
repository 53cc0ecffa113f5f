"""Asks the operating system for punctual scans, and measures how late and how long each scan was.

The requests need no privileges. A refused request is normal, and is shown. Linux only.
Measured: timer slack 1 ns and an EEVDF slice of 100 us bring the p99 start
lateness of a 10 ms scan beside a busy screen from 3.8 ms to 0.1 ms. With autogroup the kernel gives each
session a share of the processor, and the slice counts only inside the session. So the engine gets its
own session, and the screen's processor time is not charged to the engine.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import struct
import sys
from pathlib import Path
from typing import Final

from trcvtui import clock
from trcvtui.files import write_file
from trcvtui.snapshots.bench import EngineTiming

SLICE_NS: Final = 100_000
_PR_SET_TIMERSLACK: Final = 29
_SYS_SCHED_SETATTR: Final = {"x86_64": 314, "aarch64": 274}


def request_punctuality() -> str:
    """Request punctual scheduling for this process; return in words which requests were granted."""
    if not sys.platform.startswith("linux"):
        return "default scheduling"
    asked = ("slack", _set_timer_slack), ("slice", _set_time_slice), ("session", _begin_session)
    granted = [name for name, ask in asked if ask()]
    return "+".join(granted) or "default scheduling"


def freeze_collector() -> None:
    """Exempt the present objects from cyclic garbage collection, and switch the collector off.

    A full collection took 45 to 138 ms; the engine makes no reference cycles while it scans.
    Objects exempted earlier are collected first, so that a bench that is no longer in use is freed.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()
    gc.disable()


def _set_timer_slack() -> bool:
    libc = ctypes.CDLL(None, use_errno=True)
    return bool(libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0)


def _set_time_slice() -> bool:
    import platform

    number = _SYS_SCHED_SETATTR.get(platform.machine())
    if number is None:
        return False
    # struct sched_attr: size, policy SCHED_OTHER, flags, nice, priority, slice, deadline, period
    attr = struct.pack("=IIQiIQQQ", 48, 0, 0, 0, 0, SLICE_NS, 0, 0)
    return bool(ctypes.CDLL(None, use_errno=True).syscall(number, 0, attr, 0) == 0)


def _begin_session() -> bool:
    try:
        os.setsid()
    except OSError:  # a leader of its process group already
        return False
    return True


BAD_SHOWN_NS: Final = 10_000_000_000  # how long a bad scan is shown


class ScanTiming:
    """Overruns and worst lateness (ns) of the latest bad scans, both 0 after 10 s without a bad scan."""

    def __init__(self, mode: str) -> None:
        self._mode = mode
        self._scans = 0
        self._bad, self._bad_until = (0, 0), 0  # overruns and the worst lateness; 0: not late
        self._overruns = 0
        self.late_by_picture = 0  # scans that were due before the work on a picture paused
        self._every: list[tuple[int, int, int, int]] | None = None
        self._used = 0  # processor time when the last scan ended

    def keep_every_scan(self) -> None:
        self._every, self._used = [], clock.thread_cpu_ns()

    def write_to(self, path: Path) -> None:
        """Write every kept scan as JSON: [began on the monotonic clock, late, length, used], all in ns.

        `used` is the processor time from the end of the previous scan to the end of this scan.
        """
        late = self.late_by_picture
        kept = {
            "mode": self._mode, "overruns": self._overruns, "late_by_picture": late, "scans": self._every
        }  # fmt: skip
        write_file(path, json.dumps(kept), "timing", is_own=True)

    def count_scan(self, due: int, began: int, ended: int, interval: int) -> None:
        """Count one scan. A scan overran if it ended after the next scan was due.

        The scan is late if it began more than half an interval after `due`.
        """
        self._scans += 1
        has_overrun, late = ended > due + interval, began - due
        self._overruns += has_overrun
        if has_overrun or late > interval // 2:
            overruns, worst = self._bad if ended < self._bad_until else (0, 0)
            self._bad = overruns + has_overrun, max(worst, late if late > interval // 2 else 0)
            self._bad_until = ended + BAD_SHOWN_NS
        if self._every is not None:
            before, self._used = self._used, clock.thread_cpu_ns()
            self._every.append((began, began - due, ended - began, self._used - before))

    def summary(self, now: int) -> EngineTiming:
        bad = self._bad if now < self._bad_until else (0, 0)
        return EngineTiming(self._scans, *bad, self._mode, self.late_by_picture)
