"""Which leaf of one layout is which of another: by path, in any case, as runs of neighbours.

Rule: where two declarations agree, an array is one run, however long; the cost is that of the declarations.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct


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
