"""A type laid out in memory: its leaves and gaps, and the profiles that give it the same layout.

Rule: two profiles count as one if every leaf has the same place and stored form in both.
"""

from __future__ import annotations

import re
from array import array
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

from trcvtui.errors import UserError, mistake
from trcvtui.udt.layout.layout_tree import (
    Leaf,
    LeafDecoder,
    Node,
    PlacedArray,
    PlacedLeaf,
    decoder_of,
    find_node,
    leaves_of,
)
from trcvtui.udt.layout.placing import MOST_LEAVES, Placer
from trcvtui.udt.layout.rules import BYTE_ORDERS, DEFAULT_LAYOUT, LAYOUTS, LayoutRules, rules_for
from trcvtui.udt.layout.value_text import stored_form
from trcvtui.udt.types import Enumeration, StringType, Struct, Type, Union, ValueKind, all_parts, type_text

__all__ = [
    "BYTE_ORDERS",
    "DEFAULT_LAYOUT",
    "LAYOUTS",
    "MOST_LEAVES",
    "Layout",
    "LayoutRules",
    "Leaf",
    "lay_out",
    "rules_for",
]


# No slots: codec and leaves are cached properties.
@dataclass(frozen=True, eq=False)
class Layout:
    """A type laid out; offsets and sizes are in bytes, leaves are numbered from 0 in declared order.

    Declared order is offset order, except for the members of a UNION.
    """

    name: str
    type: Type
    rules: LayoutRules
    root: Node = field(repr=False)

    @property
    def size(self) -> int:
        """Return the size with the gap at the end."""
        return self.root.size

    @property
    def align(self) -> int:
        """Return the alignment that the type has as a member."""
        return min(self.root.align, self.rules.cap)

    @property
    def leaf_count(self) -> int:
        return self.root.leaves

    @cached_property
    def whole_decoder(self) -> LeafDecoder | None:
        """Return the codec of the whole layout, compiled once; None if leaves share bytes."""
        return decoder_of(self._leaves, BYTE_ORDERS[self.rules.byte_order])

    @cached_property
    def _leaves(self) -> tuple[Leaf, ...]:
        return tuple(leaves_of(self.root))

    def leaves(self, start: int = 0, stop: int | None = None) -> tuple[Leaf, ...]:
        """Return the leaves of number start..stop-1 (default: all)."""
        return self._leaves[max(start, 0) : None if stop is None else max(stop, 0)]

    def leaf(self, number: int) -> Leaf:
        return self._leaves[number]

    @cached_property
    def _leaf_by_byte(self) -> array[int]:
        # For each byte the number of the first leaf that covers it, -1 in a gap.
        owners = array("i", [-1]) * self.size
        for number in range(self.leaf_count - 1, -1, -1):
            leaf = self._leaves[number]
            owners[leaf.offset : leaf.offset + leaf.size] = array("i", [number]) * leaf.size
        return owners

    def leaf_number_at(self, place: int) -> int | None:
        """Return the number of the first leaf that covers the byte at `place`."""
        number = self._leaf_by_byte[place] if 0 <= place < self.size else -1
        return None if number < 0 else number

    def count_leaves_within(self, length: int) -> int:
        """Return how many leaves are complete in the first `length` bytes."""
        return sum(leaf.offset + leaf.size <= length for leaf in self._leaves)

    def leaf_number(self, path: str) -> int:
        """Return the number of the leaf at a path such as `st.arr[2].x`; raise UserError if there is none."""
        try:
            number, node = find_node(self.root, path)
        except LookupError as unknown:
            where, found = f"{self.name}, '{path[:60]}'", f"'{str(unknown)[:60]}'"
            raise mistake(where, found, "a member or an index within bounds") from None
        if not isinstance(node, PlacedLeaf):
            found = f"'{path[:60]}', which has members of its own"
            raise mistake(self.name, found, "the path of one of them")
        return number

    def padding(self) -> list[tuple[int, int]]:
        """Return offset and size of every gap, in offset order; a byte with a used bit is not a gap."""
        covered = bytearray(self.size)
        for leaf in self._leaves:
            covered[leaf.offset : leaf.offset + leaf.size] = b"\1" * leaf.size
        return [(gap.start(), len(gap[0])) for gap in re.finditer(b"\0+", covered)]

    def __reduce__(self) -> tuple[object, ...]:
        # Pickled as the declaration alone: the other process lays it out again.
        return lay_out, (self.type, self.rules, self.name)


def lay_out(type_: Type, rules: LayoutRules, name: str = "") -> Layout:
    """Return the layout of a type; raise UserError if something in it has no layout or is too large."""
    name = _declared_spelling(type_, name) or type_text(type_)
    return Layout(name, type_, rules, Placer(rules).place(type_, name))


def _declared_spelling(type_: Type, name: str) -> str:
    # Names ignore case (IEC 61131-3); the spelling of the declaration is shown.
    own = type_.name if isinstance(type_, Struct | Union | Enumeration) else name
    return own if own.casefold() == name.casefold() else name


class Profile(NamedTuple):
    """How a sender stores a type. `text` is the STRING form, or "" if the type has no STRING."""

    layout: str
    byte_order: str
    text: str = ""

    @property
    def rules(self) -> LayoutRules:
        return rules_for(self.layout, self.byte_order, self.text or None)

    def __str__(self) -> str:
        return f"{self.layout}, {self.byte_order}-endian" + (f", STRING {self.text}" if self.text else "")


def profiles_for(type_: Type) -> tuple[Profile, ...]:
    """Return every profile that makes sense for a type, the default layout first."""
    with_text = has_text(type_)
    found = []
    for layout, rules in LAYOUTS.items():
        forms = rules.text_forms if with_text else ("",)
        orders = sorted(BYTE_ORDERS, key=lambda order, own=rules.byte_order: order != own)  # type: ignore[misc]
        found += [Profile(layout, order, form) for order in orders for form in forms]
    return tuple(found)


def group_same_layouts(
    type_: Type, profiles: tuple[Profile, ...], name: str = "", own: LayoutRules | None = None
) -> list[tuple[tuple[Profile, ...], Layout]]:
    """Return the type laid out in each profile. Profiles with the same layout are together.

    A profile that cannot hold the type is left out. `own` has the options of our side that a profile lacks.
    """
    found: dict[object, tuple[list[Profile], Layout]] = {}
    for profile in profiles:
        try:
            layout = lay_out(type_, merge_own_rules(profile.rules, own), name)
        except UserError:
            continue
        found.setdefault(layout_shape(layout), ([], layout))[0].append(profile)
    return [(tuple(same), layout) for same, layout in found.values()]


def merge_own_rules(rules: LayoutRules, own: LayoutRules | None) -> LayoutRules:
    """Return the rules of a profile with our pointer size, and our `string_even` if the layout is ours."""
    if own is None:
        return rules
    even = own.string_even if own.name == rules.name else rules.string_even
    return replace(rules, pointer_size=own.pointer_size, string_even=even)


def layout_shape(layout: Layout, *, by_bytes: bool = False) -> object:
    """Return a value that is equal for two layouts of one type in which all bytes mean the same.

    With `by_bytes`, the value is also equal if only the sign of durations or the room after texts differs.
    """
    rules, known = layout.rules, dict[int, object]()

    def leaf_shape(node: PlacedLeaf) -> object:
        form, size = stored_form(node.type, rules), node.size
        if isinstance(node.type, StringType):
            is_bytes = not node.type.wide
            size = 0 if by_bytes else size
        else:
            row = rules.storage(node.type)
            is_bytes = node.size == 1 or (row.name, row.code) == ("DT", "8s")
            if by_bytes and row.kind is ValueKind.DURATION:
                form = (row.name, row.size, row.unit_ns)
        return size, node.is_bit, form, "" if is_bytes else rules.byte_order

    def shape_of(node: Node) -> object:
        if isinstance(node, PlacedLeaf):
            return leaf_shape(node)
        if id(node) in known:
            return known[id(node)]
        if isinstance(node, PlacedArray):  # with a single element the distance to the next is unused
            known[id(node)] = node.pitch if node.count > 1 and node.leaves else 0, shape_of(node.element)
        else:
            parts = zip(node.offsets, node.bits, node.nodes, strict=True)
            known[id(node)] = tuple((offset, bit, shape_of(one)) for offset, bit, one in parts if one.leaves)
        return known[id(node)]

    return layout.size, shape_of(layout.root)


def has_text(type_: Type) -> bool:
    return any(isinstance(one, StringType) for one in all_parts(type_))
