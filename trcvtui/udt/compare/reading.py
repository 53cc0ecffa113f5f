"""One reading: a layout and a cause held against bytes, with the points of members, length and padding."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple

from trcvtui.udt.compare.beside import extra_evidence
from trcvtui.udt.compare.causes import CutMessages, FitCause, cut
from trcvtui.udt.compare.drift import MOST_LEAVES, is_unknown_member
from trcvtui.udt.compare.likelihood import (
    MOST_MESSAGES,
    REPEAT_EXPONENT,
    LeafEvidence,
    bits_evidence,
    evidence,
    exchange_pairs,
    exchange_words,
    gap_points,
    judge_step,
    repeated_zero_points,
    value_bytes,
)
from trcvtui.udt.layout.layout import Layout, LayoutRules, Leaf, Profile, layout_shape
from trcvtui.udt.layout.value_text import stored_form, value_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import Elementary, StringType, ValueKind, all_parts

MOST_GAPS: Final = 16  # that are looked at
MOST_VALUE_CHARACTERS: Final = 32  # characters of a value
MOST_REASONS: Final = 64

# The points of what is no member; those of members and causes stand in likelihood.py.
LENGTH: Final = (8.0, -30.0)  # the message has the size of the type
MULTIPLE_POINTS: Final = -1.0  # less, when it is several times that size
MOST_ORDER_POINTS: Final = 8.0  # points of numbers for a byte order
MOST_ROUND_POINTS: Final = 6.0  # points of numbers that are round in a byte order, beside some that are not
UNLIKELY_POINTS: Final = -3.0  # points of a number
EXCHANGED_LEAD: Final = (6.0, 4.5)  # how much likelier with other bytes a number of 2 bytes is, and of more
CONTRARY_WEIGHT: Final = 3.0  # how much more a number counts that speaks for the other order


class Reason(NamedTuple):
    """Points for (above 0) or against, the member's path ("" for length and padding), and the words."""

    points: float
    path: str
    text: str


EvidenceCache = dict[tuple[object, ...], dict[bytes, LeafEvidence | None]]


class ReadMember(NamedTuple):
    leaf: Leaf
    start: int
    stop: int
    known: dict[bytes, LeafEvidence | None]  # of the same type, in the same form and byte order
    bits: int  # BOOLs in this byte, at the last of them
    can_narrow: bool  # what follows would lie where it does if this one were half as wide


class LayoutView:
    """The leaves and the gaps of a layout that are looked at, what is known of bytes shared with others."""

    def __init__(self, layout: Layout, known: EvidenceCache) -> None:
        self.layout, self.members = layout, []
        self.stop = min(layout.leaf_count, MOST_LEAVES)
        has_bit_fields = any(getattr(part, "bit_fields", ()) for part in all_parts(layout.type))
        self.gaps = [] if has_bit_fields else layout.padding()[:MOST_GAPS]  # the room of those is no padding
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
            self.members.append(ReadMember(leaf, leaf.offset, stop, kept, bits, can_narrow))

    def evidence(self, member: ReadMember, raw: bytes) -> LeafEvidence | None:
        if raw not in member.known:
            found = (
                bits_evidence(member.bits, raw)
                if member.bits
                else evidence(member.leaf, raw, self.layout.rules)
            )
            member.known[raw] = found
        return member.known[raw]


class MemberPoints(NamedTuple):
    """What one member says, with its bytes that say the nearest to it."""

    member: ReadMember
    points: float
    fair: float
    order: float
    raw: bytes
    why: str
    parts: tuple[bytes, ...]  # all of its bytes, each once


# -- one reading ---------------------------------------------------------------------------------------------


class Reading:
    """A layout and a cause held against the bytes."""

    def __init__(
        self, profiles: tuple[Profile, ...], look: LayoutView, cause: FitCause, cutting: CutMessages
    ) -> None:
        self.profiles, self.look, self.cause, self.cutting = profiles, look, cause, cutting
        self.others: list[Reason] = []  # all reasons but the members'
        self.said: list[MemberPoints] = []
        self.steps: list[Reason] = []
        self.read: list[tuple[ReadMember, list[bytes]]] = []  # each member, its bytes as the reading has them
        self.has_length = True
        self.has_meaning = True  # what stands beside the members is known
        self.odd = ""  # a value that machines do not send
        self.filled = ""  # padding that is not 0
        self.narrow = ""  # a number that would be another one if it were half as wide
        self.has_plain = False  # a number that is round in no way

    @classmethod
    def judge(
        cls,
        profiles: tuple[Profile, ...],
        look: LayoutView,
        cause: FitCause,
        messages: Sequence[bytes],
        framed: bool,
    ) -> Reading | None:
        """Return the reading; None where the cause cannot be."""
        cutting = cut(cause, look.layout.size, messages, framed, MOST_MESSAGES)
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
            return False
        told = {}
        for unit, (before, after) in zip(units, self.cutting.extras, strict=True):
            if (before, after) not in told:
                extra = extra_evidence(cause, before, unit, after)
                if extra is None:
                    return False
                told[before, after] = extra
        self.has_meaning = all(extra.has_meaning for extra in told.values())
        befores = {before: extra.points - extra.of_after for (before, _), extra in told.items()}
        if len({extra.has_meaning for extra in told.values()}) > 1:  # a length in some of them is chance
            befores = dict.fromkeys(befores, min(befores.values()))
        afters = {after: extra.of_after for (_, after), extra in told.items()}
        points = sum(sum(one.values()) * len(one) ** (REPEAT_EXPONENT - 1) for one in (befores, afters))
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
            change = changes.get(member.leaf.size) if changes and is_number(member) else None
            if of_text and isinstance(member.leaf.type, StringType) and not look.layout.rules.text.header:
                change = of_text
            if change:
                changed = [change(part) for part in parts]
                has_changed = has_changed or changed != parts
                parts = changed
            self.judge_member(member, parts)
            self.read.append((member, parts))
        self.weaken_equals()
        return has_changed

    def weaken_equals(self) -> None:
        """Let equal bytes in several members, as in an ARRAY, say less than others would."""
        count = Counter(one.parts for one in self.said)
        for number, one in enumerate(self.said):
            share = count[one.parts] ** (REPEAT_EXPONENT - 1)
            points, fair, order = one.points * share, one.fair * share, one.order * share
            self.said[number] = one._replace(points=points, fair=fair, order=order)

    def judge_member(self, member: ReadMember, parts: list[bytes]) -> None:
        rules = self.look.layout.rules
        distinct = {value_bytes(member.leaf, part, rules): part for part in parts}.values()
        told = [(found, part) for part in distinct if (found := self.look.evidence(member, part))]
        if not told:
            return
        self.has_plain = self.has_plain or any(found.is_plain and member.leaf.size > 1 for found, _ in told)
        is_shared = self.look.layout.root.overlaps  # a UNION: what is none here may be another member
        odd = "" if is_shared else next((found.why for found, _ in told if found.is_odd), "")
        self.odd = self.odd or (f"{self.path(member)}: {odd}" if odd else "")
        share = len(told) ** REPEAT_EXPONENT / len(told)
        points = sum(found.points for found, _ in told)
        values = tuple(part for _, part in told)
        constant = repeated_zero_points(member.leaf.type, values)
        nearest, raw = min(told, key=lambda one: abs(one[0].points - points / len(told)))
        self.said.append(
            MemberPoints(
                member,
                points * share + constant,
                sum(found.fair for found, _ in told) * share + constant,
                sum(found.order for found, _ in told) * share,
                raw,
                nearest.why,
                values,
            )
        )
        self.judge_sign(member, values)
        if len(distinct) > 1:
            self.judge_steps(member, parts)

    def judge_sign(self, member: ReadMember, parts: Sequence[bytes]) -> None:
        """Note a number whose values all are negative ones of half its width, with padding after it."""
        type_ = member.leaf.type
        if not member.can_narrow or not isinstance(type_, Elementary) or type_.kind is not ValueKind.INTEGER:
            return
        bits, is_little = 4 * member.leaf.size, self.look.layout.rules.byte_order == "little"
        numbers = [int.from_bytes(part[::-1] if is_little else part, "big", signed=True) for part in parts]
        if bits > 8 and type_.code.islower() and all(1 << bits - 1 <= one < 1 << bits for one in numbers):
            half = numbers[-1] - (1 << bits)
            self.narrow = f"{self.path(member)} = {numbers[-1]} is {half} if the sender has it half as wide"

    def judge_steps(self, member: ReadMember, parts: list[bytes]) -> None:
        pairs = [(before, after) for before, after in pairwise(parts) if before != after]
        steps = [judge_step(member.leaf, before, after, self.look.layout.rules) for before, after in pairs]
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
        self.others.append(Reason(round(points + (MULTIPLE_POINTS if several > 1 else 0), 2), "", said))

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
                points *= len(there) ** REPEAT_EXPONENT
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
    def fair_score(self) -> float:
        """Return the points in a comparison of byte orders: all numbers of a sender may be round."""
        more = sum(one.fair - one.points for one in self.said)
        return self.score + (min(more, MOST_ROUND_POINTS) if self.has_plain else more)

    @property
    def order_points(self) -> float:
        """Return what the numbers say for the byte order: what speaks against it counts more."""
        told = [one.order for one in self.said]
        for_it = sum(points for points in told if points > 0)
        return min(for_it + CONTRARY_WEIGHT * sum(points for points in told if points < 0), MOST_ORDER_POINTS)

    @property
    def order(self) -> object:
        """Return in which order the bytes of numbers are read."""
        cause = self.cause
        return self.profiles[0].byte_order, cause.kind if cause.of_member or cause.of_all else None

    @cached_property
    def meaning(self) -> object:
        """Return a value that is equal for readings in which these bytes mean the same."""
        look = self.look
        is_seen = look.stop == look.layout.leaf_count and not any(map(self.is_negative, self.said))
        cause = self.cause
        return (cause.kind, cause.front, cause.back, cause.member, cause.theirs), layout_shape(
            look.layout, by_bytes=is_seen
        )

    @cached_property
    def values(self) -> object:
        size, front, rules = self.look.layout.size, self.cause.front, self.look.layout.rules
        members = []
        for member, parts in self.read:
            bits = max(member.bits, 1)  # a BOOL alone in its byte is read alike as a bit and as a byte
            form = stored_form(member.leaf.type, rules)
            members.append((member.start + front, bits, form, *self.plain_values(member, parts)))
        return size + front + self.cause.back, tuple(members)

    @cached_property
    def places(self) -> object:
        """Return where the members begin, and which of them are bits."""
        front = self.cause.front
        return (
            self.order,
            self.cause.kind,
            [(member.leaf.path, member.start + front, member.bits) for member, _ in self.read],
        )

    def find_exchanged(self) -> str:
        """Return a number that would be far likelier with its bytes exchanged; "" where there is none."""
        for member, parts in self.read:
            if not is_number(member) or member.leaf.size == 1 or member.bits:
                continue
            share: float = max(len(set(parts)), 1) ** (REPEAT_EXPONENT - 1)
            own, *others = (
                share
                * sum(found.points for part in set(parts) if (found := self.look.evidence(member, way(part))))
                for way in (bytes, reverse_bytes, exchange_pairs, exchange_words)
            )
            if own < UNLIKELY_POINTS and max(others) > own + EXCHANGED_LEAD[member.leaf.size > 2]:
                value = decode_leaf(self.look.layout, member.leaf, parts[-1])
                return f"{self.path(member)} = {value_text(member.leaf, value, parts[-1])}"
        return ""

    @property
    def widest_number(self) -> int:
        """Return the size of the largest number: up to 2, words exchanged are nothing, bytes the order."""
        return max((member.leaf.size for member, _ in self.read if is_number(member)), default=0)

    @cached_property
    def by_path(self) -> dict[str, list[object]]:
        """Return the values of each member."""
        layout = self.look.layout
        return {
            member.leaf.path: [decode_leaf(layout, member.leaf, part) for part in parts]
            for member, parts in self.read
        }

    def plain_values(self, member: ReadMember, parts: list[bytes]) -> Iterator[object]:
        """Yield what makes the value of a member, as it would be in big-endian."""
        rules = self.look.layout.rules
        is_little = rules.byte_order == "little"
        if isinstance(member.leaf.type, StringType) and member.leaf.type.wide:
            yield is_little
        for part in parts:
            said = value_bytes(member.leaf, part, rules)
            yield said[::-1] if is_little and is_number(member) else said

    def is_negative(self, one: MemberPoints) -> bool:
        type_ = one.member.leaf.type
        if not isinstance(type_, Elementary) or type_.kind is not ValueKind.DURATION:
            return False
        start, stop = one.member.start, one.member.stop
        last = 0 if self.look.layout.rules.byte_order == "big" else -1
        return any(unit[start:stop][last] > 127 for unit in self.cutting.units if len(unit) >= stop)

    def path(self, member: ReadMember) -> str:
        return member.leaf.path or self.look.layout.name

    def reasons(self) -> tuple[Reason, ...]:
        look = self.look
        said: list[tuple[float, Reason | MemberPoints]] = [
            (one.points, one) for one in self.others + self.steps
        ]
        said += [(one.points, one) for one in self.said]
        said.sort(key=lambda one: -abs(one[0]))
        shown = [self.word_reason(one) for _, one in said[:MOST_REASONS]]
        if look.layout.leaf_count > look.stop:
            shown.append(
                Reason(0.0, "", f"only the first {look.stop} of {look.layout.leaf_count} are judged")
            )
        return tuple(reason for reason in shown if reason.points or not reason.path)

    def word_reason(self, one: Reason | MemberPoints) -> Reason:
        if isinstance(one, Reason):
            return one
        leaf, path = one.member.leaf, self.path(one.member)
        if one.member.bits:
            return Reason(
                round(one.points, 2), leaf.path, f"16#{one.raw.hex().upper()} up to {path}: {one.why}"
            )
        value = value_text(leaf, decode_leaf(self.look.layout, leaf, one.raw), one.raw)
        shown = value if len(value) <= MOST_VALUE_CHARACTERS else value[:MOST_VALUE_CHARACTERS] + "..."
        return Reason(round(one.points, 2), leaf.path, f"{path} = {shown}: {one.why}")


def reverse_bytes(raw: bytes) -> bytes:
    return raw[::-1]


def is_number(member: ReadMember) -> bool:
    return not isinstance(member.leaf.type, StringType) and not member.leaf.coding.code.endswith("s")
