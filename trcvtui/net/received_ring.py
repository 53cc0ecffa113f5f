"""The newest bytes that each CONNECT, UDP_CONFIG or ComBuffer has received, or sent: bounded rings.

A position counts all bytes of one ring since the start of the PLC, over all connections. Bytes that the
ring has dropped count, too. Bytes that were unread at the connection's end, or beyond the buffer of a
datagram, have positions but no known values. Each such gap has at most MOST_SKIPPED positions.
Rule: a run's saved state has no bytes of a ring. A restored ring is empty and keeps its last position.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from typing import Any, Final

from trcvtui.wording import exact_size

BLOCK_BYTES: Final = 1 << 15  # with 1 << 12 a message of 64 KiB takes 25 us longer
DEFAULT_HISTORY: Final = 1 << 20  # bytes that a ring keeps if the project does not say
LEAST_HISTORY: Final = 1 << 16
MOST_HISTORY: Final = 1 << 26
MOST_RING_BYTES: Final = 1 << 26  # of all rings of a PLC
MOST_SKIPPED: Final = 256


def sent_ring_name(connect: str) -> str:
    """Return the name of the ring for what a CONNECT or UDP_CONFIG sends."""
    return f"{connect} sent"  # a declared name cannot have a space


class ReceivedRings:
    """The rings of one PLC by name. A name that is declared again keeps its ring."""

    def __init__(self) -> None:
        self._rings: dict[str, ReceivedRing] = {}
        self._blocks = OrderedDict[tuple[str, int], ReceivedRing]()  # by first position, the oldest first

    def __getstate__(self) -> dict[str, object]:
        return {"_rings": self._rings}  # Rule: without the bytes

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._blocks = OrderedDict()

    def open_ring(self, name: str, most: int = DEFAULT_HISTORY) -> ReceivedRing:
        """Return the ring of a name. From now on the ring has room for at most `most` bytes."""
        found = self._rings.setdefault(name, ReceivedRing(name, self))
        found.most = most
        return found

    def get(self, name: str) -> ReceivedRing | None:
        return self._rings.get(name)

    @property
    def is_full(self) -> bool:
        return len(self._blocks) >= MOST_RING_BYTES // BLOCK_BYTES

    def register_block(self, name: str, position: int) -> None:
        """Note a new block; while all rings together have too many blocks, forget the oldest block."""
        self._blocks[name, position] = self._rings[name]
        while len(self._blocks) > MOST_RING_BYTES // BLOCK_BYTES:
            self._blocks.popitem(last=False)[1].forget_oldest()

    def unregister_block(self, name: str, position: int) -> None:
        del self._blocks[name, position]


class ReceivedRing:
    """The newest `most` bytes, in blocks; only the last block may be incomplete."""

    def __init__(self, name: str, of_all: ReceivedRings) -> None:
        self.end = 0
        self.incarnations = 0  # connections so far: each one's bytes can be distinguished
        self.most = DEFAULT_HISTORY
        self._name, self._all = name, of_all
        self._first = self._restored = (
            0  # where the oldest block begins; where the ring began after a restore
        )
        self._blocks: deque[bytearray] = deque()
        self._room = 0  # in the last block

    def __getstate__(self) -> dict[str, object]:
        kept = "end", "incarnations", "most", "_name", "_all"  # Rule: without the bytes
        return {name: self.__dict__[name] for name in kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._first, self._restored, self._blocks, self._room = self.end, self.end, deque(), 0

    @property
    def first(self) -> int:
        return max(self._first, self.end - self.most)

    @property
    def missing_reason(self) -> str:
        """Return why the ring has no older bytes, or "" if none are missing."""
        if not self.first or self.first == self.end:
            return ""
        if self.end - self.first == self.most:
            return f"older than the {exact_size(self.most)} that are kept"
        if self.first == self._restored:
            return "from before the keyframe at which the run continues"
        if self._all.is_full:
            return "older than the 64MiB that all histories keep together"
        return "older than what was kept while its history was smaller"

    def append(self, content: bytes | memoryview) -> int:
        """Append bytes; a full ring drops its oldest bytes. Return the position of the first new byte."""
        size, position = len(content), self.end
        self.end = position + size
        if 0 < size <= self._room:  # most appends fit into the last block
            self._blocks[-1].extend(content)
            self._room -= size
            return position
        done = 0
        while done < size:
            if not self._room:
                self._begin_block(position + done)
            part = content[done : done + self._room]
            self._blocks[-1].extend(part)
            self._room -= len(part)
            done += len(part)
        return position

    def add_unknown(self, size: int) -> int:
        """Give positions to bytes of unknown value, MOST_SKIPPED at most; return the first position."""
        return self.append(bytes(min(size, MOST_SKIPPED)))  # else the end of one connection empties the ring

    def _begin_block(self, position: int) -> None:
        if not self._blocks:
            self._first = position
        self._blocks.append(bytearray())
        self._room = BLOCK_BYTES
        while position - self._first >= self.most + BLOCK_BYTES:
            self._all.unregister_block(self._name, self._first)
            self.forget_oldest()
        self._all.register_block(self._name, position)

    def forget_oldest(self) -> None:
        self._blocks.popleft()
        self._first += BLOCK_BYTES
        if not self._blocks:
            self._first, self._room = self.end, 0

    def read(self, start: int, stop: int) -> bytes:
        """Return the bytes from `start` to `stop` that the ring still has."""
        start, stop = max(start, self.first), min(stop, self.end)
        if start >= stop:
            return b""
        place, found = start - self._first, bytearray()
        while len(found) < stop - start:
            number, at = divmod(place + len(found), BLOCK_BYTES)
            found += self._blocks[number][at : at + stop - start - len(found)]
        return bytes(found)
