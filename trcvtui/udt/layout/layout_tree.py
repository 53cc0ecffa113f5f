"""A type laid out as a tree of leaves, structures, unions and arrays, each with size and number of leaves.

Rule: an array's element is stored only once, so a tree is only as large as its declaration.
Leaves are counted in declared order, which is offset order except in a UNION. Offsets are relative to the
node.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

from trcvtui.udt.layout.coding import Coding, Value
from trcvtui.udt.types import Array, LeafType, Struct, Type, Union, all_members


class Leaf(NamedTuple):
    """One leaf of a laid-out type: path such as `st.arr[2].x`, offset and size in bytes.

    A leaf of one bit has size 1, and `bit` is the number of the bit in the byte.
    """

    path: str
    type: LeafType
    offset: int
    size: int
    coding: Coding
    bit: int | None = None


class PlacedLeaf:
    """A value of elementary type, a text, an enumeration, or one bit. The parent node stores the place."""

    __slots__ = ("align", "coding", "is_bit", "size", "type")
    leaves = 1
    overlaps = False

    def __init__(self, type_: LeafType, coding: Coding, size: int, align: int, is_bit: bool = False) -> None:
        self.type, self.coding, self.size, self.align, self.is_bit = type_, coding, size, align, is_bit


class PlacedMember(NamedTuple):
    """A member with its place. A nameless member is the base (EXTENDS). `bit` is the bit in the byte."""

    name: str
    offset: int
    node: Node
    bit: int = 0


class FlatMember(NamedTuple):
    """A member of a structure or its base. Its leaves begin at `first`. `bit` is None if it is no bit."""

    name: str
    offset: int
    bit: int | None
    node: Node
    first: int


class PlacedStruct:
    """A structure: names, offsets and nodes of its members, and the number of leaves before each."""

    def __init__(self, parts: Sequence[PlacedMember], size: int, align: int) -> None:
        self.names = tuple(part.name for part in parts)
        self.steps = tuple(map(_quote_name, self.names))
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

    def flat_members(self, offset: int = 0, first: int = 0) -> Iterator[FlatMember]:
        """Yield the members of the structure. The members of its base (EXTENDS) come first."""
        for number, node in enumerate(self.nodes):
            name, at, before = self.names[number], offset + self.offsets[number], first + self.firsts[number]
            if name or not isinstance(node, PlacedStruct):
                is_bit = isinstance(node, PlacedLeaf) and node.is_bit
                yield FlatMember(name, at, self.bits[number] if is_bit else None, node, before)
            else:
                yield from node.flat_members(at, before)


class PlacedUnion(PlacedStruct):
    """A union: a structure whose members all have offset 0."""

    def __init__(self, parts: Sequence[PlacedMember], size: int, align: int) -> None:
        super().__init__(parts, size, align)
        self.overlaps = True


class PlacedArray:
    """An array with its element laid out once, its declared bounds, and `pitch` bytes between elements.

    An array of bits has rows of `row_size` bytes, and only the last index varies in a row.
    """

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

    def element_place(self, number: int) -> tuple[int, int]:
        """Return the offset of element `number`, and its bit there. An element that is no bit has bit 0."""
        if not self.is_bits:
            return number * self.pitch, 0
        row, column = divmod(number, self.columns)
        return row * self.row_size + column // 8, column % 8


def _quote_name(name: str) -> str:
    return name if not name or re.fullmatch(_NAME, name) else '"' + name.replace('"', '""') + '"'


Node = PlacedLeaf | PlacedStruct | PlacedArray


def members_of(
    type_: Struct | Union, node: PlacedStruct
) -> Iterator[tuple[str, int, int | None, Node, Type]]:
    """Yield name, offset, bit, node and type of every member. Members of a base (EXTENDS) come first."""
    for one, member in zip(node.flat_members(), all_members(type_), strict=True):
        yield one.name, one.offset, one.bit, one.node, member.type


def leaves_of(node: Node, path: str = "", offset: int = 0, bit: int = 0) -> Iterator[Leaf]:
    """Yield the leaves of a node that has this path and place."""
    if isinstance(node, PlacedLeaf):
        yield Leaf(path, node.type, offset, node.size, node.coding, bit if node.is_bit else None)
    elif isinstance(node, PlacedStruct):
        prefix = path + "." if path else ""
        for step, place, child, at in zip(node.steps, node.offsets, node.nodes, node.bits, strict=True):
            if child.leaves:
                yield from leaves_of(child, prefix + step if step else path, offset + place, at)
    elif node.leaves:
        for number, index in enumerate(indices(node)):
            place, at = node.element_place(number)
            yield from leaves_of(node.element, path + index, offset + place, at)


def indices(node: PlacedArray) -> Iterator[str]:
    """Yield the index of each element in the declared bounds, such as `[1,2]`."""
    ranges = (range(low, high + 1) for low, high in node.bounds)
    return (f"[{','.join(map(str, index))}]" for index in product(*ranges))


_NAME = r'[^.\[\]"]+'
_STEP_PATTERN = rf'\.?(?:({_NAME})|"((?:[^"]|"")*)")|\[([^\[\]]*)\]'
_INDEX_PATTERN = r"(?a)\s*(-?\d{1,19})\s*"


def find_node(node: Node, path: str) -> tuple[int, Node]:
    """Return the first leaf's number and the node at a path. Raise LookupError with the failed step."""
    number = at = 0
    while at < len(path):
        step = re.match(_STEP_PATTERN, path[at:])
        if step is None:
            raise LookupError(path[at:])
        at += step.end()
        before, node = _find_child(node, step)
        number += before
    return number, node


def _find_child(node: Node, step: re.Match[str]) -> tuple[int, Node]:
    name, quoted, indices = step.groups()
    name = quoted.replace('""', '"') if name is None and quoted is not None else name
    while name is not None and isinstance(node, PlacedStruct) and node.nodes:
        number = node.index.get(name.casefold())
        if number is not None:
            return node.firsts[number], node.nodes[number]
        if node.names[0]:
            break
        node = node.nodes[0]  # the base (EXTENDS): its members need no name in front
    if indices is not None and isinstance(node, PlacedArray):
        element = _element_number(node, indices)
        if element is not None:
            return element * node.element.leaves, node.element
    raise LookupError(step.group())


def _element_number(node: PlacedArray, text: str) -> int | None:
    """Return the number of the element at an index such as `1,2`, or None if it is out of bounds."""
    found, number = text.split(","), 0
    for index, (low, high) in zip(found, node.bounds, strict=False):
        at = re.fullmatch(_INDEX_PATTERN, index)
        if at is None or not low <= int(at[1]) <= high:
            return None
        number = number * (high - low + 1) + int(at[1]) - low
    return number if len(found) == len(node.bounds) else None


# -- the leaves compiled: one `struct.Struct`, and the conversions of its raw values -------------------------

Data = bytes | bytearray | memoryview
LeafValues = tuple[Value | None, ...]


class LeafDecoder:
    """Reads bytes as values, in leaf order; raises struct.error if there are too few bytes."""

    def __init__(self, leaves: Sequence[Leaf], order: str) -> None:
        parts, end = [order], 0
        self._conversions: list[tuple[int, Callable[[Any], Value]]] = []
        for number, leaf in enumerate(leaves):
            if leaf.offset > end:
                parts.append(f"{leaf.offset - end}x")
            parts.append(leaf.coding.code)
            end = leaf.offset + leaf.size
            if leaf.coding.to_value:
                self._conversions.append((number, leaf.coding.to_value))
        self._unpack = struct.Struct("".join(parts)).unpack_from

    def read(self, data: Data) -> LeafValues:
        raw = self._unpack(data)
        if not self._conversions:
            return raw
        values = list(raw)
        for number, to_value in self._conversions:
            values[number] = to_value(values[number])
        return tuple(values)


def decoder_of(leaves: Sequence[Leaf], order: str) -> LeafDecoder | None:
    """Return the codec of the leaves, or None if a leaf is a bit or leaves share a byte.

    Bits share a byte, and members of a UNION share bytes. Leaves that share a byte are read one by one.
    """
    end = 0
    for leaf in leaves:
        if leaf.bit is not None or leaf.offset < end:
            return None
        end = leaf.offset + leaf.size
    return LeafDecoder(leaves, order)
