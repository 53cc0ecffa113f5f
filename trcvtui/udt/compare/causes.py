"""What else may be wrong with messages: bytes beside the type, exchanged bytes, blanks; each with its points.

A cause is tried only where the lengths of the messages allow it, and says how rare it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import Final, Literal, NamedTuple

from trcvtui.errors import one_line
from trcvtui.udt.compare.checksums import CHECKSUMS
from trcvtui.udt.compare.likelihood import chance, pairs_exchanged, words_exchanged

HEADER, TRAILER, LONG, SHORT = "header", "trailer", "long", "short"
WORD_SWAP, BYTE_SWAP, BLANKS = "word-swap", "byte-swap", "blanks"
MORE, FEWER, WIDTH = "more", "fewer", "width"  # of a member of the sender's type
DRIFTS: Final = (MORE, FEWER, WIDTH)
MOST_EXTRA: Final = 64  # bytes of a header or a trailer
MOST_OF_STREAM: Final = 8  # the same where no message ends, or several are one
MOST_AFTER: Final = 4  # bytes after a message that has some before it, too

Change = Callable[[bytes], bytes]


class FitCause(NamedTuple):
    """One cause: its kind, its number of bytes, how it is undone, and the points that it costs.

    `front`: bytes before the members that are no members, below 0 bytes that are missing there; `back` the
    same after them. `of_member` changes the bytes of a number by size, `of_text` those of a text, `of_all`
    those of a whole message. `member` is where the sender's type differs from ours, `theirs` its type there.
    """

    kind: str | None = None
    n: int = 0
    front: int = 0
    back: int = 0
    cost: float = 0.0
    about: str = ""
    of_member: dict[int, Change] | None = None
    of_all: Change | None = None
    of_text: Change | None = None
    member: str = ""
    theirs: str = ""

    def __str__(self) -> str:
        """Return the cause as it stands after a profile: "" for none."""
        count, more = (
            "1 bit" if self.kind == MORE and not self.n else _bytes_text(self.n),
            _bytes_text(self.back),
        )
        words = _IN_WORDS.get(self.kind or "", "").format(
            count, member=one_line(self.member), theirs=one_line(self.theirs)
        )
        return f"{words} and {more} after it" if self.kind == HEADER and self.back else words

    def can_fit(self, size: int, framed: bool, lengths: Collection[int]) -> bool:
        """Return whether a message of one of these lengths can be the type of this size with this cause."""
        period = size + self.front + self.back
        if max(self.front, self.back) > MOST_OF_STREAM or self.front > 0 < self.back:
            is_several = not (self.front + self.back) % max(size, 1)  # of the same type
            return framed and period in lengths and not is_several
        if not framed:
            return period > 0
        return period > 0 and any(length % period == 0 for length in lengths)


def _bytes_text(number: int) -> str:
    return "1 byte" if number == 1 else f"{number} bytes"


_IN_WORDS: Final = {
    HEADER: "{} before it",
    TRAILER: "{} after it",
    LONG: "one byte long",
    SHORT: "one byte short",
    WORD_SWAP: "words exchanged (CDAB)",
    BYTE_SWAP: "bytes exchanged in 16 bits (BADC)",
    BLANKS: "texts filled with blanks",
    MORE: "{} more before {member}",
    FEWER: "without {member}",
    WIDTH: "{member} as {theirs}",
}


def _in_pairs(raw: bytes) -> bytes:
    """Return the words of each 32 bits exchanged."""
    out, end = bytearray(raw), len(raw) & ~3
    for to, place in enumerate((2, 3, 0, 1)):  # by slices: a message may have 4 MiB
        out[to:end:4] = raw[place:end:4]
    return bytes(out)


NONE: Final = FitCause()
_words: Final[dict[int, Change]] = {4: words_exchanged, 8: words_exchanged}
_bytes: Final[dict[int, Change]] = dict.fromkeys((2, 4, 8), pairs_exchanged)
# A swap of words in one byte order and a swap of bytes in the other one are often the same bytes: they cost
# the same, and the one in our own byte order comes first.
SWAPS: Final = (
    FitCause(WORD_SWAP, cost=-3.5, about="of each number of 4 and 8 bytes", of_member=_words),
    FitCause(WORD_SWAP, cost=-3.5, about="of each number of 4 bytes", of_member={4: words_exchanged}),
    FitCause(
        WORD_SWAP,
        cost=-4.0,
        about="of each number of 4 bytes, and of each half of 8",
        of_member={4: words_exchanged, 8: _in_pairs},
    ),
    FitCause(WORD_SWAP, cost=-3.5, about="of every 4 bytes of the message", of_all=_in_pairs),
    FitCause(BYTE_SWAP, cost=-3.5, about="of the whole message", of_all=pairs_exchanged),
    FitCause(BYTE_SWAP, cost=-3.5, about="of each number", of_member=_bytes),
)
EXTRA: Final = (
    *(FitCause(HEADER, n, front=n, cost=-2.5) for n in range(1, MOST_EXTRA + 1)),
    *(FitCause(TRAILER, n, back=n, cost=-2.5) for n in range(1, MOST_EXTRA + 1)),
    FitCause(LONG, 1, back=1, cost=-3.0),
    FitCause(SHORT, 1, back=-1, cost=-3.0, about="its last byte is missing"),
    FitCause(SHORT, 1, front=-1, cost=-6.0, about="its first byte is missing"),
    *(
        FitCause(HEADER, n, front=n, back=back, cost=-5.0)
        for back in range(1, MOST_AFTER + 1)
        for n in range(1, MOST_OF_STREAM + 1)
    ),
)
BLANK_TEXTS: Final = FitCause(
    BLANKS, cost=-2.5, about="no NUL ends them", of_text=lambda raw: raw.rstrip(b" ").ljust(len(raw), b"\0")
)
CAUSES: Final = (NONE, *SWAPS, BLANK_TEXTS, *EXTRA)

# What stands after a message, with the logarithm of how likely.
ENDINGS: Final = {
    b"\r\n": ("CR LF", 0.4), b"\n": ("LF", 0.1), b"\r": ("CR", 0.1), b"\x03": ("ETX", 0.05),
    b"\x04": ("EOT", 0.02), b"\n\r": ("LF CR", 0.01), b"\r\n\0": ("CR LF NUL", 0.02),
    b"\0\r\n": ("NUL CR LF", 0.02), b"\x03\r\n": ("ETX CR LF", 0.02), b"\r\n\r\n": ("CR LF CR LF", 0.02),
}  # fmt: skip
CHECKSUM: Final = 0.02
MOST_CHECKED: Final = 2048  # bytes of a message of which checksums are made
OWN_ENDING: Final = 0.15  # anything else of two or more bytes
ZEROS_BEFORE: Final = 0.05
ZEROS_AFTER: Final = 0.002  # zeros are padding more often than a trailer
ORDERS: Final[tuple[Literal["big", "little"], ...]] = ("big", "little")
LENGTH_FIELD: Final = 0.5  # how often a header has the length


class ExtraEvidence(NamedTuple):
    """Points of the bytes beside one message, what they are, and whether that is known."""

    points: float
    text: str
    has_meaning: bool = True


def extra_evidence(cause: FitCause, before: bytes, unit: bytes, after: bytes) -> ExtraEvidence | None:
    """Return what the bytes before and after one message say; None where it is not so."""
    if cause.kind == LONG:
        is_known = _trailer(before, unit, after) is not None  # then it is no byte too many
        said = f"one byte too many: {_hex(after)}"
        return None if is_known else ExtraEvidence(-0.5, said, has_meaning=False)
    if cause.kind == SHORT:
        return ExtraEvidence(0.0, f"one byte too few: {cause.about}")
    head = _header(before, len(unit), len(after)) if before else None
    tail = _trailer(before, unit, after) if after else None
    if after and (tail is None or (before and not tail.has_meaning)):
        return None
    if head and tail:
        return ExtraEvidence(head.points + tail.points, f"{head.text}; {tail.text}", head.has_meaning)
    return head or tail or ExtraEvidence(0.0, "")


def _header(before: bytes, size: int, after: int) -> ExtraEvidence:
    said = f"before it stands {_hex(before)}"
    field = length_field(before, size + after) or length_field(before, size)
    if field is None:
        likely = 1 - LENGTH_FIELD if any(before) else ZEROS_BEFORE
        return ExtraEvidence(math.log(likely), said, has_meaning=False)
    part, words = field
    points = math.log(LENGTH_FIELD / 8 / len(before)) - chance(part)
    is_meant = len(part) * 2 >= len(before)  # else it may be one by chance
    return ExtraEvidence(points, f"{said}, {words}", is_meant)


def _trailer(before: bytes, unit: bytes, after: bytes) -> ExtraEvidence | None:
    said = f"after it stands {_hex(after)}"
    name, share = ENDINGS.get(after) or (_checksum(before, unit, after), CHECKSUM)
    if name:
        return ExtraEvidence(math.log(share) - chance(after), f"{said}, {name}")
    if len(after) == 1:
        return None  # then it is a byte too many
    if not any(after):
        return ExtraEvidence(math.log(ZEROS_AFTER), f"after it stand {len(after)} zeros", has_meaning=False)
    return ExtraEvidence(math.log(OWN_ENDING), said, has_meaning=False)


def _checksum(before: bytes, unit: bytes, after: bytes) -> str:
    """Return the name of the checksum that stands after a message; "" where it is none that is known."""
    if len(unit) > MOST_CHECKED:
        return ""
    for name, (width, of) in CHECKSUMS.items():
        if width == len(after):
            numbers = (of(before + unit), of(unit))
            if any(number.to_bytes(width, order) == after for number in numbers for order in ORDERS):
                return name
    return ""


def _hex(raw: bytes) -> str:
    return raw.hex(" ").upper()


def has_length_field(cause: FitCause, messages: Sequence[bytes], size: int) -> bool:
    """Return whether each message begins with the length of what follows it; one byte may be it by chance."""
    found = [length_field(one[: cause.n], size) for one in messages]
    return cause.kind == HEADER and all(one is not None and len(one[0]) * 2 >= cause.n for one in found)


def length_field(extra: bytes, size: int) -> tuple[bytes, str] | None:
    """Return the bytes of a header that are a length, and what it counts; None where there are none."""
    for width in (4, 2, 1):
        for at in range(len(extra) - width + 1):
            part = extra[at : at + width]
            counted = {
                size: "of the type",
                size + len(extra): "of all",
                size + len(extra) - at - width: "of what follows it",
            }
            for order in ORDERS:
                number = int.from_bytes(part, order)
                if number in counted:
                    form = "" if width == 1 else f", {order}-endian"
                    return part, f"the length {number} {counted[number]}{form}"
    return None


def cut(cause: FitCause, size: int, messages: Sequence[bytes], framed: bool, most: int) -> Cutting:
    """Return the messages cut for a type of `size` bytes, the last ones, what is over stays out."""
    period = size + cause.front + cause.back
    if period <= 0 or not size:
        return Cutting((), (), 0, 0)
    if not framed:
        messages = [b"".join(messages)]
    whole: list[tuple[bytes, int, int]] = []
    fitting, several = 0, 1
    for message in messages:
        count, over = divmod(len(message), period)
        if framed and (over or not count):
            continue
        fitting += 1
        several = max(several, count)
        whole += [(message, period * number, period) for number in range(max(count - most, 0), count)]
    units: list[bytes] = []
    extras: list[tuple[bytes, bytes]] = []
    lead = bytes(max(-cause.front, 0))
    for message, start, length in whole[-most:]:
        piece = message[start : start + length]
        first, last = max(cause.front, 0), length - max(cause.back, 0)
        unit = lead + piece[first:last]
        units.append(cause.of_all(unit) if cause.of_all else unit)
        extras.append((piece[:first], piece[last:]))
    return Cutting(tuple(units), tuple(extras), fitting, several)


class Cutting(NamedTuple):
    """Messages of the type's size, what stood before and after each, how many fit, how many are in one."""

    units: tuple[bytes, ...]
    extras: tuple[tuple[bytes, bytes], ...]
    fitting: int
    several: int
