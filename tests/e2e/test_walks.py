"""Walks of a user through the installed program in tmux: keys in, screen text out, files left after."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import TRCVTUI, Terminal
from tests.scenario.scenarios import CONFIGS

PASSIVE = CONFIGS / "passive.toml"
Opener = Callable[..., Terminal]


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Opener]:
    """Open the installed program on the simulated network; its files go into this test's own folders."""
    opened: list[Terminal] = []
    homes = " ".join(f"XDG_{name}_HOME={tmp_path / name.lower()}" for name in ("STATE", "CONFIG"))

    def open_on(columns: int, rows: int, project: Path = PASSIVE) -> Terminal:
        command = (
            f"cd {tmp_path}; unset DISPLAY WAYLAND_DISPLAY; {homes} {TRCVTUI} run {project} --kernel sim"
        )
        opened.append(Terminal(columns, rows, f"{command}; echo ended with $?; exec cat"))
        opened[-1].wait("7000")
        return opened[-1]

    yield open_on
    for terminal in opened:
        terminal.close()


def say(terminal: Terminal, line: str, seen: str | Callable[[str], bool] = "✓") -> str:
    """Type a bench command and wait for what it brings."""
    terminal.keys(":")
    terminal.type(line)
    terminal.keys("Enter")
    shows = seen if callable(seen) else lambda screen: seen in screen
    return terminal.wait(lambda screen: f": {line[:20]}" in screen and shows(screen))


def receive(terminal: Terminal) -> None:
    """Let TRCV_C_1 be connected and receive."""
    say(terminal, "set TRCV_C_1 CONT=1")
    say(terminal, "peer P1 connect", "7004")
    terminal.keys("n")
    terminal.wait("7006 receiving")


def test_at_80x24_en_r_is_toggled_and_7006_becomes_a_7008_that_stays_visible(program: Opener) -> None:
    terminal = program(80, 24)
    receive(terminal)
    terminal.keys("2")
    assert re.search(r"n +EN_R ─┤ ■ 1", terminal.wait("2 TRCV_C_1 · TRCV_C"))
    say(terminal, "peer P1 send hex 01 02 03 04 05", "5/8")
    say(terminal, "peer P1 send hex 06 07 08", "0/8")
    assert "DONE ◂" in terminal.wait("last    DONE 8 B in scan"), "one scan long, and still to be seen"
    terminal.keys("4")
    terminal.wait("16#7008 received         ■ DONE 8 B")
    terminal.keys("n")
    terminal.wait("7004 connected")


def test_a_session_is_saved_as_a_scenario_that_passes(program: Opener, tmp_path: Path) -> None:
    terminal = program(140, 45)
    receive(terminal)
    say(terminal, "peer P1 send hex 01 02 03 04 05 06 07 08", lambda screen: "▕01 02 03 04 05 06" in screen)
    say(terminal, f"save scenario {tmp_path}/seen.toml", "seen.toml")
    saved = tmp_path / "seen.toml"
    terminal.wait(lambda _: saved.exists())
    assert "peer P1 send" in tomllib.loads(saved.read_text(encoding="utf-8"))["scenario"]["steps"]
    terminal.keys("q")
    terminal.wait("ended with 0")
    runner = Terminal(100, 30, f"{TRCVTUI} scenario {saved}; echo ended with $?; exec cat")
    try:
        runner.wait("ended with 0")
    finally:
        runner.close()
