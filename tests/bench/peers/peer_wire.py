"""One kernel with peers on it, and the other side of each connection in bare kernel calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.bench.peers.peer import Peer
from trcvtui.net.kernel import Handle, NewClient
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.results import Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel
from trcvtui.plc.ledger import BenchNote, Event
from trcvtui.project.project import PeerDecl

MS: Final = 1_000_000
HOME: Final = Endpoint("127.0.0.1", 0)
MOST_STEPS: Final = 20_000  # loopback answers within a few; a peer that never does is a failure, not a hang


class Wire:
    """One kernel, the peers on it, and the other side of each connection in bare kernel calls."""

    def __init__(self, kernel: SimKernel | OsKernel) -> None:
        self.kernel = kernel
        self.peers: list[Peer] = []
        self.events: list[Event] = []
        self.now = 0
        self.ends: dict[str, Endpoint] = {}

    def add(self, decl: PeerDecl) -> Peer:
        peer = Peer(decl, self.kernel, self.ends.get, self.events.append)
        self.peers.append(peer)
        return peer

    def peer(self, name: str, active: bool, end: Endpoint | str = HOME) -> Peer:
        return self.add(PeerDecl(name, active, end))

    def socket(self) -> Handle:
        handle = self.kernel.socket("PLC")
        assert not isinstance(handle, Fault)
        return handle

    def listener(self) -> Handle:
        handle = self.socket()
        assert self.kernel.bind(handle, HOME) is None and self.kernel.listen(handle, 4) is None
        end = self.kernel.local_end(handle)
        assert end is not None
        self.ends["C1"] = end
        return handle

    def client(self, peer: Peer) -> Handle:
        assert peer.transport.last_port is not None
        handle = self.socket()
        assert self.kernel.connect(handle, Endpoint("127.0.0.1", peer.transport.last_port)) is None
        self.until(lambda: self.kernel.connect_result(handle) is None)
        return handle

    def accept(self, listener: Handle) -> Handle:
        found: list[NewClient] = []

        def accepted() -> bool:
            got = self.kernel.accept(listener)
            if isinstance(got, NewClient):
                found.append(got)
            return bool(found)

        self.until(accepted)
        return found[0].handle

    def step(self, ns: int = MS) -> None:
        self.now += ns
        if isinstance(self.kernel, SimKernel):
            self.kernel.advance(self.now)
        for peer in self.peers:
            peer.step(self.now)

    def until(self, holds: Callable[[], bool]) -> None:
        for _ in range(MOST_STEPS):
            self.step()
            if holds():
                return
        raise AssertionError("it never came")

    def read(self, handle: Handle, size: int) -> bytes:
        """Return exactly `size` bytes."""
        got = bytearray()

        def complete() -> bool:
            buffer = memoryview(bytearray(size - len(got)))
            count = self.kernel.recv(handle, buffer)
            if isinstance(count, int):
                got.extend(buffer[:count])
            return len(got) == size

        if size:
            self.until(complete)
        return bytes(got)

    def ending(self, handle: Handle) -> str:
        """Return FIN or the errno name with which the connection ends."""
        found: list[str] = []

        def ended() -> bool:
            count = self.kernel.recv(handle, memoryview(bytearray(100)))
            if isinstance(count, Fault):
                found.append(count.error)
            elif count == 0:
                found.append("FIN")
            return bool(found)

        self.until(ended)
        return found[0]

    def notes(self, name: str = "P1") -> list[str]:
        return [e.what for e in self.events if isinstance(e, BenchNote) and e.subject == name]

    def close(self) -> None:
        for peer in self.peers:
            peer.end()
        if isinstance(self.kernel, OsKernel):
            self.kernel.close_all()


def connected(wire: Wire) -> tuple[Peer, Handle]:
    listener = wire.listener()
    peer = wire.peer("P1", True, "@C1")
    assert peer.connect(wire.now) == ""
    other = wire.accept(listener)
    wire.until(lambda: peer.state == "connected")
    return peer, other


def write(wire: Wire, handle: Handle, payload: bytes) -> None:
    assert wire.kernel.send(handle, memoryview(payload)) == len(payload)
