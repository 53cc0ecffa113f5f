"""Cuts a stream of bytes into frames by prefix, suffix, size and gap; notes what ended each frame."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

from msgspec import Struct


class FrameEnding(StrEnum):
    SUFFIX = "suffix"
    SIZE = "size reached"
    OVERRUN = "size reached without the suffix"
    GAP = "gap"
    ZERO = "byte 00 in a text"


class Framing(Struct, frozen=True):
    """How to cut frames of at most `size` bytes. `timeout_ns` is the longest gap, and 0 sets no limit.

    If `text`, frames are STRINGs: a byte 00 ends a frame; a frame that `size` ends has not ended well.
    """

    size: int
    prefix: bytes = b""
    suffix: bytes = b""
    timeout_ns: int = 0
    text: bool = False

    def cuts_like(self, other: Framing) -> bool:
        """Return whether both framings cut frames alike; their timeouts may differ."""
        mine = self.size, self.prefix, self.suffix, self.text
        return mine == (other.size, other.prefix, other.suffix, other.text)

    def ended_by(self, ending: FrameEnding) -> str:
        """Return in words what ended a frame; the words for OVERRUN depend on whether there is a suffix."""
        is_full = ending is FrameEnding.OVERRUN and not self.suffix
        return "size reached, and there is no suffix" if is_full else str(ending)


class Frame(NamedTuple):
    """A frame; `content` includes prefix and suffix."""

    content: bytes
    ending: FrameEnding


class FeedResult(NamedTuple):
    """The result of one call of a framer: the number of bytes taken, and a frame if one is complete."""

    used: int
    frame: Frame | None = None


# Rule: frames do not depend on how the stream was cut: each search continues where the last one ended.
# Bounds: the part never exceeds the size of a frame; only the newest KEPT_NOISE_BYTES of noise are kept.

KEPT_NOISE_BYTES: Final = 256


class Framer:
    """Cuts a stream into frames and keeps an incomplete frame. `discarded` counts the bytes of noise.

    If `had_false_start`, the noise found in the last call contained the first byte of the prefix.
    """

    def __init__(self) -> None:
        self.discarded = 0
        self.had_false_start = False
        self.noise = b""  # its newest bytes
        self.last_byte: int | None = None  # ns
        self._part = bytearray()
        self._has_prefix = False
        self._framing: Framing | None = None  # of the part

    @property
    def busy(self) -> bool:
        """Return whether a frame has begun; noise does not begin a frame."""
        return bool(self._part)

    @property
    def partial_frame(self) -> bytes:
        """Return a copy of the frame that is not complete yet."""
        return bytes(self._part)

    @property
    def pending(self) -> int:
        """Return how many bytes of the incomplete frame have come."""
        return len(self._part)

    def framing_changed(self, framing: Framing) -> bool:
        """Return whether the incomplete frame began under another framing, apart from the timeout."""
        return self._framing is not None and bool(self._part) and not self._framing.cuts_like(framing)

    def flush(self) -> bytes:
        part = bytes(self._part)
        self._part.clear()
        self._has_prefix = False
        return part

    def feed(self, received: bytes, framing: Framing, now: int) -> FeedResult:
        """Take bytes up to the end of one frame; a call without bytes checks the gap."""
        self.had_false_start = False
        if not received:  # bytes that have come were in time: only silence makes a gap
            return FeedResult(0, self._end_by_gap(framing, now))
        self._framing, self.last_byte = framing, now
        used = 0 if self._has_prefix else self._seek_prefix(received, framing)
        if not self._has_prefix:
            return FeedResult(used)
        before = len(self._part)
        self._part += received[used : used + framing.size - before]
        used += len(self._part) - before
        found = self._find_end(before, framing)
        if found is None:
            return FeedResult(used)
        end, ending = found
        used -= len(self._part) - end  # what follows the end is of the next frame
        del self._part[end:]
        return FeedResult(used, Frame(self.flush(), ending))

    def _end_by_gap(self, framing: Framing, now: int) -> Frame | None:
        if not self._part or not framing.timeout_ns or self.last_byte is None:
            return None
        return Frame(self.flush(), FrameEnding.GAP) if now - self.last_byte >= framing.timeout_ns else None

    def _seek_prefix(self, received: bytes, framing: Framing) -> int:
        """Look for the prefix; return the number of used bytes. Keep last bytes that may begin a prefix."""
        head = framing.prefix[: framing.size]  # a frame has no room for more
        before = len(self._part)
        joined = bytes(self._part) + received
        at = joined.find(head)
        self._has_prefix = at >= 0
        start = at if self._has_prefix else len(joined) - _prefix_start_size(joined, head)
        end = start + len(head) if self._has_prefix else len(joined)
        self.had_false_start = head[:1] in joined[:start] if head else False
        self.discarded += start
        self.noise = (self.noise + joined[:start][-KEPT_NOISE_BYTES:])[-KEPT_NOISE_BYTES:]
        self._part[:] = joined[start:end]
        return end - before

    def _find_end(self, before: int, framing: Framing) -> tuple[int, FrameEnding] | None:
        """Return where a frame ends, and what ends it. The first `before` bytes were searched already."""
        prefix, suffix = framing.prefix, framing.suffix
        # A suffix may begin in the bytes of an earlier call, but not in the prefix.
        at = self._part.find(suffix, max(len(prefix), before - len(suffix) + 1)) if suffix else -1
        zero = self._part.find(0, 0, at if at >= 0 else None) if framing.text else -1
        if zero >= 0:
            return zero + 1, FrameEnding.ZERO  # a STRING cannot hold it
        if at >= 0:
            return at + len(suffix), FrameEnding.SUFFIX
        if len(self._part) < framing.size:
            return None
        good = not suffix and not framing.text and len(prefix) <= framing.size  # else no end came
        return framing.size, FrameEnding.SIZE if good else FrameEnding.OVERRUN


def _prefix_start_size(joined: bytes, head: bytes) -> int:
    """Return the size of the longest part, shorter than `head`, that ends `joined` and begins `head`."""
    longest = min(len(head) - 1, len(joined))
    return next((n for n in range(longest, 0, -1) if joined.endswith(head[:n])), 0)


class FrameSummary(NamedTuple):
    """A delivered frame: its size, the sizes of its prefix and suffix, and what ended the frame."""

    size: int
    prefix: int
    suffix: int
    ending: FrameEnding

    @property
    def is_good(self) -> bool:
        return self.ending in (FrameEnding.SUFFIX, FrameEnding.SIZE)


class FrameTally(NamedTuple):
    """Counts frames by how they ended, and dropped parts; `reason` is the last reason for a drop."""

    good: int = 0
    gaps: int = 0
    overruns: int = 0
    parts: int = 0
    reason: str = ""

    @property
    def frame_count(self) -> int:
        return self.good + self.gaps + self.overruns

    def count_ending(self, ending: FrameEnding) -> FrameTally:
        if ending is FrameEnding.GAP:
            return self._replace(gaps=self.gaps + 1)
        if ending is FrameEnding.OVERRUN:
            return self._replace(overruns=self.overruns + 1)
        return self._replace(good=self.good + 1)

    def count_dropped(self, reason: str) -> FrameTally:
        return self._replace(parts=self.parts + 1, reason=reason)


NO_FRAMES = FrameTally()


def summary_of(frame: Frame, framing: Framing) -> FrameSummary:
    """Return the summary of a frame; a frame that a gap has ended may have only part of the prefix."""
    size = len(frame.content)
    suffix = len(framing.suffix) if frame.ending is FrameEnding.SUFFIX else 0
    return FrameSummary(size, min(size, len(framing.prefix)), suffix, frame.ending)
