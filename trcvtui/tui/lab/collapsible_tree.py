"""The rows of a pair tree, with what is folded: row number to row, byte or leaf to row number.

Rule: rows are counted by declaration and by what was folded by hand; none is listed, so 100,000 cost nothing.
"""

from __future__ import annotations

from bisect import bisect_right
from functools import cached_property
from typing import Final, NamedTuple

from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import (
    Node,
    PlacedArray,
    PlacedLeaf,
    PlacedStruct,
    PlacedUnion,
    index_text,
)
from trcvtui.udt.types import Array, Struct, Type, Union, type_text

# Rule: an array holds its element once, so the tree is as large as the declaration, whatever the bounds.

MOST_OPEN: Final = 16  # elements of an array that stands open unasked


Known = dict[tuple[int, int, int], "PairedNode"]


class Place(NamedTuple):
    """Offset, size in bytes, and the bit of what is one bit."""

    offset: int
    size: int
    bit: int | None = None

    def __str__(self) -> str:
        """Return the offset, of a bit such as `2.5`."""
        return str(self.offset) if self.bit is None else f"{self.offset}.{self.bit}"


class TreeEntry(NamedTuple):
    """A member with its places in its owner and its first leaf; without a pair it is a gap."""

    name: str
    pair: PairedNode | None
    ours: Place
    theirs: Place
    first: int


class PairedNode:
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
    def element(self) -> PairedNode:
        """Return the element of an array."""
        ours, theirs = self.ours, self.theirs
        assert isinstance(self.type, Array)
        assert isinstance(ours, PlacedArray) and isinstance(theirs, PlacedArray)
        return _pair(self.type.element, ours.element, theirs.element, self._known)

    @cached_property
    def gaps(self) -> tuple[int, int]:
        """Return how many bytes lie between two elements, on either side."""
        return _gap(self.ours), _gap(self.theirs)

    @cached_property
    def entries(self) -> list[TreeEntry]:
        """Return members and gaps in declared order."""
        ours, theirs = self.ours, self.theirs
        assert isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct)
        assert isinstance(self.type, Struct | Union)
        base = [] if self.type.base is None else [self.type.base]
        types = [*base, *(member.type for member in self.type.members)]
        found: list[TreeEntry] = []
        ends = 0, 0
        for number, type_ in enumerate(types):
            places = _place(ours, number), _place(theirs, number)
            first = ours.firsts[number]
            found += self._gap_before(ends, (places[0].offset, places[1].offset), first)
            name = ours.names[number] or f"EXTENDS {getattr(type_, 'name', '')}"
            pair = _pair(type_, ours.nodes[number], theirs.nodes[number], self._known)
            found.append(TreeEntry(name, pair, *places, first))
            ends = places[0].offset + places[0].size, places[1].offset + places[1].size
        return found + self._gap_before(ends, (ours.size, theirs.size), ours.leaves)

    def _gap_before(self, ends: tuple[int, int], starts: tuple[int, int], first: int) -> list[TreeEntry]:
        sizes = [max(0, start - end) for start, end in zip(starts, ends, strict=True)]
        if isinstance(self.ours, PlacedUnion) or not any(sizes):
            return []
        ours, theirs = (Place(end, size) for end, size in zip(ends, sizes, strict=True))
        return [TreeEntry("", None, ours, theirs, first)]

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
        return all(e.ours == e.theirs and (e.pair is None or e.pair.is_same) for e in self.entries)

    def element_place(self, number: int) -> tuple[Place, Place]:
        """Return where an element lies in its array, on either side."""
        return _element(self.ours, number), _element(self.theirs, number)

    def entry_of_leaf(self, number: int) -> int:
        """Return the number of the entry that holds a leaf."""
        place = bisect_right(self.firsts, number) - 1
        while self.entries[place].pair is None or not self.entries[place].pair.ours.leaves:  # type: ignore[union-attr]
            place -= 1
        return place


def twin_of(ours: Layout, theirs: Layout) -> PairedNode:
    """Return both layouts of a type as one tree."""
    return _pair(ours.type, ours.root, theirs.root, {})


def _pair(type_: Type, ours: Node, theirs: Node, known: Known) -> PairedNode:
    key = id(type_), id(ours), id(theirs)
    if key not in known:
        known[key] = PairedNode(type_, ours, theirs, known)
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


Key = tuple[int, ...]  # the number of the member or element at each level; a gap after an element: -1


class TreeRow(NamedTuple):
    """One row: `is_open` is None for what cannot be folded; `leaf` is the number of its first leaf.

    A place of size 0 is a gap that this side has not.
    """

    key: Key
    name: str
    pair: PairedNode | None
    ours: Place
    theirs: Place
    leaf: int
    is_open: bool | None = None

    @property
    def is_leaf(self) -> bool:
        """Return whether it has a value."""
        return self.pair is not None and self.pair.is_leaf

    @property
    def is_gap(self) -> bool:
        """Return whether it is padding."""
        return self.pair is None

    @property
    def type_text(self) -> str:
        """Return the declared type."""
        return type_text(self.pair.type) if self.pair is not None else ""

    @property
    def moved(self) -> bool:
        """Return whether it, or something in it, lies elsewhere on the other side."""
        same = self.pair is None or self.pair.is_same
        if self.is_gap:
            return self.ours.size != self.theirs.size
        return self.ours != self.theirs or not same


class _Fold:
    """What was folded or opened by hand at one node and below."""

    __slots__ = ("below", "flipped", "rows", "starts")

    def __init__(self) -> None:
        self.flipped = False
        self.below: dict[int, _Fold] = {}
        self.rows: int | None = None
        self.starts: list[int] | None = None


class FoldTree:
    """A pair tree whose branches open and close."""

    def __init__(self, root: PairedNode, name: str) -> None:
        self.root, self.name = root, name
        self._top = _Fold()
        self._plain: dict[int, tuple[int, list[int]]] = {}  # of nodes that nobody has touched
        self._all: bool | None = None

    # -- folding ------------------------------------------------------------------------------------

    def toggle(self, key: Key) -> None:
        """Open or close one branch."""
        fold = self._top
        for step in key:
            fold.rows, fold.starts = None, None
            fold = fold.below.setdefault(step, _Fold())
        fold.rows, fold.starts = None, None
        fold.flipped = not fold.flipped

    def open_all(self, is_open: bool | None) -> None:
        """Open or close everything below the root; None: as it stood at first."""
        self._all, self._top = is_open, _Fold()
        self._plain.clear()

    def _opens(self, pair: PairedNode, fold: _Fold | None) -> bool:
        unasked = pair.is_open if self._all is None or pair is self.root else self._all
        return unasked != (fold is not None and fold.flipped)

    # -- counting -----------------------------------------------------------------------------------

    @property
    def row_count(self) -> int:
        """Return the number of rows."""
        return self._rows(self.root, self._top)

    def _rows(self, pair: PairedNode, fold: _Fold | None) -> int:
        if pair.is_leaf:
            return 1
        if fold is None:
            return self._untouched(pair)[0]
        if fold.rows is None:
            fold.rows = 1 + (self._below(pair, fold) if self._opens(pair, fold) else 0)
        return fold.rows

    def _untouched(self, pair: PairedNode) -> tuple[int, list[int]]:
        found = self._plain.get(id(pair))
        if found is None:
            starts = [] if pair.is_array else self._starts_of(pair, None)
            below = self._elements(pair, None) if pair.is_array else starts[-1]
            found = self._plain[id(pair)] = 1 + (below if self._opens(pair, None) else 0), starts
        return found

    def _below(self, pair: PairedNode, fold: _Fold) -> int:
        return self._elements(pair, fold) if pair.is_array else self._starts(pair, fold)[-1]

    def _starts(self, pair: PairedNode, fold: _Fold | None) -> list[int]:
        if fold is None:
            return self._untouched(pair)[1]
        if fold.starts is None:
            fold.starts = self._starts_of(pair, fold)
        return fold.starts

    def _starts_of(self, pair: PairedNode, fold: _Fold | None) -> list[int]:
        starts = [0]
        for number, entry in enumerate(pair.entries):
            below = fold.below.get(number) if fold is not None else None
            starts.append(starts[-1] + (1 if entry.pair is None else self._rows(entry.pair, below)))
        return starts

    def _each(self, pair: PairedNode) -> int:
        return self._rows(pair.element, None) + any(pair.gaps)

    def _elements(self, pair: PairedNode, fold: _Fold | None) -> int:
        touched = fold.below.items() if fold is not None else ()
        more = sum(
            self._rows(pair.element, below) + any(pair.gaps) - self._each(pair) for _, below in touched
        )
        return pair.count * self._each(pair) + more

    def _element_start(self, pair: PairedNode, fold: _Fold | None, number: int) -> int:
        each, touched = self._each(pair), fold.below if fold is not None else {}
        more = sum(
            self._rows(pair.element, touched[n]) + any(pair.gaps) - each for n in touched if n < number
        )
        return number * each + more

    def _element_at(self, pair: PairedNode, fold: _Fold | None, y: int) -> tuple[int, int]:
        each, done, start = self._each(pair), 0, 0
        for number in sorted(fold.below) if fold is not None else ():
            before = (number - done) * each
            if y < start + before:
                break
            own = self._rows(pair.element, fold.below[number]) + any(pair.gaps) if fold is not None else 0
            if y < start + before + own:
                return number, y - start - before
            start, done = start + before + own, number + 1
        return done + (y - start) // each, (y - start) % each

    # -- row number to row --------------------------------------------------------------------------

    def row(self, y: int) -> TreeRow:
        whole = (Place(0, self.root.ours.size), Place(0, self.root.theirs.size))
        at = TreeRow((), self.name, self.root, *whole, 0)
        fold: _Fold | None = self._top
        while y > 0 and at.pair is not None:
            y -= 1
            at, fold, y = (self._into_array if at.pair.is_array else self._into_struct)(at, at.pair, fold, y)
        if at.pair is None or at.pair.is_leaf:
            return at
        return at._replace(is_open=self._opens(at.pair, fold))

    def _into_struct(
        self, at: TreeRow, pair: PairedNode, fold: _Fold | None, y: int
    ) -> tuple[TreeRow, _Fold | None, int]:
        starts = self._starts(pair, fold)
        number = bisect_right(starts, y) - 1
        entry = pair.entries[number]
        below = fold.below.get(number) if fold is not None else None
        return _child(at, number, entry), below, y - starts[number]

    def _into_array(
        self, at: TreeRow, pair: PairedNode, fold: _Fold | None, y: int
    ) -> tuple[TreeRow, _Fold | None, int]:
        number, y = self._element_at(pair, fold, y)
        below = fold.below.get(number) if fold is not None else None
        places = pair.element_place(number)
        array, element = pair.ours, pair.element
        assert isinstance(array, PlacedArray)
        name, leaf = index_text(array, number), number * element.ours.leaves
        child = _child(at, number, TreeEntry(name, element, *places, leaf))
        if y < self._rows(element, below):
            return child, below, y
        ours, theirs = (
            Place(place.offset + place.size, gap) for place, gap in zip(places, pair.gaps, strict=True)
        )
        gap = _child(at, number, TreeEntry("", None, ours, theirs, leaf + element.ours.leaves))
        return gap._replace(key=(*gap.key, -1)), None, 0

    # -- leaf to row number -------------------------------------------------------------------------

    def row_of_leaf(self, leaf: int, opens: bool = False) -> int:
        """Return the row of a leaf, or of the closed branch that it is in; `opens` opens those."""
        y, pair, key, whole = 0, self.root, Key(), leaf
        way: _Fold | None = self._top
        while not pair.is_leaf:
            if not self._opens(pair, way):
                if not opens:
                    return y
                self.toggle(key)
                return self.row_of_leaf(whole, opens)
            if pair.is_array:
                number, rest = divmod(leaf, max(1, pair.element.ours.leaves))
                y += 1 + self._element_start(pair, way, number)
                pair, leaf = pair.element, rest
            else:
                number = pair.entry_of_leaf(leaf)
                entry = pair.entries[number]
                y += 1 + self._starts(pair, way)[number]
                assert entry.pair is not None
                pair, leaf = entry.pair, leaf - entry.first
            way = way.below.get(number) if way is not None else None
            key = (*key, number)
        return y

    def row_of_key(self, key: Key) -> int:
        """Return the row of a key whose branches stand open; of its last open branch where one is closed."""
        y, pair = 0, self.root
        fold: _Fold | None = self._top
        for number in key:
            if pair.is_leaf or not self._opens(pair, fold):
                return y
            if number < 0:  # after the element
                return y + self._rows(pair, fold)
            if pair.is_array:
                if number >= pair.count:
                    return y
                y += 1 + self._element_start(pair, fold, number)
                below: PairedNode | None = pair.element
            else:
                if number >= len(pair.entries):
                    return y
                y += 1 + self._starts(pair, fold)[number]
                below = pair.entries[number].pair
            if below is None:
                return y
            fold, pair = fold.below.get(number) if fold is not None else None, below
        return y


def _child(at: TreeRow, number: int, entry: TreeEntry) -> TreeRow:
    ours, theirs = (
        place._replace(offset=owner.offset + place.offset)
        for owner, place in ((at.ours, entry.ours), (at.theirs, entry.theirs))
    )
    return TreeRow((*at.key, number), entry.name, entry.pair, ours, theirs, at.leaf + entry.first)
