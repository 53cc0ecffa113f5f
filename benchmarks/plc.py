"""A PLC of many TRCV_C on real sockets, without peers, task or screen: what a throughput run drives."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Final

from trcvtui import clock
from trcvtui.net.connection.resources import BufferPool, ConnectionBudget, JobQueue, Resources
from trcvtui.net.faults import FaultPlan, FaultyKernel
from trcvtui.net.kernel import Handle, NewClient
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.results import Fault, WouldBlock
from trcvtui.plc.commands import SetInput
from trcvtui.plc.containment import Containment, ExceptionNote
from trcvtui.plc.runtime import Runtime
from trcvtui.project.file import read_project

SET_UP_SCANS: Final = 8
AN_ADDRESS: Final = 4000  # CONNECTs: with more, the kernel searches long for a free port
PATIENCE_NS: Final = 30_000_000_000


class OpenKernel(OsKernel):
    """The real network, which tells the descriptors of the connections that it accepted."""

    def __init__(self) -> None:
        super().__init__()
        self.accepted: list[Handle] = []

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        """Take one finished handshake."""
        got = super().accept(handle)
        if isinstance(got, NewClient):
            self.accepted.append(got.handle)
        return got


class ManyReceivers:
    """`count` connections, each with a TRCV_C whose DATA has `size` bytes."""

    def __init__(self, count: int, size: int) -> None:
        project = read_project(_document(count, size), "benchmark", Path())
        plan, self.kernel = FaultPlan(), OpenKernel()
        unlimited = Resources(
            JobQueue(count, plan.take_fault), BufferPool(count, plan.take_fault), ConnectionBudget(count)
        )
        kernel = FaultyKernel(self.kernel, plan)
        containment = Containment(
            lambda part, report: report(),
            lambda error: ExceptionNote(repr(error), False),
            lambda note: None,
            None,
            lambda do: do(),
        )
        self.runtime = Runtime(project, kernel, unlimited, lambda name: None, None, containment)
        self._names = [f"C{i}" for i in range(count)]
        self._start = clock.now_ns()
        self.scan(SET_UP_SCANS)

    def scan(self, scans: int = 1) -> None:
        """Let scans pass at the clock's time."""
        for _ in range(scans):
            self.runtime.scan(clock.now_ns() - self._start)

    def scan_for(self, ns: int) -> int:
        """Scan without a pause for so long; return how long it took."""
        scan, start, now_ns = self.runtime.scan, self._start, clock.now_ns
        began = now = now_ns()
        while now < began + ns:
            scan(now - start)
            now = now_ns()
        return now - began

    def ports(self) -> list[int]:
        """Return the ports that the CONNECTs listen on."""
        found = [self.runtime.listening_port(name) for name in self._names]
        return [port for port in found if port is not None]

    def take_partners(self, count: int | None = None) -> None:
        """Let scans pass until so many CONNECTs have their partner, or all."""
        end = clock.now_ns() + PATIENCE_NS
        while len(self.kernel.accepted) < (len(self._names) if count is None else count):
            self.scan()
            if clock.now_ns() > end:
                raise TimeoutError(f"{len(self.kernel.accepted)} of {len(self._names)} partners came")
        self.scan(SET_UP_SCANS)

    def sockets(self) -> list[socket.socket]:
        """Return socket objects over the descriptors that the PLC receives on; detach them after use."""
        return [socket.socket(fileno=handle) for handle in self.kernel.accepted]

    def receive(self) -> None:
        """Raise EN_R everywhere."""
        for name in self._names:
            self.runtime.submit(SetInput(f"T{name}", "EN_R", True))

    def bytes_received(self) -> int:
        """Return how many bytes all connections have received."""
        return sum(connection.bytes_received for connection in self.runtime.snapshot().connections)

    def close(self) -> None:
        """Free every socket."""
        self.runtime.close()
        self.kernel.close_all()


def _document(count: int, size: int) -> dict[str, object]:
    names = [f"C{i}" for i in range(count)]
    return {
        "dialect": "baosky",
        "options": {"max_len": 65536},
        "data": [{"name": f"rx{name}", "type": f"ARRAY[1..{size}] OF BYTE"} for name in names],
        "connect": [
            {"name": name, "LocalAddress": f"127.0.{number // AN_ADDRESS}.1", "LocalPort": 0}
            for number, name in enumerate(names)
        ],
        "instance": [
            {"name": f"T{name}", "block": "TRCV_C", "connect": name, "data": f"rx{name}", "CONT": True}
            for name in names
        ],
    }
