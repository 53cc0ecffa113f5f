"""The simulated network: its ports, the wire that carries segments, and the socket of each handle.

The methods of a socket answer "" or an errno name, as the system calls of Linux do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Final

from msgspec.structs import replace

from trcvtui.net.kernel import SocketOptions
from trcvtui.net.results import ANY_ADDRESS, Endpoint, broadcast_address, is_group, is_loopback, parse_octets
from trcvtui.net.sim.stream import (
    RESET_SEGMENT,
    RTO_MAX,
    PortClaim,
    Segment,
    SegmentFlag,
    SimStream,
    StreamPhase,
    Tuning,
    ignore_change,
)
from trcvtui.net.sim.timers import MS, SECOND, Ticket, TimerQueue

LOOPBACK: Final = "127.0.0.1"
BROADCAST_ADDRESS: Final = "255.255.255.255"


def simulated_broadcast(address: str) -> str:
    """Return the broadcast address for a simulated address, with the masks that `--netns` uses."""
    return broadcast_address(address, "255.0.0.0" if is_loopback(address) else "255.255.255.0")


FIRST_FREE_PORT: Final = 32768
LAST_FREE_PORT: Final = 60999


class PortTable:
    def __init__(self) -> None:
        self._claims: dict[int, list[PortClaim]] = {}
        self._next = FIRST_FREE_PORT

    def bind(self, claim: PortClaim, end: Endpoint) -> str:
        """Bind the claim to a local end; return "" or the errno name."""
        port = end.port or self._free_port()
        if not port or self._is_taken(claim, end.address, port):
            return "EADDRINUSE"
        claim.address, claim.port, claim.fixed = end.address, port, end.port != 0
        self.add(claim)
        return ""

    def claim_free_port(self, claim: PortClaim, address: str) -> bool:
        """Give a connecting socket's claim a free port if it has none; return whether it has a port now."""
        claim.address = address
        if claim.port:
            return True
        claim.port = self._free_port()
        if claim.port:
            self.add(claim)
        return claim.port != 0

    def mark_listening(self, claim: PortClaim) -> str:
        """Make the claim exclusive; return "" or the errno name. A claim without a port gets a free one."""
        if not claim.port and not self.claim_free_port(claim, claim.address):
            return "EADDRINUSE"
        if self._is_taken(claim, claim.address, claim.port):
            return "EADDRINUSE"
        claim.listening = True
        return ""

    def add(self, claim: PortClaim) -> None:
        """Add a claim that has its address and port to the table."""
        self._claims.setdefault(claim.port, []).append(claim)

    def release(self, claim: PortClaim) -> None:
        """Remove a claim from the table, if the table has it."""
        holders = self._claims.get(claim.port)
        if holders is not None and claim in holders:
            holders.remove(claim)
            if not holders:
                del self._claims[claim.port]

    def _is_taken(self, claim: PortClaim, address: str, port: int) -> bool:
        return any(
            other is not claim
            and (address == other.address or ANY_ADDRESS in (address, other.address))  # 0.0.0.0 meets all
            and (other.listening or not (claim.reuse and other.reuse))  # SO_REUSEADDR never shares a listener
            for other in self._claims.get(port, ())
        )

    def _free_port(self) -> int:
        """Return a port that no claim has, or 0 if there is none."""
        for _ in range(FIRST_FREE_PORT, LAST_FREE_PORT + 1):
            port = self._next
            self._next = port + 1 if port < LAST_FREE_PORT else FIRST_FREE_PORT
            if port not in self._claims:
                return port
        return 0


NO_HOST_AFTER: Final = 3070 * MS  # ARP unanswered
TIME_WAIT: Final = 60 * SECOND
PLAYED_SEND_ROOM: Final = 8 << 20  # bytes of a partner played from a capture that the PLC has not taken


class SimListener:
    """A listening socket: finished handshakes wait in its queue."""

    __slots__ = ("backlog", "changed", "claim", "owner", "queue", "tuning")

    def __init__(
        self, owner: str, claim: PortClaim, tuning: Tuning, backlog: int, changed: Callable[[], None]
    ) -> None:
        self.owner = owner
        self.claim, self.tuning, self.backlog, self.changed = claim, tuning, backlog, changed
        self.queue: deque[SimStream] = deque()


class SimHost:
    """The only machine of the simulated network, for all handles. It has loopback and `addresses`."""

    def __init__(self, addresses: tuple[str, ...], latency: int) -> None:
        self.addresses = addresses
        self.broadcasts = {simulated_broadcast(LOOPBACK), BROADCAST_ADDRESS}
        self.ports = PortTable()
        self.agenda = TimerQueue()
        self._latency = latency
        self.played: dict[str, list[SimStream]] = {}  # owner -> calls that only a played partner answers
        self._down: dict[str, None] = {}
        self._listeners: dict[Endpoint, SimListener] = {}
        self._streams: dict[tuple[Endpoint, Endpoint], SimStream] = {}

    # -- time ----------------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        return self.agenda.now

    def call_at(self, due: int, act: Callable[[], None]) -> Ticket:
        return self.agenda.call_at(due, act)

    def cancel(self, ticket: Ticket | None) -> None:
        self.agenda.cancel(ticket)

    def call_after_latency(self, act: Callable[[], None]) -> None:
        """Call `act` after the latency, or at once if the latency is 0."""
        if self._latency:
            self.call_at(self.now + self._latency, act)
        else:
            act()

    # -- links ---------------------------------------------------------------------------------------

    def set_link(self, owner: str, up: bool) -> None:
        if up:
            self._down.pop(owner, None)
        else:
            self._down[owner] = None

    def is_up(self, one: str, other: str) -> bool:
        """Return whether the links of both owners are up."""
        return not self._down or not (one in self._down or other in self._down)

    def owns_address(self, address: str) -> bool:
        return is_loopback(address) or address in self.addresses

    def is_broadcast(self, address: str) -> bool:
        return address in self.broadcasts and address not in self.addresses

    # -- segments ------------------------------------------------------------------------------------

    def carry(self, source: SimStream, segment: Segment) -> None:
        """Carry a segment to the partner; drop it if a link is down when it leaves or when it arrives."""
        partner = source.partner
        if partner is None or (self._down and not self.is_up(source.owner, partner.owner)):
            return
        self.call_after_latency(partial(self._deliver, source, partner, segment))

    def _deliver(self, source: SimStream, partner: SimStream, segment: Segment) -> None:
        if self._down and not self.is_up(source.owner, partner.owner):
            return
        if partner.phase is not StreamPhase.OVER:
            partner.handle_segment(segment)
        elif partner.lingering and not segment.data:  # TIME_WAIT answers a FIN or probe again
            if segment.flags:
                partner.acknowledge()
        elif not segment.flags & SegmentFlag.RST:  # RFC 9293 3.10.7.1: never an RST for an RST
            self.carry(partner, RESET_SEGMENT)

    # -- the handshake -------------------------------------------------------------------------------

    def listen(self, listener: SimListener) -> None:
        """Let SYNs reach the listener."""
        assert listener.claim.end is not None
        self._listeners[listener.claim.end] = listener

    def stop_listening(self, listener: SimListener) -> None:
        """Refuse new clients, and reset the queued ones."""
        assert listener.claim.end is not None
        self._listeners.pop(listener.claim.end, None)
        for client in listener.queue:
            client.abort()
        listener.queue.clear()

    def has_connection(self, client: SimStream) -> bool:
        """Return whether there is a connection with the same two ends."""
        old = self._streams.get((client.local, client.remote))
        return old is not None and not old.lingering  # TIME_WAIT may be reused, with timestamps (RFC 6191)

    def connect(self, client: SimStream) -> None:
        """Begin a connection; the caller has checked that no other connection has the same ends."""
        ends = (client.local, client.remote)
        if ends in self._streams:  # TIME_WAIT: the caller has asked `has_connection`
            self._remove_stream(self._streams[ends])
        self._streams[ends] = client
        if client.owner in self.played:
            self.played[client.owner].append(client)
            return
        if not self.owns_address(client.remote.address):
            self.call_at(self.now + NO_HOST_AFTER, client.fail_no_host)
        client.connect()

    def carry_syn(self, client: SimStream) -> None:
        """Carry a SYN to the machine that has the address."""
        if client.owner in self._down or not self.owns_address(client.remote.address):
            return
        if client.local == client.remote:  # a simultaneous open with itself
            client.partner = client
            client.establish(client.make_syn_ack().edge)
        else:
            self.call_after_latency(partial(self._deliver_syn, client))

    def _deliver_syn(self, client: SimStream) -> None:
        if client.phase is not StreamPhase.SYN_SENT:
            return
        at_any = Endpoint(ANY_ADDRESS, client.remote.port)
        listener = self._listeners.get(client.remote) or self._listeners.get(at_any)
        if listener is None:
            self.call_after_latency(partial(self._deliver_refusal, client))
        elif self.is_up(client.owner, listener.owner):
            server = client.partner or self._admit(listener, client)
            if server is not None:
                self.carry(server, server.make_syn_ack())

    def connect_as_partner(self, local: Endpoint, target: Endpoint) -> SimStream | None:
        """Let a played partner connect to a listener. Return its end, or None if already connected."""
        client = self._make_played_stream(local, target)
        if self.has_connection(client):
            return None
        self.connect(client)
        return client

    def answer_as_partner(self, owner: str) -> SimStream | None:
        """Let a played partner answer an owner's newest call; return the partner's end, None: no call."""
        client = self._take_newest_attempt(owner)
        if client is None:
            return None
        server = self._make_played_stream(client.remote, client.local)
        self._streams[server.local, server.remote] = server
        server.partner, client.partner = client, server
        server.establish(client.make_syn_ack().edge)
        self.carry(server, server.make_syn_ack())
        return server

    def refuse_as_partner(self, owner: str) -> bool:
        """Let a played partner refuse an owner's newest attempt; return False if there is none."""
        client = self._take_newest_attempt(owner)
        if client is not None:
            client.handle_segment(RESET_SEGMENT)
        return client is not None

    def _take_newest_attempt(self, owner: str) -> SimStream | None:
        calls = self.played.get(owner, [])
        waiting = [each for each in calls if each.phase is StreamPhase.SYN_SENT]
        calls[:] = waiting[:-1]
        return waiting[-1] if waiting else None

    def _make_played_stream(self, local: Endpoint, remote: Endpoint) -> SimStream:
        claim = PortClaim(local.address, local.port, reuse=True)
        name = f"partner {local} of {remote}"
        made = SimStream(self, name, claim, local, remote, Tuning(send_room=PLAYED_SEND_ROOM))
        made.always_answers = True
        return made

    def _deliver_refusal(self, client: SimStream) -> None:
        if client.owner not in self._down and client.phase is StreamPhase.SYN_SENT:
            client.handle_segment(RESET_SEGMENT)

    def _admit(self, listener: SimListener, client: SimStream) -> SimStream | None:
        """Return the server's end of a new connection, or None if backlog + 1 clients wait already."""
        ends = (client.remote, client.local)
        old = self._streams.get(ends)
        if old is not None:  # the client has lost it, else it could not use the same ends again
            self._remove_stream(old) if old.lingering else old.handle_reset()
        if len(listener.queue) > listener.backlog:  # Linux drops the SYN: the client sends it again
            return None
        claim = PortClaim(client.remote.address, listener.claim.port, listener.claim.reuse)
        server = SimStream(self, listener.owner, claim, *ends, replace(listener.tuning))
        self.ports.add(claim)
        self._streams[ends] = server
        server.partner, client.partner = client, server
        server.establish(client.make_syn_ack().edge)
        listener.queue.append(server)
        listener.changed()
        return server

    # -- the end -------------------------------------------------------------------------------------

    def remove_ended(self, stream: SimStream, linger: bool) -> None:
        """Remove an ended connection from the tables: with `linger` after TIME_WAIT, otherwise at once."""
        stream.lingering = linger
        if linger:
            self.call_at(self.now + TIME_WAIT, lambda: self._remove_stream(stream))
        else:
            self._remove_stream(stream)

    def _remove_stream(self, stream: SimStream) -> None:
        stream.lingering = False
        ends = (stream.local, stream.remote)
        if self._streams.get(ends) is stream:
            del self._streams[ends]
        if not (stream.claim.fixed and stream.held):  # a bound socket keeps its port until it is closed
            self.ports.release(stream.claim)

    def release_port(self, stream: SimStream) -> None:
        """Free the port of a connection that ended before its handle was freed."""
        if stream.phase is StreamPhase.OVER and not stream.lingering:
            self.ports.release(stream.claim)


KEEP_ALIVE_LIMITS_S: Final = (1, 32767)
KEEP_ALIVE_DEFAULT: Final = 7200 * SECOND
SMALL_SEND_BUFFER: Final = 2 * 4608  # Linux doubles the value of SO_SNDBUF and SO_RCVBUF
SMALL_RECEIVE_BUFFER: Final = 2 * 2304
# The answer to a second connect on the same socket.
SECOND_CONNECT_ERRORS: Final = {
    StreamPhase.SYN_SENT: "EALREADY",
    StreamPhase.OPEN: "EISCONN",
    StreamPhase.OVER: "ECONNABORTED",
}


class SimSocket:
    """One socket. `changed` is called whenever its readiness may have changed."""

    __slots__ = ("_wire", "changed", "claim", "listener", "owner", "polled", "stream", "tuning")

    def __init__(self, wire: SimHost, owner: str, stream: SimStream | None = None) -> None:
        self._wire, self.owner, self.stream = wire, owner, stream
        self.claim = PortClaim() if stream is None else stream.claim
        self.tuning = Tuning() if stream is None else stream.tuning
        self.listener: SimListener | None = None
        self.polled = False
        self.changed: Callable[[], None] = ignore_change

    def set_watcher(self, changed: Callable[[], None]) -> None:
        self.changed = changed
        if self.stream is not None:
            self.stream.changed = changed

    @property
    def is_readable(self) -> bool:
        if self.stream is not None:
            return self.stream.is_readable
        return self.listener is None or bool(self.listener.queue)  # neither: a fresh socket shows HUP

    @property
    def is_gone(self) -> bool:
        """Return whether poll would see FIN, HUP or an error."""
        return self.stream.is_gone if self.stream is not None else self.listener is None

    @property
    def local_end(self) -> Endpoint | None:
        return self.stream.local if self.stream is not None else self.claim.end

    def __str__(self) -> str:
        """Return the owner, the state and the ends, for a list of sockets that were never closed."""
        if self.stream is not None:
            return f"{self.owner} {self.stream.phase.value} {self.stream.local} {self.stream.remote}"
        state = "fresh" if self.listener is None else "listening"
        return f"{self.owner} {state} {self.claim.end or ''}".rstrip()

    def set_options(self, options: SocketOptions) -> tuple[str, ...]:
        low, high = KEEP_ALIVE_LIMITS_S
        is_valid = low <= options.keep_alive_s <= high
        self.tuning.keep_alive = options.keep_alive_s * SECOND if is_valid else KEEP_ALIVE_DEFAULT
        self.tuning.user_timeout = options.user_timeout_ms * MS
        self.tuning.longest_wait = RTO_MAX
        if options.small_buffers:
            self.tuning.send_room, self.tuning.receive_room = SMALL_SEND_BUFFER, SMALL_RECEIVE_BUFFER
        if self.stream is not None:
            self.stream.apply_options()
        return () if is_valid else ("TCP_KEEPIDLE", "TCP_KEEPINTVL")

    def bind(self, end: Endpoint) -> str:
        return self._bind_error(end) or self._wire.ports.bind(self.claim, end)

    def _bind_error(self, end: Endpoint) -> str:
        if not is_valid_end(end) or self.claim.port:
            return "EINVAL"
        # Linux binds to broadcast and multicast addresses without complaint (8081).
        known = self._wire.owns_address(end.address) or self._wire.is_broadcast(end.address)
        if not (known or end.address == ANY_ADDRESS or is_group(end.address)):
            return "EADDRNOTAVAIL"
        return ""

    def listen(self, backlog: int) -> str:
        if self.stream is not None:
            return "EINVAL"
        if self.listener is not None:
            self.listener.backlog = backlog
            return ""
        error = self._wire.ports.mark_listening(self.claim)
        if not error:
            self.listener = SimListener(self.owner, self.claim, self.tuning, backlog, self.changed)
            self._wire.listen(self.listener)
            self.changed()
        return error

    def connect(self, end: Endpoint) -> str:
        if self.listener is not None:
            return "EISCONN"
        if self.stream is not None:
            return SECOND_CONNECT_ERRORS[self.stream.phase]
        if not is_valid_end(end) and self.owner not in self._wire.played:
            return "EINVAL"
        remote = Endpoint(LOOPBACK, end.port) if end.address == ANY_ADDRESS else end  # as Linux does
        is_broadcast = self._wire.is_broadcast(remote.address)
        error = "ENETUNREACH" if is_broadcast else self._route_error(remote.address)
        if error:
            return error
        local = self._source_address(remote.address)
        if not self._wire.ports.claim_free_port(self.claim, local):
            return "EADDRNOTAVAIL"
        return self._begin_connect(Endpoint(local, self.claim.port), remote)

    def _begin_connect(self, local: Endpoint, remote: Endpoint) -> str:
        stream = SimStream(self._wire, self.owner, self.claim, local, remote, self.tuning)
        if self._wire.has_connection(stream):
            return "EADDRNOTAVAIL"
        self.stream = stream
        self.set_watcher(self.changed)
        self._wire.connect(stream)
        self.changed()
        return ""

    def _route_error(self, remote: str) -> str:
        """Return the errno name if the connect call itself refuses the target (80A0), otherwise ""."""
        if is_group(remote):
            return "ENETUNREACH"
        if self._wire.owns_address(remote):
            return ""
        if is_loopback(self.claim.address):
            return "EINVAL"
        return "" if self._wire.addresses else "ENETUNREACH"

    def _source_address(self, remote: str) -> str:
        if self.claim.address != ANY_ADDRESS:
            return self.claim.address
        if is_loopback(remote):
            return LOOPBACK
        return remote if self._wire.owns_address(remote) else self._wire.addresses[0]

    def probe_shutdown(self) -> str:
        return "ENOTCONN" if self.stream is None or self.stream.phase is StreamPhase.OVER else ""

    def shutdown(self, both: bool) -> str:
        """Send FIN on a connection. A listener stops listening if `both` directions are shut."""
        if self.stream is not None:
            return self.stream.shutdown(both)
        if self.listener is None:
            return "ENOTCONN"
        if both:
            self._stop_listening()
            self.changed()
        return ""

    def free(self, abort: bool) -> None:
        """Free the connection, the listener and the port of this socket."""
        self._stop_listening()
        if self.stream is None:
            self._wire.ports.release(self.claim)
            return
        if abort:
            self.stream.abort()
        else:
            self.stream.close()
        self._wire.release_port(self.stream)

    def _stop_listening(self) -> None:
        if self.listener is not None:
            self._wire.stop_listening(self.listener)
            self.claim.listening = False
            self.listener = None


def is_valid_end(end: Endpoint) -> bool:
    return parse_octets(end.address) is not None and 0 <= end.port < 65536
