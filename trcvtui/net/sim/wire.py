"""What lies between the ends of the simulated network: latency, cut links, and who answers a SYN."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from trcvtui.net.connection.ipv4 import is_loopback
from trcvtui.net.kernel import Endpoint
from trcvtui.net.sim.halves import RESET, Flag, Segment
from trcvtui.net.sim.ports import ANY, Claim, PortTable
from trcvtui.net.sim.stream import Phase, Stream, Tuning
from trcvtui.net.sim.timers import MS, SECOND, Agenda, Ticket

NO_HOST_AFTER: Final = 3070 * MS  # ARP unanswered (2.3)
TIME_WAIT: Final = 60 * SECOND


class Listener:
    """A listening socket: finished handshakes wait in its queue."""

    __slots__ = ("backlog", "changed", "claim", "owner", "queue", "tuning")

    def __init__(
        self, owner: str, claim: Claim, tuning: Tuning, backlog: int, changed: Callable[[], None]
    ) -> None:
        self.owner = owner
        self.claim = claim
        self.tuning = tuning
        self.backlog = backlog
        self.changed = changed
        self.queue: deque[Stream] = deque()


class SimWire:
    """The one machine that all handles share: loopback and its own addresses, nobody else."""

    def __init__(self, addresses: tuple[str, ...], latency: int) -> None:
        self.addresses = addresses
        self.ports = PortTable()
        self.agenda = Agenda()
        self._latency = latency
        self._down: dict[str, None] = {}
        self._listeners: dict[Endpoint, Listener] = {}
        self._streams: dict[tuple[Endpoint, Endpoint], Stream] = {}

    # -- time ----------------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        """Return the virtual time in ns."""
        return self.agenda.now

    def at(self, due: int, act: Callable[[], None]) -> Ticket:
        """Do act at the time due."""
        return self.agenda.at(due, act)

    def cancel(self, ticket: Ticket | None) -> None:
        """Take a ticket back."""
        self.agenda.cancel(ticket)

    # -- links ---------------------------------------------------------------------------------------

    def set_link(self, owner: str, up: bool) -> None:
        """Let all traffic of the owner's handles go silent, or return."""
        if up:
            self._down.pop(owner, None)
        else:
            self._down[owner] = None

    def is_up(self, one: str, other: str) -> bool:
        """Return whether the links of both owners are up."""
        return not self._down or not (one in self._down or other in self._down)

    def owns(self, address: str) -> bool:
        """Return whether the address is one of this machine."""
        return is_loopback(address) or address in self.addresses

    # -- segments ------------------------------------------------------------------------------------

    def carry(self, source: Stream, segment: Segment) -> None:
        """Carry a segment to the partner, unless a link is down when it leaves or arrives."""
        partner = source.partner
        if partner is None or (self._down and not self.is_up(source.owner, partner.owner)):
            return
        if self._latency:
            self.at(self.now + self._latency, lambda: self._deliver(source, partner, segment))
        else:
            self._deliver(source, partner, segment)

    def _deliver(self, source: Stream, partner: Stream, segment: Segment) -> None:
        if self._down and not self.is_up(source.owner, partner.owner):
            return
        if partner.phase is not Phase.OVER:
            partner.arrive(segment)
        elif partner.lingering and not segment.data:
            if segment.flags:
                partner.acknowledge()
        elif not segment.flags & Flag.RST:
            self.carry(partner, RESET)

    # -- the handshake -------------------------------------------------------------------------------

    def listen(self, listener: Listener) -> None:
        """Let SYNs reach the listener."""
        assert listener.claim.end is not None
        self._listeners[listener.claim.end] = listener

    def stop_listening(self, listener: Listener) -> None:
        """Refuse newcomers, and reset those that are queued."""
        assert listener.claim.end is not None
        self._listeners.pop(listener.claim.end, None)
        for client in listener.queue:
            client.abort()
        listener.queue.clear()

    def is_taken(self, client: Stream) -> bool:
        """Return whether a connection with the same two ends stands; TIME_WAIT is none (timestamps)."""
        old = self._streams.get((client.local, client.remote))
        return old is not None and not old.lingering

    def connect(self, client: Stream) -> None:
        """Begin a connection whose ends are free."""
        ends = (client.local, client.remote)
        if ends in self._streams:
            self._leave(self._streams[ends])
        self._streams[ends] = client
        if not self.owns(client.remote.address):
            self.at(self.now + NO_HOST_AFTER, client.no_host)
        client.connect()

    def syn(self, client: Stream) -> None:
        """Carry a SYN to whoever has the address."""
        if client.owner in self._down or not self.owns(client.remote.address):
            return
        if client.local == client.remote:
            client.partner = client
            client.open(client.answer_syn().edge)
        elif self._latency:
            self.at(self.now + self._latency, lambda: self._syn_arrives(client))
        else:
            self._syn_arrives(client)

    def _syn_arrives(self, client: Stream) -> None:
        if client.phase is not Phase.SYN_SENT:
            return
        listener = self._listener_at(client.remote)
        if listener is None:
            self._refuse(client)
        elif self.is_up(client.owner, listener.owner):
            server = client.partner or self._admit(listener, client)
            if server is not None:
                self.carry(server, server.answer_syn())

    def _refuse(self, client: Stream) -> None:
        """Answer a SYN with RST in the name of the machine."""
        if self._latency:
            self.at(self.now + self._latency, lambda: self._refusal_arrives(client))
        else:
            client.arrive(RESET)

    def _refusal_arrives(self, client: Stream) -> None:
        if client.owner not in self._down and client.phase is Phase.SYN_SENT:
            client.arrive(RESET)

    def _listener_at(self, end: Endpoint) -> Listener | None:
        return self._listeners.get(end) or self._listeners.get(Endpoint(ANY, end.port))

    def _admit(self, listener: Listener, client: Stream) -> Stream | None:
        """Return the server side of a new connection, None when the queue holds backlog + 1 already."""
        ends = (client.remote, client.local)
        old = self._streams.get(ends)
        if old is not None:  # the partner's machine has forgotten it, else it could not begin anew
            self._leave(old) if old.lingering else old.reset()
        if len(listener.queue) > listener.backlog:
            return None
        claim = listener.claim.child(client.remote.address)
        server = Stream(self, listener.owner, claim, *ends, replace(listener.tuning))
        self.ports.add(claim)
        self._streams[ends] = server
        server.partner, client.partner = client, server
        server.open(client.answer_syn().edge)
        listener.queue.append(server)
        listener.changed()
        return server

    # -- the end -------------------------------------------------------------------------------------

    def over(self, stream: Stream, linger: bool) -> None:
        """Take a connection that has ended out of the tables, at once or after TIME_WAIT."""
        stream.lingering = linger
        if linger:
            self.at(self.now + TIME_WAIT, lambda: self._leave(stream))
        else:
            self._leave(stream)

    def _leave(self, stream: Stream) -> None:
        stream.lingering = False
        ends = (stream.local, stream.remote)
        if self._streams.get(ends) is stream:
            del self._streams[ends]
        if not (stream.claim.fixed and stream.held):
            self.ports.release(stream.claim)

    def let_go(self, stream: Stream) -> None:
        """Free the port of a connection that had ended before its handle was freed."""
        if stream.phase is Phase.OVER and not stream.lingering:
            self.ports.release(stream.claim)
