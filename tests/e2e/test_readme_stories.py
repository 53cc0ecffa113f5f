"""The keys and commands of the README, typed into a true terminal as they are printed, show what it says.

In the README a key or a line to type stands in `code`, what the screen then shows in *italics*.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import PATIENCE_S, TRCVTUI, Terminal

pytestmark = [pytest.mark.live, pytest.mark.slow]
ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOKEN = re.compile(r"`([^`]+)`|(?<!\*)\*([^*]+)\*(?!\*)")
PORT = re.compile(r"127\.0\.0\.1:(\d+)")
SIZES = pytest.mark.parametrize(("columns", "rows"), [(100, 30), (80, 24)])


def section(title: str) -> str:
    return README.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def steps(title: str) -> list[str]:
    return re.findall(r"^\d\. (.*?)(?=^\d\. |^$)", section(title), re.MULTILINE | re.DOTALL)


def play(terminal: Terminal, step: str) -> None:
    """Press and type what a step says; see what it shows, in its order."""
    for typed, shown in TOKEN.findall(step):
        if shown:
            terminal.wait(shown)
        elif " " in typed:
            terminal.type(typed)
        else:
            terminal.keys({"enter": "Enter"}.get(typed, typed))


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[list[Terminal]]:
    terminals: list[Terminal] = []
    yield terminals
    for terminal in terminals:
        terminal.close()


@SIZES
@pytest.mark.parametrize("title", ["Try it", "A fault, from connect to verdict"])
def test_the_steps_show_what_the_readme_says(
    opened: list[Terminal], title: str, columns: int, rows: int
) -> None:
    (command,) = re.findall(r"^\.venv/bin/trcvtui (.*)$", section(title), re.MULTILINE)
    opened.append(Terminal(columns, rows, f"cd {ROOT}; exec {TRCVTUI} {command}"))
    opened[0].wait("▶ RUN")
    assert len(steps(title)) == 4
    for step in steps(title):
        play(opened[0], step)


@SIZES
def test_your_own_device_in_a_minute(opened: list[Terminal], tmp_path: Path, columns: int, rows: int) -> None:
    text = section("Your own device in a minute")
    (command,) = re.findall(r"`trcvtui (run [^`]*)`", text)
    opened.append(Terminal(columns, rows, f"cd {tmp_path}; exec {TRCVTUI} {command}"))
    terminal, device = opened[0], None
    terminal.wait("enter: create it")
    waiting_for = {"`enter`": "press A, then enter", "`A`, then `enter`": "▸ TRCV_C_1"}
    rows_of_keys = re.findall(r"^\| (?!key|---)(.*?) \| (.*) \|$", text, re.MULTILINE)
    assert len(rows_of_keys) == 6
    for keys, seen in rows_of_keys:
        if "`" in keys:
            play(terminal, keys)
        else:
            found = PORT.search(terminal.wait(lambda screen: PORT.search(screen) is not None))
            assert found is not None
            device = socket.create_connection(("127.0.0.1", int(found[1])), PATIENCE_S)
        for shown in (*re.findall(r"\*(.+?)\*", seen), waiting_for.get(keys, "")):
            terminal.wait(shown)
    assert device is not None
    with device:
        device.sendall(b"\x0a\x0b\x0c\x0d")
        terminal.wait(lambda screen: "0a 0b 0c 0d" in screen.lower())
        play(terminal, "`:` `save project` `enter`")
        terminal.wait(lambda screen: "unsaved" not in screen)
    assert "TRCV_C" in (tmp_path / "new.toml").read_text(encoding="utf-8")
