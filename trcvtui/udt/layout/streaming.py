"""The leaves of a layout, and their values in step, however many there are: nothing of them is kept.

Rule: what is made of the element of an ARRAY is made once and given again for every element.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, islice, product, repeat
from operator import itemgetter
from typing import Final, Generic, TypeVar

from trcvtui.udt.layout.codec import Codec, Data, array_plan, codec_of, present
from trcvtui.udt.layout.coded import Value
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout
from trcvtui.udt.layout.layout_tree import (
    Leaf,
    Node,
    PlacedArray,
    PlacedLeaf,
    PlacedStruct,
    PlacedUnion,
    walk,
)

FEW: Final = 256  # leaves that are made one by one
PAGE: Final = 1024  # elements that are decoded, rows that are aligned at once
MOST_AT_ONCE: Final = 16 * PAGE  # leaves that are decoded in one go
CODECS_KEPT: Final = 32

_M = TypeVar("_M")
_T = TypeVar("_T")
Make = Callable[[Leaf], _M]


def stream(layout: Layout, make: Make[_M], by_offset: bool = False) -> Iterator[tuple[int, str, _M]]:
    """Yield of every leaf its offset, how its path begins, and what `make` made of it.

    The leaf that `make` is given has the rest of the path, and an offset that means nothing. In declared
    order, or by offset: these differ in a UNION.
    """
    return _Stream(make, by_offset).of(layout.root, "", 0)


class _Stream(Generic[_M]):
    def __init__(self, make: Make[_M], by_offset: bool) -> None:
        self.make, self.by_offset = make, by_offset

    def of(self, node: Node, path: str, offset: int, bit: int = 0) -> Iterator[tuple[int, str, _M]]:
        if isinstance(node, PlacedArray) and node.leaves > FEW:
            return self.array(node, path, offset)
        if isinstance(node, PlacedStruct) and node.leaves > FEW:
            prefix = path + "." if path else ""
            steps = ((prefix + name if name else path) for name in node.steps)
            places = (offset + place for place in node.offsets)
            members = map(self.of, node.nodes, steps, places, node.bits)
            is_union = isinstance(node, PlacedUnion) and self.by_offset
            return heapq.merge(*members, key=itemgetter(0)) if is_union else chain.from_iterable(members)
        return ((place, "", made) for place, made in self.few(node, path, offset, bit))

    def few(self, node: Node, path: str, offset: int = 0, bit: int = 0) -> list[tuple[int, _M]]:
        rows = [(leaf.offset, self.make(leaf)) for leaf in walk(node, path, offset, 0, node.leaves, bit)]
        return sorted(rows, key=itemgetter(0)) if self.by_offset and node.overlaps else rows

    def array(self, node: PlacedArray, path: str, offset: int) -> Iterator[tuple[int, str, _M]]:
        element = node.element
        if element.leaves > FEW:
            for number, index in enumerate(_indices(node)):
                yield from self.of(element, path + index, offset + number * node.pitch)
        elif node.is_bits:
            made = [self.made_of(element, bit)[0][1] for bit in range(8)]
            for number, index in enumerate(_indices(node)):
                place, bit = node.place(number)
                yield offset + place, path + index, made[bit]
        else:
            rows = self.made_of(element)
            for at, index in zip(range(offset, offset + node.size, node.pitch), _indices(node), strict=True):
                before = path + index
                for place, one in rows:
                    yield at + place, before, one

    def made_of(self, element: Node, bit: int = 0) -> list[tuple[int, _M]]:
        """Return what is made of an element; the path of its leaves begins behind the index."""
        make, self.make = self.make, lambda leaf: make(leaf._replace(path=leaf.path[1:]))
        rows = self.few(element, "]", 0, bit)
        self.make = make
        return rows


def _indices(node: PlacedArray) -> Iterator[str]:
    """Yield the index of each element, such as `[1,2]`."""
    if len(node.bounds) == 1:
        ((low, high),) = node.bounds
        return (f"[{index}]" for index in range(low, high + 1))
    ranges = (range(low, high + 1) for low, high in node.bounds)
    return (f"[{','.join(map(str, index))}]" for index in product(*ranges))


# -- values --------------------------------------------------------------------------------------------------


def values_of(layout: Layout, data: Data) -> Iterator[Value | None]:
    """Yield the values of all leaves in declared order, None for each that is missing or partly present."""
    return _Values(bytes(data), BYTE_ORDERS[layout.rules.byte_order]).of(layout.root, 0)


class _Values:
    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order = data, order
        self.codecs: dict[int, Codec] = {}

    def codec(self, node: Node) -> Codec:
        if id(node) not in self.codecs:
            if len(self.codecs) >= CODECS_KEPT:
                self.codecs.clear()
            self.codecs[id(node)] = codec_of(node, self.order)
        return self.codecs[id(node)]

    def of(self, node: Node, at: int, bit: int = 0) -> Iterator[Value | None]:
        if at >= len(self.data):
            return repeat(None, node.leaves)
        if isinstance(node, PlacedArray) and node.leaves > MOST_AT_ONCE and not node.is_bits:
            return self.array(node, at)
        if isinstance(node, PlacedStruct) and node.leaves > MOST_AT_ONCE:
            members = zip(node.nodes, node.offsets, node.bits, strict=True)
            return chain.from_iterable(self.of(child, at + place, bit) for child, place, bit in members)
        return iter(self.read(node, at, bit))

    def array(self, node: PlacedArray, at: int) -> Iterator[Value | None]:
        element, pitch = node.element, node.pitch
        if element.leaves > MOST_AT_ONCE:
            for number in range(node.count):
                yield from self.of(element, at + number * pitch)
            return
        once = max(PAGE // max(element.leaves, 1), 1)
        codec, number = Codec(array_plan(element, once, pitch, self.order), self.order), 0
        while number + once <= node.count and at + once * pitch <= len(self.data):
            yield from codec.read(self.data[at : at + once * pitch])
            number, at = number + once, at + once * pitch
        for _ in range(number, node.count):
            yield from self.read(element, at)
            at += pitch

    def read(self, node: Node, at: int, bit: int = 0) -> Iterable[Value | None]:
        part, codec = self.data[at : at + node.size], self.codec(node)
        if isinstance(node, PlacedLeaf) and node.is_bit:
            return (bool(part[0] >> bit & 1) if part else None,)
        if len(part) == node.size:
            return codec.read(part)
        return present(walk(node, "", 0, 0, node.leaves), codec.read_filled(part), len(part))


def pages(rows: Iterable[_T], size: int = PAGE) -> Iterator[list[_T]]:
    """Yield rows by the page."""
    waiting = iter(rows)
    while page := list(islice(waiting, size)):
        yield page
