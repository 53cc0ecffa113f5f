"""Lay a type out in memory: every leaf and every gap with its offset, as the rules of the layout say.

Rule: alignment applies to the members of a STRUCT only; a lone scalar, text or array of these is tight
(baosky.md section 9).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from trcvtui.errors import mistake
from trcvtui.udt.codec import Codec, Page, codec_of, page_of
from trcvtui.udt.coding import coding_of
from trcvtui.udt.placed import (
    Leaf,
    Node,
    PlacedArray,
    PlacedLeaf,
    PlacedStruct,
    find,
    leaf_number_at,
    leaves_within,
    walk,
)
from trcvtui.udt.rules import BYTE_ORDERS, DEFAULT_LAYOUT, LAYOUT_ALIASES, LAYOUTS, LayoutRules, rules_for
from trcvtui.udt.types import Array, Enumeration, LeafType, Struct, Text, Type, type_text

__all__ = [
    "BYTE_ORDERS",
    "DEFAULT_LAYOUT",
    "LAYOUTS",
    "LAYOUT_ALIASES",
    "MOST_BYTES",
    "MOST_LEAVES",
    "Layout",
    "LayoutRules",
    "Leaf",
    "lay_out",
    "rules_for",
]

# TRCV_C takes 65535 bytes at most; the limits leave room for DATA that is wrong on purpose (80A5).
MOST_BYTES = 4 * 1024 * 1024
MOST_LEAVES = 1024 * 1024
_PAGES_KEPT = 8


# No slots: the compiled codec is kept on the layout, made when first asked for.
@dataclass(frozen=True, eq=False)
class Layout:
    """A type laid out; leaves are numbered in offset order from 0, offsets and sizes are in bytes."""

    name: str
    type: Type
    rules: LayoutRules
    root: Node = field(repr=False)

    @property
    def size(self) -> int:
        """Return the size in bytes, the gap at the end included."""
        return self.root.size

    @property
    def align(self) -> int:
        """Return the alignment that the type has as a member."""
        return self.root.align

    @property
    def leaf_count(self) -> int:
        """Return the number of leaves."""
        return self.root.leaves

    @cached_property
    def codec(self) -> Codec:
        """Return the codec of the whole layout, compiled once."""
        return codec_of(self.root, BYTE_ORDERS[self.rules.byte_order])

    def leaves(self, start: int = 0, stop: int | None = None) -> Iterator[Leaf]:
        """Yield the leaves of number start..stop-1 (default: all), made as they are asked for."""
        return walk(self.root, "", 0, max(start, 0), self.leaf_count if stop is None else stop)

    def leaf(self, number: int) -> Leaf:
        """Return one leaf by its number."""
        for leaf in self.leaves(number, number + 1):
            return leaf
        raise IndexError(number)

    def page(self, start: int, stop: int) -> Page:
        """Return the leaves of number start..stop-1 with a codec for just these; the last pages are kept."""
        pages = self._pages
        if (start, stop) not in pages:
            if len(pages) >= _PAGES_KEPT:
                del pages[next(iter(pages))]
            leaves = tuple(self.leaves(start, stop))
            pages[start, stop] = page_of(max(start, 0), leaves, BYTE_ORDERS[self.rules.byte_order])
        return pages[start, stop]

    @cached_property
    def _pages(self) -> dict[tuple[int, int], Page]:
        return {}

    def leaf_at(self, place: int) -> int | None:
        """Return the number of the leaf that covers the byte at `place`; None in a gap or outside."""
        return leaf_number_at(self.root, place)

    def leaves_within(self, length: int) -> int:
        """Return how many leaves lie wholly in the first `length` bytes."""
        return leaves_within(self.root, length)

    def number_of(self, path: str) -> int:
        """Return the number of the leaf at a path such as `st.arr[2].x`; raise UserError if there is none."""
        try:
            number, node = find(self.root, path)
        except LookupError as unknown:
            where, found = f"{self.name}, '{path[:60]}'", f"'{str(unknown)[:60]}'"
            raise mistake(where, found, "a member or an index within bounds") from None
        if not isinstance(node, PlacedLeaf):
            raise mistake(
                self.name, f"'{path[:60]}', which has members of its own", "the path of one of them"
            )
        return number

    def padding(self) -> Iterator[tuple[int, int]]:
        """Yield offset and size of every gap, in offset order."""
        end = 0
        for leaf in self.leaves():
            if leaf.offset > end:
                yield end, leaf.offset - end
            end = leaf.offset + leaf.size
        if self.size > end:
            yield end, self.size - end

    def __reduce__(self) -> tuple[object, ...]:
        # Between processes only the declaration travels; the tree is made again on the other side.
        return lay_out, (self.type, self.rules, self.name)


def lay_out(type_: Type, rules: LayoutRules, name: str = "") -> Layout:
    """Return the layout of a type; raise UserError when it or a STRING in it is too long."""
    name = _spelled(type_, name) or type_text(type_)
    return Layout(name, type_, rules, _Placing(rules).place(type_, name))


class _Placing:
    """One laying out: each STRUCT is placed once, however many members have its type."""

    def __init__(self, rules: LayoutRules) -> None:
        self.rules = rules
        self.placed: dict[Struct, Node] = {}

    def place(self, type_: Type, where: str) -> Node:
        if isinstance(type_, Array):
            return _checked(PlacedArray(type_, self.place(type_.element, where)), where)
        if not isinstance(type_, Struct):
            return self.place_leaf(type_, where)
        if type_ not in self.placed:
            self.placed[type_] = self.place_struct(type_, where)
        return self.placed[type_]

    def place_leaf(self, type_: LeafType, where: str) -> Node:
        coding = coding_of(type_, self.rules)
        if isinstance(type_, Text):
            form = self.rules.text
            if form.length(type_) > form.longest:
                raise mistake(where, type_text(type_), f"at most {form.longest} characters")
            return PlacedLeaf(type_, coding, form.size(type_), min(2 if type_.wide else 1, self.rules.cap))
        row = self.rules.row(type_.base if isinstance(type_, Enumeration) else type_)
        return PlacedLeaf(type_, coding, row.size, min(row.align, self.rules.cap))

    def place_struct(self, type_: Struct, where: str) -> Node:
        members: list[tuple[str, int, Node]] = []
        end, align = 0, 1 if not type_.members else self.rules.struct_floor
        for member in type_.members:
            node = self.place(member.type, f"{where}.{member.name}")
            step = max(min(node.align, self.rules.cap), self.rules.member_floor)
            offset = _up(end, step)
            members.append((member.name, offset, node))
            end, align = offset + node.size, max(align, step)
        return _checked(PlacedStruct(members, _up(end, align), align), where)


def _spelled(type_: Type, name: str) -> str:
    # Names are the same in any case (IEC 61131-3); shown is the one in the declaration.
    own = type_.name if isinstance(type_, Struct | Enumeration) else name
    return own if own.casefold() == name.casefold() else name


def _up(offset: int, align: int) -> int:
    return -(-offset // align) * align


def _checked(node: Node, where: str) -> Node:
    if node.size > MOST_BYTES:
        raise mistake(where, f"{node.size} bytes", f"at most {MOST_BYTES} bytes")
    if node.leaves > MOST_LEAVES:
        raise mistake(where, f"{node.leaves} elements", f"at most {MOST_LEAVES} elements")
    return node
