"""A type laid out: a tree of leaves, structures, unions and arrays; each knows its size and its leaves.

Rule: an array holds its element once, however many there are, so a tree is as large as its declaration and
every question below goes straight down. Leaves are counted in declared order, which is offset order but for
the members of a UNION; offsets are relative to the node.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from trcvtui.udt.layout.coding import Coding
from trcvtui.udt.types import Array, LeafType


class Leaf(NamedTuple):
    """One leaf of a laid-out type: path such as `st.arr[2].x`, offset and size in bytes.

    A leaf of one bit has its number in the byte as `bit`, and the byte as its size.
    """

    path: str
    type: LeafType
    offset: int
    size: int
    coding: Coding
    bit: int | None = None


class PlacedLeaf:
    """A value of elementary type, a text, an enumeration; or one bit, whose place its owner knows."""

    __slots__ = ("align", "coding", "is_bit", "size", "type")
    leaves = 1
    overlaps = False

    def __init__(self, type_: LeafType, coding: Coding, size: int, align: int, is_bit: bool = False) -> None:
        self.type, self.coding, self.size, self.align, self.is_bit = type_, coding, size, align, is_bit


class PlacedMember(NamedTuple):
    """A member where it lies; without a name it is what the type EXTENDS. `bit` is the place of a bit."""

    name: str
    offset: int
    node: Node
    bit: int = 0


class FlatMember(NamedTuple):
    """A member of a structure or of what it EXTENDS; `bit` is None but for a bit, `first` its first leaf."""

    name: str
    offset: int
    bit: int | None
    node: Node
    first: int


class PlacedStruct:
    """A structure: its members' names, offsets and nodes, and the number of leaves before each."""

    __slots__ = (
        "align", "bits", "firsts", "index", "leaves", "names", "nodes", "offsets", "overlaps",
        "size", "steps",
    )  # fmt: skip

    def __init__(self, parts: Sequence[PlacedMember], size: int, align: int) -> None:
        self.names = tuple(part.name for part in parts)
        self.steps = tuple(map(_step, self.names))
        self.offsets = tuple(part.offset for part in parts)
        self.nodes = tuple(part.node for part in parts)
        self.bits = tuple(part.bit for part in parts)
        self.index = {name.casefold(): number for number, name in enumerate(self.names)}
        self.size: int = size
        self.align: int = align
        self.overlaps: bool = any(node.overlaps for node in self.nodes)
        firsts = [0]
        for node in self.nodes:
            firsts.append(firsts[-1] + node.leaves)
        self.leaves: int = firsts.pop()
        self.firsts = tuple(firsts)

    def flat(self, offset: int = 0, first: int = 0) -> Iterator[FlatMember]:
        """Yield the members, those of what the type EXTENDS as members of its own."""
        for number, node in enumerate(self.nodes):
            name, at, before = self.names[number], offset + self.offsets[number], first + self.firsts[number]
            if name or not isinstance(node, PlacedStruct):
                is_bit = isinstance(node, PlacedLeaf) and node.is_bit
                yield FlatMember(name, at, self.bits[number] if is_bit else None, node, before)
            else:
                yield from node.flat(at, before)


class PlacedUnion(PlacedStruct):
    """A union: as a structure, but every member begins at 0."""

    __slots__ = ()

    def __init__(self, parts: Sequence[PlacedMember], size: int, align: int) -> None:
        super().__init__(parts, size, align)
        self.overlaps = True


class PlacedArray:
    """An array: its element laid out once, its declared bounds, and how far it is to the next element.

    Of bits a row (all but the last index fixed) begins at a byte of its own, `row_size` bytes apart.
    """

    __slots__ = (
        "align", "bounds", "columns", "count", "element", "is_bits", "leaves", "overlaps",
        "pitch", "row_size", "size",
    )  # fmt: skip

    def __init__(self, type_: Array, element: Node, pitch: int, align: int) -> None:
        self.bounds, self.count, self.element, self.pitch = type_.bounds, type_.count, element, pitch
        low, high = type_.bounds[-1]
        self.columns: int = high - low + 1
        self.is_bits: bool = isinstance(element, PlacedLeaf) and element.is_bit
        self.row_size: int = -(-self.columns // 8) if self.is_bits else self.columns * pitch
        self.size: int = self.count // self.columns * self.row_size
        self.align: int = align
        self.leaves: int = element.leaves * self.count
        self.overlaps: bool = element.overlaps

    def place(self, number: int) -> tuple[int, int]:
        """Return the offset of the element of that number, and its bit."""
        if not self.is_bits:
            return number * self.pitch, 0
        row, column = divmod(number, self.columns)
        return row * self.row_size + column // 8, column % 8

    def number_of(self, index: Sequence[int]) -> int | None:
        """Return the number of the element at an index; None when it is not within bounds."""
        number = 0
        for at, (low, high) in zip(index, self.bounds, strict=True):
            if not low <= at <= high:
                return None
            number = number * (high - low + 1) + at - low
        return number


def _step(name: str) -> str:
    return name if not name or re.fullmatch(_NAME, name) else '"' + name.replace('"', '""') + '"'


Node = PlacedLeaf | PlacedStruct | PlacedArray


def walk(node: Node, path: str, offset: int, start: int, stop: int, bit: int = 0) -> Iterator[Leaf]:
    """Yield the leaves of number start..stop-1 below the node, whose own path and place are given."""
    if not node.leaves:
        return
    if isinstance(node, PlacedLeaf):
        if start <= 0 < stop:
            yield Leaf(path, node.type, offset, node.size, node.coding, bit if node.is_bit else None)
    elif isinstance(node, PlacedStruct):
        prefix = path + "." if path else ""
        first = max(bisect_right(node.firsts, max(start, 0)) - 1, 0)
        for number in range(first, len(node.nodes)):
            before, name = node.firsts[number], node.steps[number]
            if before >= stop:
                return
            place, below = offset + node.offsets[number], prefix + name if name else path
            yield from walk(
                node.nodes[number], below, place, start - before, stop - before, node.bits[number]
            )
    else:
        yield from _walk_array(node, path, offset, start, stop)


def _walk_array(node: PlacedArray, path: str, offset: int, start: int, stop: int) -> Iterator[Leaf]:
    element, each = node.element, node.element.leaves
    for number in range(max(start, 0) // each, min(-(-stop // each), node.count)):
        place, bit = node.place(number)
        below, place = path + index_text(node, number), offset + place
        if isinstance(element, PlacedLeaf):
            at = bit if element.is_bit else None
            yield Leaf(below, element.type, place, element.size, element.coding, at)
        else:
            yield from walk(element, below, place, start - number * each, stop - number * each)


def index_text(node: PlacedArray, number: int) -> str:
    """Return the index of the element of that number with the declared bounds, such as `[1,2]`."""
    indices = []
    for low, high in reversed(node.bounds):
        number, index = divmod(number, high - low + 1)
        indices.append(str(low + index))
    return f"[{','.join(reversed(indices))}]"


def kinds(node: Node) -> Iterator[PlacedLeaf]:
    """Yield every leaf of the declaration once, that of an ARRAY for all of its elements."""
    waiting, seen = [node], {id(node)}
    for one in waiting:
        if isinstance(one, PlacedLeaf):
            yield one
            continue
        inner = one.nodes if isinstance(one, PlacedStruct) else (one.element,)
        waiting += [child for child in inner if child.leaves and id(child) not in seen]
        seen.update(map(id, inner))


def leaves_within(node: Node, length: int) -> int:
    """Return how many leaves lie wholly in the first `length` bytes of the node."""
    if length >= node.size:
        return node.leaves
    if length <= 0 or isinstance(node, PlacedLeaf):
        return 0
    if isinstance(node, PlacedUnion):
        return sum(leaves_within(member, length) for member in node.nodes)
    if isinstance(node, PlacedStruct):
        cut = bisect_right(node.offsets, length - 1) - 1  # the last member that has a byte within
        return node.firsts[cut] + leaves_within(node.nodes[cut], length - node.offsets[cut])
    if node.is_bits:
        rows, rest = divmod(length, node.row_size)
        return rows * node.columns + min(8 * rest, node.columns)
    whole, rest = divmod(length, node.pitch)
    return whole * node.element.leaves + leaves_within(node.element, rest)


def next_leaf(node: Node, length: int) -> int | None:
    """Return the number of the first leaf that does not lie wholly in the first `length` bytes."""
    if not node.leaves:
        return None
    if isinstance(node, PlacedLeaf):
        return 0 if length < node.size else None
    if not node.overlaps:
        within = leaves_within(node, length)
        return within if within < node.leaves else None
    if isinstance(node, PlacedArray):
        number = min(max(length, 0) // node.pitch, node.count - 1)
        for element in range(number, min(number + 2, node.count)):
            found = next_leaf(node.element, length - element * node.pitch)
            if found is not None:
                return element * node.element.leaves + found
        return None
    for before, offset, member in zip(node.firsts, node.offsets, node.nodes, strict=True):
        found = next_leaf(member, length - offset)
        if found is not None:
            return before + found
    return None


def leaf_number_at(node: Node, place: int, bit: int | None = None) -> int | None:
    """Return the number of the first leaf that covers the byte at `place`, or that bit of it."""
    if not 0 <= place < node.size:
        return None
    if isinstance(node, PlacedLeaf):
        return 0
    if isinstance(node, PlacedStruct):
        return _member_at(node, place, bit)
    if node.is_bits:
        row, rest = divmod(place, node.row_size)
        column = 8 * rest + (bit or 0)
        return row * node.columns + column if column < node.columns else None
    number, rest = divmod(place, node.pitch)
    below = leaf_number_at(node.element, rest, bit)
    return None if below is None else number * node.element.leaves + below


def _member_at(node: PlacedStruct, place: int, bit: int | None) -> int | None:
    # Several members at one offset: the bits of a byte, the members of a union, and what is empty.
    last = bisect_right(node.offsets, place)
    for number in range(bisect_left(node.offsets, node.offsets[last - 1]) if last else 0, last):
        child = node.nodes[number]
        if bit is not None and isinstance(child, PlacedLeaf) and child.is_bit and node.bits[number] != bit:
            continue
        below = leaf_number_at(child, place - node.offsets[number], bit)
        if below is not None:
            return node.firsts[number] + below
    return None


def gaps(node: Node) -> Iterator[tuple[int, int]]:
    """Yield start and end of every run of bytes that no leaf covers, in order; neighbours may touch."""
    if isinstance(node, PlacedUnion):
        yield from _common_gaps(node)
    elif isinstance(node, PlacedStruct):
        end = 0
        for offset, member in zip(node.offsets, node.nodes, strict=True):
            if offset > end:
                yield end, offset
            for first, last in gaps(member):
                yield offset + first, offset + last
            end = offset + member.size
        if node.size > end:
            yield end, node.size
    elif isinstance(node, PlacedArray) and not node.is_bits and node.size:
        inner = [*gaps(node.element), (node.element.size, node.pitch)]
        inner = [(first, last) for first, last in inner if first < last]
        for start in range(0, node.size if inner else 0, node.pitch):
            for first, last in inner:
                yield start + first, start + last


def _common_gaps(node: PlacedUnion) -> Iterator[tuple[int, int]]:
    common: Iterator[tuple[int, int]] = iter([(0, node.size)] if node.size else [])
    for member in node.nodes:
        common = _both(common, chain(gaps(member), [(member.size, node.size)]))
    return common


def _both(some: Iterator[tuple[int, int]], others: Iterator[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    one, other = next(some, None), next(others, None)
    while one and other:
        first, last = max(one[0], other[0]), min(one[1], other[1])
        if first < last:
            yield first, last
        if one[1] <= other[1]:
            one = next(some, None)
        else:
            other = next(others, None)


_NAME = r'[^.\[\]"]+'
_STEP = rf'\.?(?:({_NAME})|"((?:[^"]|"")*)")|\[([^\[\]]*)\]'
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
    name, quoted, indices = step.groups()
    name = quoted.replace('""', '"') if name is None and quoted is not None else name
    while name is not None and isinstance(node, PlacedStruct) and node.nodes:
        number = node.index.get(name.casefold())
        if number is not None:
            return node.firsts[number], node.nodes[number]
        if node.names[0]:
            break
        node = node.nodes[0]  # what the type EXTENDS: its members need no name in front
    if indices is not None and isinstance(node, PlacedArray):
        element = _element_number(node, indices)
        if element is not None:
            return element * node.element.leaves, node.element
    raise LookupError(step.group())


def _element_number(node: PlacedArray, text: str) -> int | None:
    found = [re.fullmatch(_INDEX, index) for index in text.split(",")]
    index = [int(one[1]) for one in found if one is not None]
    return node.number_of(index) if len(found) == len(index) == len(node.bounds) else None
