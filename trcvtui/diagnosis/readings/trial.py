"""A framing tried on a recording: the real framer cuts it, chunk by chunk, at the recorded times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import lgamma, log, log2
from typing import Final, NamedTuple

from trcvtui.blocks.framing import Frame, FrameEnding, Framer, Framing
from trcvtui.blocks.serial.com_buffer import LineChunk, LineRecording

PIECE_BYTES: Final = 512  # bytes of one call: frames do not depend on it, but the framer copies less
GOOD_ENDINGS: Final = frozenset({FrameEnding.SUFFIX, FrameEnding.SIZE})


class LocatedFrame(NamedTuple):
    """A frame and its place in the recording."""

    start: int
    content: bytes
    ending: FrameEnding

    @property
    def end(self) -> int:
        return self.start + len(self.content)


@dataclass(frozen=True, slots=True)
class LengthField:
    """A length field of `width` bytes at `position`. The field's value plus `more` is the frame size."""

    position: int
    width: int
    order: str  # little or big
    more: int

    @property
    def head_size(self) -> int:
        """Return how many bytes are needed to know the length."""
        return self.position + self.width

    def frame_size(self, head: bytes) -> int:
        field = head[self.position : self.head_size]
        return (field[0] if self.width == 1 else int.from_bytes(field, self.order)) + self.more  # type: ignore[arg-type]


@dataclass(frozen=True)  # no slots: cached_property needs a dict
class Cut:
    """A recording that the framer has cut. With `gaps`, a frame that ended at a gap counts as good.

    `noise` counts bytes before a prefix, in `noise_runs` pieces. `broken` counts bytes in frames that a
    disconnect cut. `left` counts bytes in the frame without an end.
    """

    frames: tuple[LocatedFrame, ...]
    noise: int
    noise_runs: int
    broken: int
    left: int
    total: int
    gaps: bool = False

    @cached_property
    def good(self) -> list[LocatedFrame]:
        """Return the frames that ended as the framing says. With `gaps`, add frames that a gap ended."""
        endings = GOOD_ENDINGS | {FrameEnding.GAP} if self.gaps else GOOD_ENDINGS
        return [frame for frame in self.frames if frame.ending in endings]

    @cached_property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Return the places of the good frames: two framings with the same places cut alike."""
        return tuple([(frame.start, frame.end) for frame in self.good])


def cut(recording: LineRecording, framing: Framing, most: int = 0) -> Cut:
    """Cut a recording into at most `most` frames, 0 for all. Without a suffix, a gap is a good end."""
    return _TrialRun(recording, framing, most).run()


def cut_by_length(recording: LineRecording, field: LengthField, longest: int, most: int = 0) -> Cut:
    """Cut a recording by a length field: one job takes the head of a frame, the next job takes the rest."""
    return _TrialRun(recording, Framing(field.head_size), most, (field, longest)).run()


class _TrialRun:
    def __init__(
        self, recording: LineRecording, framing: Framing, most: int, by: tuple[LengthField, int] | None = None
    ) -> None:
        self._recording, self._framing, self._by = recording, framing, by
        self._most = most or recording.size + 1
        self._framer = Framer()
        self._frames: list[LocatedFrame] = []
        self._at = self._broken = self._noise_runs = 0
        self._head = b""  # of a frame with a length field, until its rest comes
        self._asked = framing

    def run(self) -> Cut:
        recording, before = self._recording, 0
        for chunk in recording.chunks if self._framing.timeout_ns else _join_by_connection(recording.chunks):
            if len(self._frames) >= self._most:
                break
            if chunk.begins:
                self._break_connection()
            elif self._framing.timeout_ns and chunk.t_ns - recording.tick_ns > before:
                self._pass_gap(chunk.t_ns - recording.tick_ns)  # the last call before this chunk
            for start in range(0, len(chunk.payload), PIECE_BYTES):
                self._add_bytes(chunk.payload[start : start + PIECE_BYTES], chunk.t_ns)
            before = chunk.t_ns
        if self._framing.timeout_ns:
            self._pass_gap(recording.until_ns)
        left = self._framer.pending + len(self._head)
        gaps = bool(self._framing.timeout_ns) and not self._framing.suffix
        frames = tuple(self._frames)
        return Cut(frames, self._framer.discarded, self._noise_runs, self._broken, left, self._at, gaps)

    def _break_connection(self) -> None:
        self._broken += len(self._framer.flush()) + len(self._head)
        self._head, self._asked = b"", self._framing

    def _pass_gap(self, now: int) -> None:
        self._add_frame(self._framer.feed(b"", self._asked, now).frame)

    def _add_bytes(self, payload: bytes, now: int) -> None:
        while payload and len(self._frames) < self._most:
            noise = self._framer.discarded
            used, frame = self._framer.feed(payload, self._asked, now)
            self._noise_runs += self._framer.discarded > noise
            self._at += used
            payload = payload[used:]
            self._add_frame(frame)

    def _add_frame(self, frame: Frame | None) -> None:
        if frame is None:
            return
        content, ending = self._head + frame.content, frame.ending
        if self._by is not None and not self._head:
            field, longest = self._by
            size = field.frame_size(content)
            if field.head_size < size <= longest:
                self._head, self._asked = content, Framing(size - field.head_size)
                return
            ending = FrameEnding.SIZE if size == field.head_size else FrameEnding.OVERRUN
        self._head, self._asked = b"", self._framing
        self._frames.append(LocatedFrame(self._at - len(content), content, ending))


def join_chunks(recording: LineRecording) -> LineRecording:
    return replace(recording, chunks=tuple(_join_by_connection(recording.chunks)))


def _join_by_connection(chunks: Sequence[LineChunk]) -> Iterator[LineChunk]:
    """Yield the bytes of each connection in one chunk: without a timeout their times do not matter."""
    begun: list[LineChunk] = []
    for chunk in chunks:
        if chunk.begins and begun:
            yield begun[0]._replace(payload=b"".join([each.payload for each in begun]))
            begun.clear()
        begun.append(chunk)
    if begun:
        yield begun[0]._replace(payload=b"".join([each.payload for each in begun]))


# -- how much a cut explains, in bits ---------------------------------------------------------------------

# Rule: equal bytes in all frames, equal lengths, and ends where the line pauses save bits; each exception
# costs some. So noise, in which nothing is equal, saves none with any framing.

COMPARED_COLUMNS: Final = 8  # bytes at each end of the frames that are compared place by place
EXCEPTION_BITS: Final = 8.0  # cost of a frame with another end, or of a piece of noise
MOST_MARK_BITS: Final = 24.0  # bits for the mere frequency of a mark
TEXT: Final = frozenset(range(0x20, 0x7F)) | {0x09}
KNOWN_ENDS: Final = (b"\r\n", b"\n", b"\r", b"\x03", b"\x04", b"\x00", b"\x7e", b"\xc0", b"\x17")
FLAG_BYTES: Final = (b"\x7e", b"\xc0")
LINE_ENDS: Final = (b"\n", b"\r", b"\x03")
KNOWN_STARTS: Final = (b"\x02", b"\x01", b"\x7e", b"\xc0", b":", b"$", b"!", b"\xaa\x55")


@dataclass(frozen=True, slots=True)
class Scale:
    """The cost of each byte value of a recording, in bits; the places of pauses and connections."""

    costs: tuple[float, ...]
    counts: Counter[int]
    pauses: frozenset[int]
    starts: frozenset[int]
    total: int

    @property
    def is_text(self) -> bool:
        printable = sum([number for byte, number in self.counts.items() if byte in TEXT])
        return printable >= 0.75 * self.total


def make_bit_scale(stream: bytes, pauses: Iterable[int], starts: Iterable[int]) -> Scale:
    """Return the scale of a recording. Before each position in `pauses` the line was surely quiet."""
    counts = Counter(stream)
    total = max(1, len(stream))
    costs = tuple([-log2(counts[byte] / total) if counts[byte] else 0.0 for byte in range(256)])
    return Scale(costs, counts, frozenset(pauses), frozenset(starts), total)


def saved_bits(cut: Cut, scale: Scale, prefix: bytes, suffix: bytes, *, told_lengths: bool = False) -> float:
    """Return how many bits a cut saves. With `told_lengths`, the lengths of frames cost no bits."""
    good = cut.good
    if len(good) < 2:
        return 0.0
    columns = _column_savings(good, scale)
    lengths = [len(frame.content) for frame in good]
    said = 0.0 if told_lengths else _bits_of_lengths(lengths)
    saved = sum(columns.values()) - said
    if suffix:  # the alternative: the suffix gives the lengths, and its first byte costs each time
        ended = sum([bits for place, bits in columns.items() if place != -len(suffix)])
        saved = max(saved, ended)
    begun = {frame.start for frame in good}
    saved += _score_alignment(good, scale.pauses, cut.total)
    saved += EXCEPTION_BITS * (len(scale.starts & begun) - (1 if cut.left else 0))
    runs = len(cut.frames) - len(good)
    if cut.noise_runs:
        saved -= cut.noise_runs * max(EXCEPTION_BITS, log2(1 + cut.noise))
    saved += _score_marks(good, scale, prefix, suffix) - EXCEPTION_BITS * (1 + runs)
    return saved * (sum(lengths) / cut.total) ** 2  # bytes without a good frame count against it


def is_word_in_lines(good: Sequence[LocatedFrame], scale: Scale, suffix: bytes) -> bool:
    """Return whether a suffix is only a word in a text: nearly all frames have exactly one line end."""
    if not suffix or not scale.is_text or not set(suffix) <= TEXT:
        return False
    once = [any(frame.content.count(end) == 1 for end in LINE_ENDS) for frame in good]
    return sum(once) >= 0.9 * len(good)


def _column_savings(good: Sequence[LocatedFrame], scale: Scale) -> dict[int, float]:
    """Return the bits that each column saves: column 0 is a frame's first byte, column -1 its last byte."""
    shortest = min(len(frame.content) for frame in good)
    from_end = min(COMPARED_COLUMNS, shortest // 2)
    places = [*range(min(COMPARED_COLUMNS, shortest - from_end)), *range(-from_end, 0)]
    found = {}
    for place in places:
        bits = _bits_saved([frame.content[place] for frame in good], scale.costs)
        if bits > 0:
            found[place] = bits
    return found


def _bits_saved(column: Sequence[int], costs: Sequence[float]) -> float:
    """Return the bits that a column saves if earlier bytes predict each byte. A new value saves nothing."""
    seen = Counter(column)
    again = sum([costs[byte] * (number - 1) for byte, number in seen.items()])
    return again - _bits_of_order(seen.values())


def _bits_of_order(times: Collection[int]) -> float:
    return (lgamma(sum(times) + 1) - sum([lgamma(number) for number in times])) / log(2)


def _bits_of_lengths(lengths: Sequence[int]) -> float:
    each = log2(max(lengths) - min(lengths) + 1)
    seen = Counter(lengths)
    learned = each * len(seen) + _bits_of_order(seen.values())
    return 2 * log2(max(lengths) + 1) + min(len(lengths) * each, learned)


def _score_alignment(good: Sequence[LocatedFrame], pauses: frozenset[int], total: int) -> float:
    inner = {place for place in pauses if 0 < place < total}
    ends = {frame.end for frame in good} | {frame.start for frame in good}
    ends -= {0, total}
    if not inner or not ends:
        return 0.0
    both = len(inner & ends)
    free = total - 1 - len(ends)
    plain = _log2_choices(total - 1, len(inner))
    by_frames = _log2_choices(len(ends), both) + _log2_choices(free, len(inner) - both)
    return max(0.0, plain - by_frames - log2(len(inner) + 1))


def _log2_choices(of: int, some: int) -> float:
    """Return log2 of the number of ways to choose `some` of `of`."""
    if not 0 < some < of:
        return 0.0
    return (lgamma(of + 1) - lgamma(some + 1) - lgamma(of - some + 1)) / log(2)


def _score_marks(good: Sequence[LocatedFrame], scale: Scale, prefix: bytes, suffix: bytes) -> float:
    number, bits = len(good), 0.0
    if (suffix in KNOWN_ENDS or suffix.lstrip(b"\r\n") in KNOWN_ENDS) and (scale.is_text or len(suffix) > 1):
        bits += min(2.0 * number, MOST_MARK_BITS)
    if prefix in KNOWN_STARTS and scale.is_text:
        bits += min(1.0 * number, MOST_MARK_BITS / 2)
    empty = sum([len(frame.content) <= len(prefix) + len(suffix) for frame in good])
    most = number * 3 if suffix in FLAG_BYTES else number  # a flag may also begin frames, or fill pauses
    if suffix and empty * 5 <= most and not (scale.is_text and suffix[-1] in TEXT):
        bits += min(_frequency_bits(suffix[-1], scale), MOST_MARK_BITS)
    return bits


def _frequency_bits(byte: int, scale: Scale) -> float:
    """Return how unlikely the frequency of a byte is, in bits."""
    share, even = scale.counts[byte] / scale.total, 1 / max(2, len(scale.counts))
    if share <= even or share == 1:
        return 0.0
    odd = share * log2(share / even) + (1 - share) * log2((1 - share) / (1 - even))
    return max(0.0, scale.total * odd - EXCEPTION_BITS)
