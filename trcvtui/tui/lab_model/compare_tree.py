"""Two layouts of one type as one tree: every node with its place on both sides, gaps as nodes of their own.

Rule: an array holds its element once, so the tree is as large as the declaration, whatever the bounds.
"""

from __future__ import annotations

from bisect import bisect_right
from functools import cached_property
from typing import Final, NamedTuple

from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, PlacedUnion
from trcvtui.udt.types import Array, Struct, Type, Union

MOST_OPEN: Final = 16  # elements of an array that stands open unasked


Known = dict[tuple[int, int, int], "Twin"]


class Place(NamedTuple):
    """Offset, size in bytes, and the bit of what is one bit."""

    offset: int
    size: int
    bit: int | None = None

    def __str__(self) -> str:
        """Return the offset, of a bit such as `2.5`."""
        return str(self.offset) if self.bit is None else f"{self.offset}.{self.bit}"


class Entry(NamedTuple):
    """A member with its places in its owner and its first leaf; without a twin it is a gap."""

    name: str
    twin: Twin | None
    ours: Place
    theirs: Place
    first: int


class Twin:
    """One node as both sides lay it out."""

    def __init__(self, type_: Type, ours: Node, theirs: Node, known: Known) -> None:
        self.type, self.ours, self.theirs, self._known = type_, ours, theirs, known

    @property
    def is_leaf(self) -> bool:
        """Return whether nothing stands below."""
        return isinstance(self.ours, PlacedLeaf)

    @property
    def is_array(self) -> bool:
        """Return whether elements stand below."""
        return isinstance(self.ours, PlacedArray)

    @property
    def is_open(self) -> bool:
        """Return whether it stands open unasked: a long array does not."""
        return not isinstance(self.ours, PlacedArray) or self.ours.count <= MOST_OPEN

    @property
    def count(self) -> int:
        """Return the number of elements of an array."""
        return self.ours.count if isinstance(self.ours, PlacedArray) else 0

    @cached_property
    def element(self) -> Twin:
        """Return the element of an array."""
        ours, theirs = self.ours, self.theirs
        assert isinstance(self.type, Array)
        assert isinstance(ours, PlacedArray) and isinstance(theirs, PlacedArray)
        return _twin(self.type.element, ours.element, theirs.element, self._known)

    @cached_property
    def gaps(self) -> tuple[int, int]:
        """Return how many bytes lie between two elements, on either side."""
        return _gap(self.ours), _gap(self.theirs)

    @cached_property
    def entries(self) -> list[Entry]:
        """Return members and gaps in declared order."""
        ours, theirs = self.ours, self.theirs
        assert isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct)
        assert isinstance(self.type, Struct | Union)
        base = [] if self.type.base is None else [self.type.base]
        types = [*base, *(member.type for member in self.type.members)]
        found: list[Entry] = []
        ends = 0, 0
        for number, type_ in enumerate(types):
            places = _place(ours, number), _place(theirs, number)
            first = ours.firsts[number]
            found += self._gap_before(ends, (places[0].offset, places[1].offset), first)
            name = ours.names[number] or f"EXTENDS {getattr(type_, 'name', '')}"
            twin = _twin(type_, ours.nodes[number], theirs.nodes[number], self._known)
            found.append(Entry(name, twin, *places, first))
            ends = places[0].offset + places[0].size, places[1].offset + places[1].size
        return found + self._gap_before(ends, (ours.size, theirs.size), ours.leaves)

    def _gap_before(self, ends: tuple[int, int], starts: tuple[int, int], first: int) -> list[Entry]:
        sizes = [max(0, start - end) for start, end in zip(starts, ends, strict=True)]
        if isinstance(self.ours, PlacedUnion) or not any(sizes):
            return []
        ours, theirs = (Place(end, size) for end, size in zip(ends, sizes, strict=True))
        return [Entry("", None, ours, theirs, first)]

    @cached_property
    def firsts(self) -> list[int]:
        """Return the number of the first leaf of each entry."""
        return [entry.first for entry in self.entries]

    @cached_property
    def is_same(self) -> bool:
        """Return whether everything below lies at the same place on both sides."""
        if self.ours.size != self.theirs.size:
            return False
        if self.is_leaf:
            return self.ours.is_bit == self.theirs.is_bit  # type: ignore[union-attr]
        if self.is_array:
            ours, theirs = self.ours, self.theirs
            assert isinstance(ours, PlacedArray) and isinstance(theirs, PlacedArray)
            return (ours.pitch, ours.row_size) == (theirs.pitch, theirs.row_size) and self.element.is_same
        return all(e.ours == e.theirs and (e.twin is None or e.twin.is_same) for e in self.entries)

    def element_place(self, number: int) -> tuple[Place, Place]:
        """Return where an element lies in its array, on either side."""
        return _element(self.ours, number), _element(self.theirs, number)

    def entry_of_leaf(self, number: int) -> int:
        """Return the number of the entry that holds a leaf."""
        place = bisect_right(self.firsts, number) - 1
        while self.entries[place].twin is None or not self.entries[place].twin.ours.leaves:  # type: ignore[union-attr]
            place -= 1
        return place


def twin_of(ours: Layout, theirs: Layout) -> Twin:
    """Return both layouts of a type as one tree."""
    return _twin(ours.type, ours.root, theirs.root, {})


def _twin(type_: Type, ours: Node, theirs: Node, known: Known) -> Twin:
    """Return the twin of two nodes: one, however many members have that type."""
    key = id(type_), id(ours), id(theirs)
    if key not in known:
        known[key] = Twin(type_, ours, theirs, known)
    return known[key]


def _place(node: PlacedStruct, number: int) -> Place:
    child = node.nodes[number]
    is_bit = isinstance(child, PlacedLeaf) and child.is_bit
    return Place(node.offsets[number], child.size, node.bits[number] if is_bit else None)


def _element(node: Node, number: int) -> Place:
    assert isinstance(node, PlacedArray)
    offset, bit = node.place(number)
    return Place(offset, node.element.size, bit if node.is_bits else None)


def _gap(node: Node) -> int:
    return max(0, node.pitch - node.element.size) if isinstance(node, PlacedArray) and not node.is_bits else 0
