"""A type laid out: a tree of leaves, structures and arrays; each knows its size, alignment and leaves.

Rule: an array holds its element once, however many there are, so a tree is as large as its declaration and
every question below goes straight down. Leaves are counted in offset order; offsets are relative to the node.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from typing import NamedTuple

from trcvtui.udt.coding import Coding
from trcvtui.udt.types import Array, LeafType


class Leaf(NamedTuple):
    """One leaf of a laid-out type: path such as `st.arr[2].x`, offset and size in bytes."""

    path: str
    type: LeafType
    offset: int
    size: int
    coding: Coding
    bit: int | None = None


class PlacedLeaf:
    """A value of elementary type, a text or an enumeration."""

    __slots__ = ("align", "coding", "size", "type")
    leaves = 1

    def __init__(self, type_: LeafType, coding: Coding, size: int, align: int) -> None:
        self.type, self.coding, self.size, self.align = type_, coding, size, align


class PlacedStruct:
    """A structure: its members' names, offsets and nodes, and the number of leaves before each."""

    __slots__ = ("align", "firsts", "index", "leaves", "names", "nodes", "offsets", "size")

    def __init__(self, members: list[tuple[str, int, Node]], size: int, align: int) -> None:
        self.names = tuple(name for name, _, _ in members)
        self.offsets = tuple(offset for _, offset, _ in members)
        self.nodes = tuple(node for _, _, node in members)
        self.index = {name.casefold(): number for number, name in enumerate(self.names)}
        self.size: int = size
        self.align: int = align
        firsts = [0]
        for node in self.nodes:
            firsts.append(firsts[-1] + node.leaves)
        self.leaves: int = firsts.pop()
        self.firsts = tuple(firsts)


class PlacedArray:
    """An array: its element laid out once, and its declared bounds."""

    __slots__ = ("align", "bounds", "count", "element", "leaves", "size")

    def __init__(self, type_: Array, element: Node) -> None:
        self.bounds, self.count, self.element = type_.bounds, type_.count, element
        self.size: int = element.size * self.count
        self.align: int = element.align
        self.leaves: int = element.leaves * self.count


Node = PlacedLeaf | PlacedStruct | PlacedArray


def walk(node: Node, path: str, offset: int, start: int, stop: int) -> Iterator[Leaf]:
    """Yield the leaves of number start..stop-1 below the node, whose own path and offset are given."""
    if not node.leaves:
        return
    if isinstance(node, PlacedLeaf):
        if start <= 0 < stop:
            yield Leaf(path, node.type, offset, node.size, node.coding)
    elif isinstance(node, PlacedStruct):
        prefix = path + "." if path else ""
        first = max(bisect_right(node.firsts, max(start, 0)) - 1, 0)
        for number in range(first, len(node.nodes)):
            before = node.firsts[number]
            if before >= stop:
                return
            place = offset + node.offsets[number]
            yield from walk(
                node.nodes[number], prefix + node.names[number], place, start - before, stop - before
            )
    else:
        yield from _walk_array(node, path, offset, start, stop)


def _walk_array(node: PlacedArray, path: str, offset: int, start: int, stop: int) -> Iterator[Leaf]:
    element, each = node.element, node.element.leaves
    for number in range(max(start, 0) // each, min(-(-stop // each), node.count)):
        below, place = path + index_text(node, number), offset + number * element.size
        if isinstance(element, PlacedLeaf):
            yield Leaf(below, element.type, place, element.size, element.coding)
        else:
            yield from walk(element, below, place, start - number * each, stop - number * each)


def index_text(node: PlacedArray, number: int) -> str:
    """Return the index of the element of that number with the declared bounds, such as `[1,2]`."""
    indices = []
    for low, high in reversed(node.bounds):
        number, index = divmod(number, high - low + 1)
        indices.append(str(low + index))
    return f"[{','.join(reversed(indices))}]"


def leaves_within(node: Node, length: int) -> int:
    """Return how many leaves lie wholly in the first `length` bytes of the node."""
    if length >= node.size:
        return node.leaves
    if length <= 0 or isinstance(node, PlacedLeaf):
        return 0
    if isinstance(node, PlacedStruct):
        cut = bisect_right(node.offsets, length) - 1
        return node.firsts[cut] + leaves_within(node.nodes[cut], length - node.offsets[cut])
    whole, rest = divmod(length, node.element.size)
    return whole * node.element.leaves + leaves_within(node.element, rest)


def leaf_number_at(node: Node, place: int) -> int | None:
    """Return the number of the leaf that covers the byte at `place`; None in a gap or outside."""
    if not 0 <= place < node.size:
        return None
    if isinstance(node, PlacedLeaf):
        return 0
    if isinstance(node, PlacedStruct):
        number = bisect_right(node.offsets, place) - 1
        before, child, rest = node.firsts[number], node.nodes[number], place - node.offsets[number]
    else:
        number, rest = divmod(place, node.element.size)
        before, child = number * node.element.leaves, node.element
    below = leaf_number_at(child, rest)
    return None if below is None else before + below


_STEP = r"\.?([^\W\d]\w*)|\[([^\[\]]*)\]"
_INDEX = r"(?a)\s*(-?\d{1,19})\s*"


def find(node: Node, path: str) -> tuple[int, Node]:
    """Return the node at a path and the number of its first leaf; raise LookupError naming a failed step."""
    number = at = 0
    while at < len(path):
        step = re.match(_STEP, path[at:])
        if step is None:
            raise LookupError(path[at:])
        at += step.end()
        before, node = _below(node, step)
        number += before
    return number, node


def _below(node: Node, step: re.Match[str]) -> tuple[int, Node]:
    name, indices = step.groups()
    if name is not None and isinstance(node, PlacedStruct) and name.casefold() in node.index:
        number = node.index[name.casefold()]
        return node.firsts[number], node.nodes[number]
    if indices is not None and isinstance(node, PlacedArray):
        element = _element_number(node, indices)
        if element is not None:
            return element * node.element.leaves, node.element
    raise LookupError(step.group())


def _element_number(node: PlacedArray, text: str) -> int | None:
    indices = [re.fullmatch(_INDEX, index) for index in text.split(",")]
    if len(indices) != len(node.bounds):
        return None
    number = 0
    for found, (low, high) in zip(indices, node.bounds, strict=True):
        if found is None or not low <= int(found[1]) <= high:
            return None
        number = number * (high - low + 1) + int(found[1]) - low
    return number
