"""The received bytes of one CONNECT: its jobs one after the other, and what was dropped between them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

from trcvtui.rig.history.window import JobSpan, RecvSpan

_STOP = attrgetter("span.stop")
_START = attrgetter("span.position")
_COMPACT: Final = 1024  # forgotten chunks that stay in the list until it is cut
_MOST_STEPS: Final = 256  # back to the job before: one instance among very many on a CONNECT


@dataclass(frozen=True, slots=True)
class Chunk:
    """One job, or one stretch of dropped bytes. `content` is empty where the values are not kept."""

    span: JobSpan
    connect: str
    incarnation: int
    content: bytes
    recvs: tuple[RecvSpan, ...]


class JobStream:
    """Chunks by position; the oldest are forgotten first."""

    def __init__(self) -> None:
        self.end = 0
        self._chunks: list[Chunk] = []
        self._first = 0

    @property
    def begin(self) -> int:
        """Return the position of the oldest byte that is kept."""
        return self._chunks[self._first].span.position if self._first < len(self._chunks) else self.end

    def add(self, chunk: Chunk) -> None:
        """Append a chunk at the end."""
        self._chunks.append(chunk)
        self.end = chunk.span.stop

    def forget_oldest(self) -> Chunk:
        """Drop the oldest chunk."""
        oldest = self._chunks[self._first]
        self._first += 1
        if self._first >= _COMPACT:
            del self._chunks[: self._first]
            self._first = 0
        return oldest

    def from_position(self, position: int) -> Iterator[Chunk]:
        """Return the chunk that holds a position and those behind it."""
        place = bisect_right(self._chunks, position, lo=self._first, key=_STOP)
        for number in range(place, len(self._chunks)):
            yield self._chunks[number]

    def at(self, position: int) -> Chunk | None:
        """Return the chunk that holds a position."""
        chunk = next(self.from_position(position), None)
        return chunk if chunk is not None and chunk.span.position <= position else None

    def newest_first(self, position: int) -> Iterator[Chunk]:
        """Return the chunks that begin before a position, the newest first."""
        place = bisect_left(self._chunks, position, lo=self._first, key=_START)
        for number in range(place - 1, self._first - 1, -1):
            yield self._chunks[number]

    def job_before(self, position: int, instance: str) -> Chunk | None:
        """Return the job of an instance that ended with DONE before the chunk at `position`."""
        for steps, chunk in enumerate(self.newest_first(position)):
            if chunk.span.done and chunk.span.instance == instance:
                return chunk
            if steps > _MOST_STEPS:
                break
        return None

    def done(self, position: int, is_forward: bool, is_done: bool = True) -> int | None:
        """Return where the next job that ended with DONE begins, or the one that began before.

        Without `is_done`: the next bytes that were dropped.
        """
        chunks = self.from_position(position) if is_forward else self.newest_first(position)
        for chunk in chunks:
            if chunk.span.done is is_done and (not is_forward or chunk.span.position > position):
                return chunk.span.position
        return None

    def runs(self, start: int, stop: int) -> list[tuple[int, bytes]]:
        """Return the bytes from `start` to `stop`, put together as far as no byte is missing between them."""
        found: list[tuple[int, list[bytes]]] = []
        reached = -1
        for chunk in self.from_position(start):
            begin = chunk.span.position
            if begin >= stop:
                break
            if not chunk.content:
                continue
            if begin != reached:
                found.append((max(begin, start), []))
            found[-1][1].append(chunk.content[max(0, start - begin) : stop - begin])
            reached = chunk.span.stop
        return [(place, b"".join(parts)) for place, parts in found]
