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

from trcvtui.udt.compare.compare import difference
from trcvtui.udt.compare.drift import drifted_layouts, is_unknown
from trcvtui.udt.compare.likelihood import (
    CAUSES,
    DRIFTS,
    MOST_MESSAGES,
    NONE,
    REPEATED,
    SHORT,
    Cutting,
    FitCause,
    LeafEvidence,
    bits_evidence,
    cut,
    evidence,
    extra_evidence,
    gap_points,
    repeated_zeros,
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
MOST_REASONS: Final = 64

# What is needed for "fits best".
CLEAR: Final = 5.0  # points ahead of the next other reading
CLEAR_OF_DRIFT: Final = 7.4  # of one that reads the same but for a member or two: padding may hide them
LESS_CLEAR: Final = 2.0  # points fewer where the other one has a value that machines do not send
OWN_CLEAR: Final = 3.0  # points of the members; nearer, a cause that is rare is no evidence against it
OWN_POINTS: Final = 4.0  # of the members
MOST_OF_ORDER: Final = 8.0  # points of numbers for a byte order
MOST_OF_ROUND: Final = 6.0  # points of numbers that are round in a byte order, beside some that are not
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
    is said of one reading at most; `doubt` says why it is not said of the first one, which `is_ahead` where
    one odd value is all that speaks against it. `same` are the readings
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
    is_ahead: bool = False
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
    asked = tuple(sorted(asked, key=lambda one: (one.layout != sender, _strangeness(one, own))))
    lengths = set(map(len, seen))
    known: _EvidenceCache = {}
    layouts = same_layouts(type_, asked, name, own)
    tried: list[tuple[tuple[Profile, ...], Layout, Iterable[FitCause]]] = []
    for same, layout in layouts:
        fitting = [cause for cause in CAUSES if cause is NONE or cause.can_fit(layout.size, framed, lengths)]
        tried.append((same, layout, fitting))
    if framed and seen:
        drifted = drifted_layouts(layouts, seen, own)
        tried += [(same, layout, (cause,)) for same, layout, cause in drifted]
    found = []
    for same, layout, causes in tried:
        look = _LayoutView(layout, known)
        readings = (_Reading.of(same, look, cause, seen, framed) for cause in causes)
        found += [reading for reading in readings if reading is not None]
    if framed and len(messages) > len(seen):
        said = Reason(0.0, "", f"only the last {len(seen)} of {len(messages)} messages are judged")
        for reading in found:
            reading.others.append(said)
    found.sort(key=lambda one: (not one.has_length, -one.score, *one.strangeness(sender, own)))
    return tuple(_ranked(found, seen))


def _strangeness(profile: Profile, own: LayoutRules) -> int:
    """Return the lower the usual: our own profile, our own layout, a vendor's byte order, others."""
    if profile.layout == own.name:
        return int(profile.byte_order != own.byte_order)
    return 2 if profile.byte_order == LAYOUTS[profile.layout].byte_order else 3


def leaders(fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the best one and those that are tied with it by their points."""
    return tuple(fit for fit in fits if fit.score > fits[0].score - TIE)


def without_near_drifts(fits: Sequence[Fit]) -> list[Fit]:
    """Return the readings, but the drifts only where they are clearly ahead: of many some are, by chance."""
    ahead = max((fit.score for fit in fits if fit.cause.kind not in DRIFTS), default=0.0) + CLEAR_OF_DRIFT
    return [fit for fit in fits if fit.cause.kind not in DRIFTS or fit.score > ahead]


def verdict(fits: Sequence[Fit]) -> str:
    """Return what the ranking says, in one sentence."""
    if not fits:
        return "this type cannot be laid out"
    best, tied = fits[0], leaders(fits)
    if best.fits_best:
        other = next((one for one in fits if one.rank > 1), None)
        after = f"; next is {other.name} ({other.score:+.1f})" if other else ""
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

_EvidenceCache = dict[tuple[object, ...], dict[bytes, LeafEvidence | None]]


class _Member(NamedTuple):
    leaf: Leaf
    start: int
    stop: int
    known: dict[bytes, LeafEvidence | None]  # of the same type, in the same form and byte order
    bits: int  # BOOLs in this byte, at the last of them


class _LayoutView:
    """The leaves and the gaps of a layout that are looked at, what is known of bytes shared with others."""

    def __init__(self, layout: Layout, known: _EvidenceCache) -> None:
        self.layout, self.members = layout, []
        self.stop = min(layout.leaf_count, MOST_LEAVES)
        self.gaps = layout.padding()[:MOST_GAPS]
        leaves = layout.leaves(0, self.stop)
        for number, leaf in enumerate(leaves):
            is_last = number + 1 == self.stop or leaves[number + 1].offset != leaf.offset
            if (leaf.bit is not None and not is_last) or is_unknown(leaf):
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


class _MemberPoints(NamedTuple):
    """What one member says, with its bytes that say the nearest to it."""

    member: _Member
    points: float
    fair: float
    order: float
    raw: bytes
    why: str
    parts: tuple[bytes, ...]  # all of its bytes, each once


# -- one reading ---------------------------------------------------------------------------------------------


class _Reading:
    """A layout and a cause held against the bytes."""

    def __init__(
        self, profiles: tuple[Profile, ...], look: _LayoutView, cause: FitCause, cutting: Cutting
    ) -> None:
        self.profiles, self.look, self.cause, self.cutting = profiles, look, cause, cutting
        self.others: list[Reason] = []  # all reasons but the members'
        self.said: list[_MemberPoints] = []
        self.steps: list[Reason] = []
        self.read: list[tuple[_Member, list[bytes]]] = []  # each member, its bytes as the reading has them
        self.has_length = True
        self.has_meaning = True  # what stands beside the members is known
        self.odd = ""  # a value that machines do not send
        self.filled = ""  # padding that is not 0
        self.has_plain = False  # a number that is round in no way

    @classmethod
    def of(
        cls,
        profiles: tuple[Profile, ...],
        look: _LayoutView,
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
        told = {}
        for unit, (before, after) in zip(units, self.cutting.extras, strict=True):
            if (before, after) not in told:
                extra = extra_evidence(cause, before, unit, after)
                if extra is None:
                    return False
                told[before, after] = extra
        self.has_meaning = all(extra.has_meaning for extra in told.values())
        points = sum(extra.points for extra in told.values()) / len(told) * len(told) ** REPEATED
        said = next(iter(told.values())).text or (f"{cause}: {cause.about}" if cause.about else str(cause))
        if len(told) == 1 and len(units) > 1 and cause.n and not cause.member:
            said += " in each message"
        self.others.append(Reason(round(cause.cost + points, 2), "", said))
        return True

    def judge_members(self) -> bool:
        look, changes, of_text = self.look, self.cause.of_member, self.cause.of_text
        has_changed = not changes and not of_text
        for member in look.members:
            parts = [unit[member.start : member.stop] for unit in self.cutting.units]
            if self.cause.back < 0 and isinstance(member.leaf.type, StringType):  # it may have ended before
                parts = [part.ljust(member.leaf.size, b"\0") for part in parts]
            parts = [part for part in parts if len(part) == member.leaf.size]
            if self.cause.front < 0 and member.start < -self.cause.front:
                continue
            change = changes.get(member.leaf.size) if changes and _is_number(member) else None
            if of_text and isinstance(member.leaf.type, StringType) and not look.layout.rules.text.header:
                change = of_text
            if change:
                changed = [change(part) for part in parts]
                has_changed = has_changed or changed != parts
                parts = changed
            self.judge_member(member, parts)
            self.read.append((member, parts))
        self.weigh_equals()
        return has_changed

    def weigh_equals(self) -> None:
        """Let equal bytes in several members, as in an ARRAY, say less than others would."""
        count = Counter(one.parts for one in self.said)
        for number, one in enumerate(self.said):
            share = count[one.parts] ** (REPEATED - 1)
            points, fair, order = one.points * share, one.fair * share, one.order * share
            self.said[number] = one._replace(points=points, fair=fair, order=order)

    def judge_member(self, member: _Member, parts: list[bytes]) -> None:
        rules = self.look.layout.rules
        distinct = {spoken(member.leaf, part, rules): part for part in parts}.values()
        told = [(found, part) for part in distinct if (found := self.look.evidence(member, part))]
        if not told:
            return
        self.has_plain = self.has_plain or any(found.is_plain and member.leaf.size > 1 for found, _ in told)
        odd = next((found.why for found, _ in told if found.is_odd), "")
        self.odd = self.odd or (f"{self.path(member)}: {odd}" if odd else "")
        share = len(told) ** REPEATED / len(told)
        points = sum(found.points for found, _ in told)
        values = tuple(part for _, part in told)
        constant = repeated_zeros(member.leaf.type, values)
        nearest, raw = min(told, key=lambda one: abs(one[0].points - points / len(told)))
        self.said.append(
            _MemberPoints(
                member,
                points * share + constant,
                sum(found.fair for found, _ in told) * share + constant,
                sum(found.order for found, _ in told) * share,
                raw,
                nearest.why,
                values,
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
            more = f"{abs(have - size)} {'more' if have > size else 'fewer'}"
            self.others.append(Reason(LENGTH[1], "", f"{have} bytes came, the type has {size}: {more}"))
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
            self.filled = self.filled or (said if filled else "")
            points = min(gap_points(part) for part in there)
            if filled:  # what differs from message to message is a value more likely
                points *= len(there) ** REPEATED
            self.others.append(Reason(round(points, 2), "", said))

    # -- what follows -------------------------------------------------------------------------------------

    @property
    def own_points(self) -> float:
        return sum(one.points for one in self.said) + sum(step.points for step in self.steps)

    def strangeness(self, sender: str, own: LayoutRules) -> tuple[bool, bool]:
        """Return what puts this one after others of the same points."""
        return self.profiles[0].layout != sender, self.profiles[0].byte_order != own.byte_order

    @cached_property
    def score(self) -> float:
        return round(self.own_points + sum(one.points for one in self.others), 2)

    @cached_property
    def fair(self) -> float:
        """Return the points in a comparison of byte orders: all numbers of a sender may be round."""
        more = sum(one.fair - one.points for one in self.said)
        return self.score + (min(more, MOST_OF_ROUND) if self.has_plain else more)

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
        cause = self.cause
        return (cause.kind, cause.front, cause.back, cause.member, cause.theirs), shape(
            look.layout, by_bytes=is_seen
        )

    @cached_property
    def values(self) -> object:
        size, front, rules = self.look.layout.size, self.cause.front, self.look.layout.rules
        members = []
        for member, parts in self.read:
            bits = max(member.bits, 1)  # a BOOL alone in its byte is read alike as a bit and as a byte
            form = stored_form(member.leaf.type, rules)
            members.append((member.start + front, bits, form, *self.plain(member, parts)))
        return size + front + self.cause.back, tuple(members)

    @cached_property
    def places(self) -> object:
        """Return where the members begin, and which of them are bits."""
        front = self.cause.front
        return (
            self.way,
            self.cause.kind,
            [(member.leaf.path, member.start + front, member.bits) for member, _ in self.read],
        )

    @property
    def widest(self) -> int:
        """Return the size of the largest number: up to 2, words exchanged are nothing, bytes the order."""
        return max((member.leaf.size for member, _ in self.read if _is_number(member)), default=0)

    @cached_property
    def by_path(self) -> dict[str, list[object]]:
        """Return the values of each member."""
        layout = self.look.layout
        return {
            member.leaf.path: [decode_leaf(layout, member.leaf, part) for part in parts]
            for member, parts in self.read
        }

    def plain(self, member: _Member, parts: list[bytes]) -> Iterator[object]:
        """Yield what makes the value of a member, as it would be in big-endian."""
        rules = self.look.layout.rules
        is_little = rules.byte_order == "little"
        if isinstance(member.leaf.type, StringType) and member.leaf.type.wide:
            yield is_little
        for part in parts:
            said = spoken(member.leaf, part, rules)
            yield said[::-1] if is_little and _is_number(member) else said

    def is_negative(self, one: _MemberPoints) -> bool:
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
        said: list[tuple[float, Reason | _MemberPoints]] = [
            (one.points, one) for one in self.others + self.steps
        ]
        said += [(one.points, one) for one in self.said]
        said.sort(key=lambda one: -abs(one[0]))
        shown = [self.worded(one) for _, one in said[:MOST_REASONS]]
        if look.layout.leaf_count > look.stop:
            shown.append(
                Reason(0.0, "", f"only the first {look.stop} of {look.layout.leaf_count} are judged")
            )
        return tuple(reason for reason in shown if reason.points or not reason.path)

    def worded(self, one: Reason | _MemberPoints) -> Reason:
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
    odd = f"machines seldom send such a value: {rows[0][0].odd}" if rows and rows[0][0].odd else ""
    number = 0
    for together in _shared(rows) if messages else [rows]:
        rank = number + 1
        for row in together:
            first, number = row[0], number + 1
            profiles = tuple(dict.fromkeys(profile for one in row for profile in one.profiles))
            yield Fit(
                profiles, first.look.layout, first.score, first.reasons(), first.cause,
                round(first.own_points, 2), number == 1 and not (doubt or odd), number == 1 and not doubt,
                (doubt or odd) if number == 1 else "",
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
    others = len(messages) - best.cutting.fitting
    if others and len(messages) > 1:
        return f"{others} of {len(messages)} messages have another length"
    if best.cutting.several > 1 and len(messages) > 1:
        return "every message is several times as long as the type"
    if best.cause.kind == SHORT and any(_is_number(member) and not parts for member, parts in best.read):
        return "the byte that is missing is one of a number"
    ending = {message[-2:] for message in messages}
    last = best.read[-1][0] if best.read else None
    if best.cause.kind is None and last and last.leaf.size > 1 and _is_number(last) and ending <= {b"\r\n"}:
        return "every message ends in CR LF, here a number"
    if best.cause.kind in DRIFTS:
        return "that the sender's type differs, and where, is a guess"
    if not best.has_meaning:
        return "what the bytes beside the members mean is not known"
    if best.filled:
        return f"{best.filled}: a member may lie there"
    if best.own_points < OWN_POINTS:
        return "the members themselves say too little"
    if len(set(b"".join(messages))) == 1:
        return "all bytes are the same"
    for other in ranked[1:]:
        is_one_way = other.way == best.way or (best.cause.kind is None and best.widest <= 2)
        if is_one_way and best.cause.kind in (None, other.cause.kind) and _is_same(best, other):
            continue
        is_other_place = other.cause.kind not in DRIFTS and other.places != best.places
        if not is_other_place and all(best.by_path.get(path) == has for path, has in other.by_path.items()):
            continue
        is_rare = other.way != best.way and abs(other.own_points - best.own_points) < OWN_CLEAR
        clear = CLEAR_OF_DRIFT - best.cause.cost if other.cause.kind in DRIFTS else CLEAR
        clear -= LESS_CLEAR if other.odd else 0.0
        if other.score > best.score - clear + (other.cause.cost if is_rare else 0.0):
            if _is_same(best, other):
                return f"{_called(other)} ({other.score:+.1f}) reads the same values at the same places"
            if abs(other.own_points - best.own_points) < 0.01 and other.way != best.way:
                return f"{_called(other)} ({other.score:+.1f}) reads values that are as good"
            return f"{_called(other)} ({other.score:+.1f}) is near"
        if best.cause.kind is None and other.cause.kind is not None:
            continue  # numbers that are all round, and a cause: two rare things at once
        order = best.order if other.way != best.way else 0.0
        if other.fair > (best.score if other.has_plain else best.fair) + order - CLEAR:
            return (
                f"{_called(other)} may be right: without numbers that are round in a byte order "
                "(multiples of 256) it is as good"
            )
    return ""


def _called(reading: _Reading) -> str:
    return f"{reading.profiles[0]}, {reading.cause}" if reading.cause.kind else str(reading.profiles[0])
