"""A tap in a true terminal: its screen holds and lets go; without the screen bytes go on."""

from __future__ import annotations

import os
import re
import signal
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.tapping import PATIENCE, calling, exactly, listening
from tests.e2e.terminal import TRCVTUI, Terminal

pytestmark = [pytest.mark.live, pytest.mark.slow]
WORDS = "from trcvtui.cli.line import tap_screen"


class Line:
    """A tap on a terminal, and a connection through it."""

    def __init__(self, *words: str) -> None:
        self.door, port = listening()
        command = f"{TRCVTUI} tap 127.0.0.1:0 {port} {' '.join(words)}"
        self.terminal = Terminal(100, 30, f"{command}; echo ended with $?; exec cat")
        self.near = self.far = self.door

    def call(self) -> None:
        """Call through the tap, as soon as the screen says where it listens."""
        self.terminal.wait("looks on")
        self.terminal.keys("7")
        place = r"T: 127\.0\.0\.1:(\d+) to"
        screen = self.terminal.wait(lambda text: re.search(place, text) is not None)
        found = re.search(place, screen)
        assert found is not None
        self.near = calling(int(found[1]))
        self.far = self.door.accept()[0]
        self.far.settimeout(PATIENCE)
        self.terminal.wait("1 open of 1")

    def process(self, words: str) -> int:
        """Return the process that has this connection's tap above it, and these words."""
        pane = int(self.terminal._call("display-message", "-p", "#{pane_pid}"))
        found = [pid for pid in _below(pane) if words in Path(f"/proc/{pid}/cmdline").read_text()]
        return found[0]

    def close(self) -> None:
        self.terminal.close()
        for sock in (self.near, self.far, self.door):
            sock.close()


def _below(pid: int) -> Iterator[int]:
    """Yield the children of a process, and theirs."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    for child in map(int, children):
        yield child
        yield from _below(child)


@pytest.fixture
def line() -> Iterator[Line]:
    made = Line()
    yield made
    made.close()


def still(sock: socket.socket) -> bool:
    """Return whether nothing has come."""
    sock.setblocking(False)
    try:
        return not sock.recv(1)
    except BlockingIOError:
        return True
    finally:
        sock.settimeout(PATIENCE)


def is_held(screen: str) -> bool:
    """Return whether the header shows HELD with its age."""
    return re.search(r"IN THE LINE .* HELD \d+ s", screen) is not None


def is_reset(sock: socket.socket) -> bool:
    """Return whether the connection ends with RST."""
    try:
        sock.recv(1)
    except ConnectionResetError:
        return True
    return False


def test_r_asks_with_its_command_esc_sends_nothing_and_enter_resets_both_ends(line: Line) -> None:
    line.call()
    line.terminal.keys("r")
    line.terminal.wait("tap T to-plc rst conversation 1")
    line.terminal.keys("Escape")
    line.terminal.wait("type a bench command")
    line.near.sendall(b"alive")
    assert exactly(line.far, 5) == b"alive"
    line.terminal.keys("r")
    line.terminal.wait("tap T to-plc rst conversation 1")
    line.terminal.keys("Enter")
    assert is_reset(line.near) and is_reset(line.far)
    line.terminal.wait("0 open of 1")


def test_on_an_armed_tap_r_resets_both_ends_at_once() -> None:
    line = Line("--armed")
    try:
        line.call()
        line.terminal.keys("r")
        assert is_reset(line.near) and is_reset(line.far)
    finally:
        line.close()


def test_a_key_holds_a_direction_another_lets_it_go_and_q_ends_both_ends(line: Line) -> None:
    line.call()
    line.near.sendall(b"first")
    assert exactly(line.far, 5) == b"first"
    line.terminal.keys("h")
    line.terminal.wait(is_held)
    line.near.sendall(b"second")
    line.terminal.wait("6 B held")
    assert still(line.far)
    line.terminal.keys("h")
    assert exactly(line.far, 6) == b"second"
    line.terminal.wait(lambda text: "HELD" not in text)
    line.terminal.keys("q")
    line.terminal.wait("ended with 0")
    assert line.far.recv(1) == b""


def test_the_doctor_judges_what_has_passed_the_tap(line: Line) -> None:
    line.call()
    line.near.sendall(b"message")
    assert exactly(line.far, 7) == b"message"
    line.terminal.wait("DONE ◆ 7 B")
    line.terminal.keys("J")
    line.terminal.wait("healthy")


def test_without_its_screen_a_tap_lets_go_and_goes_on(line: Line) -> None:
    line.call()
    line.terminal.keys("h")
    line.terminal.wait(is_held)
    line.near.sendall(b"held")
    line.terminal.wait("4 B held")
    os.kill(line.process(WORDS), signal.SIGKILL)
    assert exactly(line.far, 4) == b"held"
    line.terminal.wait("the screen is gone: bytes still go on")
    line.near.sendall(b"more")
    assert exactly(line.far, 4) == b"more"
    line.terminal.keys("C-c")
    line.terminal.wait("ended with 0")


def test_without_its_engine_a_tap_lets_go_and_goes_on(line: Line) -> None:
    line.call()
    line.terminal.keys("h")
    line.terminal.wait(is_held)
    line.near.sendall(b"held")
    os.kill(line.process("multiprocessing.spawn"), signal.SIGKILL)
    assert exactly(line.far, 4) == b"held"
    line.terminal.wait("ENGINE ENDED")
    line.far.sendall(b"back")
    assert exactly(line.near, 4) == b"back"


def test_an_engine_that_is_started_anew_shows_the_conversation_that_goes_on(line: Line) -> None:
    line.call()
    os.kill(line.process("multiprocessing.spawn"), signal.SIGKILL)
    line.terminal.wait("ENGINE ENDED")
    line.near.sendall(b"unseen")
    assert exactly(line.far, 6) == b"unseen"
    line.terminal.keys("R")
    line.terminal.wait("engine 2 runs")
    line.terminal.keys("h")
    line.terminal.wait(is_held)
    line.near.sendall(b"seen")
    line.terminal.wait("4 B held")
    line.terminal.keys("h")
    assert exactly(line.far, 4) == b"seen"


def test_a_key_typed_while_an_engine_starts_waits_for_it_and_for_the_pane(line: Line) -> None:
    line.call()
    os.kill(line.process("multiprocessing.spawn"), signal.SIGKILL)
    line.terminal.wait("ENGINE ENDED")
    line.terminal.keys("R", "h")
    line.terminal.wait(is_held)
    line.near.sendall(b"seen")
    line.terminal.wait("4 B held")


def test_a_killed_tap_ends_both_ends_and_its_screen_gives_the_terminal_back(line: Line) -> None:
    line.call()
    os.kill(line.process(" tap".replace(" ", "\0")), signal.SIGKILL)
    for sock in (line.near, line.far):
        sock.settimeout(PATIENCE)
        with suppress(ConnectionResetError):
            assert sock.recv(1) == b""
    line.terminal.wait("the tap has ended: both ends have seen an end")
    assert "7 Line" not in line.terminal.screen()
