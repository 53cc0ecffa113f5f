"""A ComBuffer: the queue of bytes between a line and its blocks. The buffer records received bytes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from msgspec import Struct

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import BufferBytesLost, BytesBuffered, Environment, FeederHold, SerialNote
from trcvtui.blocks.table import BlockRow
from trcvtui.net.received_ring import ReceivedRing

# Bound: the newest MOST_RECORDED_BYTES, in MOST_RECORDED_CHUNKS chunks; the bytes of one scan are one.
# A reader gets a frozen copy.

MOST_RECORDED_BYTES: Final = 65_536
MOST_RECORDED_CHUNKS: Final = 8192


class LineChunk(NamedTuple):
    """Bytes that came in one scan, at `t_ns` of the run. If `begins`, these bytes begin a connection."""

    t_ns: int
    payload: bytes
    begins: bool = False


@dataclass(frozen=True)  # no slots: `size` is read often and computed once
class LineRecording:
    """The chunks of one line, oldest first, as of `until_ns`.

    `source` is `sim`, `serial`, `tcp` or `cable`. `tick_ns` is the resolution of the times, which is the
    interval of the scans. `dropped` counts the older bytes that were dropped.
    """

    source: str
    chunks: tuple[LineChunk, ...]
    until_ns: int = 0
    tick_ns: int = 0
    dropped: int = 0

    @cached_property
    def size(self) -> int:
        return sum([len(chunk.payload) for chunk in self.chunks])

    def first_part(self, most: int) -> LineRecording:
        """Return a recording of at most the first `most` bytes. The last chunk may be cut."""
        kept: list[LineChunk] = []
        room = most
        for chunk in self.chunks:
            kept.append(chunk._replace(payload=chunk.payload[:room]))
            room -= len(chunk.payload)
            if room <= 0:
                return LineRecording(self.source, tuple(kept), chunk.t_ns, self.tick_ns, self.dropped)
        return self


class LineRecorder:
    """Records the bytes of one line, including bytes for which the ComBuffer had no room."""

    def __init__(self) -> None:
        self._chunks: deque[LineChunk] = deque()
        self._size = 0
        self._dropped = 0
        self._is_new = True

    def add(self, payload: bytes, now: int) -> None:
        payload = payload[-MOST_RECORDED_BYTES:]
        if not payload:
            return
        last = self._chunks[-1] if self._chunks else None
        if last is not None and last.t_ns == now and not self._is_new:
            self._chunks[-1] = last._replace(payload=last.payload + payload)
        else:
            self._chunks.append(LineChunk(now, payload, self._is_new))
        self._is_new = False
        self._size += len(payload)
        while self._size > MOST_RECORDED_BYTES or len(self._chunks) > MOST_RECORDED_CHUNKS:
            self._drop_oldest_part()

    def mark_connection_end(self) -> None:
        """Note that the next bytes are of another connection."""
        self._is_new = True

    def make_recording(self, source: str, until: int, tick: int) -> LineRecording:
        return LineRecording(source, tuple(self._chunks), until, tick, self._dropped)

    def _drop_oldest_part(self) -> None:
        """Drop the oldest chunk. If there is only one chunk, drop only its oldest bytes."""
        if len(self._chunks) == 1:
            (last,) = self._chunks
            over = self._size - MOST_RECORDED_BYTES
            self._chunks[0] = last._replace(payload=last.payload[over:])
        else:
            over = len(self._chunks.popleft().payload)
        self._size -= over
        self._dropped += over


# Rule: the end of a connection has its place among the bytes; a reader stops there and gets its reason.
# Bound: never more than `size` bytes; what has no room is dropped and counted.

COM_BUFFER_SIZE: Final = 300  # ARRAY[0..300] OF BYTE: one place of a ring stays free
MOST_CONNECTION_ENDS: Final = 64  # a partner may connect and leave any number of times


class ComBuffer:
    """One ComBuffer. `head` counts all bytes taken out, `tail` all bytes put in.

    `recorded` has the bytes of the line, with their times in ns.
    """

    def __init__(
        self,
        name: str,
        size: int,
        write: Callable[[SerialNote], None],
        now: Callable[[], int],
        received: ReceivedRing,
    ) -> None:
        self.recorded = LineRecorder()
        self.received = received
        self._now = now
        self.name = name
        self.size = size
        self.head = 0
        self.lost = 0
        self.ends = 0  # how many ends of connections the readers have met
        self.end_reason = ""
        self._bytes = bytearray()
        self._ends: deque[tuple[int, str]] = deque(maxlen=MOST_CONNECTION_ENDS)
        self._write = write

    @property
    def count(self) -> int:
        """Return how many bytes wait."""
        return len(self._bytes)

    @property
    def free(self) -> int:
        """Return how many more bytes the ComBuffer can take."""
        return self.size - len(self._bytes)

    @property
    def tail(self) -> int:
        return self.head + len(self._bytes)

    # -- the line's side --------------------------------------------------------------------------------

    def put(self, payload: bytes, is_received: bool = True) -> int:
        """Append received bytes, or bytes of a send block; return how many of these bytes had room."""
        self.recorded.add(payload, self._now())
        taken = min(len(payload), self.free)
        position = self.received.append(payload) if is_received else -1
        if taken:
            self._write(BytesBuffered(self.name, self.tail, taken, position))
            self._bytes += payload[:taken]
        if taken < len(payload):
            self._note_lost(len(payload) - taken, "the ComBuffer is full", position + taken)
        return taken

    def mark_connection_end(self, reason: str) -> None:
        """Mark the end of a connection after the last byte."""
        self.recorded.mark_connection_end()
        if not self._ends or self._ends[-1] != (self.tail, reason):  # marked once
            self._ends.append((self.tail, reason))

    def discard_all(self, reason: str) -> None:
        """Take all bytes out unread (ClearComBuffer, a new connection)."""
        if self._bytes:
            self._note_lost(len(self._bytes), reason)
            self.head += len(self._bytes)
            self._bytes.clear()

    def note_held(self, is_held: bool) -> None:
        """Note in the ledger that the TRCV_C that feeds the ComBuffer is held, or released (FeederHold)."""
        self._write(FeederHold(self.name, is_held))

    # -- the reader's side ------------------------------------------------------------------------------

    def peek(self) -> bytes:
        """Return a copy of the bytes that wait, up to the end of their connection."""
        while self._ends and self._ends[0][0] <= self.head:  # rule: its last byte has been read
            self.end_reason = self._ends.popleft()[1]
            self.ends += 1
        size = self._ends[0][0] - self.head if self._ends else len(self._bytes)
        return bytes(self._bytes[:size])

    def read(self, size: int) -> bytes:
        """Take out and return at most `size` bytes."""
        taken = bytes(self._bytes[:size])
        del self._bytes[:size]
        self.head += len(taken)
        return taken

    def _note_lost(self, size: int, reason: str, position: int = -1) -> None:
        self.lost += size
        self._write(BufferBytesLost(self.name, self.tail, size, reason, position))


class BufferBinding(Struct, frozen=True):
    """In `data`, `prefix` and `suffix`, None means a pointer of 0. `priority` is the task's priority."""

    env: Environment
    buffer: ComBuffer
    data: DataArea | None
    prefix: DataArea | None
    suffix: DataArea | None
    instance: str
    priority: int = 1

    def class_of(self, row: BlockRow) -> str:
        return row.serial
