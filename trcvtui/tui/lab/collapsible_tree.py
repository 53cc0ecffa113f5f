"""The visible rows of a type in two layouts: members, elements and gaps of the open branches.

Rule: a long array is closed at first, so that few rows are listed until you open the array.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import Final, NamedTuple

from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, PlacedUnion, indices
from trcvtui.udt.types import Array, Struct, Type, Union, type_text

MOST_OPEN_ELEMENTS: Final = 16  # an array of more elements is closed at first


class Place(NamedTuple):
    """An offset and a size in bytes. For a single bit, `bit` is its number in the byte."""

    offset: int
    size: int
    bit: int | None = None

    def __str__(self) -> str:
        """Return the offset. For a single bit, add the bit number, as in `2.5`."""
        return str(self.offset) if self.bit is None else f"{self.offset}.{self.bit}"


Places = tuple[Place, Place]  # ours, theirs
Key = tuple[int, ...]  # the number of the member or element at each level; the gap after it: -1 appended


class TreeRow(NamedTuple):
    """One row. `is_open` is None if the row cannot be folded. `leaf` is the number of the row's first leaf.

    A gap has no type. A gap has size 0 on a side without it. If `moved`, the place of the row, or of a part
    of the row, differs between the sides.
    """

    key: Key
    name: str
    type: Type | None
    ours: Place
    theirs: Place
    leaf: int
    moved: bool
    is_leaf: bool = False
    is_open: bool | None = None

    @property
    def is_gap(self) -> bool:
        return self.type is None

    @property
    def type_text(self) -> str:
        return type_text(self.type) if self.type is not None else ""


class FoldTree:
    """Both layouts of a type as rows whose branches open and close."""

    def __init__(self, ours: Layout, theirs: Layout) -> None:
        self._ours, self._theirs = ours, theirs
        pairs = zip(ours.leaves(), theirs.leaves(), strict=True)
        moves = ((a.offset, a.size, a.bit) != (b.offset, b.size, b.bit) for a, b in pairs)
        self._moves = list(accumulate(moves, initial=0))  # for each leaf: how many before it have moved
        self._flipped: set[Key] = set()  # branches that you toggled
        self._all: bool | None = None  # the state of the other branches; None: as at first
        self._build_rows()

    def toggle(self, key: Key) -> None:
        self._flipped ^= {key}
        self._build_rows()

    def set_all_open(self, is_open: bool | None) -> None:
        """Open or close everything below the root; None: restore the first state."""
        self._all = is_open
        self._flipped.clear()
        self._build_rows()

    def row_of_leaf(self, leaf: int, opens: bool = False) -> int:
        """Return the row of a leaf, or of the closed branch that hides it. `opens` opens such branches."""
        y = self._row_before(leaf)
        while opens and not self.rows[y].is_leaf:
            self.toggle(self.rows[y].key)
            y = self._row_before(leaf)
        return y

    def _row_before(self, leaf: int) -> int:
        return bisect_right(self.rows, leaf, key=lambda row: row.leaf) - 1

    def row_of_key(self, key: Key) -> int:
        return next(y for y, row in enumerate(self.rows) if row.key == key)

    # -- the list -----------------------------------------------------------------------------------

    def _build_rows(self) -> None:
        ours, theirs = self._ours, self._theirs
        self.rows: list[TreeRow] = []
        whole = Place(0, ours.size), Place(0, theirs.size)
        self._add_row((), ours.name, ours.type, (ours.root, theirs.root), whole, 0)

    def _add_row(
        self, key: Key, name: str, type_: Type, nodes: tuple[Node, Node], places: Places, leaf: int
    ) -> None:
        ours, theirs = nodes
        is_leaf = isinstance(ours, PlacedLeaf)
        is_open = None if is_leaf else self._is_open(key, ours)
        moved = places[0] != places[1] or self._moves[leaf] != self._moves[leaf + ours.leaves]
        self.rows.append(TreeRow(key, name, type_, *places, leaf, moved, is_leaf, is_open))
        if not is_open:
            return
        if isinstance(ours, PlacedArray) and isinstance(theirs, PlacedArray):
            assert isinstance(type_, Array)
            self._add_elements(key, type_.element, ours, theirs, places, leaf)
        elif isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct):
            assert isinstance(type_, Struct | Union)
            self._add_members(key, type_, ours, theirs, places, leaf)

    def _is_open(self, key: Key, node: Node) -> bool:
        at_first = not isinstance(node, PlacedArray) or node.count <= MOST_OPEN_ELEMENTS
        return (at_first if self._all is None or not key else self._all) != (key in self._flipped)

    def _add_elements(
        self, key: Key, type_: Type, ours: PlacedArray, theirs: PlacedArray, places: Places, leaf: int
    ) -> None:
        nodes = ours.element, theirs.element
        for number, name in enumerate(indices(ours)):
            own = _element_place(ours, number, places[0]), _element_place(theirs, number, places[1])
            first = leaf + number * ours.element.leaves
            self._add_row((*key, number), name, type_, nodes, own, first)
            ends = own[0].offset + _element_pitch(ours), own[1].offset + _element_pitch(theirs)
            self._add_gap((*key, number), own, ends, first + ours.element.leaves)

    def _add_members(
        self, key: Key, type_: Struct | Union, ours: PlacedStruct, theirs: PlacedStruct, at: Places, leaf: int
    ) -> None:
        types = [*([] if type_.base is None else [type_.base]), *(member.type for member in type_.members)]
        before: Places | None = None
        for number, inner in enumerate(types):
            places = _member_place(ours, number, at[0]), _member_place(theirs, number, at[1])
            first = leaf + ours.firsts[number]
            if before is not None and not isinstance(ours, PlacedUnion):  # members of a UNION overlap
                self._add_gap((*key, number - 1), before, (places[0].offset, places[1].offset), first)
            name = ours.names[number] or f"EXTENDS {getattr(inner, 'name', '')}"
            nodes = ours.nodes[number], theirs.nodes[number]
            self._add_row((*key, number), name, inner, nodes, places, first)
            before = places
        if before is not None and not isinstance(ours, PlacedUnion):
            ends = at[0].offset + ours.size, at[1].offset + theirs.size
            self._add_gap((*key, len(types) - 1), before, ends, leaf + ours.leaves)

    def _add_gap(self, key: Key, before: Places, starts: tuple[int, int], leaf: int) -> None:
        ends = [place.offset + place.size for place in before]
        ours, theirs = (Place(end, max(0, start - end)) for end, start in zip(ends, starts, strict=True))
        if ours.size or theirs.size:
            self.rows.append(TreeRow((*key, -1), "", None, ours, theirs, leaf, ours.size != theirs.size))


def _member_place(node: PlacedStruct, number: int, owner: Place) -> Place:
    child = node.nodes[number]
    is_bit = isinstance(child, PlacedLeaf) and child.is_bit
    return Place(owner.offset + node.offsets[number], child.size, node.bits[number] if is_bit else None)


def _element_pitch(node: PlacedArray) -> int:
    return 0 if node.is_bits else node.pitch


def _element_place(node: PlacedArray, number: int, owner: Place) -> Place:
    offset, bit = node.element_place(number)
    return Place(owner.offset + offset, node.element.size, bit if node.is_bits else None)
