"""Which profile fits? Profiles ranked by what the bytes at hand say, with the reasons.

Rule: a tie is a tie, and is told with what the tied profiles differ in.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from trcvtui.udt.decode import decode_leaves
from trcvtui.udt.difference import difference
from trcvtui.udt.layout import Layout, Leaf
from trcvtui.udt.likelihood import SPARE, Hint, hint_of, spare_bits_hint, steady_hint
from trcvtui.udt.profiles import Profile, profiles_for, same_layouts
from trcvtui.udt.types import Type

MOST_LEAVES: Final = 256  # that are looked at
MOST_MESSAGES: Final = 8  # the last ones
MOST_GAPS: Final = 16  # that are looked at
NAMED: Final = 3  # members that a sentence names
TIE: Final = 0.05  # points

# The points of what is no member; those of members stand in likelihood.py.
LENGTH: Final = (8.0, -8.0)  # the message has the size of the type
MULTIPLE: Final = 3.0  # or several times that size


class Reason(NamedTuple):
    """Points for (above 0) or against, the member's path ("" for length and padding), and the words."""

    points: float
    path: str
    text: str


class Fit(NamedTuple):
    """One way to read the bytes: all profiles that mean it, the layout, the points and why.

    `reasons` have the weightiest first.
    """

    profiles: tuple[Profile, ...]
    layout: Layout
    score: float
    reasons: tuple[Reason, ...]

    @property
    def profile(self) -> Profile:
        """Return the first of the profiles."""
        return self.profiles[0]

    def __str__(self) -> str:
        """Return the profiles by name, with their points."""
        also = ", ".join(str(profile) for profile in self.profiles[1:])
        return f"{self.profile} ({self.score:+.1f})" + (f", the same for this type: {also}" if also else "")


def fit(
    type_: Type,
    messages: Sequence[bytes],
    name: str = "",
    *,
    framed: bool = True,
    profiles: Iterable[Profile] | None = None,
) -> tuple[Fit, ...]:
    """Return every reading of the bytes, the best first.

    `messages` are what the sender sent at once, each from its first byte; not `framed`: they are pieces of
    one stream that begins with a message, and their lengths say nothing.
    """
    asked = profiles_for(type_) if profiles is None else tuple(profiles)
    found = [_judged(same, layout, messages, framed) for same, layout in same_layouts(type_, asked, name)]
    return tuple(sorted(found, key=lambda fit: -fit.score))


def leaders(fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the best one and those that are tied with it."""
    return tuple(fit for fit in fits if fit.score > fits[0].score - TIE)


def verdict(fits: Sequence[Fit]) -> str:
    """Return what the ranking says, in one sentence."""
    if not fits:
        return "this type cannot be laid out"
    tied = leaders(fits)
    if fits[0].score <= 0:
        return f"no profile fits these bytes well; the least bad is {fits[0]}"
    if len(tied) == 1:
        behind = f"; next is {fits[1].profile} ({fits[1].score:+.1f})" if len(fits) > 1 else ""
        return f"{fits[0]} fits best{behind}"
    names = " and ".join(str(fit.profile) for fit in tied[:NAMED])
    more = f" (and {len(tied) - NAMED} more)" if len(tied) > NAMED else ""
    apart = difference(tied[0].layout, tied[1].layout)
    return f"{names}{more} cannot be told apart by these bytes: the first two differ only in {apart}"


# -- one profile ---------------------------------------------------------------------------------------------


def _judged(profiles: tuple[Profile, ...], layout: Layout, messages: Sequence[bytes], framed: bool) -> Fit:
    reasons = _length(layout, messages) if framed else []
    units = _units(layout.size, messages if framed else [b"".join(messages)])
    reasons += _padding(layout, units)
    reasons += _members(layout, units)
    reasons.sort(key=lambda reason: -abs(reason.points))
    return Fit(profiles, layout, round(sum(reason.points for reason in reasons), 2), tuple(reasons))


def _length(layout: Layout, messages: Sequence[bytes]) -> list[Reason]:
    points, said = [], ""
    for message in messages:
        have, size = len(message), layout.size
        if have == size:
            points.append(LENGTH[0])
            said = said or f"{have} bytes came, and the type has {size}"
        elif size and have and have % size == 0:
            points.append(MULTIPLE)
            said = said or f"{have} bytes came, {have // size} times the {size} of the type"
        else:
            points.append(LENGTH[1])
            said = f"{have} bytes came, the type has {size}"
    return [Reason(sum(points) / len(points), "", said)] if points else []


def _units(size: int, messages: Sequence[bytes]) -> list[bytes]:
    """Return the messages cut in the size of the type, the last ones; what is over stays out."""
    if not size:
        return []
    cut: list[bytes] = []
    for message in messages:
        whole = max(len(message) // size, 1)
        cut += [message[at * size : (at + 1) * size] for at in range(max(whole - MOST_MESSAGES, 0), whole)]
    return cut[-MOST_MESSAGES:]


def _padding(layout: Layout, units: Sequence[bytes]) -> list[Reason]:
    reasons: list[Reason] = []
    for number, (offset, size) in enumerate(layout.padding()):
        there = [unit[offset : offset + size] for unit in units if len(unit) >= offset + size]
        if number == MOST_GAPS:
            break
        if not there:
            continue
        zeros = sum(not any(part) for part in there)
        place = f"byte {offset}" if size == 1 else f"bytes {offset} to {offset + size - 1}"
        filled = next((part for part in there if any(part)), b"")
        said = f"padding at {place} is 0" if not filled else f"padding at {place} holds {filled.hex(' ')}"
        good, bad = SPARE[0] * size, SPARE[1]
        points = (good * zeros + bad * (len(there) - zeros)) / len(there)
        reasons.append(Reason(round(points, 2), "", said))
    return reasons


def _members(layout: Layout, units: Sequence[bytes]) -> list[Reason]:
    stop = min(layout.leaf_count, MOST_LEAVES)
    leaves = layout.page(0, stop).leaves
    decoded = [decode_leaves(layout, unit, 0, stop) for unit in units]
    reasons: list[Reason] = []
    for number, leaf in enumerate(leaves):
        hints: list[Hint] = []
        for unit, values in zip(units, decoded, strict=True):
            value = values[number]
            hint = None if value is None else hint_of(layout, leaf, value, _part(unit, leaf))
            if hint:
                hints.append(hint)
        reasons += _mean(leaf, hints)
        reasons += _mean(leaf, _changes(layout, leaf, units))
        if leaf.bit is not None and (number + 1 == stop or leaves[number + 1].offset != leaf.offset):
            there = [part for unit in units if (part := _part(unit, leaf))]
            reasons += _mean(leaf, [hint for part in there if (hint := spare_bits_hint(layout, leaf, part))])
    return reasons


def _changes(layout: Layout, leaf: Leaf, units: Sequence[bytes]) -> list[Hint]:
    parts = [_part(unit, leaf) for unit in units]
    there = [part for part in parts if len(part) == leaf.size]
    pairs = pairwise(there)
    return [hint for before, after in pairs if (hint := steady_hint(layout, leaf, before, after))]


def _mean(leaf: Leaf, hints: Sequence[Hint]) -> list[Reason]:
    """Return one reason for a member: the mean of its points, in the words of the hint that is nearest."""
    if not hints:
        return []
    mean = sum(hint.points for hint in hints) / len(hints)
    nearest = min(hints, key=lambda hint: abs(hint.points - mean))
    return [Reason(round(mean, 2), leaf.path, nearest.why)] if mean else []


def _part(unit: bytes, leaf: Leaf) -> bytes:
    return unit[leaf.offset : leaf.offset + leaf.size]
