"""A framing tried on a recording: the real framer cuts it, chunk by chunk, at the times of then."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

from trcvtui.blocks.framing.frame import Ending, Frame, Framing
from trcvtui.blocks.framing.framer import Framer
from trcvtui.blocks.serial.recording import Chunk, Recording

PIECE: Final = 512  # bytes of one call: frames do not depend on it, and the framer copies less
GOOD: Final = frozenset({Ending.SUFFIX, Ending.SIZE})


class Placed(NamedTuple):
    """A frame, and where it stands in the recording."""

    start: int
    content: bytes
    ending: Ending

    @property
    def end(self) -> int:
        """Return where the next byte stands."""
        return self.start + len(self.content)


@dataclass(frozen=True, slots=True)
class LengthField:
    """Where a length stands: `width` bytes at `position`; the frame has that number + `more` bytes."""

    position: int
    width: int
    order: str  # little or big
    more: int

    @property
    def head(self) -> int:
        """Return how many bytes are needed to know the length."""
        return self.position + self.width

    def size_of(self, head: bytes) -> int:
        """Return how many bytes the frame has."""
        field = head[self.position : self.head]
        return (field[0] if self.width == 1 else int.from_bytes(field, self.order)) + self.more  # type: ignore[arg-type]


@dataclass(frozen=True)  # no slots: what is asked for often is worked out once
class Cut:
    """What the framer made of a recording; `gaps`: frames that a gap ended are as wanted.

    `noise` bytes before a prefix in `noise_runs` pieces, `broken` in frames whose connection ended, `left` in
    the frame that has no end yet.
    """

    frames: tuple[Placed, ...]
    noise: int
    noise_runs: int
    broken: int
    left: int
    total: int
    gaps: bool = False

    @cached_property
    def good(self) -> list[Placed]:
        """Return the frames that ended as the framing says."""
        endings = GOOD | {Ending.GAP} if self.gaps else GOOD
        return [frame for frame in self.frames if frame.ending in endings]

    @cached_property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Return where the good frames stand: two framings with the same places cut alike."""
        return tuple([(frame.start, frame.end) for frame in self.good])


def cut(recording: Recording, framing: Framing, most: int = 0) -> Cut:
    """Return the frames of a recording, at most so many (0: all); without a suffix a gap is a good end."""
    return _Run(recording, framing, most).run()


def cut_by_length(recording: Recording, field: LengthField, longest: int, most: int = 0) -> Cut:
    """Return the frames of a length field: a job for the head, then one for the rest."""
    return _Run(recording, Framing(field.head), most, (field, longest)).run()


class _Run:
    """One run over a recording."""

    def __init__(
        self, recording: Recording, framing: Framing, most: int, by: tuple[LengthField, int] | None = None
    ) -> None:
        self._recording, self._framing, self._by = recording, framing, by
        self._most = most or recording.size + 1
        self._framer = Framer()
        self._frames: list[Placed] = []
        self._at = self._broken = self._noise_runs = 0
        self._head = b""  # of a frame with a length field
        self._asked = framing

    def run(self) -> Cut:
        """Return what the framer makes of it."""
        recording, before = self._recording, 0
        for chunk in recording.chunks if self._framing.timeout_ns else _joined(recording.chunks):
            if len(self._frames) >= self._most:
                break
            if chunk.begins:
                self._break()
            elif self._framing.timeout_ns and chunk.t_ns - recording.tick_ns > before:
                self._gap(chunk.t_ns - recording.tick_ns)  # the last call before it
            for start in range(0, len(chunk.payload), PIECE):
                self._take(chunk.payload[start : start + PIECE], chunk.t_ns)
            before = chunk.t_ns
        if self._framing.timeout_ns:
            self._gap(recording.until_ns)
        left = self._framer.size + len(self._head)
        gaps = bool(self._framing.timeout_ns) and not self._framing.suffix
        frames = tuple(self._frames)
        return Cut(frames, self._framer.discarded, self._noise_runs, self._broken, left, self._at, gaps)

    def _break(self) -> None:
        self._broken += len(self._framer.drop()) + len(self._head)
        self._head, self._asked = b"", self._framing

    def _gap(self, now: int) -> None:
        self._ended(self._framer.take(b"", self._asked, now).frame)

    def _take(self, payload: bytes, now: int) -> None:
        while payload and len(self._frames) < self._most:
            noise = self._framer.discarded
            used, frame = self._framer.take(payload, self._asked, now)
            self._noise_runs += self._framer.discarded > noise
            self._at += used
            payload = payload[used:]
            self._ended(frame)

    def _ended(self, frame: Frame | None) -> None:
        if frame is None:
            return
        content, ending = self._head + frame.content, frame.ending
        if self._by is not None and not self._head:
            field, longest = self._by
            size = field.size_of(content)
            if field.head < size <= longest:
                self._head, self._asked = content, Framing(size - field.head)
                return
            ending = Ending.SIZE if size == field.head else Ending.OVERRUN
        self._head, self._asked = b"", self._framing
        self._frames.append(Placed(self._at - len(content), content, ending))


def joined(recording: Recording) -> Recording:
    """Return it with the bytes of each connection in one chunk."""
    return replace(recording, chunks=tuple(_joined(recording.chunks)))


def _joined(chunks: Sequence[Chunk]) -> Iterator[Chunk]:
    """Yield the bytes of each connection in one: without a timeout nothing depends on when they came."""
    begun: list[Chunk] = []
    for chunk in chunks:
        if chunk.begins and begun:
            yield begun[0]._replace(payload=b"".join([each.payload for each in begun]))
            begun.clear()
        begun.append(chunk)
    if begun:
        yield begun[0]._replace(payload=b"".join([each.payload for each in begun]))
