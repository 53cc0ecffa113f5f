"""A tap in a true terminal: its screen holds and lets go; without the screen bytes go on."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.tapping import PATIENCE, calling, exactly, listening
from tests.e2e.terminal import TRCVTUI, Terminal
from tests.waiting import children_of

pytestmark = [pytest.mark.live, pytest.mark.slow]
WORDS = "from trcvtui.cli.line import show_tap"
TAP = "\0tap"


class Line:
    """A tap on a terminal, and a connection through it."""

    def __init__(self) -> None:
        self.door, port = listening()
        command = f"{TRCVTUI} tap 127.0.0.1:0 {port}"
        self.terminal = Terminal(100, 30, f"{command}; echo ended with $?; exec cat")
        self.near = self.far = self.door

    def call(self) -> None:
        """Call through the tap, as soon as the screen says where it listens."""
        self.terminal.wait("◌ shadow")
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
        found = [pid for pid in self._all() if words in Path(f"/proc/{pid}/cmdline").read_text()]
        return found[0]

    def _all(self) -> Iterator[int]:
        return _below(int(self.terminal._call("display-message", "-p", "#{pane_pid}")))

    def close(self) -> None:
        left: list[int] = []
        with suppress(subprocess.CalledProcessError):  # a test may have closed the terminal
            left += self._all()
        self.terminal.close()  # a tap goes on without it
        for pid in left:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for sock in (self.near, self.far, self.door):
            sock.close()


def _below(pid: int) -> Iterator[int]:
    for child in children_of(pid):
        yield child
        yield from _below(child)


@pytest.fixture
def line() -> Iterator[Line]:
    made = Line()
    yield made
    made.close()


def still(sock: socket.socket) -> bool:
    sock.setblocking(False)
    try:
        return not sock.recv(1)
    except BlockingIOError:
        return True
    finally:
        sock.settimeout(PATIENCE)


def asks(screen: str) -> bool:
    return "1 connection open" in screen


def is_held(screen: str) -> bool:
    """Return whether the header shows HELD with its age."""
    return re.search(r"IN THE LINE .* HELD \d+ s", screen) is not None


def passes(line: Line) -> bool:
    line.near.sendall(b"more")
    return exactly(line.far, 4) == b"more"


def test_a_key_holds_a_direction_another_lets_it_go_and_q_asks_before_it_cuts(line: Line) -> None:
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
    line.terminal.keys(":")
    line.terminal.type("tap T to-plc drop 1")
    line.terminal.keys("Enter")
    line.terminal.wait("T: nothing is held in this direction")
    for key in ("q", "Escape", "C-q"):
        line.terminal.keys("q")
        line.terminal.wait(asks)
        line.terminal.keys(key)
        line.terminal.wait(lambda text: not asks(text))
    assert passes(line)
    line.terminal.keys("q")
    line.terminal.wait(asks)
    line.terminal.keys("c")
    assert "the tap ends and cuts 1 connection\n" in line.terminal.wait("ended with 0")
    assert line.far.recv(1) == b""


def test_q_asks_nothing_where_no_connection_is_open(line: Line) -> None:
    line.terminal.wait("◌ shadow")
    line.terminal.keys("q")
    assert "cuts" not in line.terminal.wait("ended with 0")


def test_a_screen_that_is_left_leaves_the_line_open_until_a_signal(line: Line) -> None:
    line.call()
    os.kill(line.process("multiprocessing.spawn"), signal.SIGKILL)
    line.terminal.wait("ENGINE ENDED")
    line.terminal.keys("q")  # the tap itself knows what is open
    line.terminal.wait(asks)
    line.terminal.keys("d")
    line.terminal.wait("the screen has ended; forwarding continues; Ctrl+C or kill")
    assert passes(line)
    line.terminal.keys("C-c")
    line.terminal.wait("ended with 0")
    assert line.far.recv(1) == b""


def test_a_terminal_that_is_closed_leaves_the_line_open(line: Line) -> None:
    line.call()
    tap, screen = line.process(TAP), Path(f"/proc/{line.process(WORDS)}")
    line.terminal.keys("q")
    line.terminal.wait(asks)
    line.terminal.close()
    ended = time.monotonic() + PATIENCE
    while screen.exists() and time.monotonic() < ended:
        assert passes(line)
    assert passes(line)
    os.kill(tap, signal.SIGTERM)
    assert line.far.recv(1) == b""


def test_without_its_screen_a_tap_lets_go_and_goes_on(line: Line) -> None:
    line.call()
    line.terminal.keys("h")
    line.terminal.wait(is_held)
    line.near.sendall(b"held")
    line.terminal.wait("4 B held")
    os.kill(line.process(WORDS), signal.SIGKILL)
    assert exactly(line.far, 4) == b"held"
    line.terminal.wait("the screen has ended; forwarding continues")
    assert passes(line)
    line.terminal.keys("C-c")
    line.terminal.wait("ended with 0")


def test_without_its_engine_a_tap_lets_go_and_a_new_one_shows_what_goes_on(
    line: Line,
) -> None:
    line.call()
    line.terminal.keys("h")
    line.terminal.wait(is_held)
    line.near.sendall(b"held")
    os.kill(line.process("multiprocessing.spawn"), signal.SIGKILL)
    assert exactly(line.far, 4) == b"held"
    line.terminal.wait("ENGINE ENDED")
    line.far.sendall(b"back")
    assert exactly(line.near, 4) == b"back"
    line.terminal.keys("R", "h")  # a key that is typed while an engine starts waits for it
    line.terminal.wait(is_held)
    line.near.sendall(b"seen")
    line.terminal.wait("4 B held")
    line.terminal.keys("h")
    assert exactly(line.far, 4) == b"seen"
    line.terminal.wait("DONE ◆ 4 B")
    line.terminal.keys("J")
    line.terminal.wait("healthy")


def test_a_killed_tap_ends_both_ends_and_its_screen_gives_the_terminal_back(line: Line) -> None:
    line.call()
    os.kill(line.process(TAP), signal.SIGKILL)
    for sock in (line.near, line.far):
        sock.settimeout(PATIENCE)
        with suppress(ConnectionResetError):
            assert sock.recv(1) == b""
    line.terminal.wait("the tap has ended: both ends were informed (TCP: FIN or RST)")
    assert "7 Line" not in line.terminal.screen()
