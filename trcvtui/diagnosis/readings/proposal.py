"""The advice on framings: frozen proposals, the best first, each with its evidence in sentences."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from trcvtui.blocks.framing import Framing
from trcvtui.blocks.serial.com_buffer import LineRecording
from trcvtui.diagnosis.readings.marks import constant_bytes_between
from trcvtui.diagnosis.readings.trial import KNOWN_ENDS, KNOWN_STARTS, TEXT, Cut, LengthField, LocatedFrame
from trcvtui.udt.literals import format_duration
from trcvtui.wording import count

MOST_SHOWN: Final = 8  # frames of a preview
MOST_BYTES_SHOWN: Final = 48  # of each
CONTROL_NAMES: Final = {
    0x00: "NUL", 0x01: "SOH", 0x02: "STX", 0x03: "ETX", 0x04: "EOT", 0x05: "ENQ", 0x06: "ACK", 0x0A: "LF",
    0x0D: "CR", 0x09: "TAB", 0x15: "NAK", 0x17: "ETB", 0x1B: "ESC", 0x20: "SP",
}  # fmt: skip


class CutKind(StrEnum):
    PREFIX = "constant prefix"
    SUFFIX = "constant suffix"
    PREFIX_SUFFIX = "constant prefix and suffix"
    LENGTH = "length field"
    SIZE = "fixed size"
    GAP = "gap"


@dataclass(frozen=True, slots=True)
class PreviewFrame:
    """A frame of a preview: its first bytes, its size and its place in the recording, and what ended it."""

    content: bytes
    size: int
    start: int
    ending: str


@dataclass(frozen=True, slots=True)
class Proposal:
    """One way to cut the recording.

    `rank` counts from 1. Proposals that cut alike share a rank. `framing` is the setting of ReceiveData.
    If `framing` is None, `field` is the length field by which a program must cut, and `instead` says how.
    Of all `of_frames` frames, `frames` ended as they should, with `explained` of `total` bytes.
    Other bytes are counted in `noise`, `left` and `broken`. `longest` is the size of the longest frame.
    """

    rank: int
    kind: CutKind
    title: str
    framing: Framing | None
    field: LengthField | None
    evidence: tuple[str, ...]
    doubt: tuple[str, ...]
    instead: str
    frames: int
    of_frames: int
    explained: int
    total: int
    noise: int
    left: int
    broken: int
    longest: int
    preview: tuple[PreviewFrame, ...]


@dataclass(frozen=True, slots=True)
class FramingAdvice:
    """The proposals, the best first. `said` says what the proposals are based on, or why there are none."""

    proposals: tuple[Proposal, ...]
    said: str

    def text(self) -> str:
        lines = [self.said]
        first: dict[int, int] = {}
        for number, each in enumerate(self.proposals, 1):
            alike = first.setdefault(each.rank, number)
            lines.append(f"{number}. {each.title}{f' (cuts as {alike} does)' if alike != number else ''}")
            lines += [f"   {sentence}" for sentence in (*each.evidence, *each.doubt)]
            lines += [f"   {each.instead}"] if each.instead else []
        return "\n".join(lines)


def make_preview(frames: tuple[LocatedFrame, ...]) -> tuple[PreviewFrame, ...]:
    return tuple(
        [
            PreviewFrame(frame.content[:MOST_BYTES_SHOWN], len(frame.content), frame.start, str(frame.ending))
            for frame in frames[:MOST_SHOWN]
        ]
    )


def spell(mark: bytes) -> str:
    """Return a mark as `0D 0A (CR LF)`."""
    names = [CONTROL_NAMES.get(byte, f"'{chr(byte)}'" if 0x20 < byte < 0x7F else "") for byte in mark]
    return f"{mark.hex(' ').upper()} ({' '.join(names)})" if all(names) else mark.hex(" ").upper()


FEW_FRAMES: Final = 5
BYTE_ORDER_TEXTS: Final = {"big": "high byte first", "little": "low byte first"}


def make_title(kind: CutKind, framing: Framing, field: LengthField | None) -> str:
    if field is not None:
        width = "byte" if field.width == 1 else f"bytes, {BYTE_ORDER_TEXTS[field.order]}"
        return f"length field: {field.width} {width}, at byte {field.position}; {_length_meaning(field)}"
    parts = [f"prefix {spell(framing.prefix)}"] if framing.prefix else []
    parts += [f"suffix {spell(framing.suffix)}"] if framing.suffix else []
    if not framing.suffix:
        ends_by_gap = framing.timeout_ns != 0
        parts.append(
            f"a gap of {format_duration(framing.timeout_ns)}" if ends_by_gap else f"fixed size {framing.size}"
        )
    return ", ".join(parts)


def _length_meaning(field: LengthField) -> str:
    if field.more == 0:
        return "counts the whole frame"
    after = field.more - field.head_size
    if after == 0:
        return "counts the bytes after it"
    if after > 0:
        return f"counts the bytes after it except the last {after}"
    return f"a frame has {field.more} bytes more than it says"


def list_evidence(
    kind: CutKind, framing: Framing, field: LengthField | None, made: Cut, recording: LineRecording
) -> tuple[str, ...]:
    """Return the evidence for a cut, the most telling first."""
    good, stream = made.good, b"".join([chunk.payload for chunk in recording.chunks])[: made.total]
    number, frames = len(good), count(len(made.frames), "frame")
    texts = []
    is_both = framing.prefix == framing.suffix
    if framing.suffix:
        elsewhere = stream.count(framing.suffix) - number * (2 if is_both else 1)
        texts.append(f"{number} of {frames} end in {spell(framing.suffix)}{_else(framing.suffix, elsewhere)}")
    if framing.prefix:
        elsewhere = stream.count(framing.prefix) - number * (2 if is_both else 1)
        texts.append(
            f"{number} of {frames} begin with {spell(framing.prefix)}{_else(framing.prefix, elsewhere)}"
        )
    if field is not None:
        texts.append(
            f"{number} lengths lead from frame to frame, the last to byte {good[-1].end} of {made.total}"
        )
    if framing.timeout_ns and not framing.suffix:
        texts.append(
            f"{count(number, 'pause')} of {format_duration(framing.timeout_ns)} or longer, no other near it"
        )
    lengths = sorted({len(frame.content) for frame in good})
    size = (
        f"all of {count(lengths[0], 'byte')}"
        if len(lengths) == 1
        else f"of {lengths[0]} to {lengths[-1]} bytes"
    )
    explained = sum([len(frame.content) for frame in good])
    texts.append(f"{count(number, 'frame')}, {size}: {explained} of {count(made.total, 'byte')}")
    borders = _count_chunk_borders(made, recording)
    if borders is not None:
        texts.append(f"{borders[0]} of {borders[1]} chunks begin where a frame does")
    return (*texts, *_describe_rest(made))


def _else(mark: bytes, elsewhere: int) -> str:
    plain = mark.hex(" ").upper()
    if elsewhere <= 0:
        return f"; {plain} occurs nowhere else"
    return f"; {plain} occurs {'once' if elsewhere == 1 else f'{elsewhere} times'} elsewhere"


def _count_chunk_borders(made: Cut, recording: LineRecording) -> tuple[int, int] | None:
    """Return how many chunks begin at a border of frames, and how many there are, or None for too few."""
    starts, at = [], 0
    for chunk in recording.chunks:
        if at >= made.total:
            break
        starts.append(at)
        at += len(chunk.payload)
    ends = {frame.end for frame in made.good} | {frame.start for frame in made.good}
    both = len(ends & set(starts))
    return (both, len(starts)) if len(starts) > 2 and 2 * both > len(starts) else None


def _describe_rest(made: Cut) -> list[str]:
    rest = []
    bad = (
        [frame for frame in made.frames if frame not in made.good]
        if len(made.good) < len(made.frames)
        else []
    )
    if bad:
        size = sum([len(frame.content) for frame in bad])
        rest.append(f"{count(size, 'byte')} in {count(len(bad), 'frame')} without that end")
    if made.noise:
        rest.append(f"{count(made.noise, 'byte')} of noise before a prefix")
    if made.broken:
        rest.append(f"{count(made.broken, 'byte')} whose connection ended before the frame did")
    if made.left:
        rest.append(f"{count(made.left, 'byte')} at the end that are no whole frame yet")
    return [f"left over: {'; '.join(rest)}"] if rest else []


def list_doubts(kind: CutKind, framing: Framing, made: Cut, recording: LineRecording) -> tuple[str, ...]:
    doubt = []
    if framing.timeout_ns and recording.source == "tcp":
        doubt.append("a gap over TCP is a guess: the network joins and splits what was sent")
    if len(made.good) < FEW_FRAMES:
        doubt.append(f"{count(len(made.good), 'frame')} are few: record more")
    if framing.prefix and (len(made.good) < FEW_FRAMES or not _has_usual_prefix(framing)):
        doubt.append(f"{spell(framing.prefix)} may be data that has not changed yet")
    if framing.suffix and set(framing.suffix) <= TEXT and framing.suffix not in KNOWN_ENDS:
        doubt.append(f"{spell(framing.suffix)} may be data")
    lone = sum([frame.content == framing.suffix for frame in made.good])
    if lone * 3 >= len(made.good):
        frames = count(len(made.good), "frame")
        doubt.append(f"{lone} of {frames} are {spell(framing.suffix)} alone: it may begin frames too")
    left_out = constant_bytes_between(made.good) if kind is CutKind.PREFIX_SUFFIX else 0
    if left_out:
        between = f"{count(left_out, 'byte')} {'is' if left_out == 1 else 'are'} between nearly all frames"
        doubt.append(f"{between}: a check after the suffix? ReceiveData drops it")
    if kind is CutKind.SIZE:
        doubt.append("nothing marks a start: one lost byte shifts all frames after it until Reset")
    if kind is CutKind.PREFIX and not framing.timeout_ns and made.noise == 0:
        doubt.append("all frames have one size so far, which may change")
    return tuple(doubt)


def _has_usual_prefix(framing: Framing) -> bool:
    """Return whether the prefix is usual. Prefix 01 without a suffix is not usual: 01 may be an address."""
    if framing.prefix == framing.suffix:
        return True
    return framing.prefix in KNOWN_STARTS and (framing.suffix != b"" or framing.prefix != b"\x01")


def describe_workaround(field: LengthField | None) -> str:
    """Return how a program does what ReceiveData cannot."""
    if field is None:
        return ""
    cannot = "cannot be set: ReceiveData has no length field"
    jobs = f"LEN of TRCV_C (or SizeReceiveData) = {field.head_size} for the head, then = what the head says"
    return f"{cannot}; a program does it with two jobs: {jobs}"
