"""Borders of messages inside writes, found by a length field, a delimiter, or a head before each body.

Rule: sizes alone prove nothing. Proof is a length that leads from border to border, or a recurring end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from trcvtui.diagnosis.line_facts import SegmentFacts

FEW_MESSAGES: Final = 3
LEAST_MESSAGES: Final = 8  # fewer do not prove a length field
MOST_MESSAGES: Final = 512  # that are examined
LAST_PLACE: Final = 9  # of a length field
LENGTH_OFFSETS: Final = range(-8, 65)  # bytes of a message that its length may not count
DELIMITERS: Final = (b"\r\n", b"\n", b"\r", b"\x03")
LONGEST_HEAD: Final = 64
PAUSE_RATIO: Final = 2  # the pause after a body is so many times that after its head


class MessageLength(NamedTuple):
    """A length field of `width` bytes at byte `at`. Its number plus `more` is the size of the message."""

    at: int
    width: int
    order: str
    more: int

    def message_size(self, message: bytes) -> int:
        """Return the size of the message, or 0 if `message` is too short to contain the length."""
        end = self.at + self.width
        number = int.from_bytes(message[self.at : end], self.order)  # type: ignore[arg-type]
        return number + self.more if len(message) >= end else 0

    @property
    def counts_all_or_rest(self) -> bool:
        """Return whether the length counts all bytes of the message, or the bytes after the length."""
        return self.more in (0, self.at + self.width)


def find_length_field(messages: Sequence[bytes]) -> MessageLength | None:
    """Return the length field that fits every message, or None if none fits or a fit may be chance."""
    lengths = {len(one) for one in messages}
    if len(lengths) < 2 or len(messages) < LEAST_MESSAGES:
        return None
    places = sorted(
        _find_lengths(messages[:MOST_MESSAGES], min(lengths)),
        key=lambda one: (not one.counts_all_or_rest, one.at % one.width, -one.width, one.at),
    )
    return next((one for one in places if one.counts_all_or_rest or len(lengths) > 2), None)


def _find_lengths(messages: Sequence[bytes], shortest: int) -> Iterator[MessageLength]:
    first, rest = messages[0], messages[1:]
    for width in (4, 2, 1):
        for at in range(min(LAST_PLACE, shortest - width + 1)):
            for order in ("big", "little") if width > 1 else ("big",):
                more = len(first) - MessageLength(at, width, order, 0).message_size(first)
                place = MessageLength(at, width, order, more)
                if more in LENGTH_OFFSETS and all(place.message_size(one) == len(one) for one in rest):
                    yield place


def count_messages(place: MessageLength, content: bytes) -> int:
    """If the lengths lead exactly to the end of the bytes, return the number of messages, else 0."""
    at = number = 0
    while at < len(content):
        size = place.message_size(content[at : at + place.at + place.width])
        if size < place.at + place.width:
            return 0
        at, number = at + size, number + 1
    return number if at == len(content) else 0


# -- several messages in one write ---------------------------------------------------------------------------


class Joints(NamedTuple):
    """Writes with several messages: how many in each write, the proof, and the remedy."""

    numbers: tuple[int, ...]
    proof: str
    mend: str


def find_joined_messages(parts: Sequence[bytes]) -> Joints | None:
    """Return how messages are joined if some writes have several and others one, or None without proof."""
    ways = (*_joined_by_mark(parts), *_joined_by_length(parts)) if parts else ()
    several = (one for one in ways if sum(number > 1 for number in one.numbers) >= FEW_MESSAGES)
    return next((one for one in several if one.numbers.count(1) >= 2), None)


def _joined_by_mark(parts: Sequence[bytes]) -> Iterator[Joints]:
    """Yield each delimiter that ends every write, if nearly all messages begin with the same two bytes."""
    for mark in DELIMITERS:
        if all(part.endswith(mark) for part in parts):
            lines = [line for part in parts for line in part.split(mark)[:-1]]
            begin, often = Counter(line[:2] for line in lines).most_common(1)[0]
            if len(begin) == 2 and often * 10 >= 9 * len(lines):
                shown = mark.hex(" ").upper()
                mend = f"cut messages at {shown} in the program (TwinCAT: ReceiveData with that suffix)"
                yield Joints(tuple(part.count(mark) for part in parts), f"each message ends in {shown}", mend)


def _joined_by_length(parts: Sequence[bytes]) -> Iterator[Joints]:
    """Yield the length fields by which each write can be split into messages."""
    shortest = min(parts, key=len)
    for place in _find_lengths([shortest], len(shortest)):
        numbers = tuple([count_messages(place, part) for part in parts]) if place.counts_all_or_rest else (0,)
        if all(numbers) and (place.width > 1 or len(set(map(len, parts))) > 2):
            head = place.at + place.width
            mend = f"two jobs: LEN {head} for the head, then as many bytes as the head says"
            yield Joints(numbers, f"the length at byte {place.at} leads to the next message", mend)


# -- head and body -------------------------------------------------------------------------------------------


class HeadAndBody(NamedTuple):
    """Messages in two writes: size of the head, sizes of head plus body, usual pause between the writes."""

    head: int
    sizes: frozenset[int]
    pairs: int
    pause_ns: int
    proof: str


def find_head_and_body(writes: Sequence[SegmentFacts], content: bytes, need: int) -> HeadAndBody | None:
    """Return head and body if each second write is the body of the head before, or None without proof.

    The proof is a length in the head, or that head and body together always have the size of a job.
    """
    pairs = [*zip(writes[::2], writes[1::2], strict=False)]
    head = pairs[0][0].size if len(pairs) >= FEW_MESSAGES else 0
    if not 0 < head <= LONGEST_HEAD or any(a.size != head or b.size <= head for a, b in pairs):
        return None
    pauses = [b.ns - a.ns for a, b in pairs]
    others = [b.ns - a.ns for (_, a), (b, _) in pairwise(pairs)]
    wholes = [content[a.at : b.at + b.size] for a, b in pairs if b.at + b.size <= len(content)]
    sizes = frozenset(a.size + b.size for a, b in pairs)
    if len(wholes) < FEW_MESSAGES or max(pauses) * PAUSE_RATIO > min(others):
        return None  # pauses do not separate pairs
    proof = "the head gives the length" if _has_length_in_head(wholes, head) else ""
    if not proof and sizes == {need}:
        proof = f"head and rest together always have {need} bytes"
    return HeadAndBody(head, sizes, len(pairs), sorted(pauses)[len(pauses) // 2], proof) if proof else None


def _has_length_in_head(wholes: Sequence[bytes], head: int) -> bool:
    """Return whether a head has the length of the message or of its body, in two bytes or more."""
    lengths = {len(whole) for whole in wholes}
    return any(
        place.counts_all_or_rest and place.at + place.width <= head and (place.width > 1 or len(lengths) > 2)
        for place in _find_lengths(wholes[:MOST_MESSAGES], head)
    )
