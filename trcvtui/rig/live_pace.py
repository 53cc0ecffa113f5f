"""Real time for a live bench: a scan at each multiple of the interval, never two in a burst."""

from __future__ import annotations

from typing import Final

from trcvtui.rig import clock
from trcvtui.rig.assembly import Bench

SETTLE_LIMIT_NS: Final = 2_000_000_000
SETTLE_STEP_NS: Final = 200_000


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

    def settle(self, bench: Bench) -> None:
        """Let peers work until the local kernel has taken what they were told, or a limit has passed."""
        limit = clock.now_ns() + SETTLE_LIMIT_NS
        while not bench.settled and clock.now_ns() < limit:
            clock.sleep_until(clock.now_ns() + SETTLE_STEP_NS)
            bench.step_peers()
