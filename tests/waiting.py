"""Wait for what another process does: the processor is left to it, and a wait that fails says what it saw."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from subprocess import Popen
from typing import Any

import pytest

PATIENCE_S = 240  # below pytest's own limit: a busy machine is slow, not wrong
LOOK_S = 0.01


def until(holds: Callable[[], object], saw: Callable[[], object] = lambda: "nothing else") -> None:
    """Look until something holds; raise AssertionError with what was seen instead."""
    limit = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < limit, f"it never came, seen was {saw()}"
        time.sleep(LOOK_S)  # between two looks


def children_of(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    if not path.exists():
        pytest.skip("a system without /proc")
    return [int(each) for each in path.read_text().split()]


def until_size(process: Popen[Any], file: Path, size: int) -> None:
    """Look until a process that runs has written so many bytes of a file."""

    def found() -> int:
        return file.stat().st_size if file.is_file() else -1

    until(
        lambda: found() >= size or process.poll() is not None,
        lambda: f"{found()} of {size} bytes of {file}",
    )
    assert process.poll() is None, f"it has ended with {found()} bytes of {file}"
