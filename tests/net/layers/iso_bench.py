"""A bench of two networks with a LayerKernel in front; its clock stands until somebody moves it."""

from __future__ import annotations

from tests.net.net_bench import ANY_PORT, LOOPBACK, Bench, OsNetwork
from tests.net.sim.net_sim import SimNetwork
from trcvtui.net.faults import FaultPlan, FaultyKernel
from trcvtui.net.kernel import Handle, NewClient, SocketOptions
from trcvtui.net.layers.iso_on_tcp import Code, ConnectTpdu, IsoSettings, TpktReader, encode_tpdu
from trcvtui.net.layers.layer_kernel import LayerKernel
from trcvtui.net.layers.layered_stream import CLIENT_DROPPED, LayerNote
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault

SECOND = 1_000_000_000
E001, E002, E003 = b"\xe0\x01", b"\xe0\x02", b"\xe0\x03"
CAP = 65536
CALLS = IsoSettings(E001, E002, CAP)
WAITS = IsoSettings(E002, E001, CAP)
REFUSED = Fault("session", "ECONNREFUSED")


class Net:
    """A network with sessions in front; its clock stands until somebody moves it."""

    def __init__(self, below: SimNetwork | OsNetwork) -> None:
        self.now = 0
        self.told: list[tuple[str, str]] = []  # of clients that were dropped: CONNECT, why
        self.heard: list[tuple[str, str, str]] = []  # of everything else: CONNECT, what, why
        self.below = below
        self.faulty = FaultyKernel(below.kernel, FaultPlan())
        self.kernel = LayerKernel(self.faulty, lambda: self.now, self._hear)

    def _hear(self, note: LayerNote) -> None:
        assert note.client.startswith(LOOPBACK)
        if note.what == CLIENT_DROPPED:
            self.told.append((note.connect, note.why))
        else:
            self.heard.append((note.connect, note.what, note.why))

    def breathe(self) -> None:
        self.below.breathe()

    def inside(self, handle: Handle) -> int:
        below: int = self.faulty.unread(handle)
        return self.kernel.unread(handle) - below


class IsoBench(Bench):
    """A bench with ISO-on-TCP in its hands."""

    def __init__(self, net: Net) -> None:
        super().__init__(net)
        self.net = net
        self._open: set[Handle] = set()

    def socket(
        self, reuse: bool = False, end: Endpoint | None = None, polled: bool = False, owner: str = "X"
    ) -> Handle:
        handle = super().socket(reuse, end, polled, owner)
        self._open.add(handle)
        return handle

    def accept(self, listener: Handle) -> NewClient:
        got = super().accept(listener)
        self._open.add(got.handle)
        return got

    def close(self) -> None:
        self.close_all(*self._open)

    def iso_socket(self, settings: IsoSettings, owner: str = "C1", small: bool = False) -> Handle:
        handle = self.socket(owner=owner)
        self.kernel.set_options(handle, SocketOptions(session=settings, small_buffers=small))
        return handle

    def iso_listener(self, settings: IsoSettings, end: Endpoint = ANY_PORT, owner: str = "C1") -> Handle:
        handle = self.iso_socket(settings, owner)
        assert self.kernel.set_reuse(handle) is None
        assert self.kernel.bind(handle, end) is None
        assert self.kernel.listen(handle, 4) is None
        assert self.kernel.poll_add(handle) is None
        return handle

    def call(self, end: Endpoint, settings: IsoSettings = CALLS, small: bool = False) -> Handle:
        handle = self.iso_socket(settings, "P1", small)
        assert self.kernel.connect(handle, end) is None
        return handle

    def taken(self, listener: Handle, settings: IsoSettings = WAITS, caller: Handle | None = None) -> Handle:
        """Wait for a client of this listener and take it, as a CONNECT does; `caller` looks meanwhile."""

        def has_come() -> bool:
            if caller is not None:
                assert self.kernel.connect_result(caller) is WOULD_BLOCK
            return self.kernel.readable(listener)

        self.until(has_come)
        got = self.accept(listener)
        self.kernel.set_options(got.handle, SocketOptions(session=settings))
        return got.handle

    def message(self, handle: Handle, room: int = CAP) -> tuple[bytes, int]:
        """Wait for the next message: its bytes as far as there is room, and how many it had."""
        into = bytearray(room)
        found: list[Datagram] = []

        def is_there() -> bool:
            got = self.kernel.recv_from(handle, memoryview(into))
            if isinstance(got, Datagram):
                found.append(got)
            return bool(found)

        self.until(is_there)
        return bytes(into[: found[0].size]), found[0].whole

    def up(self) -> tuple[Handle, Handle]:
        listener = self.iso_listener(WAITS)
        caller = self.call(self.end(listener))
        called = self.taken(listener, caller=caller)
        assert self.verdict(caller) is None
        assert self.kernel.poll_add(caller) is None
        return caller, called

    def close_all(self, *handles: Handle) -> None:
        for handle in handles:
            self.kernel.close(handle)
        self.settle()


def answer_of(b: IsoBench, client: Handle, size: int) -> list[object]:
    return list(TpktReader().feed(b.receive(client, size)))


def raw_client(b: IsoBench, end: Endpoint, *data: bytes) -> Handle:
    """Return a plain TCP client that has sent these bytes."""
    client = b.connect(end)
    for part in data:
        b.send(client, part)
    return client


def raw_up(b: IsoBench, settings: IsoSettings = WAITS, size_code: int = 7) -> tuple[Handle, Handle]:
    """Return a plain TCP client whose CR was taken, and what it is connected to."""
    listener = b.iso_listener(settings)
    client = raw_client(b, b.end(listener), encode_tpdu(ConnectTpdu(Code.CR, 0, 1, E001, E002, size_code)))
    return client, b.taken(listener, settings)
