"""Judges the bytes before and after the members: a length field, STX .. ETX, a checksum, CR LF, or unknown.

Rule: a reading with unexplained bytes is listed, but it is never called sure.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final, Literal, NamedTuple

from trcvtui.udt.compare.causes import BYTE_TOO_FEW, BYTE_TOO_MANY, HEADER, MOST_EXTRA_BYTES, FitCause
from trcvtui.udt.compare.checksums import CHECKSUMS
from trcvtui.udt.compare.likelihood import log_chance

# Endings of a message with their likelihood; below, marks at its begin.
END_MARKS: Final = {
    b"\r\n": ("CR LF", 0.4), b"\n": ("LF", 0.1), b"\r": ("CR", 0.1), b"\x03": ("ETX", 0.05),
    b"\x04": ("EOT", 0.02), b"\n\r": ("LF CR", 0.01), b"\r\n\0": ("CR LF NUL", 0.02),
    b"\0\r\n": ("NUL CR LF", 0.02), b"\x03\r\n": ("ETX CR LF", 0.02), b"\r\n\r\n": ("CR LF CR LF", 0.02),
}  # fmt: skip
START_MARKS: Final = {b"\x02": "STX", b"\x01": "SOH"}
CHECKSUM_SHARE: Final = 0.02
MOST_CHECKSUM_BYTES: Final = 2048  # of longer messages no checksum is calculated
OWN_ENDING_SHARE: Final = 0.15  # any other ending of two or more bytes
ZEROS_BEFORE_SHARE: Final = 0.05
ZEROS_AFTER_SHARE: Final = 0.002  # zeros are padding more often than a trailer
BLOCK_CHECK_NAME: Final = "xor8"  # devices call it BCC
INT_BYTE_ORDERS: Final[tuple[Literal["big", "little"], ...]] = ("big", "little")
LENGTH_FIELD_SHARE: Final = 0.5  # how often a header contains the length
BOTH_SIDES_POINTS: Final = -5.0  # points of a cause with bytes before and after


class ExtraEvidence(NamedTuple):
    """Points and text for the bytes beside a value, whether the bytes are known, a name for each side."""

    points: float
    text: str
    has_meaning: bool = True
    before: str = ""
    after: str = ""
    of_after: float = 0.0  # the part of `points` that the bytes after it have


def usual_length(lengths: Sequence[int]) -> int:
    """Return the length that at least half of the messages have, or 0."""
    (length, often), *_ = Counter(lengths).most_common(1) or [(0, 0)]
    return length if often * 2 >= len(lengths) else 0


def surrounding_causes(size: int, length: int) -> Iterator[FitCause]:
    """Yield a cause for each place of the type in a longer message, with bytes before and after."""
    extra = length - size
    if size and 1 < extra <= MOST_EXTRA_BYTES and extra % size:  # else it is several values of the type
        for front in range(1, extra):
            yield FitCause(HEADER, front, front=front, back=extra - front, cost=BOTH_SIDES_POINTS)


def extra_evidence(cause: FitCause, before: bytes, unit: bytes, after: bytes) -> ExtraEvidence | None:
    """Return the evidence of the bytes before and after a message, or None if they contradict the cause."""
    if cause.kind == BYTE_TOO_MANY:
        is_known = _judge_trailer(before, unit, after) is not None  # a known ending is a trailer
        text = f"one byte too many: {_hex_text(after)}"
        return None if is_known else ExtraEvidence(-0.5, text, has_meaning=False, of_after=-0.5)
    if cause.kind == BYTE_TOO_FEW:
        return ExtraEvidence(0.0, f"one byte too few: {cause.about}")
    tail = _judge_trailer(before, unit, after) if after else None
    if after and before and not cause.is_guess and (tail is None or not tail.has_meaning):
        return None  # bytes on both sides are likely only with a known ending
    if after and tail is None:
        if not before:
            return None
        tail = ExtraEvidence(math.log(OWN_ENDING_SHARE), f"behind: {_hex_text(after)}", has_meaning=False)
    head = _judge_header(before, len(unit), after) if before else None
    if head and tail:
        is_known = head.has_meaning and tail.has_meaning
        points, text = head.points + tail.points, f"{head.text}; {tail.text}"
        return ExtraEvidence(points, text, is_known, head.before, tail.after, tail.points)
    return head or (tail and tail._replace(of_after=tail.points)) or ExtraEvidence(0.0, "")


def _judge_header(before: bytes, size: int, after: bytes) -> ExtraEvidence:
    text = f"in front: {_hex_text(before)}"
    mark = next((mark for mark in START_MARKS if before.startswith(mark) and b"\x03" in after), b"")
    name = START_MARKS.get(mark, "")
    field = find_length_field(before, size + len(after)) or find_length_field(before, size)
    known = f"{text}, {name}" if mark else text
    if field is None:
        rest = before[len(mark) :]
        likely = 1 - LENGTH_FIELD_SHARE if any(before) else ZEROS_BEFORE_SHARE
        return ExtraEvidence(math.log(likely), known, not rest, "" if rest else name)
    part, words = field
    points = math.log(LENGTH_FIELD_SHARE / 8 / len(before)) - log_chance(part)
    is_meant = (len(mark) + len(part)) * 2 >= len(before)  # else it may be a length by chance
    named = ", ".join(filter(None, (name, f"with {words}")))
    return ExtraEvidence(points, f"{known}, {words}", is_meant, named if is_meant else "")


def _judge_trailer(before: bytes, unit: bytes, after: bytes) -> ExtraEvidence | None:
    text = f"behind: {_hex_text(after)}"
    name, share = END_MARKS.get(after) or _find_checksum(before, unit, after)
    if name:
        return ExtraEvidence(math.log(share) - log_chance(after), f"{text}, {name}", after=name)
    if len(after) == 1:
        return None  # BYTE_TOO_MANY explains it
    if not any(after):
        return ExtraEvidence(math.log(ZEROS_AFTER_SHARE), f"behind: {len(after)} zeros", has_meaning=False)
    return ExtraEvidence(math.log(OWN_ENDING_SHARE), text, has_meaning=False)


def _find_checksum(before: bytes, unit: bytes, after: bytes) -> tuple[str, float]:
    """Return name and share of a checksum after a message, with or without an end mark, or "" and 0."""
    if name := _checksum((before + unit, unit), after):
        return name, CHECKSUM_SHARE
    for mark, (ending, share) in END_MARKS.items():
        of, start, end = unit + mark, len(mark), -len(mark)
        if after.startswith(mark) and (name := _checksum((before + of, before[1:] + of, of), after[start:])):
            return f"{ending}, {name}", share * CHECKSUM_SHARE
        of = unit
        if after.endswith(mark) and (name := _checksum((before + of, before[1:] + of, of), after[:end])):
            return f"{name}, {ending}", share * CHECKSUM_SHARE
    return "", 0.0


def _checksum(contents: Sequence[bytes], after: bytes) -> str:
    if not after or len(contents[0]) > MOST_CHECKSUM_BYTES:
        return ""
    for name, (width, of) in CHECKSUMS.items():
        if width == len(after):
            numbers = map(of, contents)
            if any(number.to_bytes(width, order) == after for number in numbers for order in INT_BYTE_ORDERS):
                return f"BCC ({name})" if name == BLOCK_CHECK_NAME else name
    return ""


def _hex_text(raw: bytes) -> str:
    return raw.hex(" ").upper()


def has_length_field(cause: FitCause, messages: Sequence[bytes], size: int) -> bool:
    """Return whether a length field fills at least half of each header: a smaller one may be chance."""
    found = [find_length_field(one[: cause.n], size) for one in messages]
    return cause.kind == HEADER and all(one is not None and len(one[0]) * 2 >= cause.n for one in found)


def find_length_field(extra: bytes, size: int) -> tuple[bytes, str] | None:
    """Return the bytes of a header that hold a length, and what the length counts, or None."""
    for width in (4, 2, 1):
        for at in range(len(extra) - width + 1):
            part = extra[at : at + width]
            counted = {
                size: "of the type",
                size + len(extra): "of all bytes",
                size + len(extra) - at - width: "of the bytes that follow",
            }
            for order in INT_BYTE_ORDERS:
                number = int.from_bytes(part, order)
                if number in counted:
                    form = "" if width == 1 else f", {order}-endian"
                    return part, f"the length {number} {counted[number]}{form}"
    return None
