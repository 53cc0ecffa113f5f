"""TSEND_C in front of a real program that does not read, and then reads everything."""

from __future__ import annotations

import os
import subprocess
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import need
from trcvtui.bench.bench import Bench
from trcvtui.plc import commands
from trcvtui.project.file import read_project
from trcvtui.scenario.command import LivePace

FRAME = 4000
MOST_SCANS = 3000

PROJECT = f"""
dialect = "baosky"
options.small_buffers = true
[[data]]
name = "tx"
type = "ARRAY[1..{FRAME}] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
KeepAliveTimeInterval = 1
[[instance]]
name = "TSEND_C_1"
block = "TSEND_C"
connect = "C1"
data = "tx"
CONT = true
"""


class Sender:
    """A program that numbers its frames and raises REQ whenever the block is free."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.pace = bench, LivePace()
        self.wants_more = True
        self.asked = False
        self.done = 0
        self.shown: list[int] = []

    def scan(self) -> None:
        """Ask for a frame where the block is idle, let one scan pass, count what it shows."""
        status = self.shown[-1] if self.shown else 0
        may_ask = self.wants_more and not self.asked and status in (0x7004, 0x7009, 0x80A8)
        self.asked = may_ask  # an edge needs a scan with REQ = 0 before it
        if may_ask:
            number = f"{self.done:08d}".encode()
            self.bench.runtime.submit(commands.WriteData("tx", 0, number * (FRAME // len(number))))
            self.bench.runtime.submit(commands.PulseInput("TSEND_C_1", "REQ"))
        self.pace.next_scan(self.bench)
        out = self.bench.runtime.outputs("TSEND_C_1")
        self.shown.append(out.status)
        self.done += out.done

    @property
    def is_stuck(self) -> bool:
        """Return whether for 200 scans one job has waited, or each found no room: one before filled it."""
        last = self.shown[-200:]
        return len(last) == 200 and set(last) in ({0x7005}, {0x7004, 0x80A8})

    def until(self, holds: Callable[[], bool]) -> None:
        """Let scans pass until it holds."""
        for _ in range(MOST_SCANS):
            if holds():
                return
            self.scan()
        raise AssertionError(f"never: {[f'{code:04X}' for code in self.shown[-20:]]}")


@pytest.fixture
def sender(tmp_path: Path) -> Iterator[Sender]:
    made = Sender(Bench(read_project(tomllib.loads(PROJECT), "reader.toml", tmp_path), "live"))
    yield made
    made.bench.close()  # also where there is no socat: its port would stay open in some later test


def test_a_socat_that_never_reads_then_reads_all_gets_whole_frames_one_for_each_done(
    sender: Sender, tmp_path: Path
) -> None:
    bench, fifo = sender.bench, tmp_path / "reader"
    os.mkfifo(fifo)
    sender.until(lambda: bench.runtime.listening_port("C1") is not None)
    port = bench.runtime.listening_port("C1")
    command = [need("socat"), "-u", f"TCP:127.0.0.1:{port}", f"OPEN:{fifo},wronly"]
    with subprocess.Popen(command) as socat, fifo.open("rb") as reader:
        sender.until(lambda: sender.is_stuck)
        assert sender.done > 0, "the stacks, socat and the pipe have swallowed some frames"
        stuck_at = sender.done
        sender.until(lambda: len(sender.shown) >= 400)  # longer than a dead link would take to show
        assert sender.done == stuck_at and sender.is_stuck

        os.set_blocking(reader.fileno(), False)
        read = bytearray()

        def take() -> bool:
            read.extend(reader.read() or b"")
            return len(read) >= (stuck_at + 20) * FRAME

        sender.until(take)
        sender.wants_more = False
        sender.until(lambda: take() and sender.shown[-1] == 0x7004)
        bench.runtime.submit(commands.SetInput("TSEND_C_1", "CONT", False))
        sender.until(lambda: sender.shown[-1] == 0x7000)
        os.set_blocking(reader.fileno(), True)
        read.extend(reader.read())
        assert socat.wait() == 0

    frames = [bytes(read[at : at + FRAME]) for at in range(0, len(read), FRAME)]
    assert len(frames) == sender.done
    assert frames == [f"{number:08d}".encode() * (FRAME // 8) for number in range(sender.done)]
    assert not {0x80AB, 0x80A9, 0x80C5, 0x7002} & set(sender.shown[sender.shown.index(0x7004) :])
    bench.close()
    assert bench.leaks() == ()
