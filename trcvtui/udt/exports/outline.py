"""A laid-out type as exports walk it: members with their own type, place and node.

Rule: each STRUCT is written once, however many members have its type, and an array holds its element once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from trcvtui.errors import mistake
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct
from trcvtui.udt.types import Array, Struct, Type, Union

MOST_FIELDS = 20_000


class ExportField(NamedTuple):
    """One member: `name` is empty for what the type EXTENDS; `bit` counts only where `is_bit`."""

    name: str
    type: Type
    offset: int
    node: Node
    bit: int

    @property
    def is_bit(self) -> bool:
        return isinstance(self.node, PlacedLeaf) and self.node.is_bit


def fields_of(type_: Struct | Union, node: PlacedStruct) -> list[ExportField]:
    """Return the members that have bytes of their own, in declared order, the base first."""
    types: list[Type] = [] if type_.base is None else [type_.base]
    types += [member.type for member in type_.members]
    rows = zip(node.names, types, node.offsets, node.nodes, node.bits, strict=True)
    return [field for field in map(ExportField._make, rows) if field.node.leaves]


def structs_of(type_: Type, node: Node) -> Iterator[tuple[Struct | Union, PlacedStruct]]:
    """Yield every structure and union with leaves in it once, those that others use before these."""
    seen: set[Struct | Union] = set()

    def below(type_: Type, node: Node) -> Iterator[tuple[Struct | Union, PlacedStruct]]:
        if isinstance(type_, Array) and isinstance(node, PlacedArray):
            yield from below(type_.element, node.element)
        elif isinstance(type_, Struct | Union) and isinstance(node, PlacedStruct) and type_ not in seen:
            seen.add(type_)
            for field in fields_of(type_, node):
                yield from below(field.type, field.node)
            yield type_, node

    yield from below(type_, node)


def refuse_empty(layout: Layout) -> None:
    """Raise UserError for a type without a byte: there is nothing to take apart."""
    if not layout.size or not layout.leaf_count:
        raise mistake(layout.name, "a type without a value", "a type with at least one")


def count_fields(type_: Type, node: Node) -> int:
    """Return how many paths without indices lead to a leaf; it may grow as 2 to the depth."""
    counts: dict[Type, int] = {}

    def count(type_: Type, node: Node) -> int:
        if isinstance(type_, Array) and isinstance(node, PlacedArray):
            return count(type_.element, node.element)
        if not (isinstance(type_, Struct | Union) and isinstance(node, PlacedStruct)):
            return 1
        if type_ not in counts:
            counts[type_] = sum(count(field.type, field.node) for field in fields_of(type_, node))
        return counts[type_]

    return count(type_, node)
