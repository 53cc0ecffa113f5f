"""The corrective type: a declaration that under one layout lies as a type does under another.

Gaps become members of their own. What cannot be reached becomes raw bytes, and is told with the reason; the
result is laid out again and every leaf compared, so that what is called possible is proved.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from typing import Final, NamedTuple

from trcvtui.udt.layout import Layout, LayoutRules, lay_out
from trcvtui.udt.padding import Filling, Unreachable
from trcvtui.udt.placed import Node, PlacedArray, PlacedLeaf, PlacedStruct
from trcvtui.udt.placing import Placing
from trcvtui.udt.stand_in import Note, stand_in
from trcvtui.udt.types import ELEMENTARY, Array, Struct, Type, Union, type_text

MOST_PROVED: Final = 65536  # leaves that are compared one by one
BYTE: Final = ELEMENTARY["BYTE"]


class Unreached(NamedTuple):
    """A member that is raw bytes in the corrective type, or is not in it (a bit): its path, "" is all; why.

    Of the elements of an ARRAY the first is named.
    """

    path: str
    why: str


class Corrective(NamedTuple):
    """A type that lies as wanted, but for what is `unreached`; `notes` are members that need a conversion."""

    type: Type
    layout: Layout
    unreached: tuple[Unreached, ...]
    notes: tuple[Note, ...]

    @property
    def is_possible(self) -> bool:
        """Return whether every member lies at the wanted place, and the size is the wanted one."""
        return not self.unreached


def corrective(wanted: Layout, rules: LayoutRules) -> Corrective:
    """Return the type that under `rules` lies as `wanted` does; its byte order is that of `rules`.

    For the receiver `wanted` is the sender's layout and `rules` are the receiver's own; for the sender the
    other way round.
    """
    tries = [_corrected(wanted, rules, pack) for pack in ((None, 1) if rules.takes_pack else (None,))]
    return min(tries, key=lambda found: len(found.unreached))


def _corrected(wanted: Layout, rules: LayoutRules, pack: int | None) -> Corrective:
    rebuild = _Rebuild(wanted, rules, pack)
    try:
        type_ = rebuild.type(wanted.type, wanted.root, "")
        layout = lay_out(type_, rules, f"{wanted.name}_{rebuild.suffix}")
        _prove(wanted, layout, [one.path for one in rebuild.unreached])
        return Corrective(type_, layout, tuple(rebuild.unreached), tuple(rebuild.notes))
    except Unreachable as failed:
        return all_raw(wanted, rules, Unreached(failed.path, failed.why))


def all_raw(wanted: Layout, rules: LayoutRules, why: Unreached) -> Corrective:
    """Return the type as bytes and nothing else, which every layout can hold."""
    raw = Array(((0, max(wanted.size, 1) - 1),), BYTE)
    return Corrective(raw, lay_out(raw, rules, f"{wanted.name}_{_suffix(wanted)}"), (why,), ())


def _suffix(wanted: Layout) -> str:
    return wanted.rules.name.replace("-", "_")


def _prove(wanted: Layout, found: Layout, raw: list[str]) -> None:
    """Raise Unreachable unless every leaf lies where it is wanted, but for those below a path in `raw`."""
    if found.size != wanted.size:
        raise Unreachable("", f"{found.size} bytes in place of {wanted.size}")
    ours = {leaf.path: leaf for leaf in islice(found.leaves(), 2 * MOST_PROVED)}
    left_out = tuple(_without_indices(path) for path in raw)
    for leaf in islice(wanted.leaves(), MOST_PROVED):
        if left_out and _without_indices(leaf.path).startswith(left_out):
            continue
        own = ours.get(leaf.path)
        if own is None or (own.offset, own.size, own.bit) != (leaf.offset, leaf.size, leaf.bit):
            raise Unreachable(leaf.path, "it comes to lie elsewhere")


def _without_indices(path: str) -> str:
    return re.sub(r"\[[^\]]*\]", "", path)


class _Rebuild:
    """One rebuilding of a declaration; each STRUCT is rebuilt once, however many members have its type."""

    def __init__(self, wanted: Layout, rules: LayoutRules, pack: int | None) -> None:
        self.theirs, self.rules, self.pack = wanted.rules, rules, pack
        self.name = wanted.name
        self.suffix = _suffix(wanted)
        self.placing = Placing(rules)
        self.unreached: list[Unreached] = []
        self.notes: list[Note] = []
        self._built: dict[int, Struct | Union] = {}

    def type(self, type_: Type, node: Node, path: str) -> Type:
        """Return the type in place of this one; raise Unreachable."""
        match type_:
            case Array():
                assert isinstance(node, PlacedArray)
                return self.array(type_, node, path)
            case Struct() | Union():
                assert isinstance(node, PlacedStruct)
                if id(type_) not in self._built:
                    build = self.struct if isinstance(type_, Struct) else self.union
                    self._built[id(type_)] = build(type_, node, path)
                return self._built[id(type_)]
            case _:
                assert isinstance(node, PlacedLeaf)
                found, why = stand_in(node, self.theirs, self.rules, path)
                if found is None:
                    raise Unreachable(path, why)
                if why:
                    self.notes.append(Note(path, why))
                return found

    def array(self, type_: Array, node: PlacedArray, path: str) -> Type:
        first = ",".join(str(low) for low, _ in type_.bounds)
        element = self.type(type_.element, node.element, f"{path}[{first}]")
        found = type_ if element is type_.element else Array(type_.bounds, element)
        placed = self.placing.place(found, path)
        assert isinstance(placed, PlacedArray)
        if (placed.pitch, placed.row_size) != (node.pitch, node.row_size):
            why = f"its elements are {node.pitch} bytes apart, under {self.rules.name} {placed.pitch}"
            raise Unreachable(path, why)
        return found

    def struct(self, type_: Struct | Union, node: PlacedStruct, path: str) -> Struct | Union:
        fill = self.filling(type_, node)
        for name, offset, bit, child, inner in _members(type_, node):
            mark, below = (len(self.unreached), len(self.notes)), f"{path}.{name}" if path else name
            try:
                fill.put(name, self.type(inner, child, below), offset, bit, below)
            except Unreachable as failed:
                del self.unreached[mark[0] :], self.notes[mark[1] :]
                self.unreached.append(Unreached(failed.path, failed.why))
                fill.put_raw(name, offset, child.size, bit is not None, below)
        fill.finish(node.size, path)
        return self.named(type_, fill, path)

    def union(self, type_: Struct | Union, node: PlacedStruct, path: str) -> Struct | Union:
        fill = self.filling(type_, node)
        for name, _, bit, child, inner in _members(type_, node):
            below = f"{path}.{name}" if path else name
            fill.overlay(name, self.type(inner, child, below), bit, below)
        fill.cover(node.size, path)
        return self.named(type_, fill, path)

    def filling(self, type_: Struct | Union, node: PlacedStruct) -> Filling:
        cap = max(self.pack, 1) if self.pack is not None else self.placing.cap(type_)
        return Filling(self.placing, cap, {name.casefold() for name in node.names})

    def named(self, type_: Struct | Union, fill: Filling, path: str) -> Struct | Union:
        """Return the type as it was where nothing had to change."""
        members = tuple(fill.members)
        is_old = type_.base is None and self.pack is None and len(members) == len(type_.members)
        if is_old and all(new.type is old.type for new, old in zip(members, type_.members, strict=True)):
            return type_
        pack = type_.pack if self.pack is None else self.pack
        name = type_.name
        if pack is not None and not name:  # only a type of its own can have a pack_mode
            name = re.sub(r"\W+", "_", f"{self.name}.{_without_indices(path)}")
        name = f"{name}_{self.suffix}" if name else ""
        made = Struct if isinstance(type_, Struct) else Union
        return made(name, members, None, pack)


def _members(
    type_: Struct | Union, node: PlacedStruct, at: int = 0
) -> Iterator[tuple[str, int, int | None, Node, Type]]:
    """Yield name, offset, bit, node and type of every member, what the type EXTENDS as members of its own."""
    types: list[Type] = [] if type_.base is None else [type_.base]
    types += [member.type for member in type_.members]
    for name, offset, bit, child, inner in zip(
        node.names, node.offsets, node.bits, node.nodes, types, strict=True
    ):
        if name:
            is_bit = isinstance(child, PlacedLeaf) and child.is_bit
            yield name, at + offset, bit if is_bit else None, child, inner
        else:
            assert isinstance(child, PlacedStruct) and isinstance(inner, Struct | Union)
            yield from _members(inner, child, at + offset)


def told(found: Corrective) -> list[str]:
    """Return what is to be said about a corrective type, one line each."""
    lines = [f"{one.path or type_text(found.type)}: not reached: {one.why}" for one in found.unreached]
    return lines + [f"{note.path}: {note.text}" for note in found.notes]
