"""ComBuffer: the queue of bytes between a line and the blocks that read or write it.

Rule: the end of a connection has its place among the bytes; nobody reads over it without being told.
Bound: never more than `size` bytes; what has no room is dropped and counted (row 15).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

from trcvtui.blocks.serial.recording import Recorder
from trcvtui.blocks.serial_events import BytesArrived, BytesLost, LineHeld, SerialNote

ROOM: Final = 300  # ARRAY[0..300] OF BYTE: one place of a ring stays free
MOST_ENDS: Final = 64


class ComBuffer:
    """One ComBuffer. `head` and `tail`: how many bytes have left and have come, ever.

    `recorded` is what came over the line, with the times that `now` tells.
    """

    def __init__(
        self, name: str, size: int, write: Callable[[SerialNote], None], now: Callable[[], int]
    ) -> None:
        self.recorded = Recorder()
        self._now = now
        self.name = name
        self.size = size
        self.head = 0
        self.lost = 0
        self.ends = 0  # how many ends of connections the readers have met
        self.end_reason = ""
        self._bytes = bytearray()
        self._ends: deque[tuple[int, str]] = deque(maxlen=MOST_ENDS)
        self._write = write

    @property
    def count(self) -> int:
        """Return how many bytes wait."""
        return len(self._bytes)

    @property
    def free(self) -> int:
        """Return how many bytes have room."""
        return self.size - len(self._bytes)

    @property
    def tail(self) -> int:
        """Return how many bytes have come."""
        return self.head + len(self._bytes)

    # -- the line's side --------------------------------------------------------------------------------

    def put(self, payload: bytes) -> int:
        """Append bytes and return how many had room; the others are dropped."""
        self.recorded.add(payload, self._now())
        taken = min(len(payload), self.free)
        if taken:
            self._write(BytesArrived(self.name, self.tail, taken))
            self._bytes += payload[:taken]
        if taken < len(payload):
            self._lose(len(payload) - taken, "the ComBuffer is full")
        return taken

    def end(self, reason: str) -> None:
        """Mark the end of a connection behind the last byte."""
        self.recorded.end()
        if not self._ends or self._ends[-1] != (self.tail, reason):
            self._ends.append((self.tail, reason))

    def empty(self, reason: str) -> None:
        """Take all bytes out unread (ClearComBuffer, a new connection)."""
        if self._bytes:
            self._lose(len(self._bytes), reason)
            self.head += len(self._bytes)
            self._bytes.clear()

    def hold(self, is_held: bool) -> None:
        """Tell the ledger that the line waits, or goes on."""
        self._write(LineHeld(self.name, is_held))

    # -- the reader's side ------------------------------------------------------------------------------

    def look(self) -> bytes:
        """Return a copy of the bytes that wait, up to the end of their connection."""
        while self._ends and self._ends[0][0] <= self.head:
            self.end_reason = self._ends.popleft()[1]
            self.ends += 1
        size = self._ends[0][0] - self.head if self._ends else len(self._bytes)
        return bytes(self._bytes[:size])

    def take(self, size: int) -> bytes:
        """Take bytes out, as many as there are at most."""
        taken = bytes(self._bytes[:size])
        del self._bytes[:size]
        self.head += len(taken)
        return taken

    def _lose(self, size: int, reason: str) -> None:
        self.lost += size
        self._write(BytesLost(self.name, self.tail, size, reason))
