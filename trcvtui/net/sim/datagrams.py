"""UDP of the simulated network: sockets with a bounded queue, and the wire that loses without a word.

Datagrams of one sender stay in order; one that finds nobody, a cut link or a full queue is gone.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from trcvtui.net.connection.ipv4 import is_group
from trcvtui.net.kernel import WOULD_BLOCK, Datagram, Endpoint, WouldBlock
from trcvtui.net.sim.ports import ANY, PortTable
from trcvtui.net.sim.socket import LOOPBACK, SimSocket, is_sane
from trcvtui.net.sim.wire import SimWire

LARGEST: Final = 65507  # 65535 less the headers of IP and UDP
BROADCAST: Final = "255.255.255.255"
# net.core.rmem_default of Linux, and what a queued datagram costs of it there (256 of up to 100 bytes fit).
RECEIVE_ROOM: Final = 212_992
COST: Final = 832
COST_OF_A_BYTE: Final = 2


class DatagramWire:
    """Carries datagrams between the sockets of the one machine."""

    def __init__(self, wire: SimWire, latency: int) -> None:
        self.wire = wire
        self.ports = PortTable()
        self._latency = latency
        self._bound: dict[int, list[SimDatagrams]] = {}

    def enter(self, socket: SimDatagrams) -> None:
        """Let datagrams reach a socket whose end is known."""
        self._bound.setdefault(socket.claim.port, []).append(socket)

    def leave(self, socket: SimDatagrams) -> None:
        """Let nothing reach the socket any more."""
        self.ports.release(socket.claim)
        holders = self._bound.get(socket.claim.port, [])
        if socket in holders:
            holders.remove(socket)
            if not holders:
                del self._bound[socket.claim.port]

    def carry(self, owner: str, source: Endpoint, remote: Endpoint, data: bytes) -> None:
        """Carry one datagram, unless the sender's link is down."""
        if not self.wire.is_up(owner, owner):
            return
        if self._latency:
            due = self.wire.now + self._latency
            self.wire.at(due, lambda: self._deliver(owner, source, remote, data))
        else:
            self._deliver(owner, source, remote, data)

    def _deliver(self, owner: str, source: Endpoint, remote: Endpoint, data: bytes) -> None:
        target = self._socket_at(remote)
        if target is not None and self.wire.is_up(owner, target.owner):
            target.arrive(source, data)

    def _socket_at(self, end: Endpoint) -> SimDatagrams | None:
        """Return who gets it: the socket of that very address, else one of all; the newest of several."""
        holders = self._bound.get(end.port, []) if self.wire.owns(end.address) else []
        for address in (end.address, ANY):
            for socket in reversed(holders):
                if socket.claim.address == address:
                    return socket
        return None


class SimDatagrams(SimSocket):
    """One UDP socket. The methods answer "" or an errno name, as the system calls of Linux do."""

    __slots__ = ("_datagrams", "_queue", "_used")

    def __init__(self, datagrams: DatagramWire, owner: str) -> None:
        super().__init__(datagrams.wire, owner)
        self.tuning.receive_room = RECEIVE_ROOM
        self._datagrams = datagrams
        self._queue: deque[tuple[Endpoint, bytes]] = deque()
        self._used = 0

    @property
    def is_readable(self) -> bool:
        """Return whether a datagram waits."""
        return bool(self._queue)

    @property
    def is_gone(self) -> bool:
        """Return False: there is no connection that could end."""
        return False

    def bind(self, end: Endpoint) -> str:
        """Bind to a local end; port 0 takes a free one. UDP has port numbers of its own."""
        error = self._cannot_bind(end) or self._datagrams.ports.bind(self.claim, end)
        if not error:
            self._datagrams.enter(self)
        return error

    def listen(self, backlog: int) -> str:
        """Refuse: nobody connects to datagrams."""
        return "EOPNOTSUPP"

    def connect(self, end: Endpoint) -> str:
        """Refuse: each datagram names its target."""
        return "EOPNOTSUPP"

    def send_to(self, data: memoryview, end: Endpoint) -> str:
        """Send one datagram; a socket without a port takes a free one."""
        remote = Endpoint(LOOPBACK, end.port) if end.address == ANY else end
        error = self._cannot_send(len(data), remote)
        if error:
            return error
        if not self.claim.port:
            error = self.bind(Endpoint(ANY, 0))
        if not error:
            source = Endpoint(self._source_for(remote.address), self.claim.port)
            self._datagrams.carry(self.owner, source, remote, bytes(data))
        return error

    def _cannot_send(self, size: int, remote: Endpoint) -> str:
        if not is_sane(remote) or not remote.port:
            return "EINVAL"
        if size > LARGEST:
            return "EMSGSIZE"
        if is_group(remote.address):
            return "EACCES" if remote.address == BROADCAST else ""
        return self._no_way_to(remote.address)

    def arrive(self, source: Endpoint, data: bytes) -> None:
        """Queue a datagram; where there is no room for it, it is the newest that is dropped."""
        cost = _cost(data)
        if self._queue and self._used + cost > self.tuning.receive_room:
            return
        self._queue.append((source, data))
        self._used += cost
        self.changed()

    def take(self, into: memoryview) -> Datagram | WouldBlock:
        """Take the oldest datagram; what is larger than the view is cut off."""
        if not self._queue:
            return WOULD_BLOCK
        source, data = self._queue.popleft()
        self._used -= _cost(data)
        size = min(len(data), len(into))
        into[:size] = data[:size]
        self.changed()
        return Datagram(size, source, len(data))

    def free(self, abort: bool) -> None:
        """Let the port and what is queued go."""
        self._datagrams.leave(self)
        self._queue.clear()


def _cost(data: bytes) -> int:
    return COST + COST_OF_A_BYTE * len(data)
