"""In what two layouts of one type differ: size, places, byte order, stored forms, in words.

Rule: the walk is over the declaration, an ARRAY's element once; what lies alike in both is not entered.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, product
from typing import Final, NamedTuple

from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, index_text
from trcvtui.udt.layout.profiles import has_text
from trcvtui.udt.layout.stored_form import form_text, stored_form
from trcvtui.udt.types import Text

# Rule: where two declarations agree, an array is one run, however long; the cost is that of the declarations.


class Run(NamedTuple):
    """`leaves` of them in a row; the number of the first on either side, None where that side has none."""

    ours: int | None
    theirs: int | None
    leaves: int


def pair(ours: Node, theirs: Node) -> list[Run]:
    """Return the runs that hold every leaf of both: what only theirs has stands behind its siblings."""
    joined: list[Run] = []
    for run in _Pairing().runs(ours, theirs, 0, 0):
        last = joined[-1] if joined else None
        if last is not None and _follows(last, run):
            joined[-1] = last._replace(leaves=last.leaves + run.leaves)
        elif run.leaves:
            joined.append(run)
    return joined


def _follows(last: Run, run: Run) -> bool:
    ours = None if last.ours is None else last.ours + last.leaves
    theirs = None if last.theirs is None else last.theirs + last.leaves
    return (ours, theirs) == (run.ours, run.theirs)


class _Pairing:
    def __init__(self) -> None:
        self._same: dict[tuple[int, int], bool] = {}

    def runs(self, ours: Node, theirs: Node, a: int, b: int) -> Iterator[Run]:
        """Yield the runs of two nodes whose first leaves have the numbers a and b."""
        if self.same(ours, theirs):
            yield Run(a, b, ours.leaves)
        elif isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct):
            yield from self._struct(ours, theirs, a, b)
        elif (
            isinstance(ours, PlacedArray)
            and isinstance(theirs, PlacedArray)
            and len(ours.bounds) == len(theirs.bounds)
        ):
            yield from self._array(ours, theirs, a, b)
        else:
            yield Run(a, None, ours.leaves)
            yield Run(None, b, theirs.leaves)

    def _struct(self, ours: PlacedStruct, theirs: PlacedStruct, a: int, b: int) -> Iterator[Run]:
        waiting = dict(_members(theirs, b))
        for name, (first, node) in _members(ours, a):
            other = waiting.pop(name, None)
            if other is None:
                yield Run(first, None, node.leaves)
            else:
                yield from self.runs(node, other[1], first, other[0])
        for first, node in waiting.values():
            yield Run(None, first, node.leaves)

    def _array(self, ours: PlacedArray, theirs: PlacedArray, a: int, b: int) -> Iterator[Run]:
        our, their = ours.element, theirs.element
        for index in product(*[range(low, high + 1) for low, high in ours.bounds]):
            first, other = a + _number(ours, index) * our.leaves, _number(theirs, index)
            if other < 0:
                yield Run(first, None, our.leaves)
            else:
                yield from self.runs(our, their, first, b + other * their.leaves)
        for index in product(*[range(low, high + 1) for low, high in theirs.bounds]):
            if _number(ours, index) < 0:
                yield Run(None, b + _number(theirs, index) * their.leaves, their.leaves)

    def same(self, ours: Node, theirs: Node) -> bool:
        """Return whether both have the same leaf paths in the same order."""
        key = id(ours), id(theirs)
        if key not in self._same:
            self._same[key] = self._are_same(ours, theirs)
        return self._same[key]

    def _are_same(self, ours: Node, theirs: Node) -> bool:
        if isinstance(ours, PlacedArray) and isinstance(theirs, PlacedArray):
            return ours.bounds == theirs.bounds and self.same(ours.element, theirs.element)
        if isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct):
            our, their = list(_members(ours, 0)), list(_members(theirs, 0))
            return [name for name, _ in our] == [name for name, _ in their] and all(
                self.same(mine, other) for (_, (_, mine)), (_, (_, other)) in zip(our, their, strict=True)
            )
        return isinstance(ours, PlacedLeaf) and isinstance(theirs, PlacedLeaf)


def _members(node: PlacedStruct, first: int) -> Iterator[tuple[str, tuple[int, Node]]]:
    """Yield the members by name, what the type EXTENDS as members of its own."""
    for name, child, before in zip(node.names, node.nodes, node.firsts, strict=False):
        if name or not isinstance(child, PlacedStruct):
            yield name.casefold(), (first + before, child)
        else:
            yield from _members(child, first + before)


def _number(node: PlacedArray, index: tuple[int, ...]) -> int:
    """Return the number of the element at an index, -1 when it is not within bounds."""
    number = 0
    for at, (low, high) in zip(index, node.bounds, strict=True):
        if not low <= at <= high:
            return -1
        number = number * (high - low + 1) + at - low
    return number


NAMED: Final = 3  # members that a sentence names
MOST_FOUND: Final = 256  # differences that are counted


class Apart(NamedTuple):
    """A member that differs, with both sides in words; `is_place`: in its place, else in its stored form."""

    path: str
    ours: str
    theirs: str
    is_place: bool


def difference(a: Layout, b: Layout) -> str:
    """Return in what two layouts of one type differ; of the elements of an ARRAY the first is named."""
    parts = []
    if a.size != b.size:
        parts.append(f"the size, {a.size} and {b.size} bytes")
    other_text = a.rules.text.name != b.rules.text.name and has_text(a.type)
    found = list(islice(_Walk(a, b, not other_text).apart(a.root, b.root, "", (0, 0), (0, 0)), MOST_FOUND))
    for words, is_place in (("the place of", True), ("the stored form of", False)):
        members = [one for one in found if one.is_place is is_place]
        if members:
            shown = [f"{one.path or a.name} ({one.ours} and {one.theirs})" for one in members[:NAMED]]
            more = f" and {len(members) - NAMED} more" if len(members) > NAMED else ""
            parts.append(f"{words} {', '.join(shown)}{more}")
    if a.rules.byte_order != b.rules.byte_order:
        parts.append("the byte order")
    if other_text:
        parts.append(f"the STRING form, {a.rules.text.name} and {b.rules.text.name}")
    return "; ".join(parts) or "nothing"


class _Walk:
    def __init__(self, a: Layout, b: Layout, with_texts: bool) -> None:
        self.a, self.b, self.with_texts = a.rules, b.rules, with_texts
        self._alike: dict[tuple[int, int], bool] = {}

    def apart(
        self, a: Node, b: Node, path: str, at: tuple[int, int], bits: tuple[int, int]
    ) -> Iterator[Apart]:
        """Yield what differs in two nodes at these two offsets."""
        if not a.leaves or (at[0] == at[1] and bits[0] == bits[1] and self.alike(a, b)):
            return
        if isinstance(a, PlacedLeaf) and isinstance(b, PlacedLeaf):
            yield from self.leaf(a, b, path, at, bits)
        elif isinstance(a, PlacedArray) and isinstance(b, PlacedArray):
            found = False
            for number in range(min(a.count, 2)):  # the second one shows a distance
                (our, our_bit), (their, their_bit) = a.place(number), b.place(number)
                below, places = path + index_text(a, number), (at[0] + our, at[1] + their)
                for one in self.apart(a.element, b.element, below, places, (our_bit, their_bit)):
                    found = True
                    yield one
                if found:
                    return
        elif isinstance(a, PlacedStruct) and isinstance(b, PlacedStruct):
            for number, (name, our_node, their_node) in enumerate(
                zip(a.names, a.nodes, b.nodes, strict=True)
            ):
                below = f"{path}.{name}" if path and name else name or path
                places = at[0] + a.offsets[number], at[1] + b.offsets[number]
                yield from self.apart(our_node, their_node, below, places, (a.bits[number], b.bits[number]))

    def leaf(
        self, a: PlacedLeaf, b: PlacedLeaf, path: str, at: tuple[int, int], bits: tuple[int, int]
    ) -> Iterator[Apart]:
        ours, theirs = _place(a, at[0], bits[0]), _place(b, at[1], bits[1])
        if ours != theirs:
            yield Apart(path, ours, theirs, is_place=True)
        if not self.same_form(a, b):
            yield Apart(path, form_text(a.type, self.a), form_text(b.type, self.b), is_place=False)

    def alike(self, a: Node, b: Node) -> bool:
        """Return whether all below lies alike relative to the nodes, and is stored alike."""
        key = id(a), id(b)
        if key not in self._alike:
            self._alike[key] = self._are_alike(a, b)
        return self._alike[key]

    def _are_alike(self, a: Node, b: Node) -> bool:
        if isinstance(a, PlacedLeaf) and isinstance(b, PlacedLeaf):
            return a.is_bit == b.is_bit and self.same_form(a, b)
        if isinstance(a, PlacedArray) and isinstance(b, PlacedArray):
            return (a.pitch == b.pitch or a.count == 1) and self.alike(a.element, b.element)
        if isinstance(a, PlacedStruct) and isinstance(b, PlacedStruct):
            same = (a.offsets, a.bits) == (b.offsets, b.bits)
            return same and all(map(self.alike, a.nodes, b.nodes))
        return False

    def same_form(self, a: PlacedLeaf, b: PlacedLeaf) -> bool:
        if isinstance(a.type, Text) and not self.with_texts:
            return True
        return stored_form(a.type, self.a) == stored_form(b.type, self.b)


def _place(leaf: PlacedLeaf, offset: int, bit: int) -> str:
    return f"{offset}.{bit}" if leaf.is_bit else str(offset)
