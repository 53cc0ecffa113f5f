"""Drift: our type with one member more, one fewer, or one of another width, as the sender may have it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from heapq import nlargest
from itertools import islice
from operator import itemgetter
from typing import Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.compare.likelihood import (
    FEWER,
    MORE,
    REPEATED,
    WIDTH,
    FitCause,
    LeafEvidence,
    evidence,
)
from trcvtui.udt.layout.layout import Layout, Leaf, Profile, beside, lay_out
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf
from trcvtui.udt.layout.placing import Placing, Span, up
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
MOST_LEAVES: Final = 256
MOST_DRIFTS: Final = 24  # that are returned
MOST_TRIED: Final = 4000  # of one layout that have the right size
FIRST_SIGHT: Final = 3  # messages, the last ones, by which those are chosen
MOST_MORE: Final = 256  # bytes of a member more
LARGEST_ALIGN: Final = 8
SLACK: Final = 7  # bytes that gaps can take or give
COST: Final = -8.0  # points of a drift
EACH_BYTE: Final = -0.4  # of a member more, up to 8
UNKNOWN: Final = "\0"  # the name of a member that our type does not have: no source can have it
FILLERS: Final = tuple(ELEMENTARY[name] for name in ("BOOL", "BYTE", "WORD", "DWORD", "LWORD"))
FAMILIES: Final = (
    ("SINT", "INT", "DINT", "LINT"),
    ("USINT", "UINT", "UDINT", "ULINT"),
    ("BYTE", "WORD", "DWORD", "LWORD"),
    ("REAL", "LREAL"),
    ("TIME", "LTIME"),
    ("DINT", "UDINT", "REAL"),
    ("LINT", "ULINT", "LREAL"),
)

_Part = tuple[str, Type, Node | Span]


class _Drift(NamedTuple):
    """One drift: what it is, the size of the type then, and the type, which is made only where that fits."""

    cause: FitCause
    span: Node | Span
    type: Callable[[], Type]


def is_unknown(leaf: Leaf) -> bool:
    """Return whether a leaf is of a member that our type does not have."""
    return UNKNOWN in leaf.path


def drifted_layouts(
    layouts: Sequence[tuple[Sequence[Profile], Layout]], messages: Sequence[bytes], own: LayoutRules
) -> Iterator[tuple[tuple[Profile, ...], Layout, FitCause]]:
    """Yield the likeliest ways in which a drifted type has the size of the messages, each once."""
    size = len(messages[-1])
    asked = [(profile, layout) for profiles, layout in layouts for profile in profiles]
    known: dict[LayoutRules, list[tuple[FitCause, Type, Node]]] = {}  # the same in both byte orders
    found: dict[object, tuple[float, Profile, FitCause, Type]] = {}
    judge = _Judge(messages)
    for profile, layout in asked:
        is_several = size > layout.size and not size % max(layout.size, 1)  # messages in one
        if is_several or not 0 < layout.leaf_count <= MOST_LEAVES:
            continue
        rules = beside(profile.rules, own)
        in_order = replace(rules, byte_order="big")
        if in_order not in known:
            drifts = _Drifts(rules).of(layout.type, size - layout.size, "")
            fitting = ((drift.cause, drift.type()) for drift in drifts if drift.span.size == size)
            place = Placing(rules).place
            known[in_order] = [(*one, place(one[1], "")) for one in islice(fitting, MOST_TRIED)]
        for cause, type_, node in known[in_order]:
            points = cause.cost + judge.points(node, 0, rules)
            key = rules.byte_order, profile.text, cause.member, cause.theirs, round(points, 6)
            found.setdefault(key, (points, profile, cause, type_))
    seen = {_places(layout, shift) for _, layout in asked for shift in (0, size - layout.size)}
    for _, profile, cause, type_ in nlargest(MOST_DRIFTS, found.values(), key=itemgetter(0)):
        layout = lay_out(type_, beside(profile.rules, own), layouts[0][1].name)
        places = _places(layout)
        if places not in seen:
            seen.add(places)
            yield (profile,), layout, cause


class _Judge:
    """What the messages say for members at given places: at first sight, each place looked at once."""

    def __init__(self, messages: Sequence[bytes]) -> None:
        self.messages = messages[-FIRST_SIGHT:]
        self.at_place: dict[tuple[int, int, str], tuple[float, Node]] = {}
        self.of_bytes: dict[object, LeafEvidence | None] = {}

    def points(self, node: Node, offset: int, rules: LayoutRules) -> float:
        key = id(node), offset, rules.byte_order
        if key not in self.at_place:
            if isinstance(node, PlacedLeaf):
                points = self.leaf_points(node, offset, rules)
            elif isinstance(node, PlacedArray):
                starts = (node.place(number)[0] for number in range(node.count))
                points = sum(self.points(node.element, offset + start, rules) for start in starts)
            else:
                parts = zip(node.names, node.offsets, node.nodes, strict=True)
                points = sum(
                    self.points(part, offset + start, rules) for name, start, part in parts if name != UNKNOWN
                )
            self.at_place[key] = points, node
        return self.at_place[key][0]

    def leaf_points(self, node: PlacedLeaf, offset: int, rules: LayoutRules) -> float:
        told = []
        for part in {message[offset : offset + node.size] for message in self.messages}:
            key = node.type, stored_form(node.type, rules), rules.byte_order, node.is_bit, part
            if key not in self.of_bytes:
                leaf = Leaf("", node.type, offset, node.size, node.coding, 0 if node.is_bit else None)
                self.of_bytes[key] = evidence(leaf, part, rules) if len(part) == node.size else None
            found = self.of_bytes[key]
            if found is not None:
                told.append(found.points)
        return sum(told) / len(told) * len(told) ** REPEATED if told else 0.0


def _places(layout: Layout, shift: int = 0) -> tuple[object, ...]:
    """Return where the members of our own type lie, and in which form."""
    rules = layout.rules
    return rules.byte_order, *(
        (leaf.path, leaf.offset + shift, leaf.bit, leaf.size, stored_form(leaf.type, rules))
        for leaf in layout.leaves()
        if not is_unknown(leaf)
    )


class _Sizes:
    """The size of a STRUCT with others in place of some parts: what follows lies alike at like remainders."""

    def __init__(self, placing: Placing, type_: Struct, parts: Sequence[_Part]) -> None:
        self.placing, self.type, self.parts = placing, type_, parts
        self.before = [placing.spots(type_, parts[:at])[1:] for at in range(len(parts) + 1)]
        self.starts = [*(offset for offset, _ in placing.spots(type_, parts)[0]), up(*self.before[-1])]
        self.known: dict[tuple[int, int], tuple[list[int], int, int]] = {}
        self.has_bits = _has_bit(parts)

    def span(self, at: int, stop: int, *new: _Part) -> tuple[Span, int]:
        """Return the size with these for the parts from `at` to `stop`, how far what follows is moved."""
        if self.has_bits or _has_bit(new):  # where the next one lies tells no remainder
            spots, end, align = self.placing.spots(self.type, [*self.parts[:at], *new, *self.parts[stop:]])
            starts = [offset for offset, _ in spots[at + len(new) :]]
        else:
            end, align = self.before[at]
            _, end, own = self.placing.spots(self.type, [_filled(end), *new])
            bytes_before = end - end % LARGEST_ALIGN
            starts, end, last = self.after(stop, end % LARGEST_ALIGN)
            starts, end = [bytes_before + start for start in starts[:1]], bytes_before + end
            align = max(align, own, last)
        size = up(end, align)
        return Span(size, align), (starts[0] if starts else size) - self.starts[stop]

    def after(self, stop: int, filled: int) -> tuple[list[int], int, int]:
        if (stop, filled) not in self.known:
            spots, end, align = self.placing.spots(self.type, [_filled(filled), *self.parts[stop:]])
            self.known[stop, filled] = [offset for offset, _ in spots[1:]], end, align
        return self.known[stop, filled]


def _filled(size: int) -> _Part:
    return "", ELEMENTARY["BYTE"], Span(size, 1)


def _has_bit(parts: Sequence[_Part]) -> bool:
    return any(isinstance(node, PlacedLeaf) and node.is_bit for _, _, node in parts)


class _Drifts:
    """The drifts of a type in one layout, each with its size: few have that of the messages."""

    def __init__(self, rules: LayoutRules) -> None:
        self.placing = Placing(rules)

    def of(self, type_: Type, spare: int, path: str) -> Iterator[_Drift]:
        """Yield the drifts that can make the type about `spare` bytes larger."""
        match type_:
            case Array(element=element, count=count):
                for drift in self.of(element, spare // count, path):
                    pitch, align = self.placing.pitch(drift.span)
                    yield _Drift(
                        drift.cause, Span(pitch * count, align), partial(_array_of, type_, drift.type)
                    )
            case Struct(members=members, bit_fields=()) if len(members) <= MOST_MEMBERS:
                yield from self.of_struct(type_, spare, path)
            case _:
                for other in _widths(type_, spare):
                    about = f"here it is {type_text(type_)}"
                    cause = FitCause(WIDTH, 0, 0, 0, COST, about, member=path, theirs=type_text(other))
                    try:
                        node = self.placing.place(other, path)
                    except UserError:  # a text that this layout cannot hold
                        continue
                    yield _Drift(cause, node, partial(_same, other))

    def of_struct(self, type_: Struct, spare: int, path: str) -> Iterator[_Drift]:
        parts = self.placing.parts(type_, path)
        first = len(parts) - len(type_.members)  # 1 where it EXTENDS another one
        span = _Sizes(self.placing, type_, parts).span
        paths = [f"{path}.{name}" if path and name else path or name for name, _, _ in parts]
        for at, (name, inner, _) in enumerate(parts):
            for drift in self.of(inner, spare, paths[at]):
                found, _ = span(at, at + 1, (name, inner, drift.span))
                yield _Drift(drift.cause, found, partial(_with, type_, at, at + 1, first, name, drift.type))
            if spare <= 0 and at >= first:
                cause = FitCause(FEWER, cost=COST, about="the sender may not have it", member=paths[at])
                yield _Drift(cause, span(at, at + 1)[0], partial(_with, type_, at, at + 1, first))
        for at in range(first, len(parts) + 1):
            seen = set()
            place = paths[at] if at < len(parts) else f"the end of {path}" if path else "the end"
            for filler in _fillers(spare):
                found, shift = span(at, at, (UNKNOWN, filler, self.placing.place(filler, path)))
                if (found, shift) not in seen:
                    seen.add((found, shift))
                    cost = COST + EACH_BYTE * min(max(shift, 0), 8)
                    about = "the sender may have them"
                    cause = FitCause(MORE, shift, cost=cost, about=about, member=place)
                    made = partial(_with, type_, at, at, first, UNKNOWN, partial(_same, filler))
                    yield _Drift(cause, found, made)


def _same(type_: Type) -> Type:
    return type_


def _array_of(type_: Array, element: Callable[[], Type]) -> Type:
    return replace(type_, element=element())


def _with(
    type_: Struct, at: int, stop: int, first: int, name: str = "", new: Callable[[], Type] | None = None
) -> Type:
    """Return the STRUCT with one member, or none, in place of those from `at` to `stop`."""
    if new is not None and at < first:
        base = new()
        assert isinstance(base, Struct)
        return replace(type_, base=base)
    members = () if new is None else (Member(name, new()),)
    return replace(type_, members=(*type_.members[: at - first], *members, *type_.members[stop - first :]))


def _fillers(spare: int) -> Iterator[Type]:
    if -SLACK <= spare <= MOST_MORE:
        yield from FILLERS
        for count in range(max(spare - SLACK, 3), spare + SLACK + 1):
            yield Array(((1, count),), ELEMENTARY["BYTE"])


def _widths(type_: Type, spare: int) -> Iterator[Type]:
    match type_:
        case Elementary(name=name) if abs(spare) <= 2 * SLACK:
            for family in FAMILIES:
                yield from (ELEMENTARY[one] for one in family if name in family and one != name)
        case Enumeration(base=base):
            for other in _widths(base, spare):
                assert isinstance(other, Elementary)
                yield replace(type_, base=other, is_named=True)
        case StringType(length=length) if length is not None and spare:
            for more in range(spare - SLACK, spare + SLACK + 1):
                if more * spare > 0 and length + more > 0:
                    yield replace(type_, length=length + more)
