"""The simulated network: a Kernel with in-memory TCP, a virtual clock and seeded randomness.

It behaves as Linux does; tests/net/contract.py checks the common behaviour. Time moves only with `advance`.
As in the real kernel, the result of `poll` holds for the whole scan, for handles of the poll set.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Collection, Mapping
from functools import partial
from itertools import islice
from typing import Final

from trcvtui.net.kernel import Handle, KernelLoss, LocalAddress, NewClient, PathInfo, SocketOptions
from trcvtui.net.results import (
    ANY_ADDRESS,
    WOULD_BLOCK,
    Datagram,
    Endpoint,
    Fault,
    Unread,
    WaitingMessage,
    WouldBlock,
    is_group,
)
from trcvtui.net.sim.network import LOOPBACK, PortTable, SimHost, SimSocket, is_valid_end, simulated_broadcast
from trcvtui.net.sim.stream import StreamPhase
from trcvtui.net.sim.timers import MS

# Datagrams of one sender stay in order; one that finds no socket, a cut link or a full queue is lost.

LARGEST_DATAGRAM: Final = 65507  # 65535 less the headers of IP and UDP
# net.core.rmem_default of Linux, and what a queued datagram takes of it (256 of up to 100 bytes fit).
RECEIVE_ROOM: Final = 212_992
DATAGRAM_COST: Final = 832
COST_OF_A_BYTE: Final = 2


class DatagramWire:
    def __init__(self, wire: SimHost) -> None:
        self.wire = wire
        self.ports = PortTable()
        self._bound: dict[int, list[SimDatagramSocket]] = {}

    def add_socket(self, socket: SimDatagramSocket) -> None:
        """Deliver datagrams to a bound socket from now on."""
        self._bound.setdefault(socket.claim.port, []).append(socket)

    def remove_socket(self, socket: SimDatagramSocket) -> None:
        self.ports.release(socket.claim)
        holders = self._bound.get(socket.claim.port, [])
        if socket in holders:
            holders.remove(socket)
            if not holders:
                del self._bound[socket.claim.port]

    def carry(self, owner: str, source: Endpoint, remote: Endpoint, data: bytes) -> None:
        """Carry one datagram, unless the sender's link is down."""
        if self.wire.is_up(owner, owner):
            self.wire.call_after_latency(partial(self._deliver, owner, source, remote, data))

    def _deliver(self, owner: str, source: Endpoint, remote: Endpoint, data: bytes) -> None:
        for target in self._find_sockets(remote):
            if self.wire.is_up(owner, target.owner):
                target.queue_datagram(source, data)

    def deliver(self, source: Endpoint, remote: Endpoint, data: bytes) -> bool:
        """Deliver a datagram from outside; return whether a socket had room for it."""
        return True in [target.queue_datagram(source, data) for target in self._find_sockets(remote)]

    def withdraw(self, end: Endpoint) -> list[tuple[Endpoint, bytes]]:
        """Remove the unread datagrams at an address and port; return them."""
        return [each for target in self._find_sockets(end) for each in target.withdraw()]

    def _find_sockets(self, end: Endpoint) -> list[SimDatagramSocket]:
        """Return at most one socket. For a broadcast, return all bound to its address or to 0.0.0.0."""
        is_broadcast = self.wire.is_broadcast(end.address)
        holders = self._bound.get(end.port, []) if is_broadcast or self.wire.owns_address(end.address) else []
        heard = (end.address, ANY_ADDRESS)
        found = [each for address in heard for each in reversed(holders) if each.claim.address == address]
        return found if is_broadcast else found[:1]


class SimDatagramSocket(SimSocket):
    """One UDP socket. The methods answer "" or an errno name, as the system calls of Linux do."""

    __slots__ = ("_datagrams", "_dropped", "_queue", "_used", "may_broadcast")

    is_gone = False  # there is no connection that could end

    def __init__(self, datagrams: DatagramWire, owner: str) -> None:
        super().__init__(datagrams.wire, owner)
        self.tuning.receive_room = RECEIVE_ROOM
        self._datagrams = datagrams
        self._queue: deque[tuple[Endpoint, bytes]] = deque()
        self._used = self._dropped = 0
        self.may_broadcast = False

    @property
    def is_readable(self) -> bool:
        return bool(self._queue)

    def bind(self, end: Endpoint) -> str:
        error = self._bind_error(end) or self._datagrams.ports.bind(self.claim, end)  # not the ports of TCP
        if not error:
            self._datagrams.add_socket(self)
        return error

    def listen(self, backlog: int) -> str:
        return "EOPNOTSUPP"

    def connect(self, end: Endpoint) -> str:
        return "EOPNOTSUPP"  # each datagram names its target

    def send_to(self, data: memoryview, end: Endpoint) -> str:
        """Send one datagram; a socket without a port takes a free one."""
        remote = Endpoint(LOOPBACK, end.port) if end.address == ANY_ADDRESS else end
        error = self._find_send_error(len(data), remote)
        if error:
            return error
        if not self.claim.port:
            error = self.bind(Endpoint(ANY_ADDRESS, 0))
        if not error:
            source = Endpoint(self._source_address(remote.address), self.claim.port)
            self._datagrams.carry(self.owner, source, remote, bytes(data))
        return error

    def _find_send_error(self, size: int, remote: Endpoint) -> str:
        if not is_valid_end(remote) or not remote.port:
            return "EINVAL"
        if size > LARGEST_DATAGRAM:
            return "EMSGSIZE"
        is_broadcast = self._wire.is_broadcast(remote.address)
        error = "" if is_group(remote.address) else self._route_error(remote.address)
        return error or ("EACCES" if is_broadcast and not self.may_broadcast else "")

    def peek(self, skip: int) -> Unread:
        """Return the datagrams that wait, after the first `skip`."""
        found = [WaitingMessage(source, data, len(data)) for source, data in islice(self._queue, skip, None)]
        return Unread(messages=tuple(found), dropped=self._dropped)

    def queue_datagram(self, source: Endpoint, data: bytes) -> bool:
        """Queue a datagram. If there is no room, drop the datagram and return False."""
        cost = _datagram_cost(data)
        # An empty queue takes a datagram of any size.
        if self._queue and self._used + cost > self.tuning.receive_room:
            self._dropped += 1
            return False
        self._queue.append((source, data))
        self._used += cost
        self.changed()
        return True

    def withdraw(self) -> list[tuple[Endpoint, bytes]]:
        """Remove the unread datagrams, and return them."""
        unread = list(self._queue)
        self._queue.clear()
        self._used = 0
        return unread

    def read(self, into: memoryview) -> Datagram | WouldBlock:
        """Take the oldest datagram; bytes that do not fit into the view are lost."""
        if not self._queue:
            return WOULD_BLOCK
        source, data = self._queue.popleft()
        self._used -= _datagram_cost(data)
        size = min(len(data), len(into))
        into[:size] = data[:size]
        self.changed()
        return Datagram(size, source, len(data))

    def free(self, abort: bool) -> None:
        self._datagrams.remove_socket(self)
        self._queue.clear()


def _datagram_cost(data: bytes) -> int:
    return DATAGRAM_COST + COST_OF_A_BYTE * len(data)


WASTE_BYTES: Final = 65536
LOOPBACK_INTERFACE: Final = LocalAddress(
    LOOPBACK, "lo", ethernet=False, loopback=True, broadcast=simulated_broadcast(LOOPBACK)
)


class SeededRandom(random.Random):
    """Random numbers from a seed. A class of our own: a run's state names no class of another package."""


class SimKernel:
    """A Kernel with a network in memory, and with the peers of that network."""

    def __init__(
        self,
        seed: int = 0,
        addresses: tuple[str, ...] = ("10.0.0.1",),
        not_ethernet: tuple[str, ...] = (),
        latency_ns: int = 0,
        fragment: bool = False,
        names: Mapping[str, str] | None = None,
    ) -> None:
        self.wire = SimHost(tuple(dict.fromkeys((*addresses, *not_ethernet))), latency_ns)
        self.wire.broadcasts |= {simulated_broadcast(each) for each in addresses if each not in not_ethernet}
        self.datagrams = DatagramWire(self.wire)
        self._names = {n.rstrip(".").lower(): a for n, a in (names or {}).items()}
        self._random = SeededRandom(seed)
        self._not_ethernet = not_ethernet
        self._fragment = fragment
        self._sockets: dict[Handle, SimSocket] = {}
        self._made = 0
        self._ready: dict[Handle, SimSocket] = {}
        self._seen: dict[Handle, bool] = {}  # the result of the last poll; True = gone
        self._is_news = False  # something has become ready since the last `take_ready_flag`

    # -- the world -----------------------------------------------------------------------------------

    @property
    def now_ns(self) -> int:
        return self.wire.now

    @property
    def next_due_ns(self) -> int | None:
        """Return the time of the next timer, or None if there is no timer."""
        return self.wire.agenda.next_due

    def advance(self, now_ns: int) -> None:
        """Move the clock to now_ns. Each timer that is due by then is called at its own time."""
        if now_ns < self.wire.now:
            raise ValueError(f"time runs forwards: {now_ns} is before {self.wire.now}")
        self.wire.agenda.run_until(now_ns)

    def advance_until_ready(self, until_ns: int) -> int:
        """Move the clock until something becomes ready, at most to until_ns; return the time."""
        agenda = self.wire.agenda
        while not self._is_news and (due := agenda.next_due) is not None and due <= until_ns:
            agenda.run_until(max(due, agenda.now))
        if not self._is_news:
            agenda.run_until(max(until_ns, agenda.now))
        return agenda.now

    def take_ready_flag(self) -> bool:
        """Return whether anything has become ready since the last call."""
        is_news, self._is_news = self._is_news, False
        return is_news

    def set_link(self, owner: str, up: bool) -> str:
        self.wire.set_link(owner, up)
        return ""

    def leaks(self) -> tuple[str, ...]:
        return tuple(f"{handle} {socket}" for handle, socket in self._sockets.items())

    def local_addresses(self) -> tuple[LocalAddress, ...]:
        others = (
            LocalAddress(a, "tun0", ethernet=False)
            if a in self._not_ethernet
            else LocalAddress(a, "eth0", broadcast=simulated_broadcast(a))
            for a in self.wire.addresses
        )
        return (LOOPBACK_INTERFACE, *others)

    # -- the poll set --------------------------------------------------------------------------------

    def poll(self) -> None:
        # Only the ready ones: a poll must not cost more with many idle handles.
        self._seen = {handle: socket.is_gone for handle, socket in self._ready.items()}

    def readable(self, handle: Handle) -> bool:
        """Return whether the last poll saw the handle; for a handle outside the poll set, look now."""
        if handle in self._seen:
            return True
        socket = self._sockets.get(handle)
        return socket is not None and not socket.polled and socket.is_readable

    def renew(self, handle: Handle) -> bool:
        socket = self._sockets.get(handle)
        if socket is None:
            return True
        if socket.polled and socket.is_readable:
            self._seen[handle] = socket.is_gone
        return socket.is_gone

    def poll_add(self, handle: Handle) -> Fault | None:
        socket = self._sockets.get(handle)
        if socket is None or socket.polled:
            return Fault("poll_add", "EBADF" if socket is None else "EEXIST")
        socket.polled = True
        socket.changed()
        return None

    def poll_del(self, handle: Handle) -> Fault | None:
        socket = self._sockets.get(handle)
        if socket is None or not socket.polled:
            return Fault("poll_del", "EBADF" if socket is None else "ENOENT")
        socket.polled = False
        self._forget(handle)
        return None

    def _forget(self, handle: Handle) -> None:
        self._ready.pop(handle, None)
        self._seen.pop(handle, None)

    def _update_ready(self, handle: Handle, socket: SimSocket) -> None:
        if socket.polled:
            if socket.is_readable:
                self._ready[handle] = socket
                self._is_news = True
            else:
                self._ready.pop(handle, None)

    # -- set-up --------------------------------------------------------------------------------------

    def socket(self, owner: str) -> Handle | Fault:
        return self._add_socket(SimSocket(self.wire, owner))

    def _add_socket(self, socket: SimSocket) -> Handle:
        self._made += 1  # never used again, unlike a descriptor: a wrong use of a freed handle shows as EBADF
        handle = Handle(self._made)
        self._sockets[handle] = socket
        socket.set_watcher(partial(self._update_ready, handle, socket))
        return handle

    def set_reuse(self, handle: Handle) -> Fault | None:
        socket = self._sockets.get(handle)
        if socket is None:
            return Fault("set_reuse", "EBADF")
        socket.claim.reuse = True
        return None

    def set_options(self, handle: Handle, options: SocketOptions) -> tuple[str, ...]:
        socket = self._sockets.get(handle)
        return () if socket is None else socket.set_options(options)

    def set_user_timeout(self, handle: Handle, milliseconds: int) -> None:
        socket = self._sockets.get(handle)
        if socket is not None:
            socket.tuning.user_timeout = milliseconds * MS

    def bind(self, handle: Handle, end: Endpoint) -> Fault | None:
        socket = self._sockets.get(handle)
        return _make_fault("bind", "EBADF" if socket is None else socket.bind(end))

    def listen(self, handle: Handle, backlog: int) -> Fault | None:
        socket = self._sockets.get(handle)
        return _make_fault("listen", "EBADF" if socket is None else socket.listen(backlog))

    def local_end(self, handle: Handle) -> Endpoint | None:
        socket = self._sockets.get(handle)
        return None if socket is None else socket.local_end

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        socket = self._sockets.get(handle)
        if socket is not None and socket.polled and handle not in self._seen:
            return WOULD_BLOCK
        if socket is None or socket.listener is None:
            return Fault("accept", "EBADF" if socket is None else "EINVAL")
        if not socket.listener.queue:
            return WOULD_BLOCK
        stream = socket.listener.queue.popleft()
        socket.changed()
        return NewClient(self._add_socket(SimSocket(self.wire, socket.owner, stream)), stream.remote)

    def resolve(self, handle: Handle, name: str) -> str | WouldBlock | Fault:
        """Return the address of a name. Only localhost and the names given to the kernel are known."""
        if handle not in self._sockets:
            return Fault("resolve", "EBADF")
        if name in ("localhost", "localhost."):
            return LOOPBACK
        return self._names.get(name.rstrip(".").lower()) or Fault("resolve", "EAI_NONAME")

    def connect(self, handle: Handle, end: Endpoint) -> Fault | None:
        socket = self._sockets.get(handle)
        return _make_fault("connect", "EBADF" if socket is None else socket.connect(end))

    def connect_result(self, handle: Handle) -> WouldBlock | Fault | None:
        socket = self._sockets.get(handle)
        stream = socket.stream if socket is not None else None
        if stream is None:
            return Fault("connect", "EBADF" if socket is None else "ENOTCONN")
        if stream.phase is StreamPhase.SYN_SENT:
            return WOULD_BLOCK
        if stream.unread:  # bytes prove that it was connected, also if the partner sent RST right after them
            return None
        return _make_fault(
            "connect", stream.take_error() or ("ENOTCONN" if stream.phase is StreamPhase.OVER else "")
        )

    # -- data ----------------------------------------------------------------------------------------

    def recv(self, handle: Handle, into: memoryview) -> int | WouldBlock | Fault:
        """Read at most len(into) bytes, perhaps fewer if `fragment` is set. 0 means the partner's FIN."""
        socket = self._sockets.get(handle)
        if socket is not None and socket.polled and handle not in self._seen:
            return WOULD_BLOCK
        if socket is None or socket.stream is None:
            return Fault("recv", "EBADF" if socket is None else "ENOTCONN")
        most = len(into)
        if not most:
            return 0
        if self._fragment and socket.stream.unread > 1:  # TCP keeps no boundaries: any cut can happen
            most = self._random.randint(1, socket.stream.unread)
        got = socket.stream.read(into, most)
        return Fault("recv", got) if isinstance(got, str) else got

    def send(self, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
        socket = self._sockets.get(handle)
        if socket is None or socket.stream is None:
            return Fault("send", "EBADF" if socket is None else "EPIPE")
        got = socket.stream.write(data)
        return Fault("send", got) if isinstance(got, str) else got

    def datagram_socket(self, owner: str) -> Handle | Fault:
        return self._add_socket(SimDatagramSocket(self.datagrams, owner))

    def set_broadcast(self, handle: Handle) -> Fault | None:
        socket = self._sockets.get(handle)
        if isinstance(socket, SimDatagramSocket):
            socket.may_broadcast = True
        return _make_fault("set_broadcast", "EBADF" if socket is None else "")

    def send_to(self, handle: Handle, data: memoryview, end: Endpoint) -> int | WouldBlock | Fault:
        socket = self._sockets.get(handle)
        if not isinstance(socket, SimDatagramSocket):
            return Fault("send", "EBADF" if socket is None else "EPIPE")
        return _make_fault("send", socket.send_to(data, end)) or len(data)

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        socket = self._sockets.get(handle)
        if socket is not None and socket.polled and handle not in self._seen:
            return WOULD_BLOCK
        if not isinstance(socket, SimDatagramSocket):
            return Fault("recv", "EBADF" if socket is None else "ENOTCONN")
        return socket.read(into)

    def loss(self, handle: Handle) -> KernelLoss | None:
        socket = self._sockets.get(handle)
        if socket is None:
            return KernelLoss(Fault("recv", "EBADF"), 0)
        if not (self._seen.get(handle, False) if socket.polled else socket.is_gone):
            return None
        if socket.stream is None:
            return KernelLoss(None, 0)
        error = socket.stream.take_error()
        # A RST after a FIN is EPIPE: the FIN came first, and recv answers 0, too.
        fault = Fault("recv", error) if error and error != "EPIPE" else None
        return KernelLoss(fault, socket.stream.unread)

    def discard(self, handle: Handle, most: int) -> int:
        waste, gone = memoryview(bytearray(min(most, WASTE_BYTES))), 0
        while gone < most:
            taken = self.recv(handle, waste)
            if not isinstance(taken, int) or not taken:
                break
            gone += taken
        return gone

    def unread(self, handle: Handle) -> int:
        socket = self._sockets.get(handle)
        return 0 if socket is None or socket.stream is None else socket.stream.unread

    def list_unread(self, handles: Collection[Handle]) -> list[Handle]:
        return [each for each in handles if each in self._sockets and self._sockets[each].is_readable]

    def peek(self, handle: Handle, skip: int) -> Unread:
        socket = self._sockets.get(handle)
        if isinstance(socket, SimDatagramSocket):
            return socket.peek(skip)
        if socket is None or socket.stream is None:
            waits = socket.listener.queue if socket is not None and socket.listener is not None else ()
            return Unread(clients=len(waits))
        return socket.stream.peek(skip)

    def path(self, handle: Handle) -> PathInfo | None:
        socket = self._sockets.get(handle)
        return None if socket is None or socket.stream is None else socket.stream.path()

    # -- the end -------------------------------------------------------------------------------------

    def shutdown(self, handle: Handle, both: bool = True) -> Fault | None:
        socket = self._sockets.get(handle)
        return _make_fault("shutdown", "EBADF" if socket is None else socket.shutdown(both))

    def probe(self, handle: Handle) -> Fault | None:
        socket = self._sockets.get(handle)
        return _make_fault("shutdown", "EBADF" if socket is None else socket.probe_shutdown())

    def abort(self, handle: Handle) -> Fault | None:
        return self._free("abort", handle)

    def close(self, handle: Handle) -> Fault | None:
        return self._free("close", handle)

    def _free(self, call: str, handle: Handle) -> Fault | None:
        socket = self._sockets.pop(handle, None)
        if socket is None:
            return Fault(call, "EBADF")
        socket.polled = False
        self._forget(handle)
        socket.free(abort=call == "abort")
        return None


def _make_fault(call: str, error: str) -> Fault | None:
    return Fault(call, error) if error else None
