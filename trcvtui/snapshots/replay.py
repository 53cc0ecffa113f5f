"""Where a replay stands in its recording."""

from __future__ import annotations

from typing import Final

from msgspec import Struct

CANNOT_CHANGE_TEXT: Final = "a recording cannot be changed: W tries another value"
WHAT_IF: Final = "what-if "  # before the name of an instance: the same one in a run with another parameter


class ReplayPosition(Struct, frozen=True):
    """Where a replay stands in its recording. `last_scan` is known for sure once the recording `is_read`.

    `wanted` is the scan that it goes to, times are ns of the run; `marks` has 1 for each piece of the run in
    which an ERROR comes, 0 for the others. `what_if` is what there is to say of a run with another parameter;
    it parts from the recorded one in scan `parts_at`, 0: nowhere yet.
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
    first: int = 0  # the scan before those that are in it
    note: str = ""
    what_if: tuple[str, ...] = ()
    parts_at: int = 0
    first_ns: int | None = None  # UTC of time 0, where it is that of a capture
    beside: tuple[str, ...] = ()  # what is told of the capture
