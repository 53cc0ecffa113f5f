"""A bench with ISO-on-TCP that is told lines, and partners from outside that speak it."""

from __future__ import annotations

import select
import socket
from collections.abc import Callable
from pathlib import Path

from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.plc.ledger import BenchNote
from trcvtui.project.file import load_project

PASSIVE = """
dialect = "s7-1500"
[[data]]
name = "rx"
type = "ARRAY[0..1999] OF BYTE"
[[data]]
name = "tx"
type = "ARRAY[0..1999] OF BYTE"
[[connect]]
name = "C1"
type = "TCON_IP_RFC"
LocalTSelector = "16#E002"
IsoPort = 0
[[instance]]
name = "R"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[instance]]
name = "S"
block = "TSEND_C"
connect = "C1"
data = "tx"
[[peer]]
name = "P1"
iso = true
remote = "@C1"
local_tsap = "16#E001"
remote_tsap = "16#E002"
"""


class Desk:
    """A bench that is told lines."""

    def __init__(self, text: str, folder: Path, kernel: str = "sim") -> None:
        file = folder / "b.toml"
        file.write_text(text)
        self.bench = Bench(load_project(file), kernel)
        self._quiet, self._other = socket.socketpair()

    def say(self, *lines: str) -> None:
        do(self.bench, *lines)

    def until(self, holds: Callable[[], object], most: int = 3000) -> None:
        """Let scans pass until it holds, a millisecond of real time each."""
        for _ in range(most):
            self.bench.step()
            if holds():
                return
            select.select([self._quiet], [], [], 0.001)
        raise AssertionError("it never came true")

    def until_status(self, instance: str, status: str) -> None:
        self.until(lambda: self.status(instance) == status)

    def until_done(self, instance: str) -> None:
        self.until(lambda: self.bench.runtime.outputs(instance).done)

    def status(self, instance: str) -> str:
        return f"{self.bench.runtime.outputs(instance).status:04X}"

    def port(self, connect: str = "C1") -> int:
        port = self.bench.runtime.listening_port(connect)
        assert port is not None
        return port

    def notes(self, what: str) -> list[BenchNote]:
        events = [line.event for line in self.bench.runtime.ledger]
        return [event for event in events if isinstance(event, BenchNote) and event.what == what]

    def close(self) -> None:
        self.bench.close()
        self._quiet.close()
        self._other.close()
        assert self.bench.leaks() == ()
