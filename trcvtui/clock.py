"""The only clock of the house: monotonic nanoseconds, UTC, processor time, and sleeping until a deadline."""

from __future__ import annotations

import time

NS_PER_S = 1_000_000_000


def now_ns() -> int:
    """Return monotonic nanoseconds."""
    return time.perf_counter_ns()


def wall_ns() -> int:
    """Return the nanoseconds of UTC since 1970."""
    return time.time_ns()


def thread_cpu_ns() -> int:
    """Return the nanoseconds of processor time that this thread has used: waiting does not count."""
    return time.thread_time_ns()


def sleep_until(deadline_ns: int) -> None:
    """Sleep until the monotonic deadline; return at once when it has passed."""
    left = deadline_ns - time.perf_counter_ns()
    if left > 0:
        time.sleep(left / NS_PER_S)
