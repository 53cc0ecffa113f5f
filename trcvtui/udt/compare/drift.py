"""Drift: our type with one member more, one fewer, or one of another width, as the sender may have it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from heapq import nlargest
from operator import itemgetter
from typing import Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.compare.likelihood import (
    FEWER,
    MORE,
    MOST_MESSAGES,
    NONE,
    REPEATED,
    WIDTH,
    FitCause,
    evidence,
)
from trcvtui.udt.layout.layout import Layout, Leaf, Profile, beside, lay_out
from trcvtui.udt.layout.layout_tree import Node, leaves_of
from trcvtui.udt.layout.placing import Placing, Span
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
MOST_LEAVES: Final = 1024
MOST_DRIFTS: Final = 24  # that are returned
MOST_MORE: Final = 256  # bytes of a member more
SLACK: Final = 7  # bytes that gaps can take or give
COST: Final = -8.0  # points of a drift
EACH_BYTE: Final = -0.4  # of a member more, up to 8
UNKNOWN: Final = "?"  # the name of a member that our type does not have
FILLERS: Final = tuple(ELEMENTARY[name] for name in ("BOOL", "BYTE", "WORD", "DWORD", "LWORD"))
FAMILIES: Final = (
    ("SINT", "INT", "DINT", "LINT"),
    ("USINT", "UINT", "UDINT", "ULINT"),
    ("BYTE", "WORD", "DWORD", "LWORD"),
    ("REAL", "LREAL"),
    ("TIME", "LTIME"),
)

_Part = tuple[str, Type, Node | Span]


class _Drift(NamedTuple):
    """A drifted type with its size; `spots` has where in it what lies that our type has, too."""

    cause: FitCause
    type: Type
    span: Node | Span
    spots: Sequence[tuple[Type, int]] = ()


def is_unknown(leaf: Leaf) -> bool:
    """Return whether a leaf is of a member that our type does not have."""
    return UNKNOWN in leaf.path


def drifted_layouts(
    layouts: Sequence[tuple[Sequence[Profile], Layout]], messages: Sequence[bytes], own: LayoutRules
) -> Iterator[tuple[tuple[Profile, ...], Layout, FitCause]]:
    """Yield the likeliest ways in which a drifted type has the size of the messages, each once."""
    size = len(messages[-1])
    asked = [(profile, layout) for profiles, layout in layouts for profile in profiles]
    known: dict[LayoutRules, list[_Drift]] = {}  # of one byte order: the drifts are the same in both
    found: dict[object, tuple[float, int, Profile, _Drift]] = {}
    for profile, layout in asked:
        is_several = size > layout.size and not size % max(layout.size, 1)  # messages in one
        if is_several or not 0 < layout.leaf_count <= MOST_LEAVES:
            continue
        rules = beside(profile.rules, own)
        in_order = replace(rules, byte_order="big")
        if in_order not in known:
            drifts = _Drifts(rules).of(layout.type, size - layout.size, "")
            known[in_order] = [drift for drift in drifts if drift.span.size == size]
        judge = _Judge(rules, messages)
        for drift in known[in_order]:
            points = drift.cause.cost + sum(judge.points(type_, offset) for type_, offset in drift.spots)
            key = rules.byte_order, profile.text, drift.cause.member, drift.cause.theirs, round(points, 6)
            found.setdefault(key, (points, -len(found), profile, drift))
    seen = {_places(layout, shift) for _, layout in asked for shift in (0, size - layout.size)}
    for _, _, profile, drift in nlargest(MOST_DRIFTS, found.values(), key=itemgetter(0, 1)):
        layout = lay_out(drift.type, beside(profile.rules, own), layouts[0][1].name)
        places = _places(layout)
        if places not in seen:
            seen.add(places)
            yield (profile,), layout, drift.cause


class _Judge:
    """What the messages say for members at given places: a first sight, each place looked at once."""

    def __init__(self, rules: LayoutRules, messages: Sequence[bytes]) -> None:
        self.placing, self.messages = Placing(rules), messages[-MOST_MESSAGES:]
        self.known: dict[tuple[int, int], tuple[float, Type]] = {}

    def points(self, type_: Type, offset: int) -> float:
        key = id(type_), offset
        if key not in self.known:
            leaves = leaves_of(self.placing.place(type_, ""), "", offset)
            points = sum(self.leaf_points(leaf) for leaf in leaves if not is_unknown(leaf))
            self.known[key] = points, type_
        return self.known[key][0]

    def leaf_points(self, leaf: Leaf) -> float:
        parts = {message[leaf.offset : leaf.offset + leaf.size] for message in self.messages}
        told = [
            found.points
            for part in parts
            if len(part) == leaf.size and (found := evidence(leaf, part, self.placing.rules))
        ]
        return sum(told) / len(told) * len(told) ** REPEATED if told else 0.0


def _places(layout: Layout, shift: int = 0) -> tuple[object, ...]:
    """Return where the members of our own type lie, and in which form."""
    rules = layout.rules
    return rules.byte_order, *(
        (leaf.path, leaf.offset + shift, leaf.bit, leaf.size, stored_form(leaf.type, rules))
        for leaf in layout.leaves()
        if not is_unknown(leaf)
    )


class _Drifts:
    """The drifts of a type in one layout, each with its size: few have that of the messages."""

    def __init__(self, rules: LayoutRules) -> None:
        self.placing = Placing(rules)

    def of(self, type_: Type, spare: int, path: str) -> Iterator[_Drift]:
        """Yield the drifts that can make the type about `spare` bytes larger."""
        match type_:
            case Array(element=element, count=count):
                for cause, other, span, _ in self.of(element, spare // count, path):
                    pitch, align = self.placing.pitch(span)
                    whole = replace(type_, element=other)
                    yield _Drift(cause, whole, Span(pitch * count, align), ((whole, 0),))
            case Struct(members=members, bit_fields=()) if len(members) <= MOST_MEMBERS:
                yield from self.of_struct(type_, spare, path)
            case _:
                drifts: list[_Drift] = []
                for other in _widths(type_, spare):
                    about = f"here it is {type_text(type_)}"
                    cause = FitCause(WIDTH, 0, 0, 0, COST, about, member=path, theirs=type_text(other))
                    with suppress(UserError):  # a text that this layout cannot hold
                        drifts.append(_Drift(cause, other, self.placing.place(other, path), ((other, 0),)))
                yield from drifts

    def of_struct(self, type_: Struct, spare: int, path: str) -> Iterator[_Drift]:
        parts = self.placing.parts(type_, path)
        first = len(parts) - len(type_.members)  # 1 where it EXTENDS another one
        spots, size, _ = self.placing.spots(type_, parts)
        starts = [*(offset for offset, _ in spots), size]

        def changed(cause: FitCause, at: int, stop: int, *new: _Part) -> tuple[_Drift, int]:
            now = [*parts[:at], *new, *parts[stop:]]
            offsets, size, align = self.placing.spots(type_, now)
            if at < first:
                base = new[0][1]
                assert isinstance(base, Struct)
                other = replace(type_, base=base)
            else:
                members = (Member(name, inner) for name, inner, _ in new)
                other = replace(
                    type_, members=(*type_.members[: at - first], *members, *type_.members[stop - first :])
                )
            after = at + len(new)
            start = offsets[after][0] if after < len(offsets) else size
            spots = [
                (inner, offset)
                for (name, inner, _), (offset, _) in zip(now, offsets, strict=True)
                if name != UNKNOWN
            ]
            return _Drift(cause, other, Span(size, align), spots), start - starts[stop]

        paths = [f"{path}.{name}" if path and name else path or name for name, _, _ in parts]
        for at, (name, inner, _) in enumerate(parts):
            for drift in self.of(inner, spare, paths[at]):
                yield changed(drift.cause, at, at + 1, (name, drift.type, drift.span))[0]
            if spare <= 0 and at >= first:
                cause = FitCause(FEWER, cost=COST, about="the sender may not have it", member=paths[at])
                yield changed(cause, at, at + 1)[0]
        for at in range(first, len(parts) + 1):
            seen = set()
            for filler in _fillers(spare):
                node = self.placing.place(filler, path)
                drift, shift = changed(NONE, at, at, (UNKNOWN, filler, node))
                if (drift.span, shift) in seen:
                    continue
                seen.add((drift.span, shift))
                place = paths[at] if at < len(parts) else f"the end of {path}" if path else "the end"
                about = "the sender may have them"
                cost = COST + EACH_BYTE * min(max(shift, 0), 8)
                yield drift._replace(cause=FitCause(MORE, shift, cost=cost, about=about, member=place))


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
