"""What else than the layout may be wrong with bytes: something before or after a message, exchanged bytes.

Rule: a cause is tried only where the lengths of the messages allow it; each says how rare it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, Literal, NamedTuple

from trcvtui.udt.compare.likelihood import chance, pairs_exchanged, words_exchanged

HEADER, TRAILER, LONG, SHORT = "header", "trailer", "long", "short"
WORD_SWAP, BYTE_SWAP = "word-swap", "byte-swap"
MOST_EXTRA: Final = 8  # bytes of a header or a trailer

Change = Callable[[bytes], bytes]


class Cause(NamedTuple):
    """One cause: its kind, its number of bytes, how it is undone, and the points that it costs.

    `front`: bytes before the members that are no members, below 0 bytes that are missing there; `back` the
    same after them. `of_member` changes the bytes of a number by size, `of_all` those of a whole message.
    """

    kind: str | None = None
    n: int = 0
    front: int = 0
    back: int = 0
    cost: float = 0.0
    about: str = ""
    of_member: dict[int, Change] | None = None
    of_all: Change | None = None

    def __str__(self) -> str:
        """Return the cause as it stands behind a profile: "" for none."""
        bytes_ = "1 byte" if self.n == 1 else f"{self.n} bytes"
        return (
            {
                HEADER: f"{bytes_} before it",
                TRAILER: f"{bytes_} after it",
                LONG: f"{bytes_} long",
                SHORT: f"{bytes_} short",
                WORD_SWAP: "words exchanged (CDAB)",
                BYTE_SWAP: "bytes exchanged in 16 bits (BADC)",
            }.get(self.kind or "", "")
            .replace("1 byte long", "one byte long")
            .replace("1 byte short", "one byte short")
        )


def _in_pairs(raw: bytes) -> bytes:
    """Return the words of each 32 bits exchanged."""
    out, end = bytearray(raw), len(raw) & ~3
    for to, place in enumerate((2, 3, 0, 1)):  # by slices: a message may have 4 MiB
        out[to:end:4] = raw[place:end:4]
    return bytes(out)


NONE: Final = Cause()
_words: Final[dict[int, Change]] = {4: words_exchanged, 8: words_exchanged}
_bytes: Final[dict[int, Change]] = dict.fromkeys((2, 4, 8), pairs_exchanged)
# A swap of words in one byte order and a swap of bytes in the other one are often the same bytes: they cost
# the same, and the one in our own byte order comes first.
SWAPS: Final = (
    Cause(WORD_SWAP, cost=-3.5, about="of each number of 4 and 8 bytes", of_member=_words),
    Cause(WORD_SWAP, cost=-3.5, about="of each number of 4 bytes", of_member={4: words_exchanged}),
    Cause(
        WORD_SWAP,
        cost=-4.0,
        about="of each number of 4 bytes, and of each half of 8",
        of_member={4: words_exchanged, 8: _in_pairs},
    ),
    Cause(WORD_SWAP, cost=-3.5, about="of every 4 bytes of the message", of_all=_in_pairs),
    Cause(BYTE_SWAP, cost=-3.5, about="of the whole message", of_all=pairs_exchanged),
    Cause(BYTE_SWAP, cost=-3.5, about="of each number", of_member=_bytes),
)
EXTRA: Final = (
    *(Cause(HEADER, n, front=n, cost=-2.5) for n in range(1, MOST_EXTRA + 1)),
    *(Cause(TRAILER, n, back=n, cost=-2.5) for n in range(1, MOST_EXTRA + 1)),
    Cause(LONG, 1, back=1, cost=-3.0),
    Cause(SHORT, 1, back=-1, cost=-3.0, about="its last byte is missing"),
    Cause(SHORT, 1, front=-1, cost=-5.0, about="its first byte is missing"),
)
CAUSES: Final = (NONE, *SWAPS, *EXTRA)

# What stands after a message, with the logarithm of how likely.
ENDINGS: Final = {
    b"\r\n": ("CR LF", 0.4), b"\n": ("LF", 0.1), b"\r": ("CR", 0.1), b"\x03": ("ETX", 0.05),
    b"\x04": ("EOT", 0.02), b"\n\r": ("LF CR", 0.01), b"\r\n\0": ("CR LF NUL", 0.02),
    b"\0\r\n": ("NUL CR LF", 0.02), b"\x03\r\n": ("ETX CR LF", 0.02), b"\r\n\r\n": ("CR LF CR LF", 0.02),
}  # fmt: skip
OWN_ENDING: Final = 0.15  # anything else of two or more bytes
ZEROS_AFTER: Final = 0.002  # zeros are padding more often than a trailer
ORDERS: Final[tuple[Literal["big", "little"], ...]] = ("big", "little")
LENGTH_FIELD: Final = 0.5  # how often a header has the length


def extra_points(cause: Cause, extra: bytes, size: int) -> tuple[float, str] | None:
    """Return what the bytes before or after one message say, and what they are; None where it is not so."""
    shown = extra.hex(" ").upper()
    if cause.kind == HEADER:
        field = length_field(extra, size)
        if field is not None:
            part, words = field
            return math.log(LENGTH_FIELD / 8 / cause.n) - chance(part), f"before it stands {shown}, {words}"
        return math.log(1 - LENGTH_FIELD), f"before it stands {shown}"
    if cause.kind == TRAILER:
        known = ENDINGS.get(extra)
        if known is not None:
            return math.log(known[1]) - chance(extra), f"after it stands {shown}, {known[0]}"
        if cause.n == 1:
            return None  # then it is a byte too many
        if not any(extra):
            return math.log(ZEROS_AFTER), f"after it stand {cause.n} zeros"
        return math.log(OWN_ENDING), f"after it stands {shown}"
    if cause.kind == LONG:
        return -0.5, f"one byte too many: {shown}"
    return 0.0, f"one byte too few: {cause.about}" if cause.kind == SHORT else ""


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


def cut(cause: Cause, size: int, messages: Sequence[bytes], framed: bool, most: int) -> Cutting:
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
    extras: list[bytes] = []
    lead = bytes(max(-cause.front, 0))
    for message, start, length in whole[-most:]:
        piece = message[start : start + length]
        first, last = max(cause.front, 0), length - max(cause.back, 0)
        unit = lead + piece[first:last]
        units.append(cause.of_all(unit) if cause.of_all else unit)
        extras.append(piece[:first] or piece[last:])
    return Cutting(tuple(units), tuple(extras), fitting, several)


class Cutting(NamedTuple):
    """Messages of the type's size, what stood before or after each, how many fit, how many are in one."""

    units: tuple[bytes, ...]
    extras: tuple[bytes, ...]
    fitting: int
    several: int
