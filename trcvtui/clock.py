"""The only clock of the program: monotonic nanoseconds, UTC, processor time, and sleep until a deadline."""

from __future__ import annotations

import time

NS_PER_S = 1_000_000_000


def now_ns() -> int:
    return time.perf_counter_ns()


def utc_ns() -> int:
    """Return UTC in nanoseconds since 1970."""
    return time.time_ns()


def thread_cpu_ns() -> int:
    """Return the processor time of this thread in nanoseconds, without its waiting."""
    return time.thread_time_ns()


def sleep_until(deadline_ns: int) -> None:
    wait_ns = deadline_ns - time.perf_counter_ns()
    if wait_ns > 0:
        time.sleep(wait_ns / NS_PER_S)
