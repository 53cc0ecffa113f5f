"""The standard streams. A closed stream becomes the null device, so that no socket gets that number."""

from __future__ import annotations

import io
import os
import sys
from typing import Any


class _MessageStream(io.FileIO):
    """The stream stderr. A text that cannot be written is dropped, and the command continues."""

    def write(self, text: Any, /) -> int:
        try:
            return super().write(text)
        except OSError:
            return memoryview(text).nbytes


def prepare_streams() -> None:
    """Open closed standard streams as the null device. A closed `sys.stdin` or `sys.stdout` stays None."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # takes the lowest free number, this one
    if sys.stderr is sys.__stderr__ and not os.isatty(2):  # both are None if it was closed
        encoding = getattr(sys.stderr, "encoding", "utf-8")
        lines = io.BufferedWriter(_MessageStream(2, "w", closefd=False))
        made = io.TextIOWrapper(lines, encoding, "backslashreplace", line_buffering=True)
        sys.stderr = sys.__stderr__ = made  # type: ignore[misc]


def has_terminal(*numbers: int) -> bool:
    """Return whether the streams with these numbers are terminals; without numbers, all three streams."""
    return all(map(os.isatty, numbers or range(3)))
