"""The two byte queues of one end of a simulated TCP connection: what it sends and what it has received.

Positions count bytes from 0; FIN is one number behind the last byte. A window never shrinks, and sending
again goes back to the first unacknowledged byte.
"""

from __future__ import annotations

from enum import IntFlag
from typing import Final, NamedTuple

SEGMENT_BYTES: Final = 1460


class Flag(IntFlag):
    """What a segment means besides its data."""

    NONE = 0
    SYN_ACK = 1
    FIN = 2
    RST = 4
    PROBE = 8


class Segment(NamedTuple):
    """What is carried: where its data stand in the stream, what is acknowledged, how far the window goes."""

    seq: int
    ack: int
    edge: int
    data: bytes = b""
    flags: Flag = Flag.NONE


RESET: Final = Segment(0, 0, 0, b"", Flag.RST)


class SendHalf:
    """Bytes taken from the program until the partner has acknowledged them."""

    __slots__ = ("_edge", "_first", "_queue", "fin", "fin_acked", "next", "room")

    def __init__(self, room: int) -> None:
        self.room = room
        self.fin = self.fin_acked = False
        self.next = 0  # what the next new segment begins with
        self._queue = bytearray()
        self._first = 0  # where the queue begins: the first unacknowledged position
        self._edge = 0  # how far the partner's window goes

    @property
    def unacked(self) -> int:
        """Return how many bytes are in flight."""
        return len(self._queue) - self.unsent

    @property
    def unsent(self) -> int:
        """Return how many bytes the partner's window holds back."""
        return max(0, self._first + len(self._queue) - self.next)

    @property
    def is_in_flight(self) -> bool:
        """Return whether data or FIN is sent and unacknowledged."""
        return self._first < self.next

    @property
    def is_waiting(self) -> bool:
        """Return whether anything is unacknowledged or held back."""
        return self._first < self.next or bool(self._queue)

    def put(self, data: memoryview) -> int:
        """Queue what there is room for; return how many bytes that was."""
        taken = data[: max(0, self.room - len(self._queue))]
        self._queue += taken
        return len(taken)

    def open_window(self, edge: int) -> bool:
        """Let the window go to edge; return whether that is farther than before."""
        wider = edge > self._edge
        self._edge = max(self._edge, edge)
        return wider

    def acknowledge(self, ack: int) -> bool:
        """Drop what has arrived there; return whether anything of it is new."""
        taken = ack - self._first
        if taken <= 0:
            return False
        self.fin_acked = taken > len(self._queue)
        del self._queue[:taken]
        self._first = ack
        return True

    def rewind(self) -> None:
        """Send everything unacknowledged again."""
        self.next = self._first

    def emit(self) -> tuple[int, bytes, Flag] | None:
        """Return position, data and flags of what may be sent now, and count it as sent."""
        end = self._first + len(self._queue)
        seq, limit = self.next, min(end, self._edge)
        data = b""
        if seq < limit:
            data = bytes(self._queue[seq - self._first : limit - self._first])
            self.next = limit
        if self.fin and self.next == end and not self.fin_acked:
            self.next = end + 1
            return seq, data, Flag.FIN
        return (seq, data, Flag.NONE) if data else None

    def clear(self) -> None:
        """Forget what is queued: the connection is over."""
        self._queue.clear()
        self.next = self._first


class ReceiveHalf:
    """Bytes received until the program reads them."""

    __slots__ = ("_offered", "fin", "inbox", "next", "room")

    def __init__(self, room: int) -> None:
        self.room = room
        self.fin = False
        self.inbox = bytearray()
        self.next = 0  # the position that is expected next
        self._offered = room  # how far the window has been opened

    def take(self, into: memoryview, most: int) -> int:
        """Move bytes to the program; return how many."""
        size = min(len(into), len(self.inbox), most)
        into[:size] = self.inbox[:size]
        del self.inbox[:size]
        return size

    def offer(self) -> int:
        """Return how far the window goes now."""
        self._offered = max(self._offered, self.next + self.room - len(self.inbox))
        return self._offered

    @property
    def should_tell(self) -> bool:
        """Return whether the window has doubled: Linux tells no less, so small reads cost no segment each."""
        left, free = self._offered - self.next, self.room - len(self.inbox)
        return 2 * left <= self.room and free >= 2 * left and free >= min(self.room // 2, SEGMENT_BYTES)

    def brings_news(self, segment: Segment) -> bool:
        """Return whether it carries bytes that are not here yet."""
        return segment.seq + len(segment.data) > self.next

    def accept(self, segment: Segment) -> None:
        """Take in what is next in line; a partner never sends beyond the window he was told."""
        known = self.next - segment.seq
        if known < 0:  # something in front of it was lost
            return
        fresh = segment.data[known:] if known else segment.data
        self.inbox += fresh
        self.next += len(fresh)
        ends_here = segment.seq + len(segment.data) == self.next
        if segment.flags & Flag.FIN and ends_here and not self.fin:
            self.fin = True
            self.next += 1
