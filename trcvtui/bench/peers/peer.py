"""A partner of the PLC, over TCP or UDP: its commands, its steps between scans, and its routine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from msgspec.structs import replace

from trcvtui.bench.peers.queues import PeerQueues, ReplyRules
from trcvtui.bench.peers.transports import DatagramTransport, StreamTransport
from trcvtui.commands.peer import PeerRoutine
from trcvtui.commands.words import PeerPlaySequence, PeerSend
from trcvtui.net.connection.config import ConnectionPolicy
from trcvtui.net.kernel import Kernel, SocketOptions
from trcvtui.net.results import Endpoint
from trcvtui.plc.ledger import Event
from trcvtui.project.project import PeerDecl
from trcvtui.snapshots.bench import PeerSnapshot

PEER_OPTIONS: Final = SocketOptions(nodelay=True)
DEFAULT_POLICY: Final = ConnectionPolicy()
MOST_SHOWN_BYTES: Final = 4096  # received bytes in a snapshot


class Peer:
    """One peer, with its queues and its transport. Each command returns "" or what is wrong.

    `policy` is the policy of the PLC's CONNECTs. The policy sets buffer sizes and allows broadcasts or not.
    """

    def __init__(
        self,
        decl: PeerDecl,
        kernel: Kernel,
        resolve: Callable[[str], Endpoint | None],
        journal: Callable[[Event], None],
        policy: ConnectionPolicy = DEFAULT_POLICY,
    ) -> None:
        self.decl = decl
        self.stalled = False
        self.queues = PeerQueues(decl.name, journal)
        options = replace(PEER_OPTIONS, small_buffers=policy.small_buffers, session=decl.session)
        transport = DatagramTransport if decl.udp else StreamTransport
        self.transport: DatagramTransport | StreamTransport = transport(
            decl, kernel, resolve, self.queues, options
        )
        self.transport.broadcasts = policy.broadcasts
        self.due_at = self.queues.outbox.next_due
        # Methods of the transport alone.
        self.listen = self.transport.listen
        self.connect = self.transport.connect
        self.close = self.transport.close
        self.rst = self.transport.rst
        self.shutdown = self.transport.shutdown
        self.is_in = self.transport.is_in_state
        self.end = self.transport.free_sockets

    # -- state ---------------------------------------------------------------------------------------

    @property
    def state(self) -> str:
        """Return closed, listening, connecting, connected, reset or refused."""
        return self.transport.state

    @property
    def can_send(self) -> bool:
        return self.transport.can_send

    @property
    def replies(self) -> ReplyRules:
        return self.queues.replies

    @property
    def unsent(self) -> int:
        return self.queues.outbox.unsent

    def has_received(self, payload: bytes) -> bool:
        """Return whether `payload` is all that came on this connection, or all since the last match."""
        return self.queues.inbox.match_exactly(payload)

    def snapshot(self) -> PeerSnapshot:
        return PeerSnapshot(
            name=self.decl.name,
            active=self.decl.active and not self.decl.udp,
            state=self.state,
            local=str(self.transport.local or ""),
            remote=str(self.transport.remote or ""),
            stalled=self.stalled,
            messages_sent=self.queues.messages,
            bytes_sent=self.queues.bytes_sent,
            bytes_received=self.queues.inbox.total,
            pending=self.unsent,
            last_received=self.queues.inbox.last_bytes[-MOST_SHOWN_BYTES:],
            received_here=self.queues.inbox.count,
            udp=self.decl.udp,
            replies=self.replies.snapshot(),
            last_sent=tuple(self.queues.last_sent),
        )

    # -- commands ------------------------------------------------------------------------------------

    def stall(self) -> str:
        """Stop reading: the TCP window closes, or the stack's UDP queue fills and drops new datagrams."""
        self.stalled = True
        self.queues.note("stopped reading")
        return ""

    def resume(self) -> str:
        self.stalled = False
        self.queues.note("reads again")
        return ""

    def send(self, send: PeerSend, now: int, number: int = 0) -> str:
        """Send as much of a message as the stack takes now; `step` sends the rest.

        `number` is the number of the first message, for messages that contain their number.
        """
        wrong = self.transport.obstacle(send)
        if wrong:
            return wrong
        self.queues.outbox.put(send, now, number)
        return self.transport.send_due(now)

    def play(self, sequence: PeerPlaySequence, now: int) -> str:
        """Send the messages of a sequence one after the other, each after its pause."""
        wrong = self.transport.obstacle()
        if wrong:
            return wrong
        for pause_ns, send in sequence.steps:
            self.queues.outbox.put(send, now, pause_ns=pause_ns)
        return self.transport.send_due(now)

    def step(self, now: int) -> None:
        """Let the transport read, accept and send between two scans. `now` is in ns of the run."""
        self.transport.step(now, self.stalled)


# -- connect again after a pause, send messages in turn -----------------------------------------------------
#
# Rule: messages are planned from the first one on, so that late scans do not add up to a drift; a message
# whose time has passed is not sent later.


def next_due(planned: int, every_ns: int, now: int) -> int:
    """Return the planned time plus one period, or, if that has passed, one period from now."""
    due = planned + every_ns
    return due if due > now else now + every_ns


class AutomaticPeer:
    """A peer with its routine. `AutomaticPeer.step` is called before `Peer.step`."""

    def __init__(self, peer: Peer, routine: PeerRoutine) -> None:
        self._peer = peer
        self._routine = routine
        self._turn = 0
        self._next_word = 0
        self._next_attempt = 0

    def due_at(self, now: int) -> int | None:
        """Return when the peer acts next; None: only an event makes the peer act."""
        peer, routine = self._peer, self._routine
        if peer.can_send:
            return self._next_word if routine.says and not peer.unsent else None
        return self._next_attempt if routine.reconnect_ns and peer.state != "connecting" else None

    def step(self, now: int) -> None:
        if self._peer.can_send:
            self._next_attempt = now + self._routine.reconnect_ns
            self._send_if_due(now)
            return
        if now > self._next_word:
            self._next_word = 0  # missed without a connection: the next connection begins a new plan
        if self._routine.reconnect_ns and self._peer.state != "connecting":
            self._connect(now)

    def _connect(self, now: int) -> None:
        if now >= self._next_attempt:
            self._next_attempt = now + self._routine.reconnect_ns
            self._peer.connect(now)

    def _send_if_due(self, now: int) -> None:
        says = self._routine.says
        if says and now >= self._next_word and not self._peer.unsent:
            self._next_word = next_due(self._next_word or now, self._routine.every_ns, now)
            self._peer.send(says[self._turn % len(says)], now, self._turn)
            self._turn += 1
