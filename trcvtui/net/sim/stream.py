"""One end of a simulated TCP connection, as a program on Linux sees it: handshake, data, end and timers.

Rule 1: change the state before you call `carry`. Without latency, the answer comes before `carry` returns.
Rule 2: an error is reported by only one call. After that error, `read` returns 0 and `write` returns EPIPE.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Final, NamedTuple, Protocol

from msgspec import Struct

from trcvtui.net.kernel import PathInfo
from trcvtui.net.results import ANY_ADDRESS, OWN_END, PEEK_DEPTH, WOULD_BLOCK, Endpoint, Unread, WouldBlock
from trcvtui.net.sim.timers import (
    LONGEST_WAIT,
    MS,
    SECOND,
    SYN_WAITS,
    KeepAliveTimer,
    RetryTimer,
    Ticket,
    TimerVerdict,
)

# Positions count bytes from 0; FIN is one number after the last byte. A window never shrinks, and a
# retransmission begins at the first unacknowledged byte.

SEGMENT_BYTES: Final = 1460


class SegmentFlag:
    """Meanings of a segment besides its data. Flags are plain numbers, for speed: all are checked often."""

    NONE = 0
    SYN_ACK = 1
    FIN = 2
    RST = 4
    PROBE = 8


class Segment(NamedTuple):
    """A TCP segment: `seq` is where its data begins, `ack` what it acknowledges, `edge` the window end."""

    seq: int
    ack: int
    edge: int
    data: bytes = b""
    flags: int = SegmentFlag.NONE


RESET_SEGMENT: Final = Segment(0, 0, 0, b"", SegmentFlag.RST)


class SendHalf:
    """Bytes that the program has written and the partner has not acknowledged."""

    __slots__ = ("_edge", "_first", "_queue", "fin", "fin_acked", "next", "room")

    def __init__(self, room: int) -> None:
        self.room = room
        self.fin = self.fin_acked = False
        self.next = 0  # the position where the next segment begins
        self._queue = bytearray()
        self._first = 0  # where the queue begins: the first unacknowledged position
        self._edge = 0  # the end of the partner's window

    @property
    def queued_bytes(self) -> int:
        """Return how many bytes the partner has not acknowledged."""
        return len(self._queue)

    @property
    def in_flight(self) -> int:
        return len(self._queue) - self.unsent

    @property
    def unsent(self) -> int:
        """Return how many bytes wait for the partner's window."""
        return max(0, self._first + len(self._queue) - self.next)

    @property
    def is_in_flight(self) -> bool:
        """Return whether data or a FIN was sent and is not acknowledged."""
        return self._first < self.next

    @property
    def is_waiting(self) -> bool:
        """Return whether any data or a FIN is unacknowledged or unsent."""
        return self._first < self.next or bool(self._queue)

    def put(self, data: memoryview) -> int:
        """Queue the bytes that have room; return how many bytes were queued."""
        taken = data[: max(0, self.room - len(self._queue))]
        self._queue += taken
        return len(taken)

    def open_window(self, edge: int) -> bool:
        """Move the end of the window; return whether the window has grown."""
        wider = edge > self._edge
        self._edge = max(self._edge, edge)  # a late segment does not shrink it
        return wider

    def acknowledge(self, ack: int) -> bool:
        """Drop the bytes before the position `ack`. Return whether `ack` acknowledges anything new."""
        taken = ack - self._first
        if taken <= 0:
            return False
        self.fin_acked = taken > len(self._queue)
        del self._queue[:taken]
        self._first = ack
        return True

    def rewind(self) -> None:
        """Send again from the first unacknowledged byte on."""
        self.next = self._first

    def take_sendable(self) -> tuple[int, bytes, int] | None:
        """Return position, data and flags of what may be sent now, and count it as sent."""
        end = self._first + len(self._queue)
        seq, limit = self.next, min(end, self._edge)
        data = b""
        if seq < limit:
            data = bytes(self._queue[seq - self._first : limit - self._first])
            self.next = limit
        if self.fin and self.next == end and not self.fin_acked:
            self.next = end + 1
            return seq, data, SegmentFlag.FIN
        return (seq, data, SegmentFlag.NONE) if data else None

    def withdraw(self, size: int) -> int:
        """Forget at most `size` of the newest bytes that wait for the window. Return their number."""
        size = min(size, self.unsent)
        del self._queue[len(self._queue) - size :]
        return size

    def clear(self) -> None:
        self._queue.clear()
        self.next = self._first


class ReceiveHalf:
    """Received bytes that the program has not read."""

    __slots__ = ("_offered", "fin", "inbox", "next", "room")

    def __init__(self, room: int) -> None:
        self.room = room
        self.fin = False
        self.inbox = bytearray()
        self.next = 0  # the position that is expected next
        self._offered = room  # the end of the window that the partner knows

    def read(self, into: memoryview, most: int) -> int:
        """Move at most `most` bytes to the program; return how many."""
        size = min(len(into), len(self.inbox), most)
        into[:size] = self.inbox[:size]
        del self.inbox[:size]
        return size

    def offer_window(self) -> int:
        """Return the position where the offered window ends now."""
        self._offered = max(self._offered, self.next + self.room - len(self.inbox))
        return self._offered

    @property
    def should_update_window(self) -> bool:
        """Return whether the window has doubled; Linux announces no smaller growth, to save segments."""
        offered, free = self._offered - self.next, self.room - len(self.inbox)
        return 2 * offered <= self.room and free >= 2 * offered and free >= min(self.room // 2, SEGMENT_BYTES)

    def has_new_bytes(self, segment: Segment) -> bool:
        """Return whether a segment carries bytes that were not received before."""
        return segment.seq + len(segment.data) > self.next

    def accept(self, segment: Segment) -> None:
        """Append the new bytes of a segment; a partner never sends beyond the window that it knows."""
        known = self.next - segment.seq
        if known < 0:  # a segment before it was lost: the partner will send both again
            return
        fresh = segment.data[known:] if known else segment.data
        self.inbox += fresh
        self.next += len(fresh)
        ends_here = segment.seq + len(segment.data) == self.next
        if segment.flags & SegmentFlag.FIN and ends_here and not self.fin:
            self.fin = True
            self.next += 1


SEND_BUFFER: Final = 2_621_440  # with the receive buffer 4.19 MB: what Linux took before EAGAIN
RECEIVE_BUFFER: Final = 1_572_864
ORPHAN_LIFE: Final = 120 * SECOND
RTO_MAX: Final = 1 * SECOND  # as on a Linux that accepts TCP_RTO_MAX_MS


class PortClaim(Struct, eq=False):
    """A local address and port that a socket occupies. Port 0 means that the socket has no port yet.

    If `fixed`, the program chose the port. A chosen port is occupied until the handle is freed.
    """

    address: str = ANY_ADDRESS
    port: int = 0
    reuse: bool = False
    listening: bool = False
    fixed: bool = False

    @property
    def end(self) -> Endpoint | None:
        return Endpoint(self.address, self.port) if self.port else None


class StreamPhase(Enum):  # as its program sees it: FIN and TIME_WAIT are no phases
    SYN_SENT = "connecting"
    OPEN = "open"
    OVER = "over"


class Tuning(Struct):
    """The socket options that have an effect. Times are in ns. A stream and its socket share one Tuning."""

    keep_alive: int = 0
    user_timeout: int = 0
    longest_wait: int = LONGEST_WAIT
    send_room: int = SEND_BUFFER
    receive_room: int = RECEIVE_BUFFER


class Wire(Protocol):
    @property
    def now(self) -> int: ...
    def call_at(self, due: int, act: Callable[[], None]) -> Ticket: ...
    def cancel(self, ticket: Ticket | None) -> None: ...
    def carry_syn(self, client: SimStream) -> None: ...
    def carry(self, source: SimStream, segment: Segment) -> None: ...
    def remove_ended(self, stream: SimStream, linger: bool) -> None: ...
    def set_link(self, owner: str, up: bool) -> None: ...


def ignore_change() -> None:
    """Do nothing: a stream without a handle calls this in place of `changed`."""


class SimStream:
    """One end of a TCP connection. `partner` is the other end, or None before the handshake."""

    __slots__ = (
        "_alive", "_alive_ticket", "_closed_first", "_end_ticket", "_in", "_out", "_retry",
        "_retry_ticket", "_syns", "_wire", "always_answers", "changed", "claim", "error", "heard", "held",
        "lingering", "local", "owner", "partner", "phase", "read_shut", "remote", "tuning",
    )  # fmt: skip

    def __init__(
        self, wire: Wire, owner: str, claim: PortClaim, local: Endpoint, remote: Endpoint, tuning: Tuning
    ) -> None:
        self._wire, self.tuning = wire, tuning
        self.owner, self.claim, self.local, self.remote = owner, claim, local, remote
        self.partner: SimStream | None = None
        self.changed: Callable[[], None] = ignore_change
        self.phase = StreamPhase.SYN_SENT
        self.error = ""
        self.always_answers = False  # then its partner needs no keep-alive timer
        self.held = True  # by a program, or an accept queue
        self.lingering = False  # in TIME_WAIT
        self.read_shut = False
        self.heard = wire.now  # when the last segment came
        self._out = SendHalf(tuning.send_room)
        self._in = ReceiveHalf(tuning.receive_room)
        self._closed_first = False
        self._syns = 0
        self._retry = RetryTimer()
        self._alive = KeepAliveTimer(0, 0)
        self._retry_ticket: Ticket | None = None
        self._alive_ticket: Ticket | None = None
        self._end_ticket: Ticket | None = None

    # -- what a program sees -------------------------------------------------------------------------

    @property
    def is_gone(self) -> bool:
        """Return whether poll would show RDHUP, ERR or HUP: after a FIN, an error or our own shutdown."""
        return self._in.fin or self.read_shut or self.phase is StreamPhase.OVER

    @property
    def is_readable(self) -> bool:
        return bool(self._in.inbox) or self.is_gone

    def peek(self, skip: int) -> Unread:
        """Return the number of unread bytes, a part of these bytes, and whether FIN or RST has come."""
        half, is_reset = self._in, self.phase is StreamPhase.OVER and self.error == "ECONNRESET"
        end = "rst" if is_reset else "fin" if half.fin else ""
        size = len(half.inbox)
        return Unread(size, bytes(half.inbox[skip:PEEK_DEPTH]), end, size * 2 >= half.room)

    @property
    def unread(self) -> int:
        return len(self._in.inbox)

    @property
    def pending_bytes(self) -> int:
        """Return how many written bytes the partner's program has not read."""
        return self._out.queued_bytes + (len(self.partner._in.inbox) if self.partner is not None else 0)

    def path(self) -> PathInfo:
        often = self.tuning.longest_wait <= RTO_MAX
        return PathInfo(self._out.in_flight, self._out.unsent, (self._wire.now - self.heard) // MS, often)

    # -- what a program does -------------------------------------------------------------------------

    def apply_options(self) -> None:
        """Apply the tuning after a change; the keep-alive time still counts from the last segment."""
        self._out.room, self._in.room = self.tuning.send_room, self.tuning.receive_room
        self._start_keep_alive()

    def read(self, into: memoryview, most: int) -> int | WouldBlock | str:
        """Move at most `most` bytes into the view. If a str is returned, it is an errno name."""
        if self._in.inbox:  # bytes come before FIN, and FIN before an error, as on Linux
            return self._read_inbox(into, most)
        if self._in.fin:
            return 0
        if self.error:  # Rule 2
            return self.take_error()
        return 0 if self.is_gone else WOULD_BLOCK

    def _read_inbox(self, into: memoryview, most: int) -> int:
        size = self._in.read(into, most)
        if not self._in.inbox:
            self.changed()
        if self._in.should_update_window and self.phase is StreamPhase.OPEN:
            self._send_empty()
        return size

    def write(self, data: memoryview) -> int | WouldBlock | str:
        """Queue the bytes that have room in the send buffer. Return how many. A str is an errno name."""
        if self.phase is StreamPhase.SYN_SENT:
            return WOULD_BLOCK
        if self.error:
            return self.take_error()
        if self._out.fin or self.phase is StreamPhase.OVER:
            return "EPIPE"
        taken = self._out.put(data)
        if not taken and data:
            return WOULD_BLOCK
        self._send_queued()
        return taken

    def take_error(self) -> str:
        error, self.error = self.error, ""
        return error

    def shutdown(self, both: bool) -> str:
        """Send FIN after the queued data; return "" or ENOTCONN."""
        if self.phase is StreamPhase.OVER:
            return "ENOTCONN"
        if self.phase is StreamPhase.SYN_SENT:  # as Linux does: the attempt ends
            self.end_with_error("ECONNRESET")
            return ""
        self.read_shut = self.read_shut or both
        self._send_fin()
        self.changed()
        return ""

    def _send_fin(self) -> None:
        if not self._out.fin:
            self._out.fin = True
            self._closed_first = not self._in.fin  # only the first one to close gets TIME_WAIT
            self._send_queued()

    def close(self) -> None:
        """Send RST if data is unread. If not, send queued data and FIN; the stream outlives its program."""
        if self.phase is not StreamPhase.OPEN or self._in.inbox:  # RFC 2525 2.17: RST if data is unread
            self.abort()
            return
        self.held = False
        self.read_shut = True
        self._send_fin()
        if self.phase is StreamPhase.OPEN:
            self._end_ticket = self._wire.call_at(self._wire.now + ORPHAN_LIFE, self.abort)

    def abort(self) -> None:
        self.held = False
        was_open = self.phase is StreamPhase.OPEN
        if self.phase is not StreamPhase.OVER:
            self._end(linger=False)  # before the RST is carried (Rule 1)
        if was_open:
            self._wire.carry(self, RESET_SEGMENT)

    def withdraw(self, size: int) -> None:
        """Take back at most `size` of the newest bytes that the partner's program has not read."""
        size -= self._out.withdraw(size)
        inbox = self.partner._in.inbox if self.partner is not None else bytearray()
        del inbox[max(len(inbox) - size, 0) :]

    def end_by_plc(self) -> None:
        """End a played partner's stream as the captured PLC did; the PLC's stream ends with OWN_END."""
        if self.partner is not None and self.partner.phase is StreamPhase.OPEN:
            self.partner.end_with_error(OWN_END)
        self.abort()

    # -- the handshake -------------------------------------------------------------------------------

    def connect(self) -> None:
        self._retry_ticket = self._wire.call_at(self._wire.now + self._next_syn_wait(), self._repeat_syn)
        self._wire.carry_syn(self)

    def _next_syn_wait(self) -> int:
        wait, limit = SYN_WAITS[self._syns], self.tuning.user_timeout
        return min(wait, max(0, limit - sum(SYN_WAITS[: self._syns]))) if limit else wait

    def _repeat_syn(self) -> None:
        self._syns += 1
        limit = self.tuning.user_timeout
        if self._syns == len(SYN_WAITS) or 0 < limit <= sum(SYN_WAITS[: self._syns]):
            self.end_with_error("ETIMEDOUT")
        else:
            self._retry_ticket = self._wire.call_at(self._wire.now + self._next_syn_wait(), self._repeat_syn)
            self._wire.carry_syn(self)

    def fail_no_host(self) -> None:
        if self.phase is StreamPhase.SYN_SENT:
            self.end_with_error("EHOSTUNREACH")

    def make_syn_ack(self) -> Segment:
        """Return the SYN-ACK of an accepted connection."""
        return Segment(0, 0, self._in.offer_window(), b"", SegmentFlag.SYN_ACK)

    def establish(self, edge: int) -> None:
        """Become established; `edge` is the end of the partner's window."""
        self._stop_retry()
        self.phase = StreamPhase.OPEN
        self.heard = self._wire.now
        self._out.open_window(edge)
        self._start_keep_alive()
        self.changed()

    # -- what arrives --------------------------------------------------------------------------------

    def handle_segment(self, segment: Segment) -> None:
        if self.phase is StreamPhase.SYN_SENT:
            self._handle_connecting(segment)
        elif segment.flags & SegmentFlag.RST:
            self.handle_reset()
        else:
            self.heard = self._wire.now
            self._handle_ack(segment)
            if self.phase is StreamPhase.OPEN and (segment.data or segment.flags):
                self._accept_segment(segment)

    def _handle_connecting(self, segment: Segment) -> None:
        if segment.flags & SegmentFlag.RST:
            self.end_with_error("ECONNREFUSED")
        elif segment.flags & SegmentFlag.SYN_ACK:
            self.establish(segment.edge)

    def handle_reset(self) -> None:
        """End because of an RST, or because the partner has begun a new connection with the same ends."""
        if self.phase is StreamPhase.OPEN:
            # In CLOSE_WAIT Linux calls it EPIPE: the FIN was the end, the RST answers our later data.
            self.end_with_error("EPIPE" if self._in.fin and not self._out.fin else "ECONNRESET")

    def _handle_ack(self, segment: Segment) -> None:
        news = self._out.acknowledge(segment.ack)
        wider = self._out.open_window(segment.edge)
        self._retry.note_answer()
        if news or wider:
            self._stop_retry()
        if self._is_finished:
            self._end(self._closed_first)
        elif news or wider:
            self._send_queued()

    @property
    def _is_finished(self) -> bool:
        return self._in.fin and self._out.fin_acked

    def _accept_segment(self, segment: Segment) -> None:
        if self.read_shut and segment.data and self._in.has_new_bytes(segment):  # RFC 1122 4.2.2.13: RST
            self.end_with_error("ECONNRESET")
            self._wire.carry(self, RESET_SEGMENT)
            return
        self._in.accept(segment)
        self.changed()
        self._send_empty()
        if self._is_finished and self.phase is StreamPhase.OPEN:
            self._end(self._closed_first)

    # -- what is carried -----------------------------------------------------------------------------

    def _send_empty(self, flags: int = SegmentFlag.NONE) -> None:
        self._wire.carry(self, Segment(self._out.next, self._in.next, self._in.offer_window(), b"", flags))

    def acknowledge(self) -> None:
        self._send_empty()

    def _send_queued(self) -> None:
        """Send what the partner's window allows, and FIN after the last byte."""
        if self.phase is not StreamPhase.OPEN:
            return
        sent = self._out.take_sendable()
        if sent is not None:
            seq, data, flags = sent
            self._wire.carry(self, Segment(seq, self._in.next, self._in.offer_window(), data, flags))
        self._start_retry_timer()

    # -- timers --------------------------------------------------------------------------------------

    def _start_retry_timer(self) -> None:
        if self._retry_ticket is None and self._out.is_waiting and self.phase is StreamPhase.OPEN:
            if self._retry.due is None:
                self._retry.start(self._wire.now)
            self._retry_ticket = self._wire.call_at(self._retry.due or 0, self._handle_retry_due)

    def _stop_retry(self) -> None:
        self._retry.stop()
        self._wire.cancel(self._retry_ticket)
        self._retry_ticket = None

    def _handle_retry_due(self) -> None:
        self._retry_ticket = None
        probing, tuning = not self._out.is_in_flight, self.tuning
        verdict = self._retry.decide_at_due(self._wire.now, probing, tuning.user_timeout, tuning.longest_wait)
        if verdict is TimerVerdict.DEAD:
            self.end_with_error("ETIMEDOUT")
        elif probing:
            self._send_empty(SegmentFlag.PROBE)  # a zero window: probe it, there is nothing to send again
            self._start_retry_timer()
        else:
            self._out.rewind()
            self._send_queued()

    def _start_keep_alive(self) -> None:
        self._wire.cancel(self._alive_ticket)
        self._alive_ticket = None
        is_asked = self.partner is None or not self.partner.always_answers
        if self.tuning.keep_alive and self.phase is StreamPhase.OPEN and is_asked:
            self._alive = KeepAliveTimer(self.tuning.keep_alive, self.heard)
            self._alive_ticket = self._wire.call_at(self._alive.due, self._handle_alive_due)

    def _handle_alive_due(self) -> None:
        busy, limit = self._out.is_waiting, self.tuning.user_timeout
        verdict = self._alive.decide_at_due(self._wire.now, self.heard, busy, limit)
        self._alive_ticket = self._wire.call_at(self._alive.due, self._handle_alive_due)
        if verdict is TimerVerdict.DEAD:
            self.end_with_error("ETIMEDOUT")
        elif verdict is TimerVerdict.ASK:
            self._send_empty(SegmentFlag.PROBE)

    def fall_silent(self) -> None:
        """Answer nothing from now on; the partner starts its keep-alive."""
        self.always_answers = False
        self._wire.set_link(self.owner, False)
        if self.partner is not None:
            self.partner._start_keep_alive()

    # -- the end -------------------------------------------------------------------------------------

    def end_with_error(self, error: str) -> None:
        """End with this error; the partner gets no segment."""
        self.error = error
        self._end(linger=False)

    def _end(self, linger: bool) -> None:
        self.phase = StreamPhase.OVER
        self._out.clear()
        self._stop_retry()
        self._wire.cancel(self._alive_ticket)
        self._wire.cancel(self._end_ticket)
        self._alive_ticket = self._end_ticket = None
        self._wire.remove_ended(self, linger)
        self.changed()
