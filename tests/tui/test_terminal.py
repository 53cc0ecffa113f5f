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


@pytest.mark.parametrize("term", ["linux", "xterm", "screen", "tmux-256color"])
def test_a_terminal_gets_no_more_colours_than_it_has(term: str) -> None:
    """And what a colour says stands there as a word or a sign, too."""
    process, ours = _start({"TERM": term})
    try:
        seen = _read_until(ours, b"help")
        os.write(ours, b"q")
        seen += _read_to_the_end(ours)
        assert process.wait(SECONDS) == 0
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    colours = {each for sgr in re.findall(rb"\x1b\[([0-9;]*)m", seen) for each in _colours(sgr)}
    if term == "tmux-256color":
        assert "many" in colours
    else:
        assert colours and "many" not in colours, "its own sixteen, on its own background"
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", seen.decode())
    for sign in ("▸ TRCV_C_1", "B■", "E□", "7006", "BUSY ■", "ERROR □"):
        assert sign in text


def _colours(sgr: bytes) -> set[str]:
    """Return the colours that one SGR sets: `many` of a palette or of 24 bits, else a number."""
    numbers = sgr.split(b";")
    if b"38" in numbers or b"48" in numbers:
        return {"many"}
    return {n.decode() for n in numbers if n and (30 <= int(n) <= 47 or 90 <= int(n) <= 107)}
