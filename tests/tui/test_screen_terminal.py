"""One run in a real pseudo-terminal for each kind of terminal: what `run_test` cannot see."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SECONDS = 30.0


def _start(terminal: dict[str, str]) -> tuple[subprocess.Popen[bytes], int]:
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 45, 140, 0, 0))
    keep = {k: v for k, v in os.environ.items() if k not in ("COLORTERM", "NO_COLOR", "TERM")}
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.tui.terminal_app"],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        cwd=ROOT,
        env={**keep, **terminal},
    )
    os.close(theirs)
    return process, ours


def _read_until(terminal: int, wanted: bytes) -> bytes:
    seen = b""
    while wanted not in seen:
        ready, _, _ = select.select([terminal], [], [], SECONDS)
        assert ready, f"{wanted!r} did not come; seen: {seen[-400:]!r}"
        seen += os.read(terminal, 65536)
    return seen


def _read_to_the_end(terminal: int) -> bytes:
    seen = b""
    while select.select([terminal], [], [], SECONDS)[0]:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # Linux: the other end is closed
            break
        if not piece:
            break
        seen += piece
    return seen


@pytest.mark.parametrize(
    "terminal",
    [
        {"TERM": "xterm-256color", "COLORTERM": "truecolor"},
        {"TERM": "xterm-256color"},
        {"TERM": "xterm"},
        {"TERM": "linux", "NO_COLOR": "1"},
    ],
    ids=["truecolour", "256 colours", "16 colours", "no colour"],
)
def test_the_screen_opens_and_q_ends_it(terminal: dict[str, str]) -> None:
    process, ours = _start(terminal)
    try:
        seen = _read_until(ours, b"TRCV_C_2")
        seen += _read_until(ours, b"help")
        os.write(ours, b"q")
        seen += _read_to_the_end(ours)
        assert process.wait(SECONDS) == 0
        assert b"\x1b]0;x\x07" not in seen, "bytes of a partner reached the terminal as escape codes"
        assert not re.search(rb"Traceback", seen)
    finally:
        process.kill()
        process.wait()
        os.close(ours)
