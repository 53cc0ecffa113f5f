"""ReceiveData and SendData on a real port: two pseudo-terminals that socat joins, and the cable pulled."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import need
from trcvtui.blocks.environment import FrameEnded
from trcvtui.blocks.framing import FrameEnding
from trcvtui.engine.controller import fresh_bench
from trcvtui.plc import commands
from trcvtui.plc.ledger import BenchNote
from trcvtui.project.file import load_project
from trcvtui.scenario.command import LivePace

pytest.importorskip("serial")
MOST_SCANS = 500
PROJECT = """
dialect = "twincat"
start = "write suffix hex 0d 0a"
[[data]]
name = "suffix"
type = "ARRAY[0..1] OF BYTE"
[[data]]
name = "rx"
type = "ARRAY[0..63] OF BYTE"
[[data]]
name = "tx"
type = "STRING[80]"
[[combuffer]]
name = "RX"
source = "serial"
port = "{port}"
baud = 115200
[[combuffer]]
name = "TX"
line = "RX"
per_cycle = 3
[[instance]]
name = "RD"
block = "ReceiveData"
RxBuffer = "RX"
data = "rx"
pSuffix = "suffix"
LenSuffix = 2
SizeReceiveData = 64
[[instance]]
name = "SS"
block = "SendString"
TxBuffer = "TX"
data = "tx"
"""


class Line:
    """A bench on one end of a line; the test holds the other end, and the cable."""

    def __init__(self, folder: Path) -> None:
        self.ours, self.theirs = folder / "ours", folder / "theirs"
        self._socat: subprocess.Popen[bytes] | None = None
        self._device = -1
        file = folder / "line.toml"
        file.write_text(PROJECT.format(port=self.ours), encoding="utf-8")
        self.bench, self._pace = fresh_bench(load_project(file), "live"), LivePace()

    def plug(self) -> None:
        ends = [f"pty,raw,echo=0,link={end}" for end in (self.ours, self.theirs)]
        self._socat = subprocess.Popen([need("socat"), *ends])
        while not (self.ours.exists() and self.theirs.exists()):
            assert self._socat.poll() is None
            self.scan()
        self._device = os.open(self.theirs, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def pull(self) -> None:
        if self._socat is not None:
            os.close(self._device)
            self._socat.terminate()
            self._socat.wait()
        self._socat = None

    def say(self, payload: bytes) -> None:
        assert os.write(self._device, payload) == len(payload)

    def heard(self) -> bytes:
        try:
            return os.read(self._device, 100)
        except BlockingIOError:
            return b""

    def scan(self) -> None:
        self._pace.next_scan(self.bench)

    def until(self, holds: Callable[[], object]) -> None:
        """Let scans pass until it holds."""
        for _ in range(MOST_SCANS):
            if holds():
                return
            self.scan()
        raise AssertionError("never")

    def pin(self, name: str) -> bool | int:
        return self.bench.runtime.outputs("RD").pin(name)

    def is_up(self) -> bool:
        return self.bench.runtime.snapshot().combuffers[0].is_up

    def come(self) -> int:
        """Return how many bytes have come, those that had no room among them."""
        rx = self.bench.runtime.snapshot().combuffers[0]
        return rx.arrived + rx.lost

    def notes(self) -> list[str]:
        events = [line.event for line in self.bench.runtime.ledger]
        return [e.what for e in events if isinstance(e, BenchNote) and e.subject.startswith("RX ")]


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Line]:
    made = Line(tmp_path)
    yield made
    made.pull()
    made.bench.close()
    assert made.bench.leaks() == ()


def test_a_frame_comes_in_pieces_and_an_answer_goes_out(line: Line) -> None:
    line.plug()
    line.until(line.is_up)
    line.say(b"\x02 40047")
    line.until(lambda: line.pin("busy"))
    line.say(b"11\r")
    line.scan()
    line.say(b"\nnext")
    line.until(lambda: line.pin("DataReceived"))
    assert line.bench.runtime.data("rx", 11) == b"\x02 4004711\r\n"
    assert (line.pin("LenReceiveData"), line.pin("Error"), line.pin("RxTimeout")) == (11, 0, False)
    line.bench.runtime.submit(commands.WriteData("tx", 0, b"thank you\0"))
    line.bench.runtime.submit(commands.PulseInput("SS", "EN"))
    heard = b""
    for _ in range(MOST_SCANS):
        line.scan()
        heard += line.heard()
        if len(heard) >= 9:
            break
    assert heard == b"thank you"
    assert line.pin("busy") is True


def test_a_pulled_cable_ends_the_frame_and_the_port_is_found_again(line: Line) -> None:
    line.until(lambda: line.notes() == ["port not there"])
    line.plug()
    line.until(line.is_up)
    line.say(b"half")
    line.until(lambda: line.pin("busy"))
    line.pull()
    line.until(lambda: not line.is_up())
    line.until(lambda: not line.pin("busy"))
    assert (line.pin("DataReceived"), line.pin("Error")) == (False, 0)
    line.until(lambda: line.notes()[2:] == ["port gone", "port not there"])
    line.plug()
    line.until(line.is_up)
    line.say(b"whole\r\n")
    line.until(lambda: line.pin("DataReceived"))
    assert line.bench.runtime.data("rx", 7) == b"whole\r\n"
    assert line.notes() == ["port not there", "port open", "port gone", "port not there", "port open"]


def test_a_stopped_plc_gives_the_port_back(line: Line) -> None:
    line.plug()
    line.until(line.is_up)
    line.bench.runtime.submit(commands.StopPlc())
    line.scan()
    assert not line.is_up()
    line.bench.runtime.submit(commands.RunPlc())
    line.until(line.is_up)


def test_noise_for_ever_costs_no_scan_and_no_memory(line: Line) -> None:
    line.plug()
    line.until(line.is_up)
    for _ in range(50):
        line.say(b"\xff" * 200)
        line.scan()
    line.until(lambda: line.come() == 10_000)
    (rx, _) = line.bench.runtime.snapshot().combuffers
    assert rx.lost > 0 and rx.count <= rx.size == 300
    frames = [e for kept in line.bench.runtime.ledger if isinstance(e := kept.event, FrameEnded)]
    assert {(frame.size, frame.ending) for frame in frames} == {(64, str(FrameEnding.OVERRUN))}
