"""Drift: our type with one member more, one fewer, or one of another width, as a sender may have it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from heapq import nlargest
from itertools import islice
from operator import itemgetter
from typing import Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.compare.causes import FEWER, MEMBER_MORE, WIDTH, FitCause
from trcvtui.udt.compare.likelihood import REPEAT_EXPONENT, LeafEvidence, leaf_evidence, repeated_zero_points
from trcvtui.udt.layout.layout import Layout, Leaf, Profile, lay_out, merge_own_rules
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct
from trcvtui.udt.layout.placing import PlacedParts, Placer, round_up
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.layout.value_text import stored_form
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Elementary,
    Enumeration,
    Member,
    StringType,
    Struct,
    Type,
    type_text,
)

MOST_MEMBERS: Final = 64  # of a STRUCT whose drifts are tried
MOST_LEAVES: Final = 256  # that are judged
MOST_DRIFTS: Final = 24  # that are returned
MOST_DRIFTS_TRIED: Final = 4000  # of the right size, in one layout
MOST_FIRST_MESSAGES: Final = 3  # the last messages, which choose the drifts to return
MOST_ADDED_BYTES: Final = 256  # of an added member
LARGEST_ALIGN: Final = 8
GAP_SLACK: Final = 7  # bytes by which gaps can grow or shrink
DRIFT_COST: Final = -8.0  # points of a drift
SAME_WIDTH_COST: Final = -9.5  # of another type of the same width, as REAL for DINT
ADDED_BYTE_COST: Final = -0.4  # for each byte of an added member, up to 8
UNKNOWN: Final = "\0"  # the name of a member that our type lacks: no source can declare it
FILLER_TYPES: Final = tuple(ELEMENTARY[name] for name in ("LWORD", "DWORD", "WORD", "BYTE", "BOOL"))
TYPE_FAMILIES: Final = (
    ("SINT", "INT", "DINT", "LINT"),
    ("USINT", "UINT", "UDINT", "ULINT"),
    ("BYTE", "WORD", "DWORD", "LWORD"),
    ("REAL", "LREAL"),
    ("TIME", "LTIME"),
    ("DINT", "UDINT", "REAL"),
    ("LINT", "ULINT", "LREAL"),
)

_StructPart = tuple[str, Type, Node | PlacedParts]


class _Drift(NamedTuple):
    """One drift: its cause, its placed type, and a function that makes the type if it is likely."""

    cause: FitCause
    lying: Node | PlacedParts
    type: Callable[[], Type]


def is_unknown_member(leaf: Leaf) -> bool:
    """Return whether a leaf belongs to a member that our type lacks."""
    return UNKNOWN in leaf.path


def find_drifted_layouts(
    layouts: Sequence[tuple[Sequence[Profile], Layout]], messages: Sequence[bytes], own: LayoutRules
) -> Iterator[tuple[tuple[Profile, ...], Layout, FitCause]]:
    """Yield the likeliest drifts that are as long as the newest message, each once."""
    size = len(messages[-1])
    pairs = [(profile, layout) for profiles, layout in layouts for profile in profiles]
    known: dict[LayoutRules, list[_Drift]] = {}  # both byte orders share them
    found: dict[object, tuple[float, Profile, _Drift]] = {}
    judge = _PlaceScorer(messages)
    for profile, layout in pairs:
        is_several = size > layout.size and not size % max(layout.size, 1)  # several values in one message
        if is_several or not 0 < layout.leaf_count <= MOST_LEAVES:
            continue
        rules = merge_own_rules(profile.rules, own)
        in_order = replace(rules, byte_order="big")
        if in_order not in known:
            drifts = _DriftSearch(rules).find_drifts(layout.type, size - layout.size, "")
            fitting = (drift for drift in drifts if drift.lying.size == size)
            known[in_order] = list(islice(fitting, MOST_DRIFTS_TRIED))
        for drift in known[in_order]:
            cause = drift.cause
            points = round(cause.cost + judge.score_node(drift.lying, 0, rules), 6)
            # Equal points for the same change are taken as one reading; the first layout stays.
            key = rules.byte_order, profile.text, cause.member, cause.theirs, points
            found.setdefault(key, (points, profile, drift))
    seen = {_own_places_key(layout, shift) for _, layout in pairs for shift in (0, size - layout.size)}
    for _, profile, drift in nlargest(MOST_DRIFTS, found.values(), key=itemgetter(0)):
        layout = lay_out(drift.type(), merge_own_rules(profile.rules, own), layouts[0][1].name)
        places = _own_places_key(layout)
        if places not in seen:
            seen.add(places)
            yield (profile,), layout, drift.cause


class _PlaceScorer:
    """Estimates the scores of members at given offsets in the newest messages, once for each offset."""

    def __init__(self, messages: Sequence[bytes]) -> None:
        self.messages = messages[-MOST_FIRST_MESSAGES:]
        self.at_place: dict[tuple[int, int, str], tuple[float, Node | PlacedParts]] = {}
        self.of_bytes: dict[object, LeafEvidence | None] = {}

    def score_node(self, node: Node | PlacedParts, offset: int, rules: LayoutRules) -> float:
        key = id(node), offset, rules.byte_order
        if key not in self.at_place:
            if isinstance(node, PlacedLeaf):
                points = self.score_leaf(node, offset, rules)
            else:
                points = sum(self.score_node(part, offset + start, rules) for start, part in _parts(node))
            self.at_place[key] = points, node
        return self.at_place[key][0]

    def score_leaf(self, node: PlacedLeaf, offset: int, rules: LayoutRules) -> float:
        points_by_bytes: dict[bytes, float] = {}
        for part in {message[offset : offset + node.size] for message in self.messages}:
            key = node.type, stored_form(node.type, rules), rules.byte_order, node.is_bit, part
            if key not in self.of_bytes:
                leaf = Leaf("", node.type, offset, node.size, node.coding, 0 if node.is_bit else None)
                self.of_bytes[key] = leaf_evidence(leaf, part, rules) if len(part) == node.size else None
            found = self.of_bytes[key]
            if found is not None:
                points_by_bytes[part] = found.points
        if not points_by_bytes:
            return 0.0
        points: float = sum(points_by_bytes.values()) * len(points_by_bytes) ** (REPEAT_EXPONENT - 1)
        return points + repeated_zero_points(node.type, points_by_bytes)


def _parts(node: PlacedArray | PlacedStruct | PlacedParts) -> Iterable[tuple[int, Node | PlacedParts]]:
    if isinstance(node, PlacedParts):
        return node.parts
    if isinstance(node, PlacedArray):
        return ((node.element_place(number)[0], node.element) for number in range(node.count))
    return zip(node.offsets, node.nodes, strict=True)


def _own_places_key(layout: Layout, shift: int = 0) -> tuple[object, ...]:
    """Return the places and stored forms of the members of our own type."""
    rules = layout.rules
    return rules.byte_order, *(
        (leaf.path, leaf.offset + shift, leaf.bit, leaf.size, stored_form(leaf.type, rules))
        for leaf in layout.leaves()
        if not is_unknown_member(leaf)
    )


class _StructVariants:
    """A STRUCT with parts replaced. Without bits, later places depend only on end % LARGEST_ALIGN."""

    def __init__(self, placing: Placer, type_: Struct, parts: Sequence[_StructPart]) -> None:
        self.placing, self.type, self.parts = placing, type_, parts
        self.cap, self.has_bits = placing.align_cap(type_), _has_bit(parts)
        spots, end, align = placing.member_spots(type_, parts)
        self.starts = [*(offset for offset, _ in spots), round_up(end, align)]
        self.heads = [PlacedParts(0, placing.rules.struct_floor)]
        for start, part in zip(self.starts, parts, strict=False):
            head = self.heads[-1]
            _, end, step = self.place_part(part, head.size)
            self.heads.append(
                PlacedParts(end, max(head.align, step), ((0, head), *_place_if_known(start, part)))
            )
        self.tails: dict[tuple[int, int], PlacedParts] = {}

    def place_part(self, part: _StructPart, end: int) -> tuple[int, int, int]:
        """Return start, end and alignment of a part that is placed after `end`."""
        _, inner, node = part
        step = self.placing.member_align(node, self.cap)
        start = round_up(end, step)
        return start, round_up(start + node.size, self.placing.end_multiple(inner)), step

    def replace_parts(self, at: int, stop: int, new: _StructPart | None = None) -> tuple[PlacedParts, int]:
        """Return the STRUCT with parts `at` to `stop` replaced or removed, and the next part's shift."""
        if self.has_bits or (new and _has_bit([new])):  # with bits a place needs more than the remainder
            parts = [*self.parts[:at], *([new] if new else []), *self.parts[stop:]]
            spots, end, align = self.placing.member_spots(self.type, parts)
            places = zip(spots, parts, strict=True)
            lying = [one for (start, _), part in places for one in _place_if_known(start, part)]
            starts = [start for start, _ in spots[len(parts) - len(self.parts) + stop :]]
        else:
            head = self.heads[at]
            start, end, step = self.place_part(new, head.size) if new else (0, head.size, 1)
            before = end - end % LARGEST_ALIGN
            tail = self.place_tail(stop, end % LARGEST_ALIGN)
            lying = [(0, head), *(_place_if_known(start, new) if new else []), (before, tail)]
            starts = [before + place for place, _ in tail.parts[:1]]
            end, align = before + tail.size, max(step, head.align, tail.align)
        size = round_up(end, align)
        return PlacedParts(size, align, tuple(lying)), (starts[0] if starts else size) - self.starts[stop]

    def place_tail(self, stop: int, filled: int) -> PlacedParts:
        """Return the parts from number `stop` on, placed after `filled` bytes."""
        if stop == len(self.parts):
            return PlacedParts(filled, 1)
        if (stop, filled) not in self.tails:
            part = self.parts[stop]
            start, end, step = self.place_part(part, filled)
            before, rest = end - end % LARGEST_ALIGN, self.place_tail(stop + 1, end % LARGEST_ALIGN)
            lying = *_place_if_known(start, part), (before, rest)
            self.tails[stop, filled] = PlacedParts(before + rest.size, max(step, rest.align), lying)
        return self.tails[stop, filled]


def _place_if_known(start: int, part: _StructPart) -> list[tuple[int, Node | PlacedParts]]:
    """Return a part with its place, or nothing if our type lacks the part."""
    name, _, lying = part
    return [] if name == UNKNOWN else [(start, lying)]


def _has_bit(parts: Sequence[_StructPart]) -> bool:
    return any(isinstance(node, PlacedLeaf) and node.is_bit for _, _, node in parts)


class _DriftSearch:
    """Finds the drifts of a type in one layout. All are placed, but types are made only for a few."""

    def __init__(self, rules: LayoutRules) -> None:
        self.placing = Placer(rules)

    def find_drifts(self, type_: Type, spare: int, path: str) -> Iterator[_Drift]:
        """Yield the drifts that may make the type about `spare` bytes larger."""
        match type_:
            case Array(element=element, count=count):
                for drift in self.find_drifts(element, spare // count, path):
                    pitch, align = self.placing.pitch_and_align(drift.lying)
                    lying = tuple((pitch * number, drift.lying) for number in range(count))
                    made = partial(_array_with_element, type_, drift.type)
                    yield _Drift(drift.cause, PlacedParts(pitch * count, align, lying), made)
            case Struct(members=members, bit_fields=()) if len(members) <= MOST_MEMBERS:
                yield from self.find_struct_drifts(type_, spare, path)
            case _:
                size, about = self.placing.place(type_, path).size, f"our type has {type_text(type_)}"
                for other in _other_width_types(type_, spare):
                    try:
                        node = self.placing.place(other, path)
                    except UserError:  # a text too long for this layout
                        continue
                    cost = DRIFT_COST if node.size != size else SAME_WIDTH_COST
                    cause = FitCause(WIDTH, cost=cost, about=about, member=path, theirs=type_text(other))
                    yield _Drift(cause, node, partial(_return_type, other))

    def find_struct_drifts(self, type_: Struct, spare: int, path: str) -> Iterator[_Drift]:
        parts = self.placing.place_members(type_, path)
        first = len(parts) - len(type_.members)  # 1 where it EXTENDS another one
        change = _StructVariants(self.placing, type_, parts).replace_parts
        paths = [f"{path}.{name}" if path and name else path or name for name, _, _ in parts]
        for at, (name, inner, _) in enumerate(parts):
            for drift in self.find_drifts(inner, spare, paths[at]):
                found, _ = change(at, at + 1, (name, inner, drift.lying))
                yield _Drift(drift.cause, found, partial(_splice, type_, at, at + 1, first, name, drift.type))
            if spare <= 0 and at >= first and len(parts) > 1:
                cause = FitCause(FEWER, cost=DRIFT_COST, about="the sender may lack it", member=paths[at])
                yield _Drift(cause, change(at, at + 1)[0], partial(_splice, type_, at, at + 1, first))
        for at in range(first, len(parts) + 1):
            seen = set()
            place = paths[at] if at < len(parts) else f"the end of {path}" if path else "the end"
            for filler in _filler_types(spare):
                found, shift = change(at, at, (UNKNOWN, filler, self.placing.place(filler, path)))
                if (*found[:2], shift) not in seen:
                    seen.add((*found[:2], shift))
                    cost = DRIFT_COST + ADDED_BYTE_COST * min(max(shift, 0), 8)
                    about = "the sender's type may have them"
                    cause = FitCause(MEMBER_MORE, shift, cost=cost, about=about, member=place)
                    made = partial(_splice, type_, at, at, first, UNKNOWN, partial(_return_type, filler))
                    yield _Drift(cause, found, made)


def _return_type(type_: Type) -> Type:
    return type_


def _array_with_element(type_: Array, element: Callable[[], Type]) -> Type:
    return replace(type_, element=element())


def _splice(
    type_: Struct, at: int, stop: int, first: int, name: str = "", new: Callable[[], Type] | None = None
) -> Type:
    """Return the STRUCT with parts `at` to `stop` replaced by one member, or removed."""
    if new is not None and at < first:
        base = new()
        assert isinstance(base, Struct)
        return replace(type_, base=base)
    members = () if new is None else (Member(name, new()),)
    return replace(type_, members=(*type_.members[: at - first], *members, *type_.members[stop - first :]))


def _filler_types(spare: int) -> Iterator[Type]:
    if -GAP_SLACK <= spare <= MOST_ADDED_BYTES:
        yield from FILLER_TYPES
        for count in range(max(spare - GAP_SLACK, 3), spare + GAP_SLACK + 1):
            yield Array(((1, count),), ELEMENTARY["BYTE"])


def _other_width_types(type_: Type, spare: int) -> Iterator[Type]:
    match type_:
        case Elementary(name=name) if abs(spare) <= 2 * GAP_SLACK:
            for family in TYPE_FAMILIES:
                yield from (ELEMENTARY[one] for one in family if name in family and one != name)
        case Enumeration(base=base):
            for other in _other_width_types(base, spare):
                assert isinstance(other, Elementary)
                yield replace(type_, base=other, is_named=True)
        case StringType(length=length) if length is not None and spare:
            for more in range(spare - GAP_SLACK, spare + GAP_SLACK + 1):
                if more * spare > 0 and length + more > 0:
                    yield replace(type_, length=length + more)
