"""One reading: judges a layout and a cause by the bytes, with points for members, length and padding."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

from trcvtui.udt.compare.causes import CutMessages, FitCause, cut_messages
from trcvtui.udt.compare.drift import MOST_LEAVES, is_unknown_member
from trcvtui.udt.compare.extra_bytes import extra_evidence
from trcvtui.udt.compare.likelihood import (
    MOST_MESSAGES,
    REPEAT_EXPONENT,
    LeafEvidence,
    bits_evidence,
    exchange_in_pairs,
    exchange_words,
    gap_points,
    judge_change,
    leaf_evidence,
    repeated_zero_points,
    value_bytes,
)
from trcvtui.udt.layout.layout import Layout, LayoutRules, Leaf, Profile, layout_shape
from trcvtui.udt.layout.value_text import stored_form, value_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import Elementary, StringType, ValueKind, all_parts

MOST_GAPS: Final = 16  # that are judged
MOST_VALUE_CHARACTERS: Final = 32  # of a value in a reason
MOST_REASONS: Final = 64

# The points of length and padding; those of members are in likelihood.py, those of causes in causes.py.
LENGTH: Final = (8.0, -30.0)  # the message has the size of the type, or not
MULTIPLE_POINTS: Final = -1.0  # added if it is several times that size
MOST_ORDER_POINTS: Final = 8.0  # points of numbers for a byte order
MOST_ROUND_POINTS: Final = 6.0  # points of numbers that are round in a byte order, if some others are not
UNLIKELY_POINTS: Final = -3.0  # below it a number is unlikely
EXCHANGED_LEAD: Final = (6.0, 4.5)  # points that exchanged bytes must add, for 2 bytes and for more
CONTRARY_WEIGHT: Final = 3.0  # the weight of a number that is evidence for the other byte order


class Reason(NamedTuple):
    """Points, above 0 if in favour, and words. `path` is a member's path, "" for length and padding."""

    points: float
    path: str
    text: str


EvidenceCache = dict[tuple[object, ...], dict[bytes, LeafEvidence | None]]


class JudgedMember(NamedTuple):
    leaf: Leaf
    start: int
    stop: int
    known: dict[bytes, LeafEvidence | None]  # of the same type, in the same form and byte order
    bits: int  # BOOLs in this byte, at the last of them
    can_narrow: bool  # the next member would stay in place if this one were half as wide


class JudgedLayout:
    """The leaves and gaps to judge in a layout; layouts share the evidence that is known already."""

    def __init__(self, layout: Layout, known: EvidenceCache) -> None:
        self.layout, self.members = layout, []
        self.stop = min(layout.leaf_count, MOST_LEAVES)
        has_bit_fields = any(getattr(part, "bit_fields", ()) for part in all_parts(layout.type))
        self.gaps = [] if has_bit_fields else layout.padding()[:MOST_GAPS]  # their room is not padding
        leaves = layout.leaves(0, self.stop)
        for number, leaf in enumerate(leaves):
            is_last = number + 1 == self.stop or leaves[number + 1].offset != leaf.offset
            if (leaf.bit is not None and not is_last) or is_unknown_member(leaf):
                continue
            bits = 0 if leaf.bit is None else leaf.bit + 1
            form = leaf.type, *stored_form(leaf.type, layout.rules), leaf.size, layout.rules.byte_order
            key = ("bits", bits) if bits else (*form,)
            follows = leaves[number + 1].size if number + 1 < len(leaves) else leaf.size
            can_narrow = layout.rules.cap > 1 and not leaf.path.endswith("]") and follows > leaf.size // 2
            stop, kept = leaf.offset + leaf.size, known.setdefault(key, {})
            self.members.append(JudgedMember(leaf, leaf.offset, stop, kept, bits, can_narrow))

    def evidence(self, member: JudgedMember, raw: bytes) -> LeafEvidence | None:
        if raw not in member.known:
            found = (
                bits_evidence(member.bits, raw)
                if member.bits
                else leaf_evidence(member.leaf, raw, self.layout.rules)
            )
            member.known[raw] = found
        return member.known[raw]


class MemberPoints(NamedTuple):
    """The points of one member over all messages. `raw` are bytes whose points are nearest to the mean."""

    member: JudgedMember
    points: float
    fair: float
    order: float
    raw: bytes
    why: str
    parts: tuple[bytes, ...]  # its bytes in all messages, equal ones once


# -- one reading ---------------------------------------------------------------------------------------------


class Reading:
    def __init__(
        self, profiles: tuple[Profile, ...], look: JudgedLayout, cause: FitCause, cutting: CutMessages
    ) -> None:
        self.profiles, self.look, self.cause, self.cutting = profiles, look, cause, cutting
        self.others: list[Reason] = []  # all reasons but those of members
        self.member_points: list[MemberPoints] = []
        self.steps: list[Reason] = []
        self.read: list[tuple[JudgedMember, list[bytes]]] = []  # each member, its bytes with the cause undone
        self.has_length = True
        self.has_meaning = True  # the bytes beside the members are known
        self.odd = ""  # a value that machines do not send
        self.filled = ""  # padding that is not 0
        self.narrow = ""  # a number that would have another value if it were half as wide
        self.has_plain = False  # whether a number is not round

    @classmethod
    def judge(
        cls,
        profiles: tuple[Profile, ...],
        look: JudgedLayout,
        cause: FitCause,
        messages: Sequence[bytes],
        framed: bool,
    ) -> Reading | None:
        """Return the reading; None if the cause does not apply to these bytes."""
        cutting = cut_messages(cause, look.layout.size, messages, framed, MOST_MESSAGES)
        # At least half of the messages must have a length that fits.
        is_cut = bool(cutting.units) and (cutting.fitting * 2 >= len(messages) or not framed)
        if cause.kind is not None and not is_cut:
            return None
        if not is_cut:
            cutting = CutMessages(tuple(messages[-MOST_MESSAGES:]), (), 0, 1)
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
            return False  # it changes nothing
        known = {}
        for unit, (before, after) in zip(units, self.cutting.extras, strict=True):
            if (before, after) not in known:
                extra = extra_evidence(cause, before, unit, after)
                if extra is None:
                    return False
                known[before, after] = extra
        self.has_meaning = all(extra.has_meaning for extra in known.values())
        befores = {before: extra.points - extra.of_after for (before, _), extra in known.items()}
        if len({extra.has_meaning for extra in known.values()}) > 1:  # a length in some is chance
            befores = dict.fromkeys(befores, min(befores.values()))
        afters = {after: extra.of_after for (_, after), extra in known.items()}
        points = sum(sum(one.values()) * len(one) ** (REPEAT_EXPONENT - 1) for one in (befores, afters))
        text = next(iter(known.values())).text or ", ".join(filter(None, (str(cause), cause.about)))
        if len(known) == 1 and len(units) > 1 and cause.n and not cause.member:
            text += " in each message"
        self.others.append(Reason(round(cause.cost + points, 2), "", text))
        return True

    def judge_members(self) -> bool:
        look, changes, of_text = self.look, self.cause.of_member, self.cause.of_text
        has_changed = not changes and not of_text
        for member in look.members:
            parts = [unit[member.start : member.stop] for unit in self.cutting.units]
            if self.cause.back < 0 and isinstance(member.leaf.type, StringType):  # it may end earlier
                parts = [part.ljust(member.leaf.size, b"\0") for part in parts]
            parts = [part for part in parts if len(part) == member.leaf.size]
            if self.cause.front < 0 and member.start < -self.cause.front:
                continue
            change = changes.get(member.leaf.size) if changes and is_number(member) else None
            if of_text and isinstance(member.leaf.type, StringType) and not look.layout.rules.text.header:
                change = of_text
            if change:
                changed = [change(part) for part in parts]
                has_changed = has_changed or changed != parts
                parts = changed
            self.judge_member(member, parts)
            self.read.append((member, parts))
        self.weaken_equal_members()
        return has_changed

    def weaken_equal_members(self) -> None:
        """Reduce the points of members with equal bytes, as in an ARRAY: they are partly one fact."""
        count = Counter(one.parts for one in self.member_points)
        for number, one in enumerate(self.member_points):
            share = count[one.parts] ** (REPEAT_EXPONENT - 1)
            points, fair, order = one.points * share, one.fair * share, one.order * share
            self.member_points[number] = one._replace(points=points, fair=fair, order=order)

    def judge_member(self, member: JudgedMember, parts: list[bytes]) -> None:
        rules = self.look.layout.rules
        distinct = {value_bytes(member.leaf, part, rules): part for part in parts}.values()
        known = [(found, part) for part in distinct if (found := self.look.evidence(member, part))]
        if not known:
            return
        self.has_plain = self.has_plain or any(found.is_plain and member.leaf.size > 1 for found, _ in known)
        is_shared = self.look.layout.root.overlaps  # in a UNION the bytes may be another member
        odd = "" if is_shared else next((found.why for found, _ in known if found.is_odd), "")
        self.odd = self.odd or (f"{self.path(member)}: {odd}" if odd else "")
        share = len(known) ** REPEAT_EXPONENT / len(known)
        points = sum(found.points for found, _ in known)
        values = tuple(part for _, part in known)
        constant = repeated_zero_points(member.leaf.type, values)
        nearest, raw = min(known, key=lambda one: abs(one[0].points - points / len(known)))
        self.member_points.append(
            MemberPoints(
                member,
                points * share + constant,
                sum(found.fair for found, _ in known) * share + constant,
                sum(found.order for found, _ in known) * share,
                raw,
                nearest.why,
                values,
            )
        )
        self.judge_width(member, values)
        if len(distinct) > 1:
            self.judge_changes(member, parts)

    def judge_width(self, member: JudgedMember, parts: Sequence[bytes]) -> None:
        """Note a number if half its width would make all of its values negative."""
        type_ = member.leaf.type
        if not member.can_narrow or not isinstance(type_, Elementary) or type_.kind is not ValueKind.INTEGER:
            return
        bits, is_little = 4 * member.leaf.size, self.look.layout.rules.byte_order == "little"
        numbers = [int.from_bytes(part[::-1] if is_little else part, "big", signed=True) for part in parts]
        if bits > 8 and type_.code.islower() and all(1 << bits - 1 <= one < 1 << bits for one in numbers):
            half = numbers[-1] - (1 << bits)
            self.narrow = (
                f"{self.path(member)} = {numbers[-1]} is {half} if the sender's number is half as wide"
            )

    def judge_changes(self, member: JudgedMember, parts: list[bytes]) -> None:
        pairs = [(before, after) for before, after in pairwise(parts) if before != after]
        steps = [judge_change(member.leaf, before, after, self.look.layout.rules) for before, after in pairs]
        weighed = [step for step in steps if step[0]]
        if weighed:
            mean = sum(points for points, _ in weighed) / len(weighed)
            words = min(weighed, key=lambda step: abs(step[0] - mean))[1]
            path = self.path(member)
            self.steps.append(Reason(round(mean, 2), member.leaf.path, f"{path} {words}"))

    def judge_length(self, messages: Sequence[bytes], framed: bool) -> None:
        size, cause = self.look.layout.size, self.cause
        if not framed or not messages:
            return
        have = len(messages[-1])
        if not self.has_length:
            more = f"{abs(have - size)} {'too many' if have > size else 'too few'}"
            self.others.append(Reason(LENGTH[1], "", f"{have} bytes came, the type has {size}: {more}"))
            return
        share = self.cutting.fitting / len(messages)
        points = LENGTH[0] * share + LENGTH[1] * (1 - share)
        several = self.cutting.several
        beside = f" ({cause})" if cause.front + cause.back else ""
        count = f"{several} values of {size} bytes" if several > 1 else f"the type has {size}"
        text = f"{have} bytes came, {count}{beside}"
        self.others.append(Reason(round(points + (MULTIPLE_POINTS if several > 1 else 0), 2), "", text))

    def judge_gaps(self) -> None:
        for offset, size in self.look.gaps:
            parts = dict.fromkeys(unit[offset : offset + size] for unit in self.cutting.units)
            there = [part for part in parts if len(part) == size or (part and self.cause.back < 0)]
            if not there:
                continue
            place = f"byte {offset}" if size == 1 else f"bytes {offset} to {offset + size - 1}"
            filled = next((part for part in there if any(part)), b"")
            text = f"padding at {place} is 0" if not filled else f"padding at {place} holds {filled.hex(' ')}"
            self.filled = self.filled or (text if filled else "")
            points = min(gap_points(part) for part in there)
            if filled:  # bytes that change between messages are rather a value
                points *= len(there) ** REPEAT_EXPONENT
            self.others.append(Reason(round(points, 2), "", text))

    # -- the result ---------------------------------------------------------------------------------------

    @property
    def own_points(self) -> float:
        return sum(one.points for one in self.member_points) + sum(step.points for step in self.steps)

    def strangeness(self, sender: str, own: LayoutRules) -> tuple[bool, bool]:
        """Return a sort key for readings with equal points: the sender's layout, then our byte order."""
        return self.profiles[0].layout != sender, self.profiles[0].byte_order != own.byte_order

    @cached_property
    def score(self) -> float:
        return round(self.own_points + sum(one.points for one in self.others), 2)

    @cached_property
    def fair_score(self) -> float:
        """Return the score with `fair` points, to compare byte orders; if `has_plain`, limit the gain."""
        more = sum(one.fair - one.points for one in self.member_points)
        return self.score + (min(more, MOST_ROUND_POINTS) if self.has_plain else more)

    @property
    def order_points(self) -> float:
        """Return the points of the numbers for the byte order; points against the byte order weigh more."""
        each = [one.order for one in self.member_points]
        for_it = sum(points for points in each if points > 0)
        return min(for_it + CONTRARY_WEIGHT * sum(points for points in each if points < 0), MOST_ORDER_POINTS)

    @property
    def order_key(self) -> object:
        """Return a value that is equal for readings with the same order of bytes in numbers."""
        cause = self.cause
        return self.profiles[0].byte_order, cause.kind if cause.of_member or cause.of_all else None

    @cached_property
    def meaning_key(self) -> object:
        """Return a value that is equal for readings in which these bytes mean the same."""
        look = self.look
        is_seen = look.stop == look.layout.leaf_count and not any(map(self.is_negative, self.member_points))
        cause = self.cause
        return (cause.kind, cause.front, cause.back, cause.member, cause.theirs), layout_shape(
            look.layout, by_bytes=is_seen
        )

    @cached_property
    def values_key(self) -> object:
        size, front, rules = self.look.layout.size, self.cause.front, self.look.layout.rules
        members = []
        for member, parts in self.read:
            bits = max(member.bits, 1)  # a BOOL alone in its byte reads the same as bit 0 of it
            form = stored_form(member.leaf.type, rules)
            members.append((member.start + front, bits, form, *self.plain_values(member, parts)))
        return size + front + self.cause.back, tuple(members)

    @cached_property
    def places_key(self) -> object:
        """Return a value that is equal for readings with equal byte order, cause kind and member places."""
        front = self.cause.front
        return (
            self.order_key,
            self.cause.kind,
            [(member.leaf.path, member.start + front, member.bits) for member, _ in self.read],
        )

    def find_exchanged(self) -> str:
        """Return a number that would be far likelier with its bytes exchanged, or ""."""
        for member, parts in self.read:
            if not is_number(member) or member.leaf.size == 1 or member.bits:
                continue
            share: float = max(len(set(parts)), 1) ** (REPEAT_EXPONENT - 1)
            own, *others = (
                share
                * sum(found.points for part in set(parts) if (found := self.look.evidence(member, way(part))))
                for way in (bytes, reverse_bytes, exchange_in_pairs, exchange_words)
            )
            if own < UNLIKELY_POINTS and max(others) > own + EXCHANGED_LEAD[member.leaf.size > 2]:
                value = decode_leaf(self.look.layout, member.leaf, parts[-1])
                return f"{self.path(member)} = {value_text(member.leaf, value, parts[-1])}"
        return ""

    @property
    def widest_number(self) -> int:
        """Return the size of the widest number; up to 2, exchanged bytes are only another byte order."""
        return max((member.leaf.size for member, _ in self.read if is_number(member)), default=0)

    @cached_property
    def values_by_path(self) -> dict[str, list[object]]:
        layout = self.look.layout
        return {
            member.leaf.path: [decode_leaf(layout, member.leaf, part) for part in parts]
            for member, parts in self.read
        }

    def plain_values(self, member: JudgedMember, parts: list[bytes]) -> Iterator[object]:
        """Yield the value bytes of a member in each message; for a number, bytes in big-endian order."""
        rules = self.look.layout.rules
        is_little = rules.byte_order == "little"
        if isinstance(member.leaf.type, StringType) and member.leaf.type.wide:
            yield is_little
        for part in parts:
            value = value_bytes(member.leaf, part, rules)
            yield value[::-1] if is_little and is_number(member) else value

    def is_negative(self, one: MemberPoints) -> bool:
        type_ = one.member.leaf.type
        if not isinstance(type_, Elementary) or type_.kind is not ValueKind.DURATION:
            return False
        start, stop = one.member.start, one.member.stop
        last = 0 if self.look.layout.rules.byte_order == "big" else -1
        return any(unit[start:stop][last] > 127 for unit in self.cutting.units if len(unit) >= stop)

    def path(self, member: JudgedMember) -> str:
        return member.leaf.path or self.look.layout.name

    def reasons(self) -> tuple[Reason, ...]:
        look = self.look
        rows: list[tuple[float, Reason | MemberPoints]] = [
            (one.points, one) for one in self.others + self.steps
        ]
        rows += [(one.points, one) for one in self.member_points]
        rows.sort(key=lambda one: -abs(one[0]))
        shown = [self.word_reason(one) for _, one in rows[:MOST_REASONS]]
        if look.layout.leaf_count > look.stop:
            shown.append(
                Reason(0.0, "", f"only the first {look.stop} of {look.layout.leaf_count} members are judged")
            )
        return tuple(reason for reason in shown if reason.points or not reason.path)

    def word_reason(self, one: Reason | MemberPoints) -> Reason:
        if isinstance(one, Reason):
            return one
        leaf, path = one.member.leaf, self.path(one.member)
        if one.member.bits:
            return Reason(
                round(one.points, 2), leaf.path, f"16#{one.raw.hex().upper()}, BOOLs up to {path}: {one.why}"
            )
        value = value_text(leaf, decode_leaf(self.look.layout, leaf, one.raw), one.raw)
        shown = value if len(value) <= MOST_VALUE_CHARACTERS else value[:MOST_VALUE_CHARACTERS] + "..."
        return Reason(round(one.points, 2), leaf.path, f"{path} = {shown}: {one.why}")


def reverse_bytes(raw: bytes) -> bytes:
    return raw[::-1]


def is_number(member: JudgedMember) -> bool:
    return not isinstance(member.leaf.type, StringType) and not member.leaf.coding.code.endswith("s")
