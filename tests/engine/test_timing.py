"""How punctual the scans were, for the screen: a bad scan is told until ten good seconds have passed."""

from __future__ import annotations

from trcvtui.engine.timing import BAD_SHOWN_NS, ScanTiming

MS = 1_000_000
SCAN = 10 * MS


def bad_time(timing: ScanTiming, now: int) -> tuple[int, int]:
    told = timing.summary(now)
    return told.overruns, told.late_ns


def test_a_late_scan_and_an_overrun_are_told_for_ten_seconds_and_then_no_more() -> None:
    timing = ScanTiming("")
    timing.count_scan(0, SCAN // 2, SCAN // 2 + MS, SCAN)
    assert bad_time(timing, SCAN) == (0, 0), "half an interval is not late"
    timing.count_scan(0, SCAN // 2 + 1, 7 * MS, SCAN)
    timing.count_scan(20 * MS, 20 * MS, 31 * MS, SCAN)
    assert bad_time(timing, 31 * MS + BAD_SHOWN_NS - 1) == (1, SCAN // 2 + 1)
    assert bad_time(timing, 31 * MS + BAD_SHOWN_NS) == (0, 0)
    at = 31 * MS + BAD_SHOWN_NS
    timing.count_scan(at, at, at + SCAN + 1, SCAN)
    assert bad_time(timing, at + SCAN) == (1, 0), "the bad time before is over"
