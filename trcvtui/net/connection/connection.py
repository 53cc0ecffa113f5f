"""One connection: what TCON, TRCV, TDISCON and T_RESET do, at most one set-up step a scan.

Rule 1: `step` takes at most one step a scan, for the first block that calls. Other blocks get its result.
Rule 2: a loss is found once and stored per incarnation. Every block that asks gets the loss (5.3 e).
Rule 3: a FIN never overtakes bytes. While a block receives, or would receive (`readers`), the incarnation
ends after the last byte. A sender that finds the loss first gets it at once. The loss is then pending until
the receiver has read all bytes.
Rule 4: a client that comes after the partner's FIN or RST is the next partner: it waits and is not reset.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from enum import Enum, StrEnum, auto
from functools import partial
from typing import ClassVar, Final

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.net.connection.config import ConnectConfig, ConnectionPolicy
from trcvtui.net.connection.resources import Claim, DirectionClaims, Resources
from trcvtui.net.connection.set_up import SetUp, SetUpStage, StepFault
from trcvtui.net.events import (
    BytesDropped,
    BytesReceived,
    BytesSent,
    ConnectionChanged,
    ConnectionEvent,
    EventKind,
)
from trcvtui.net.kernel import DRAIN_BYTES, Handle, Kernel, KernelLoss, NewClient
from trcvtui.net.layer import TlsError
from trcvtui.net.received_ring import sent_ring_name
from trcvtui.net.results import HELD_BACK, OWN_END, WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock


class LossKind(Enum):
    CLOSED_BY_PARTNER = auto()
    RESET_BY_PARTNER = auto()
    REFUSED = auto()  # by the partner, after our side of the TLS handshake was complete
    LINK_DEAD = auto()
    FAILED = auto()
    OURS = auto()


# Why bytes never reached DATA.
LOSS_REASONS: Final = {
    LossKind.CLOSED_BY_PARTNER: "FIN",
    LossKind.RESET_BY_PARTNER: "RST",
    LossKind.REFUSED: "the partner refused us at the end of the handshake",
    LossKind.LINK_DEAD: "the link is dead",
    LossKind.FAILED: "the connection failed",
    LossKind.OURS: "closed on our side",
}
# 3.2: on an established connection each of these means that the link is dead.
LINK_DEAD_ERRORS: Final = frozenset({"ETIMEDOUT", "EHOSTUNREACH", "ENETUNREACH", "EHOSTDOWN", "ENETDOWN"})
# The partner has ended a session: with an alert, or with a FIN that lacks its close_notify.
PARTNER_END_ERRORS: Final = frozenset({TlsError.REFUSED, TlsError.TRUNCATED})
LOSSES_KEPT: Final = 8  # of the newest incarnations: a block asks at its next call


class ConnectionLoss(Struct, frozen=True):
    """How one incarnation ended. `release_fault` says why its socket could not leave the poll set."""

    kind: LossKind
    peer: str
    fault: Fault | None = None
    release_fault: Fault | None = None
    is_played: bool = False  # closed by the PLC of a capture; the capture does not show which block did

    @property
    def reason(self) -> str:
        return LOSS_REASONS[self.kind]


def classify_loss(fault: Fault | None, peer: str, may_refuse: bool = False) -> ConnectionLoss:
    """Return the loss that follows from the Fault of a call. If `fault` is None, the partner sent FIN.

    With `may_refuse`, a TLS alert is a refusal: we are the active end and have received no data.
    """
    if fault is not None and fault.error == OWN_END:
        return ConnectionLoss(LossKind.OURS, peer, is_played=True)
    if may_refuse and fault is not None and fault.error == TlsError.REFUSED:
        kind = LossKind.REFUSED
    elif fault is None or fault.error in PARTNER_END_ERRORS:
        kind = LossKind.CLOSED_BY_PARTNER
    elif fault.error == "ECONNRESET":
        kind = LossKind.RESET_BY_PARTNER
    elif fault.error in LINK_DEAD_ERRORS:
        kind = LossKind.LINK_DEAD
    else:
        kind = LossKind.FAILED
    return ConnectionLoss(kind, peer, fault)


class State(StrEnum):
    CLOSED = "closed"
    QUEUED = "queued"
    CREATED = "created"
    ESTABLISHING = "establishing"
    CONNECTED = "connected"


# Rule 1: bytes that are not acknowledged for 3 keep-alive intervals end the connection. An idle connection is
# left to keep-alive, which takes as long.
# Rule 2: a partner that lives but does not read has a zero window: that may last without limit.
# Rule 3: if a zero window is probed often, a last ACK older than the limit means a dead link.


class SentState(Enum):
    SETTLED = auto()  # the partner's stack has acknowledged all, or this system does not say
    UNDER_WAY = auto()
    DEAD = auto()


class SocketUse(Enum):
    LISTENS = auto()
    CONNECTS = auto()
    CONNECTED = auto()
    DATAGRAMS = auto()


class DeadLinkWatch:
    """Watches the sent bytes of one connection for a dead link. Call `begin` with each TCP connection."""

    def __init__(self, config: ConnectConfig, kernel: Kernel, is_on: bool) -> None:
        self._limit_ms = config.dead_after_ms
        self._kernel = kernel
        self._is_on = is_on
        self._set_ms = 0

    def begin(self, handle: Handle) -> None:
        """Limit how long bytes may stay unacknowledged."""
        self._set_ms = 0  # set here and not before connect: there it would shorten the attempt
        self._set_limit(handle, closed_window=False)

    def check(self, handle: Handle) -> SentState:
        """Return the state of the sent bytes; call it in each scan while sent bytes are under way."""
        path = self._kernel.path(handle)
        if path is None or not (path.unacked or path.unsent):
            self._set_limit(handle, closed_window=False)
            return SentState.SETTLED
        closed_window = path.unacked == 0  # nothing in flight, but bytes to send
        self._set_limit(handle, closed_window)  # Rule 2: TCP_USER_TIMEOUT would count there, too
        answers = not path.probes_often or path.last_ack_ms < self._limit_ms  # Rule 3
        return SentState.DEAD if self._is_on and closed_window and not answers else SentState.UNDER_WAY

    def _set_limit(self, handle: Handle, closed_window: bool) -> None:
        limit = self._limit_ms if self._is_on and not closed_window else 0
        if limit != self._set_ms:
            self._set_ms = limit
            self._kernel.set_user_timeout(handle, limit)


class Connection:
    """One CONNECT at run time. Blocks use this class, never the kernel."""

    SET_UP: ClassVar[type[SetUp]] = SetUp

    def __init__(
        self,
        config: ConnectConfig,
        kernel: Kernel,
        resources: Resources,
        policy: ConnectionPolicy,
        resolve: Callable[[str], int | None],
        write: Callable[[ConnectionEvent], None],
    ) -> None:
        self.config = config
        self.received = resources.received.open_ring(config.name, config.history)
        self._sent = resources.received.open_ring(sent_ring_name(config.name), config.history)
        self.state = State.CLOSED
        self.incarnation, self.attempts = self.received.incarnations, 0
        self.peer: Endpoint | None = None
        self.receiving = DirectionClaims()
        self.sending = DirectionClaims()
        self.keeping = DirectionClaims()  # blocks that build it, and hold it
        self.readers: dict[str, Callable[[bool], bool]] = {}  # instance -> would it read? True: in its turn
        self.bytes_received = self.recvs = self.bytes_sent = self.sends = 0
        self.pending_loss: ConnectionLoss | None = None  # known, but a block still reads the bytes before it
        self.since_scan = 0  # the scan in which the state last changed to connected
        self.retry_at: int | None = None
        self.link_is_dead = False  # from the loss until the partner's machine answers
        self.handle: Handle | None = None
        ids, note, work = resources.connection_ids, self._note, resources.work
        self._new_set_up = partial(self.SET_UP, config, kernel, policy, resolve, ids, note, work)
        self.set_up = self._new_set_up()
        self._kernel, self._resources, self._policy, self._write = kernel, resources, policy, write
        self._name = config.name
        self._local: Endpoint | None = None
        self._early: list[tuple[State, StepFault | None]] = []  # steps of `open`, shown one a scan
        self._stepped_in = -1
        self._step_fault: StepFault | None = None
        self._losses: dict[int, ConnectionLoss] = {}  # of the newest incarnations
        self._pauses = False  # the next step begins a pause
        self._dead_link = DeadLinkWatch(config, kernel, policy.user_timeout)

    @property
    def is_up(self) -> bool:
        """Return whether this CONNECT is connected, and no loss is known."""
        return self.state is State.CONNECTED and self.pending_loss is None

    @property
    def sockets(self) -> Iterator[tuple[Handle, SocketUse]]:
        of = SocketUse.CONNECTED, SocketUse.CONNECTS if self.config.active else SocketUse.LISTENS
        found = zip(
            (self.handle, self.set_up.attempt, self.set_up.listener), (*of, SocketUse.LISTENS), strict=True
        )
        for handle, use in found:
            if handle is not None:
                yield handle, SocketUse.DATAGRAMS if self.config.is_datagram else use

    def is_up_for(self, claim: Claim) -> bool:
        """Return whether the connection is up for a claim: a reader has it until the last byte (Rule 3)."""
        return self.is_up or (self.state is State.CONNECTED and self._is_reader(claim))

    def _is_reader(self, claim: Claim | None) -> bool:
        if claim is None:
            return False
        would = self.readers.get(claim.instance)
        return self.receiving.holds(claim) or (would is not None and would(True))

    def _has_other_readers(self, asking: Claim | None) -> bool:
        if self.receiving.is_used_by_others(asking):
            return True
        own = "" if asking is None else asking.instance
        waits = not self.receiving.holds_refused(asking)  # False: the refused `asking` bars other readers
        return any(name != own and would(waits) for name, would in self.readers.items())

    @property
    def partner(self) -> str:
        return str(self.peer or "")

    @property
    def local(self) -> Endpoint | None:
        """Return the local end of the connection, or else of the listener."""
        return self._local or self.set_up.local

    @property
    def direction_claims(self) -> tuple[DirectionClaims, ...]:
        return self.receiving, self.sending, self.keeping

    # -- set-up: TCON ------------------------------------------------------------------------

    def queue_set_up(self, now: int, has_addr: bool = True) -> Fault | None:
        """Queue the set-up job, which takes one step a scan. If `has_addr`, the UDP block has an ADDR."""
        fault = self._resources.queue.put(self.config.name)
        if fault is not None:
            return fault
        at_once = self._policy.listens_at_once and not (self.config.active or self.config.is_datagram)
        # The faults of a listener that is made at once show in the same steps as those of any other.
        self._early = self._make_early_steps(now) if at_once else []
        self.state = State.QUEUED
        return None

    def _make_early_steps(self, now: int) -> list[tuple[State, StepFault | None]]:
        failed = self._create(now)
        if failed is not None:
            return [(State.ESTABLISHING, failed)]
        return [(State.CREATED, None), (State.ESTABLISHING, self._bind_and_start(now))]

    def _note_early_faults(self) -> None:
        """Note the faults of early steps that no block has got, because the set-up ended first."""
        for _, failed in self._early:
            if failed is not None:
                self._note(EventKind.ATTEMPT_FAILED, self.set_up.remote, failed.detail, failed.fault)
        self._early = []

    def step(self, scan: int, now: int) -> StepFault | None:
        """Take one step of the set-up, once a scan; return what failed in this scan's step."""
        if self._stepped_in != scan:  # Rule 1
            self._stepped_in = scan
            self._step_fault = failed = self._take_step(now)
            if failed is not None:
                what = (
                    EventKind.ACCEPT_FAILED if failed.stage is SetUpStage.ACCEPT else EventKind.ATTEMPT_FAILED
                )
                self._note(what, self.set_up.remote, failed.detail, failed.fault)
        return self._step_fault

    def _take_step(self, now: int) -> StepFault | None:
        match self.state:
            case State.QUEUED | State.CREATED if self._early:  # done by `open`, shown now
                self.state, failed = self._early.pop(0)
                return failed
            case State.QUEUED:
                return self._create(now)
            case State.CREATED:
                return self._bind_and_start(now)
            case State.CONNECTED:
                self.end_if_loss_pending()
                return None
            case _ if self.set_up.listener is not None:
                return self._adopt(self.set_up.accept_partner(), now)
            case _ if self.set_up.attempt is not None:
                return self._adopt(self.set_up.poll_attempt(now), now)
            case _ if self._pauses:  # else a partner that ends at once would be called in each scan
                self._pauses, self.retry_at = False, now + self._policy.retry_ns
            case _ if self.retry_at is None or now >= self.retry_at:
                return self._create(now) or self._bind_and_start(now)
        return None

    def _create(self, now: int) -> StepFault | None:
        self.retry_at = None
        self.attempts += 1
        self.state = State.CREATED
        no_room = self._resources.budget.acquire(self.config.name)
        full = StepFault(SetUpStage.SOCKET, no_room) if no_room else None
        failed = self.set_up.check_and_claim() or full or self.set_up.create_socket()  # a flaw shows first
        return self._fail_attempt(failed, now) if failed else None

    def _bind_and_start(self, now: int) -> StepFault | None:
        self.state = State.ESTABLISHING
        failed = self.set_up.bind_and_start(now)
        return self._fail_attempt(failed, now) if failed else None

    def _adopt(self, got: NewClient | StepFault | None, now: int) -> StepFault | None:
        if got is None:
            return None
        if isinstance(got, StepFault):
            # A failed accept leaves the listener and the waiting client where they are.
            return got if got.stage is SetUpStage.ACCEPT else self._fail_attempt(got, now)
        if not self.config.active:
            refused = self.set_up.take_over(got)
            if refused is not None:
                return refused
        self._become_connected(got)
        self.since_scan = self._stepped_in
        return None

    def _become_connected(self, got: NewClient) -> None:
        self._begin_incarnation(got.handle, got.peer)
        self._dead_link.begin(got.handle)
        self._note(EventKind.CONNECTED)

    def _begin_incarnation(self, handle: Handle, peer: Endpoint | None) -> None:
        self.handle, self.peer = handle, peer
        self.state = State.CONNECTED
        self.link_is_dead = False
        self.received.incarnations = self.incarnation = self.incarnation + 1
        self.bytes_received = self.recvs = self.bytes_sent = self.sends = 0
        self._local = self._kernel.local_end(handle)

    def _fail_attempt(self, failed: StepFault, now: int) -> StepFault:
        self.set_up.free_attempt()
        self._resources.budget.release(self.config.name)
        self.state = State.ESTABLISHING
        if failed.stage is SetUpStage.CONNECT:  # a refusal is an answer: then the machine is there again
            self.link_is_dead &= failed.fault.error in LINK_DEAD_ERRORS
        self.retry_at = now + self._policy.retry_ns
        return failed

    # -- a second client ---------------------------------------------------------------------------

    def serve_listener(self) -> bool:
        """Handle second clients, bounded work a scan; return whether blocks must look at this CONNECT."""
        if self.end_if_loss_pending():
            return True
        listener = self.set_up.listener
        if listener is None or self.state is not State.CONNECTED or not self._kernel.readable(listener):
            return False  # without a partner `step` accepts
        if self._policy.second_client == "queue":  # it waits in the stack
            return False
        before = self.incarnation
        while not self._has_ended():  # Rule 4; without work left in this scan `accept_partner` gives None
            got = self.set_up.accept_partner()
            if not isinstance(got, NewClient):
                break
            if self._has_ended():  # between the check and the accept: Rule 4
                self.set_up.keep_successor(got)
                return True
            if not self._handle_second_client(got):  # it failed: the next step accepts another that waits
                break
        else:
            return True
        return self.state is not State.CONNECTED or self.incarnation != before

    def _has_ended(self) -> bool:
        return self.pending_loss is not None or (self.handle is not None and self._kernel.renew(self.handle))

    def _handle_second_client(self, client: NewClient) -> bool:
        if self._policy.second_client == "reject":
            self.set_up.turn_away(client, EventKind.SECOND_CLIENT)
            return True
        self._note(EventKind.REPLACED, client.peer)
        self._release_lost(ConnectionLoss(LossKind.OURS, self.partner))
        if self.set_up.take_over(client) is None:
            self._become_connected(client)
        return self.state is State.CONNECTED

    # -- data: TRCV -----------------------------------------------------------------------------

    def receive(self, into: memoryview, instance: str = "") -> int | WouldBlock | ConnectionLoss:
        """Read up to len(into) bytes. After the last byte release a lost connection and return its loss."""
        assert self.handle is not None
        got = self._kernel.recv(self.handle, into)
        if got is WOULD_BLOCK and self.pending_loss is not None:
            self._kernel.renew(self.handle)  # the loss came after the poll; bytes may have come before it
            got = self._kernel.recv(self.handle, into)
        if got is WOULD_BLOCK:
            return WOULD_BLOCK if self.pending_loss is None else self._end_after_last_byte(self.pending_loss)
        if isinstance(got, int):
            if got == 0:  # FIN
                return self._end_after_last_byte(self.pending_loss or self._classify_loss(None))
            self._note_received(into[:got], instance)
            return got
        if isinstance(got, Fault) and got.error != "EAGAIN":
            return self._end_after_last_byte(self.pending_loss or self._classify_loss(got))
        return WOULD_BLOCK  # HELD_BACK, or a planned EAGAIN

    def _end_after_last_byte(self, loss: ConnectionLoss) -> WouldBlock | ConnectionLoss:
        """Release the connection, but not while a block has a whole frame that it has not shown yet."""
        if not self.receiving.has_frame():
            return self._release_lost(loss)
        self.pending_loss = loss
        return WOULD_BLOCK

    def receive_message(self, into: memoryview, instance: str) -> Datagram | WouldBlock | ConnectionLoss:
        """Take one message; bytes without room are lost. A loss is returned after the last message."""
        assert self.handle is not None
        got = self._kernel.recv_from(self.handle, into)
        if got is WOULD_BLOCK and self.pending_loss is not None:
            self._kernel.renew(self.handle)
            got = self._kernel.recv_from(self.handle, into)
        if isinstance(got, Datagram):
            self._note_received(into[: got.size], instance)
            return got
        if got is HELD_BACK:  # there may be a message before the loss
            return WOULD_BLOCK
        seen = KernelLoss(got, 0) if isinstance(got, Fault) else self._kernel.loss(self.handle)
        loss = self.pending_loss or (self._classify_loss(seen.fault) if seen else None)
        return WOULD_BLOCK if loss is None else self._end_after_last_byte(loss)

    def _note_received(self, content: memoryview, instance: str, cut: int = 0) -> None:
        """Note the bytes of one receive call. `cut` bytes of a datagram had no room."""
        self.recvs += 1
        offset, size = self.bytes_received, len(content) + cut
        self.bytes_received = offset + size
        at = self.received.append(content)
        if cut:
            self.received.add_unknown(cut)
        self._write(BytesReceived(self._name, self.incarnation, self.recvs, offset, size, instance, at, cut))

    def check_loss(self, asking: Claim | None = None) -> ConnectionLoss | None:
        """Check for a loss without consuming data; release the connection if there is one."""
        if self.handle is None or self._has_other_readers(asking):  # Rule 3: the loss is left to the reader
            return None
        return self._look_for_loss(self.handle, asking)

    def _look_for_loss(self, handle: Handle, asking: Claim | None = None) -> ConnectionLoss | None:
        if self.pending_loss is not None:
            return self._apply_loss(self.pending_loss, asking)
        seen = self._kernel.loss(handle)
        return None if seen is None else self._apply_loss(self._classify_loss(seen.fault), asking)

    def _apply_loss(self, loss: ConnectionLoss, asking: Claim | None = None) -> ConnectionLoss:
        if not self._has_other_readers(asking):
            return self._release_lost(loss)
        self.pending_loss = loss  # Rule 3
        return loss

    def end_if_loss_pending(self) -> bool:
        """Release a lost connection that no block reads any more; return whether it was released."""
        if self.pending_loss is None or self._has_other_readers(None):
            return False
        self._release_lost(self.pending_loss)
        return True

    def find_loss(self, incarnation: int, asking: Claim | None = None) -> ConnectionLoss | None:
        """Return how an incarnation ended, or None while it is up. Readers get None until the last byte."""
        if self.state is State.CONNECTED and self.incarnation == incarnation:
            if self.pending_loss is None or self._is_reader(asking):
                return None
            return self._apply_loss(self.pending_loss)
        # Older than LOSSES_KEPT: how it ended is not known any more.
        return self._losses.get(incarnation) or ConnectionLoss(LossKind.OURS, self.partner)

    def unread(self) -> int:
        return 0 if self.handle is None else self._kernel.unread(self.handle)

    def note_dropped(self, offset: int, size: int, reason: str, incarnation: int | None = None) -> None:
        """Note bytes that never reach DATA. If `offset` is -1, the bytes were still in the stack."""
        if size:
            of = self.incarnation if incarnation is None else incarnation
            position = self.received.add_unknown(size) if offset < 0 else -1  # -1: the ring has them already
            self._write(BytesDropped(self.config.name, of, offset, size, reason, position))

    def _classify_loss(self, fault: Fault | None) -> ConnectionLoss:
        return classify_loss(fault, self.partner, self.config.active and not self.bytes_received)

    def _release_lost(self, loss: ConnectionLoss) -> ConnectionLoss:
        assert self.handle is not None
        unread = self.unread()
        self.note_dropped(-1, unread, loss.reason)
        idle = loss.kind is LossKind.REFUSED or not (unread or self.bytes_received or self.bytes_sent)
        self._pauses = idle and self.config.active and self._policy.pauses_after_idle
        loss = replace(loss, release_fault=self._kernel.poll_del(self.handle))
        self._kernel.close(self.handle)
        fin = loss.kind is LossKind.CLOSED_BY_PARTNER
        self._note(EventKind.PARTNER_CLOSED if fin else EventKind.LOST, fault=loss.fault)
        if loss.release_fault is not None:  # the block has a code for it (8087)
            self._note(EventKind.CALL_FAILED, fault=loss.release_fault)
        self._end_incarnation(loss, State.ESTABLISHING)
        return loss

    # -- data: TSEND ----------------------------------------------------------------------------

    def check_before_sending(self) -> ConnectionLoss | None:
        """Check for a loss before a send job sends."""
        assert self.handle is not None
        return self._look_for_loss(self.handle)  # after the partner's FIN the stack would still take bytes

    def send(self, data: memoryview, instance: str = "") -> int | WouldBlock | Fault | ConnectionLoss:
        """Give bytes to the local stack; return how many it took. The only Fault: a fault plan's EAGAIN."""
        assert self.handle is not None
        got = self._kernel.send(self.handle, data)
        if isinstance(got, int):
            self._resources.unsettled[self._name] = None
            self._note_sent(data[:got], instance)
            return got
        if isinstance(got, Fault):
            return got if got.error == "EAGAIN" else self._apply_loss(self._classify_loss(got))
        return WOULD_BLOCK

    def _note_sent(self, content: memoryview, instance: str) -> None:
        self.sends += 1
        offset, size = self.bytes_sent, len(content)
        self.bytes_sent = offset + size
        at = self._sent.append(content)
        self._write(BytesSent(self._name, self.incarnation, self.sends, offset, size, instance, at))

    def unacknowledged(self) -> int | None:
        """Return how many sent bytes the partner's stack has not acknowledged; None: unknown."""
        path = None if self.handle is None else self._kernel.path(self.handle)
        return None if path is None else path.unacked + path.unsent

    def check_dead_link(self) -> bool:
        """Check the bytes that are under way; return whether the link was found to be dead."""
        sent = SentState.SETTLED if self.handle is None else self._dead_link.check(self.handle)
        if sent is SentState.SETTLED:
            self._resources.unsettled.pop(self._name, None)
        if sent is not SentState.DEAD or self.pending_loss is not None:  # Rule 2: a loss is found once
            return False
        self._apply_loss(self._classify_loss(Fault("path", "ETIMEDOUT")))
        return True

    # -- close and reset: TDISCON, T_RESET ----------------------------------------------------------

    def queue_job(self) -> Fault | None:
        """Queue a disconnect or reset job; it runs in the same scan if the queue has room."""
        return self._resources.queue.put(self.config.name)

    def disconnect(self) -> Fault | None:
        """Close and free connection and listener (TDISCON), even after a Fault. Return a Fault or None.

        If shutdown fails with ENOTCONN, the partner's RST came first (80A2).
        """
        self._note_early_faults()
        fault = None
        if self.handle is not None:
            fault = self._close_orderly(self.handle)
            self._note(EventKind.DISCONNECTED, fault=fault)
            self._end_incarnation(ConnectionLoss(LossKind.OURS, self.partner), State.CLOSED)
        fault = self.set_up.free() or fault
        self._resources.budget.release(self.config.name)
        self.state, self.retry_at, self._pauses = State.CLOSED, None, False
        return fault

    def reset(self) -> Fault | None:
        """Abort the connection with RST (T_RESET). The listener stays. The next attempt starts at once."""
        assert self.handle is not None
        removed = self._kernel.poll_del(self.handle)
        # On Linux SO_LINGER and close succeed on a dead socket, too: only this probe can fail (80A3).
        probed = self._kernel.probe(self.handle)
        self.note_dropped(-1, self.unread(), "COM_RST")
        freed = self._kernel.abort(self.handle)
        fault = removed or probed or freed
        self._note(EventKind.RESET, fault=fault)
        self._end_incarnation(ConnectionLoss(LossKind.OURS, self.partner), State.ESTABLISHING)
        return fault

    def stop(self) -> None:
        """Free everything, without a result for any block (PLC STOP)."""
        if self.state is not State.CLOSED:
            self.disconnect()
            self._note(EventKind.STOPPED)
        self.keeping.end_all()
        self.set_up.forget_port()

    def abandon(self) -> None:
        """Close and forget everything, in any state that an exception can leave."""
        with suppress(Exception):  # the kernel's answers do not count: a replay has none recorded here
            self.set_up.free()
        with suppress(Exception):
            if self.handle is not None:
                self._kernel.close(self.handle)
        self.set_up = self._new_set_up()
        self._resources.budget.release(self._name)
        self._resources.unsettled.pop(self._name, None)
        self.keeping.end_all()
        self._end_incarnation(ConnectionLoss(LossKind.OURS, self.partner), State.CLOSED)
        self._pauses = False
        self._note(EventKind.STOPPED)

    def _close_orderly(self, handle: Handle) -> Fault | None:
        removed = self._kernel.poll_del(handle)
        closed = self._kernel.shutdown(handle)
        discarded = self._kernel.discard(handle, DRAIN_BYTES)  # close with unread bytes would send RST
        self.note_dropped(-1, discarded + self._kernel.unread(handle), "disconnected")
        freed = self._kernel.close(handle)
        return removed or closed or freed

    def _end_incarnation(self, loss: ConnectionLoss, state: State) -> None:
        self._losses[self.incarnation] = loss
        if len(self._losses) > LOSSES_KEPT:
            del self._losses[min(self._losses)]
        self.link_is_dead = loss.kind is LossKind.LINK_DEAD
        # retry_at None: the first attempt after a connection begins at once.
        self.handle, self.pending_loss, self.retry_at = None, None, None
        self.peer, self._local = None, None
        self.receiving.end_all()
        self.sending.end_all()
        self.state = state

    # -- notes ------------------------------------------------------------------------------------

    def _note(
        self, what: EventKind, peer: Endpoint | None = None, detail: str = "", fault: Fault | None = None
    ) -> None:
        local, other = str(self.local or ""), str(peer or self.peer or "")
        self._write(ConnectionChanged(self.config.name, self.incarnation, what, local, other, fault, detail))
