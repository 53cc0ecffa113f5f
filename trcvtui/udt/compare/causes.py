"""Causes of a mismatch other than the layout: extra bytes, exchanged bytes, blanks after a text.

A cause is tried only if the lengths of the messages allow it. A rare cause costs more points.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Final, NamedTuple

from trcvtui.errors import one_line
from trcvtui.udt.compare.likelihood import exchange_in_pairs, exchange_words

HEADER, TRAILER, BYTE_TOO_MANY, BYTE_TOO_FEW = "header", "trailer", "long", "short"
WORD_SWAP, BYTE_SWAP, BLANKS = "word-swap", "byte-swap", "blanks"
MEMBER_MORE, FEWER, WIDTH = "more", "fewer", "width"  # the sender's type differs in a member
DRIFTS: Final = (MEMBER_MORE, FEWER, WIDTH)
MOST_EXTRA_BYTES: Final = 64  # bytes of a header or a trailer
MOST_EXTRA_IN_STREAM: Final = 8  # the same in a stream, or if one message has several values of the type

BytesChange = Callable[[bytes], bytes]


class FitCause(NamedTuple):
    """One cause: its kind, its number of bytes, how to undo it, and the points that it costs.

    `front` and `back` count extra bytes before and after the members, or missing bytes if below 0.
    `of_member` undoes the cause in a number (by its size), `of_text` in a text, `of_all` in a message.
    `member` is the place where the sender's type differs from ours. `theirs` is the sender's type there.
    """

    kind: str | None = None
    n: int = 0
    front: int = 0
    back: int = 0
    cost: float = 0.0
    about: str = ""
    of_member: dict[int, BytesChange] | None = None
    of_all: BytesChange | None = None
    of_text: BytesChange | None = None
    member: str = ""
    theirs: str = ""
    is_guess: bool = False  # the bytes before and after need no known meaning

    def __str__(self) -> str:
        """Return the cause as text to follow the text of a profile, or "" without a cause."""
        count, more = (
            "1 bit" if self.kind == MEMBER_MORE and not self.n else _bytes_text(self.n),
            _bytes_text(self.back),
        )
        words = _CAUSE_TEXTS.get(self.kind or "", "").format(
            count, member=one_line(self.member), theirs=one_line(self.theirs)
        )
        return f"{words} and {more} at the end" if self.kind == HEADER and self.back else words

    def can_fit(self, size: int, framed: bool, lengths: Collection[int]) -> bool:
        """Return whether a message of one of these lengths can hold a type of this size with this cause."""
        period = size + self.front + self.back
        if max(self.front, self.back) > MOST_EXTRA_IN_STREAM:
            is_several = not (self.front + self.back) % max(size, 1)  # of the type, in one
            return framed and period in lengths and not is_several
        if not framed:
            return period > 0
        return period > 0 and any(length % period == 0 for length in lengths)


def _bytes_text(number: int) -> str:
    return "1 byte" if number == 1 else f"{number} bytes"


_CAUSE_TEXTS: Final = {
    HEADER: "{} in front",
    TRAILER: "{} at the end",
    BYTE_TOO_MANY: "one byte too long",
    BYTE_TOO_FEW: "one byte too short",
    WORD_SWAP: "words exchanged (CDAB)",
    BYTE_SWAP: "bytes exchanged in each word (BADC)",
    BLANKS: "texts filled with blanks",
    MEMBER_MORE: "{} extra before {member}",
    FEWER: "without {member}",
    WIDTH: "{member} as {theirs}",
}


def _swap_words(raw: bytes) -> bytes:
    """Return the bytes with the two words of each 32 bits exchanged."""
    out, end = bytearray(raw), len(raw) & ~3
    for to, place in enumerate((2, 3, 0, 1)):  # by slices: a message may have 4 MiB
        out[to:end:4] = raw[place:end:4]
    return bytes(out)


NONE: Final = FitCause()
_WORD_CHANGES: Final[dict[int, BytesChange]] = {4: exchange_words, 8: exchange_words}
_BYTE_CHANGES: Final[dict[int, BytesChange]] = dict.fromkeys((2, 4, 8), exchange_in_pairs)
# Swapped words in one byte order and swapped bytes in the other one are often the same bytes: they cost the
# same, and the one in our own byte order comes first.
SWAP_CAUSES: Final = (
    FitCause(WORD_SWAP, cost=-3.5, about="in each number of 4 or 8 bytes", of_member=_WORD_CHANGES),
    FitCause(WORD_SWAP, cost=-3.5, about="in each number of 4 bytes", of_member={4: exchange_words}),
    FitCause(
        WORD_SWAP,
        cost=-4.0,
        about="in each number of 4 bytes, and in both halves of one of 8",
        of_member={4: exchange_words, 8: _swap_words},
    ),
    FitCause(WORD_SWAP, cost=-3.5, about="in every 4 bytes of the message", of_all=_swap_words),
    FitCause(BYTE_SWAP, cost=-3.5, about="in the whole message", of_all=exchange_in_pairs),
    FitCause(BYTE_SWAP, cost=-3.5, about="in each number", of_member=_BYTE_CHANGES),
)
EXTRA_CAUSES: Final = (
    *(FitCause(HEADER, n, front=n, cost=-2.5) for n in range(1, MOST_EXTRA_BYTES + 1)),
    *(FitCause(TRAILER, n, back=n, cost=-2.5) for n in range(1, MOST_EXTRA_BYTES + 1)),
    FitCause(BYTE_TOO_MANY, 1, back=1, cost=-3.0),
    FitCause(BYTE_TOO_FEW, 1, back=-1, cost=-3.0, about="the last byte is missing"),
    FitCause(BYTE_TOO_FEW, 1, front=-1, cost=-6.0, about="the first byte is missing"),
)
BLANKS_CAUSE: Final = FitCause(
    BLANKS, cost=-2.5, about="no NUL ends them", of_text=lambda raw: raw.rstrip(b" ").ljust(len(raw), b"\0")
)
CAUSES: Final = (NONE, *SWAP_CAUSES, BLANKS_CAUSE, *EXTRA_CAUSES)


def cut_messages(
    cause: FitCause, size: int, messages: Sequence[bytes], framed: bool, most: int
) -> CutMessages:
    """Return the last `most` values in the messages, `size` bytes each, and the bytes beside each value."""
    period = size + cause.front + cause.back
    if period <= 0 or not size:
        return CutMessages((), (), 0, 0)
    if not framed:
        messages = [b"".join(messages)]
    whole: list[tuple[bytes, int, int]] = []
    fitting, several = 0, 1
    for message in messages:
        count, over = divmod(len(message), period)
        if framed and (over or not count):  # a message is whole values, nothing is left over
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
    return CutMessages(tuple(units), tuple(extras), fitting, several)


class CutMessages(NamedTuple):
    """Values, the bytes before and after each, how many messages fit, the most values in a message."""

    units: tuple[bytes, ...]
    extras: tuple[tuple[bytes, bytes], ...]
    fitting: int
    several: int
