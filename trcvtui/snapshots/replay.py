"""The position of a replay in its recording."""

from __future__ import annotations

from typing import Final

from msgspec import Struct

CANNOT_CHANGE_TEXT: Final = "a recording cannot be changed: W tries another value"
WHAT_IF: Final = "what-if "  # before an instance's name: this instance in the run of the what-if


class ReplayPosition(Struct, frozen=True):
    """The position of a replay. Until the recording `is_read`, `last_scan` and `last_t_ns` may grow.

    The replay goes to the scan `wanted`. Times are ns of the run. `marks` has a byte for each piece of the
    run: 1 with an ERROR, else 0. `what_if` has lines about a run with another parameter. From scan
    `parts_at` on, the what-if run differs from the recorded run; 0 means no difference yet.
    """

    scan: int
    last_scan: int
    t_ns: int
    last_t_ns: int
    is_read: bool
    wanted: int
    speed: str
    errors: int
    marks: bytes
    first: int = 0  # the scan before the first recorded one
    note: str = ""
    what_if: tuple[str, ...] = ()
    parts_at: int = 0
    first_ns: int | None = None  # UTC of time 0, if a capture gives it
    beside: tuple[str, ...] = ()  # lines about the capture
