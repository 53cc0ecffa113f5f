"""The rows of a twin tree, with what is folded: row number to row, byte or leaf to row number.

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


Key = tuple[int, ...]  # the number of the member or element at each level; a gap behind an element: -1


class TreeRow(NamedTuple):
    """One row: `is_open` is None for what cannot be folded; `leaf` is the number of its first leaf.

    A place of size 0 is a gap that this side has not.
    """

    key: Key
    name: str
    twin: Twin | None
    ours: Place
    theirs: Place
    leaf: int
    is_open: bool | None = None

    @property
    def is_leaf(self) -> bool:
        """Return whether it has a value."""
        return self.twin is not None and self.twin.is_leaf

    @property
    def is_gap(self) -> bool:
        """Return whether it is padding."""
        return self.twin is None

    @property
    def type_text(self) -> str:
        """Return the declared type."""
        return type_text(self.twin.type) if self.twin is not None else ""

    @property
    def moved(self) -> bool:
        """Return whether it, or something in it, lies elsewhere on the other side."""
        same = self.twin is None or self.twin.is_same
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
    """A twin tree whose branches open and close."""

    def __init__(self, root: Twin, name: str) -> None:
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

    def _opens(self, twin: Twin, fold: _Fold | None) -> bool:
        unasked = twin.is_open if self._all is None or twin is self.root else self._all
        return unasked != (fold is not None and fold.flipped)

    # -- counting -----------------------------------------------------------------------------------

    @property
    def row_count(self) -> int:
        """Return the number of rows."""
        return self._rows(self.root, self._top)

    def _rows(self, twin: Twin, fold: _Fold | None) -> int:
        if twin.is_leaf:
            return 1
        if fold is None:
            return self._untouched(twin)[0]
        if fold.rows is None:
            fold.rows = 1 + (self._below(twin, fold) if self._opens(twin, fold) else 0)
        return fold.rows

    def _untouched(self, twin: Twin) -> tuple[int, list[int]]:
        found = self._plain.get(id(twin))
        if found is None:
            starts = [] if twin.is_array else self._starts_of(twin, None)
            below = self._elements(twin, None) if twin.is_array else starts[-1]
            found = self._plain[id(twin)] = 1 + (below if self._opens(twin, None) else 0), starts
        return found

    def _below(self, twin: Twin, fold: _Fold) -> int:
        return self._elements(twin, fold) if twin.is_array else self._starts(twin, fold)[-1]

    def _starts(self, twin: Twin, fold: _Fold | None) -> list[int]:
        if fold is None:
            return self._untouched(twin)[1]
        if fold.starts is None:
            fold.starts = self._starts_of(twin, fold)
        return fold.starts

    def _starts_of(self, twin: Twin, fold: _Fold | None) -> list[int]:
        starts = [0]
        for number, entry in enumerate(twin.entries):
            below = fold.below.get(number) if fold is not None else None
            starts.append(starts[-1] + (1 if entry.twin is None else self._rows(entry.twin, below)))
        return starts

    def _each(self, twin: Twin) -> int:
        return self._rows(twin.element, None) + any(twin.gaps)

    def _elements(self, twin: Twin, fold: _Fold | None) -> int:
        touched = fold.below.items() if fold is not None else ()
        more = sum(
            self._rows(twin.element, below) + any(twin.gaps) - self._each(twin) for _, below in touched
        )
        return twin.count * self._each(twin) + more

    def _element_start(self, twin: Twin, fold: _Fold | None, number: int) -> int:
        """Return how many rows stand before an element of an open array."""
        each, touched = self._each(twin), fold.below if fold is not None else {}
        more = sum(
            self._rows(twin.element, touched[n]) + any(twin.gaps) - each for n in touched if n < number
        )
        return number * each + more

    def _element_at(self, twin: Twin, fold: _Fold | None, y: int) -> tuple[int, int]:
        """Return the element that row y of an open array belongs to, and the row in it."""
        each, done, start = self._each(twin), 0, 0
        for number in sorted(fold.below) if fold is not None else ():
            before = (number - done) * each
            if y < start + before:
                break
            own = self._rows(twin.element, fold.below[number]) + any(twin.gaps) if fold is not None else 0
            if y < start + before + own:
                return number, y - start - before
            start, done = start + before + own, number + 1
        return done + (y - start) // each, (y - start) % each

    # -- row number to row --------------------------------------------------------------------------

    def row(self, y: int) -> TreeRow:
        """Return row y."""
        whole = (Place(0, self.root.ours.size), Place(0, self.root.theirs.size))
        at = TreeRow((), self.name, self.root, *whole, 0)
        fold: _Fold | None = self._top
        while y > 0 and at.twin is not None:
            y -= 1
            at, fold, y = (self._into_array if at.twin.is_array else self._into_struct)(at, at.twin, fold, y)
        if at.twin is None or at.twin.is_leaf:
            return at
        return at._replace(is_open=self._opens(at.twin, fold))

    def _into_struct(
        self, at: TreeRow, twin: Twin, fold: _Fold | None, y: int
    ) -> tuple[TreeRow, _Fold | None, int]:
        starts = self._starts(twin, fold)
        number = bisect_right(starts, y) - 1
        entry = twin.entries[number]
        below = fold.below.get(number) if fold is not None else None
        return _child(at, number, entry), below, y - starts[number]

    def _into_array(
        self, at: TreeRow, twin: Twin, fold: _Fold | None, y: int
    ) -> tuple[TreeRow, _Fold | None, int]:
        number, y = self._element_at(twin, fold, y)
        below = fold.below.get(number) if fold is not None else None
        places = twin.element_place(number)
        array, element = twin.ours, twin.element
        assert isinstance(array, PlacedArray)
        name, leaf = index_text(array, number), number * element.ours.leaves
        child = _child(at, number, Entry(name, element, *places, leaf))
        if y < self._rows(element, below):
            return child, below, y
        ours, theirs = (
            Place(place.offset + place.size, gap) for place, gap in zip(places, twin.gaps, strict=True)
        )
        gap = _child(at, number, Entry("", None, ours, theirs, leaf + element.ours.leaves))
        return gap._replace(key=(*gap.key, -1)), None, 0

    # -- leaf to row number -------------------------------------------------------------------------

    def row_of_leaf(self, leaf: int, opens: bool = False) -> int:
        """Return the row of a leaf, or of the closed branch that it is in; `opens` opens those."""
        y, twin, key, whole = 0, self.root, Key(), leaf
        way: _Fold | None = self._top
        while not twin.is_leaf:
            if not self._opens(twin, way):
                if not opens:
                    return y
                self.toggle(key)
                return self.row_of_leaf(whole, opens)
            if twin.is_array:
                number, rest = divmod(leaf, max(1, twin.element.ours.leaves))
                y += 1 + self._element_start(twin, way, number)
                twin, leaf = twin.element, rest
            else:
                number = twin.entry_of_leaf(leaf)
                entry = twin.entries[number]
                y += 1 + self._starts(twin, way)[number]
                assert entry.twin is not None
                twin, leaf = entry.twin, leaf - entry.first
            way = way.below.get(number) if way is not None else None
            key = (*key, number)
        return y

    def row_of_key(self, key: Key) -> int:
        """Return the row of a key whose branches stand open; of its last open branch where one is closed."""
        y, twin = 0, self.root
        fold: _Fold | None = self._top
        for number in key:
            if twin.is_leaf or not self._opens(twin, fold):
                return y
            if number < 0:  # behind the element
                return y + self._rows(twin, fold)
            if twin.is_array:
                if number >= twin.count:
                    return y
                y += 1 + self._element_start(twin, fold, number)
                below: Twin | None = twin.element
            else:
                if number >= len(twin.entries):
                    return y
                y += 1 + self._starts(twin, fold)[number]
                below = twin.entries[number].twin
            if below is None:
                return y
            fold, twin = fold.below.get(number) if fold is not None else None, below
        return y


def _child(at: TreeRow, number: int, entry: Entry) -> TreeRow:
    ours, theirs = (
        place._replace(offset=owner.offset + place.offset)
        for owner, place in ((at.ours, entry.ours), (at.theirs, entry.theirs))
    )
    return TreeRow((*at.key, number), entry.name, entry.twin, ours, theirs, at.leaf + entry.first)
