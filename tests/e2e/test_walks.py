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


def test_the_distance_of_two_dones_stands_in_the_title_of_the_timing_pane(
    program: Opener, tmp_path: Path
) -> None:
    terminal = program(140, 45)
    receive(terminal)
    terminal.keys("Space")
    terminal.wait("HOLD")
    for _ in range(2):
        say(terminal, "peer P1 send hex 01 02 03 04 05 06 07 08")
        say(terminal, "run 12")
    terminal.keys("8")
    terminal.wait("8 Timing")
    terminal.keys("Down", "Down", "Down")
    terminal.wait("▸DONE")
    terminal.keys("N", "N", "m", "N", "N", "m")  # each pulse has two edges
    terminal.wait(lambda screen: re.search(r"1 to 2: -?12 scans, -?120\.000 ms", screen) is not None)
    say(terminal, f"export timing vcd {tmp_path}/walk.vcd", "walk.vcd")
    terminal.wait(lambda _: (tmp_path / "walk.vcd").exists())
    assert "$enddefinitions" in (tmp_path / "walk.vcd").read_text(encoding="utf-8")


def test_an_edge_of_the_past_is_explained_by_what_caused_it(program: Opener) -> None:
    terminal = program(140, 45)
    receive(terminal)
    say(terminal, "fault recv ECONNRESET on C1", lambda screen: "80AA" in screen)
    terminal.keys("4")
    terminal.wait("4 History")
    terminal.keys("Down")
    terminal.wait(lambda screen: re.search(r"▸ *\d+ .*16#7002", screen) is not None)
    terminal.keys("Down")
    screen = terminal.wait("16#80AA  ERROR")
    assert "3 STATUS · scan" in screen and "in the past" in screen
    assert re.search(r"why +(· )?Injected fault: the partner", screen)


def test_every_split_of_a_message_is_tried_and_the_table_names_what_differs(program: Opener) -> None:
    terminal = program(80, 24)
    say(terminal, "set TRCV_C_1 ADHOC=1")
    receive(terminal)
    terminal.keys("7")
    terminal.wait("7 Peer P1")
    terminal.keys("i")
    terminal.type("0102030405060708")
    terminal.wait("peer P1 send hex 0102030405060708")
    terminal.keys("BTab", "e")  # out of the field; an escape and a letter that come together would be alt+e
    terminal.wait("7 of 7 splits differ from the whole message")


def test_the_bytes_of_data_are_yanked_into_a_file(program: Opener, tmp_path: Path) -> None:
    terminal = program(80, 24)
    receive(terminal)
    terminal.keys("5")
    say(terminal, "peer P1 send hex 1b 5b 33 31 6d 00 ff 7f", lambda screen: "0000 ▕1b 5b 33 31" in screen)
    terminal.keys("y")
    terminal.wait("bytes as hex")
    terminal.keys("h")
    terminal.wait("yanked bytes as hex, 23 characters")
    kept = [path for path in (tmp_path / "state").rglob("*") if path.is_file()]
    assert any("1b 5b 33 31 6d 00 ff 7f" in path.read_text(encoding="utf-8") for path in kept), kept


def test_a_trigger_freezes_the_view_with_what_was_before_and_the_plc_runs_on(program: Opener) -> None:
    terminal = program(140, 45)
    receive(terminal)
    say(terminal, "trigger TRCV_C_1 STATUS=7008")
    say(terminal, "peer P1 send hex 01 02 03 04 05 06 07 08", lambda screen: "FROZEN" in screen)
    screen = terminal.wait(lambda text: re.search(r"FROZEN at scan \d+.*live at scan \d+", text) is not None)
    numbers = re.search(r"FROZEN at scan (\d+).*live at scan (\d+)", screen)
    assert numbers is not None
    terminal.wait(lambda text: f"live at scan {numbers[2]}" not in text and f"scan {numbers[1]}" in text)
    terminal.keys("F")
    terminal.wait(lambda text: "FROZEN" not in text)


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
