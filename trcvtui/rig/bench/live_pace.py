"""Real time for a live bench: a scan at each multiple of the interval, never two in a burst."""

from __future__ import annotations

from trcvtui.rig import clock
from trcvtui.rig.bench.bench import Bench


class LivePace:
    """Scans at the pace of the monotonic clock."""

    def __init__(self) -> None:
        self._start = clock.now_ns()
        self._deadline = self._start

    def next_scan(self, bench: Bench) -> None:
        """Sleep until the next scan is due, then let it pass."""
        clock.sleep_until(self._deadline)
        now = clock.now_ns()
        bench.step(now - self._start)
        interval = bench.runtime.interval_ns
        self._deadline += interval
        if self._deadline < now:
            self._deadline = now + interval
