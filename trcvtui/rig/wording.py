"""Numbers as a sentence says them: ages, counts, sizes."""

from __future__ import annotations

from typing import Final

SECOND: Final = 1_000_000_000


def age(ns: int) -> str:
    """Return how long ago something was, as coarse as a glance needs: `1.2 s`, `48 s`, `12 min`, `3 h`."""
    seconds = max(0, ns) / SECOND
    if seconds < 10:
        return f"{int(seconds * 10) / 10:.1f} s"
    if seconds < 100:
        return f"{int(seconds)} s"
    if seconds < 6000:
        return f"{int(seconds / 60)} min"
    return f"{int(seconds / 3600)} h"


def count(number: int, one: str, many: str = "") -> str:
    """Return `1 byte`, `2 bytes`."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def times(number: int) -> str:
    """Return `once`, `twice`, `3 times`."""
    return {1: "once", 2: "twice"}.get(number, f"{number} times")


def rate(size: int, ns: int) -> str:
    """Return how fast bytes come: `40 B/s`, `1.2 KB/s`."""
    per_second = size * SECOND / max(1, ns)
    if per_second < 1000:
        return f"{per_second:.0f} B/s"
    return f"{per_second / 1000:.1f} KB/s" if per_second < 1_000_000 else f"{per_second / 1_000_000:.1f} MB/s"
