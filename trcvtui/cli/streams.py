"""The streams that a shell gives: a closed one becomes the null device, and no socket gets its number."""

from __future__ import annotations

import io
import os
import sys
from typing import Any


class _MessageStream(io.FileIO):
    """stderr: what it does not take is left out, and ends no command."""

    def write(self, text: Any, /) -> int:
        try:
            return super().write(text)
        except OSError:
            return memoryview(text).nbytes


def prepare_streams() -> None:
    """Make stdin, stdout and stderr fit to be used; `sys.stdin` and `sys.stdout` stay None where closed."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # it gets the lowest number, this one
    if sys.stderr is sys.__stderr__ and not os.isatty(2):  # both are None where it was closed
        encoding = getattr(sys.stderr, "encoding", "utf-8")
        lines = io.BufferedWriter(_MessageStream(2, "w", closefd=False))
        made = io.TextIOWrapper(lines, encoding, "backslashreplace", line_buffering=True)
        sys.stderr = sys.__stderr__ = made  # type: ignore[misc]


def has_terminal(*numbers: int) -> bool:
    """Return whether these streams are terminals; without numbers all three: a screen draws on stderr."""
    return all(map(os.isatty, numbers or range(3)))
