"""What came over a line, kept with its times: what the advice on framings and the screen read.

Bound: the newest MOST_BYTES in MOST_CHUNKS chunks; chunks of one scan are one. A reader gets a frozen copy.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

MOST_BYTES: Final = 65_536
MOST_CHUNKS: Final = 8192


class Chunk(NamedTuple):
    """Bytes that came in one scan, at `t_ns` of the run. `begins`: they are the first of a connection."""

    t_ns: int
    payload: bytes
    begins: bool = False


@dataclass(frozen=True)  # no slots: its size is asked for often, and worked out once
class Recording:
    """The chunks of one line, oldest first, as they stand at `until_ns`.

    `source` is `sim`, `serial`, `tcp` or `cable`; `tick_ns` is how fine the times are: the interval of the
    scans; `dropped` counts the older bytes that are not kept any more.
    """

    source: str
    chunks: tuple[Chunk, ...]
    until_ns: int = 0
    tick_ns: int = 0
    dropped: int = 0

    @cached_property
    def size(self) -> int:
        """Return how many bytes are kept."""
        return sum([len(chunk.payload) for chunk in self.chunks])

    def first(self, most: int) -> Recording:
        """Return the first chunks of it, `most` bytes of them; a chunk may be cut."""
        kept: list[Chunk] = []
        room = most
        for chunk in self.chunks:
            kept.append(chunk._replace(payload=chunk.payload[:room]))
            room -= len(chunk.payload)
            if room <= 0:
                return Recording(self.source, tuple(kept), chunk.t_ns, self.tick_ns, self.dropped)
        return self


class Recorder:
    """One line's recording. Bytes that had no room in the ComBuffer are in it too: the line has had them."""

    def __init__(self) -> None:
        self._chunks: deque[Chunk] = deque()
        self._size = 0
        self._dropped = 0
        self._is_new = True

    def add(self, payload: bytes, now: int) -> None:
        """Keep what came."""
        payload = payload[-MOST_BYTES:]
        if not payload:
            return
        last = self._chunks[-1] if self._chunks else None
        if last is not None and last.t_ns == now and not self._is_new:
            self._chunks[-1] = last._replace(payload=last.payload + payload)
        else:
            self._chunks.append(Chunk(now, payload, self._is_new))
        self._is_new = False
        self._size += len(payload)
        while self._size > MOST_BYTES or len(self._chunks) > MOST_CHUNKS:
            self._shorten()

    def end(self) -> None:
        """What comes next is of another connection."""
        self._is_new = True

    def kept(self, source: str, until: int, tick: int) -> Recording:
        """Return what is kept."""
        return Recording(source, tuple(self._chunks), until, tick, self._dropped)

    def _shorten(self) -> None:
        """Drop the oldest chunk whole, so that what stays begins where a chunk did; the only one is cut."""
        if len(self._chunks) == 1:
            (last,) = self._chunks
            over = self._size - MOST_BYTES
            self._chunks[0] = last._replace(payload=last.payload[over:])
        else:
            over = len(self._chunks.popleft().payload)
        self._size -= over
        self._dropped += over
