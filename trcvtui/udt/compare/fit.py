"""Which reading fits? Profiles, with or without another cause, ranked by what the bytes at hand say.

Rule: a tie is a tie, and is told with what the tied readings differ in. "Fits best" is said only where the
members themselves speak for a reading, and clearly more than for any other one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

from trcvtui.errors import one_line
from trcvtui.udt.compare.compare import difference
from trcvtui.udt.compare.likelihood import (
    CAUSES,
    NONE,
    Cutting,
    FitCause,
    LeafEvidence,
    bits_evidence,
    cut,
    evidence,
    extra_points,
    gap_points,
    spoken,
    steady,
)
from trcvtui.udt.layout.layout import (
    DEFAULT_LAYOUT,
    LAYOUTS,
    Layout,
    LayoutRules,
    Leaf,
    Profile,
    profiles_for,
    same_layouts,
    shape,
)
from trcvtui.udt.layout.value_text import stored_form, value_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import Elementary, StringType, Type, ValueKind

MOST_LEAVES: Final = 256  # that are looked at
MOST_MESSAGES: Final = 8  # the last ones
MOST_LENGTHS: Final = 256  # messages, the last ones, of which the lengths are looked at
MOST_GAPS: Final = 16  # that are looked at
MOST_FITS: Final = 64  # that are returned; those without a cause all
FAR: Final = 40.0  # points that a reading with a cause may be worse than the best one, and be returned
NAMED: Final = 3  # members that a sentence names
SHOWN: Final = 32  # characters of a value
TIE: Final = 1.0  # points: less is no evidence

# The points of what is no member; those of members and causes stand in likelihood.py.
LENGTH: Final = (8.0, -30.0)  # the message has the size of the type
MULTIPLE: Final = -1.0  # less, when it is several times that size
REPEATED: Final = 0.6  # k messages of other bytes say k**REPEATED times as much as one
MOST_REASONS: Final = 64

# What is needed for "fits best".
CLEAR: Final = 5.0  # points ahead of the next other reading
OWN_CLEAR: Final = 3.0  # points of the members; nearer, a cause that is rare is no evidence against it
OWN_POINTS: Final = 4.0  # of the members
MOST_OF_ORDER: Final = 8.0  # points of numbers for a byte order
CONTRARY: Final = 3.0  # how much more a number counts that speaks for the other order


class Reason(NamedTuple):
    """Points for (above 0) or against, the member's path ("" for length and padding), and the words."""

    points: float
    path: str
    text: str


@dataclass(frozen=True, slots=True)
class Fit:
    """One way to read the bytes: all profiles that mean it, the cause beside them, the points and why.

    `members` are the members' own points, part of `score`. `reasons` have the weightiest first. `fits_best`
    is said of one reading at most; `doubt` says why it is not said of the first one. `same` are the readings
    that find the same value at the same place for every member: they share one `rank` (1, 1, 3), for no
    byte speaks for one of them, and differ at most in how rare their causes are.
    """

    profiles: tuple[Profile, ...]
    layout: Layout
    score: float
    reasons: tuple[Reason, ...]
    cause: FitCause = NONE
    members: float = 0.0
    fits_best: bool = False
    doubt: str = ""
    rank: int = 1
    same: tuple[str, ...] = ()

    @property
    def profile(self) -> Profile:
        return self.profiles[0]

    @property
    def name(self) -> str:
        """Return the first profile and the cause."""
        return f"{self.profile}, {self.cause}" if self.cause.kind else str(self.profile)

    def __str__(self) -> str:
        """Return the profiles by name, with their points."""
        also = ", ".join(str(profile) for profile in self.profiles[1:])
        return f"{self.name} ({self.score:+.1f})" + (f", the same for these bytes: {also}" if also else "")


def fit(
    type_: Type,
    messages: Sequence[bytes],
    name: str = "",
    *,
    framed: bool = True,
    profiles: Iterable[Profile] | None = None,
    own: LayoutRules | None = None,
    sender: str = "",
) -> tuple[Fit, ...]:
    """Return every reading of the bytes, the best first.

    `messages` are what the sender sent at once, each from its first byte, one telegram or several; not
    `framed`: they are pieces of one stream that begins with a message, and their lengths say nothing. `own`
    are the rules of our own side: it is named first where several mean the same, after the layout that the
    source of the type is likely to have, `sender`.
    """
    seen = messages[-MOST_LENGTHS:] if framed else [b"".join(messages)] if messages else []
    asked = profiles_for(type_) if profiles is None else tuple(profiles)
    own = own or LAYOUTS[DEFAULT_LAYOUT]
    ours = own.name, own.byte_order
    asked = tuple(sorted(asked, key=lambda one: (one.layout != sender, (one.layout, one.byte_order) != ours)))
    known: _Known = {}
    found = []
    for same, layout in same_layouts(type_, asked, name, own):
        look = _Look(layout, known)
        tried = (_Reading.of(same, look, cause, seen, framed) for cause in CAUSES)
        found += [reading for reading in tried if reading is not None]
    if framed and len(messages) > len(seen):
        said = Reason(0.0, "", f"only the last {len(seen)} of {len(messages)} messages are judged")
        for reading in found:
            reading.others.append(said)
    found.sort(
        key=lambda one: (-one.score, one.profiles[0].layout != sender, one.profiles[0].byte_order != ours[1])
    )
    return tuple(_ranked(found, seen))


def leaders(fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the best one and those that are tied with it by their points."""
    return tuple(fit for fit in fits if fit.score > fits[0].score - TIE)


def verdict(fits: Sequence[Fit]) -> str:
    """Return what the ranking says, in one sentence."""
    if not fits:
        return "this type cannot be laid out"
    best, tied = fits[0], leaders(fits)
    if best.fits_best:
        after = f"; next is {fits[1].name} ({fits[1].score:+.1f})" if len(fits) > 1 else ""
        return f"{best} fits best{after}"
    if best.score <= 0 or (best.members <= 0 and len(tied) == 1):
        return f"no profile fits these bytes well; the least bad is {best}"
    if len(tied) == 1:
        return f"{best} is ahead, but that is not sure: {best.doubt}"
    names = " and ".join(fit.name for fit in tied[:NAMED])
    more = f" (and {len(tied) - NAMED} more)" if len(tied) > NAMED else ""
    return f"{names}{more} cannot be told apart by these bytes: {_apart(tied[0], tied[1])}"


def _apart(one: Fit, other: Fit) -> str:
    if one.cause != other.cause:
        causes = [str(fit.cause) or "no other cause" for fit in (one, other)]
        return f"the first two are {' and '.join(causes)}"
    return f"the first two differ only in {difference(one.layout, other.layout)}"


# -- a layout, ready to be held against bytes ----------------------------------------------------------------

_Known = dict[tuple[object, ...], dict[bytes, LeafEvidence | None]]


class _Member(NamedTuple):
    leaf: Leaf
    start: int
    stop: int
    known: dict[bytes, LeafEvidence | None]  # of the same type, in the same form and byte order
    bits: int  # BOOLs in this byte, at the last of them


class _Look:
    """The leaves and the gaps of a layout that are looked at, what is known of bytes shared with others."""

    def __init__(self, layout: Layout, known: _Known) -> None:
        self.layout, self.members = layout, []
        self.stop = min(layout.leaf_count, MOST_LEAVES)
        self.gaps = layout.padding()[:MOST_GAPS]
        leaves = layout.leaves(0, self.stop)
        for number, leaf in enumerate(leaves):
            is_last = number + 1 == self.stop or leaves[number + 1].offset != leaf.offset
            if leaf.bit is not None and not is_last:
                continue
            bits = 0 if leaf.bit is None else leaf.bit + 1
            form = leaf.type, *stored_form(leaf.type, layout.rules), leaf.size, layout.rules.byte_order
            key = ("bits", bits) if bits else (*form,)
            self.members.append(
                _Member(leaf, leaf.offset, leaf.offset + leaf.size, known.setdefault(key, {}), bits)
            )

    def evidence(self, member: _Member, raw: bytes) -> LeafEvidence | None:
        if raw not in member.known:
            found = (
                bits_evidence(member.bits, raw)
                if member.bits
                else evidence(member.leaf, raw, self.layout.rules)
            )
            member.known[raw] = found
        return member.known[raw]


class _Says(NamedTuple):
    """What one member says, with its bytes that are nearest to it."""

    member: _Member
    points: float
    fair: float
    order: float
    raw: bytes
    why: str


# -- one reading ---------------------------------------------------------------------------------------------


class _Reading:
    """A layout and a cause held against the bytes."""

    def __init__(self, profiles: tuple[Profile, ...], look: _Look, cause: FitCause, cutting: Cutting) -> None:
        self.profiles, self.look, self.cause, self.cutting = profiles, look, cause, cutting
        self.others: list[Reason] = []  # all reasons but the members'
        self.said: list[_Says] = []
        self.steps: list[Reason] = []
        self.read: list[tuple[_Member, list[bytes]]] = []  # each member, its bytes as the reading has them
        self.has_length = True

    @classmethod
    def of(
        cls,
        profiles: tuple[Profile, ...],
        look: _Look,
        cause: FitCause,
        messages: Sequence[bytes],
        framed: bool,
    ) -> _Reading | None:
        """Return the reading; None where the cause cannot be."""
        cutting = cut(cause, look.layout.size, messages, framed, MOST_MESSAGES)
        is_cut = bool(cutting.units) and (cutting.fitting * 2 >= len(messages) or not framed)
        if cause.kind is not None and not is_cut:
            return None
        if not is_cut:
            cutting = Cutting(tuple(messages[-MOST_MESSAGES:]), (), 0, 1)
        found = cls(profiles, look, cause, cutting)
        found.has_length = is_cut
        if not (found.judge_cause() and found.judge_members()):
            return None
        found.judge_length(messages, framed)
        found.judge_gaps()
        return found

    def judge_cause(self) -> bool:
        cause, units = self.cause, self.cutting.units
        if cause.kind is None:
            return True
        if cause.of_all and all(cause.of_all(unit) == unit for unit in units):
            return False
        extras = dict.fromkeys(self.cutting.extras) if cause.front > 0 or cause.back > 0 else {b"": None}
        told = [extra_points(cause, extra, self.look.layout.size) for extra in extras]
        there = [one for one in told if one is not None]
        if len(there) < len(told):
            return False
        points = sum(points for points, _ in there) / len(there) * len(there) ** REPEATED
        said = there[0][1] or f"{cause}: {cause.about}"
        if len(extras) == 1 and len(units) > 1 and cause.n:
            said += " in each message"
        self.others.append(Reason(round(cause.cost + points, 2), "", said))
        return True

    def judge_members(self) -> bool:
        look, changes, has_changed = self.look, self.cause.of_member, not self.cause.of_member
        for member in look.members:
            parts = [unit[member.start : member.stop] for unit in self.cutting.units]
            if self.cause.back < 0 and isinstance(member.leaf.type, StringType):  # it may have ended before
                parts = [part.ljust(member.leaf.size, b"\0") for part in parts]
            parts = [part for part in parts if len(part) == member.leaf.size]
            if self.cause.front < 0 and member.start < -self.cause.front:
                continue
            change = changes.get(member.leaf.size) if changes and _is_number(member) else None
            if change:
                changed = [change(part) for part in parts]
                has_changed = has_changed or changed != parts
                parts = changed
            self.judge_member(member, parts)
            self.read.append((member, parts))
        self.weigh_equals()
        return has_changed

    def weigh_equals(self) -> None:
        """Let equal bytes in several members of one type, as in an ARRAY, say less than others would."""
        count = Counter((id(one.member.known), one.raw) for one in self.said)
        for number, one in enumerate(self.said):
            equal = count[id(one.member.known), one.raw]
            if equal > 1:
                share = equal**REPEATED / equal
                points, fair, order = one.points * share, one.fair * share, one.order * share
                self.said[number] = one._replace(points=points, fair=fair, order=order)

    def judge_member(self, member: _Member, parts: list[bytes]) -> None:
        rules = self.look.layout.rules
        distinct = {spoken(member.leaf, part, rules): part for part in parts}.values()
        told = [(found, part) for part in distinct if (found := self.look.evidence(member, part))]
        if not told:
            return
        share = len(told) ** REPEATED / len(told)
        points = sum(found.points for found, _ in told)
        nearest, raw = min(told, key=lambda one: abs(one[0].points - points / len(told)))
        self.said.append(
            _Says(
                member,
                points * share,
                sum(found.fair for found, _ in told) * share,
                sum(found.order for found, _ in told) * share,
                raw,
                nearest.why,
            )
        )
        if len(distinct) > 1:
            self.judge_steps(member, parts)

    def judge_steps(self, member: _Member, parts: list[bytes]) -> None:
        pairs = [(before, after) for before, after in pairwise(parts) if before != after]
        steps = [steady(member.leaf, before, after, self.look.layout.rules) for before, after in pairs]
        told = [step for step in steps if step[0]]
        if told:
            mean = sum(points for points, _ in told) / len(told)
            words = min(told, key=lambda step: abs(step[0] - mean))[1]
            path = self.path(member)
            self.steps.append(Reason(round(mean, 2), member.leaf.path, f"{path} {words}"))

    def judge_length(self, messages: Sequence[bytes], framed: bool) -> None:
        size, cause = self.look.layout.size, self.cause
        if not framed or not messages:
            return
        have = len(messages[-1])
        if not self.has_length:
            self.others.append(Reason(LENGTH[1], "", f"{have} bytes came, the type has {size}"))
            return
        share = self.cutting.fitting / len(messages)
        points = LENGTH[0] * share + LENGTH[1] * (1 - share)
        several = self.cutting.several
        beside = {1: " and", -1: " but"}.get(
            (cause.front + cause.back > 0) - (cause.front + cause.back < 0), ""
        )
        count = f", {several} times the {size} of the type" if several > 1 else f", and the type has {size}"
        said = f"{have} bytes came{count}" + (f"{beside} {cause}" if beside else "")
        self.others.append(Reason(round(points + (MULTIPLE if several > 1 else 0), 2), "", said))

    def judge_gaps(self) -> None:
        for offset, size in self.look.gaps:
            parts = dict.fromkeys(unit[offset : offset + size] for unit in self.cutting.units)
            there = [part for part in parts if len(part) == size or (part and self.cause.back < 0)]
            if not there:
                continue
            place = f"byte {offset}" if size == 1 else f"bytes {offset} to {offset + size - 1}"
            filled = next((part for part in there if any(part)), b"")
            said = f"padding at {place} is 0" if not filled else f"padding at {place} holds {filled.hex(' ')}"
            points = min(gap_points(part) for part in there)
            self.others.append(Reason(round(points, 2), "", said))

    # -- what follows -------------------------------------------------------------------------------------

    @property
    def own_points(self) -> float:
        return sum(one.points for one in self.said) + sum(step.points for step in self.steps)

    @cached_property
    def score(self) -> float:
        return round(self.own_points + sum(one.points for one in self.others), 2)

    @cached_property
    def fair(self) -> float:
        """Return the points in a comparison of byte orders."""
        return self.score + sum(one.fair - one.points for one in self.said)

    @property
    def order(self) -> float:
        """Return what the numbers say for the byte order: what speaks against it counts more."""
        told = [one.order for one in self.said]
        for_it = sum(points for points in told if points > 0)
        return min(for_it + CONTRARY * sum(points for points in told if points < 0), MOST_OF_ORDER)

    @property
    def way(self) -> object:
        """Return in which order the bytes of numbers are read."""
        cause = self.cause
        return self.profiles[0].byte_order, cause.kind if cause.of_member or cause.of_all else None

    @cached_property
    def meaning(self) -> object:
        """Return a value that is equal for readings in which these bytes mean the same."""
        look = self.look
        is_seen = look.stop == look.layout.leaf_count and not any(map(self.is_negative, self.said))
        return self.cause.kind, self.cause.n, shape(look.layout, by_bytes=is_seen)

    @cached_property
    def values(self) -> object:
        size, front, rules = self.look.layout.size, self.cause.front, self.look.layout.rules
        members = []
        for member, parts in self.read:
            bits = max(member.bits, 1)  # a BOOL alone in its byte is read alike as a bit and as a byte
            form = stored_form(member.leaf.type, rules)
            members.append((member.start + front, bits, form, *self.plain(member, parts)))
        return size + front + self.cause.back, tuple(members)

    def plain(self, member: _Member, parts: list[bytes]) -> Iterator[object]:
        """Yield what makes the value of a member, as it would be in big-endian."""
        rules = self.look.layout.rules
        is_little = rules.byte_order == "little"
        if isinstance(member.leaf.type, StringType) and member.leaf.type.wide:
            yield is_little
        for part in parts:
            said = spoken(member.leaf, part, rules)
            yield said[::-1] if is_little and _is_number(member) else said

    def is_negative(self, one: _Says) -> bool:
        type_ = one.member.leaf.type
        if not isinstance(type_, Elementary) or type_.kind is not ValueKind.DURATION:
            return False
        start, stop = one.member.start, one.member.stop
        last = 0 if self.look.layout.rules.byte_order == "big" else -1
        return any(unit[start:stop][last] > 127 for unit in self.cutting.units if len(unit) >= stop)

    def path(self, member: _Member) -> str:
        return member.leaf.path or self.look.layout.name

    def reasons(self) -> tuple[Reason, ...]:
        look = self.look
        said: list[tuple[float, Reason | _Says]] = [(one.points, one) for one in self.others + self.steps]
        said += [(one.points, one) for one in self.said]
        said.sort(key=lambda one: -abs(one[0]))
        shown = [self.worded(one) for _, one in said[:MOST_REASONS]]
        if look.layout.leaf_count > look.stop:
            shown.append(
                Reason(0.0, "", f"only the first {look.stop} of {look.layout.leaf_count} are judged")
            )
        return tuple(reason for reason in shown if reason.points or not reason.path)

    def worded(self, one: Reason | _Says) -> Reason:
        if isinstance(one, Reason):
            return one
        leaf, path = one.member.leaf, self.path(one.member)
        if one.member.bits:
            return Reason(
                round(one.points, 2), leaf.path, f"16#{one.raw.hex().upper()} up to {path}: {one.why}"
            )
        value = value_text(leaf, decode_leaf(self.look.layout, leaf, one.raw), one.raw)
        shown = value if len(value) <= SHOWN else value[:SHOWN] + "..."
        return Reason(round(one.points, 2), leaf.path, f"{path} = {shown}: {one.why}")


def _is_number(member: _Member) -> bool:
    return not isinstance(member.leaf.type, StringType) and not member.leaf.coding.code.endswith("s")


# -- all of them ---------------------------------------------------------------------------------------------


def _ranked(found: list[_Reading], messages: Sequence[bytes]) -> Iterator[Fit]:
    merged: dict[object, list[_Reading]] = {}
    for reading in found:
        merged.setdefault(reading.meaning, []).append(reading)
    rows = list(merged.values())[:MOST_FITS]
    rows = [row for row in rows if not row[0].cause.kind or row[0].score >= rows[0][0].score - FAR]
    doubt = _doubt([row[0] for row in rows], messages)
    number = 0
    for together in _shared(rows) if messages else [rows]:
        rank = number + 1
        for row in together:
            first, number = row[0], number + 1
            profiles = tuple(dict.fromkeys(profile for one in row for profile in one.profiles))
            yield Fit(
                profiles, first.look.layout, first.score, first.reasons(), first.cause,
                round(first.own_points, 2), number == 1 and not doubt, doubt if number == 1 else "",
                rank, tuple(_called(other[0]) for other in together if other is not row),
            )  # fmt: skip


def _shared(rows: list[list[_Reading]]) -> Iterator[list[list[_Reading]]]:
    """Yield the rows, those that read the same together, each of them less than `CLEAR` below their best."""
    left = rows
    while left:
        best = left[0][0]
        near = [row for row in left if any(_is_same(best, one) for one in row)]
        yield near
        left = [row for row in left if row not in near]


def _is_same(best: _Reading, other: _Reading) -> bool:
    return other.score > best.score - CLEAR and other.values == best.values


def _doubt(ranked: list[_Reading], messages: Sequence[bytes]) -> str:
    """Return why the first one is not called best; "" where it is."""
    if not ranked or not messages:
        return "there are no bytes"
    best = ranked[0]
    if not best.has_length:
        return "no message has the length of the type"
    if best.own_points < OWN_POINTS:
        return "the members themselves say too little"
    if len(set(b"".join(messages))) == 1:
        return "all bytes are the same"
    for other in ranked[1:]:
        is_rare = other.way != best.way and abs(other.own_points - best.own_points) < OWN_CLEAR
        if other.score > best.score - CLEAR + (other.cause.cost if is_rare else 0.0):
            if _is_same(best, other):
                return f"{_called(other)} ({other.score:+.1f}) reads the same values at the same places"
            if abs(other.own_points - best.own_points) < 0.01 and other.way != best.way:
                return f"{_called(other)} ({other.score:+.1f}) reads values that are as good"
            return f"{_called(other)} ({other.score:+.1f}) is near"
        order = best.order if other.way != best.way else 0.0
        if other.fair > best.fair + order - CLEAR:
            return (
                f"{_called(other)} may be right: without numbers that are round in a byte order "
                "(multiples of 256) it is as good"
            )
    return ""


def _called(reading: _Reading) -> str:
    return f"{reading.profiles[0]}, {reading.cause}" if reading.cause.kind else str(reading.profiles[0])


# -- as text and as JSON: names from a file reach the terminal as one plain line -----------------------------

MOST_ROWS: Final = 10  # of the text; JSON has all
MOST_PRINTED: Final = 12


def fit_json(fits: Sequence[Fit]) -> list[dict[str, object]]:
    """Return every reading, the best first, as `udt fit --format json` prints it."""
    return [
        {
            "rank": found.rank,
            "layout": found.profile.layout,
            "byte_order": found.profile.byte_order,
            "cause": found.cause.kind,
            "n": found.cause.n,
            "points": found.score,
            "fits_best": found.fits_best,
            "reasons": list(reason_lines(found)),
        }
        for found in fits
    ]


def fit_text(fits: Sequence[Fit], came: str) -> str:
    """Return the verdict, the first readings, and the reasons of the best one; `came` names the bytes."""
    lines = [one_line(f"{came}: {verdict(fits)}")]
    for number, found in enumerate(fits[:MOST_ROWS]):
        lines.append(f"{found.rank:>2} {found.score:+8.1f}  {named(found)}")
        if number == 0:
            told = list(reason_lines(found))
            lines += [f"             {line}" for line in told[:MOST_PRINTED]]
            if len(told) > MOST_PRINTED:
                lines.append(f"             and {len(told) - MOST_PRINTED} more reasons (--format json)")
        elif found.same:
            lines.append(f"             no byte tells it from {same_words(found)}")
    if len(fits) > MOST_ROWS:
        lines.append(f"and {len(fits) - MOST_ROWS} more readings (--format json)")
    return "\n".join(lines)


def named(found: Fit) -> str:
    """Return the first profile with the cause, and how many mean the same."""
    more = len(found.profiles) - 1
    return found.name + (f" (and {more} the same)" if more else "")


def reason_lines(found: Fit) -> Iterator[str]:
    """Yield what speaks for and against a reading, the profiles that mean the same first."""
    if found.doubt:
        yield one_line(f"not sure: {found.doubt}")
    if found.same:
        yield f"no byte tells it from {same_words(found)}"
    if len(found.profiles) > 1:
        yield "the same for these bytes: " + "; ".join(str(profile) for profile in found.profiles[1:])
    if found.profile.text:
        yield f"STRING as {found.profile.text}"
    yield f"{found.members:+.1f} are the members' own points"
    yield from (one_line(f"{reason.points:+.1f} {reason.text}") for reason in found.reasons)


def same_words(found: Fit) -> str:
    """Return the other readings that find the same values at the same places."""
    more = len(found.same) - NAMED
    return "; ".join(found.same[:NAMED]) + (f"; and {more} more" if more > 0 else "")
