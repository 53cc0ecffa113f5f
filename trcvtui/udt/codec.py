"""A layout compiled: one `struct.Struct` for all leaves or for a page of them, and the conversions."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from trcvtui.udt.coding import Value
from trcvtui.udt.placed import Leaf, Node, PlacedLeaf, PlacedStruct

Data = bytes | bytearray | memoryview
Values = tuple[Value | None, ...]
Reading = Callable[[Data], Values]


class Conversion(NamedTuple):
    """The raw values of the leaves start..stop-1 become shown values by `to_value`."""

    start: int
    stop: int
    to_value: Callable[[Any], Value]


class Codec:
    """Reads the bytes base..end-1 as values, in leaf order.

    `read` returns the values of all leaves; it raises struct.error when the data does not reach to `end`.
    """

    __slots__ = ("base", "conversions", "count", "end", "packer", "read")

    def __init__(self, packer: struct.Struct, base: int, count: int, found: list[Conversion]) -> None:
        self.packer, self.base, self.count, self.conversions = packer, base, count, tuple(found)
        self.end = base + packer.size
        # Where nothing is to convert, the whole decode is the one call into `struct`.
        direct: Reading = packer.unpack_from
        self.read = self._read if found or base else direct

    def _read(self, data: Data) -> Values:
        values = list(self.packer.unpack_from(data, self.base))
        for start, stop, to_value in self.conversions:
            values[start:stop] = map(to_value, values[start:stop])
        return tuple(values)

    def read_part(self, data: Data, present: int) -> Values:
        """Return the values of the first `present` leaves and None for the others; data may end anywhere."""
        filled = bytes(data[: self.end]).ljust(self.end, b"\0")
        return self.read(filled)[:present] + (None,) * (self.count - present)


class Page(NamedTuple):
    """Leaves that follow each other, with the codec for just these."""

    start: int
    leaves: tuple[Leaf, ...]
    codec: Codec


def codec_of(root: Node, order: str) -> Codec:
    """Compile the whole layout; `order` is the byte order mark of `struct`."""
    return Codec(struct.Struct(order + format_of(root)), 0, root.leaves, conversions(root))


def page_of(start: int, leaves: Sequence[Leaf], order: str) -> Page:
    """Compile leaves that follow each other; cheap, whatever the size of the layout."""
    base = end = leaves[0].offset if leaves else 0
    parts, found = [order], []
    for number, leaf in enumerate(leaves):
        parts.append(gap(leaf.offset - end) + leaf.coding.code)
        end = leaf.offset + leaf.size
        if leaf.coding.to_value:
            found.append(Conversion(number, number + 1, leaf.coding.to_value))
    return Page(start, tuple(leaves), Codec(struct.Struct("".join(parts)), base, len(leaves), found))


def format_of(node: Node) -> str:
    """Return the `struct` format of all leaves of the node, gaps as pad bytes."""
    if isinstance(node, PlacedLeaf):
        return node.coding.code
    if not node.leaves:
        return f"{node.size}x"
    if isinstance(node, PlacedStruct):
        return _struct_format(node)
    element = format_of(node.element)
    return f"{node.count}{element}" if len(element) == 1 else element * node.count


def _struct_format(node: PlacedStruct) -> str:
    parts, end = [], 0
    for offset, child in zip(node.offsets, node.nodes, strict=True):
        parts.append(gap(offset - end) + format_of(child))
        end = offset + child.size
    return "".join(parts) + gap(node.size - end)


def gap(size: int) -> str:
    """Return the `struct` format of a gap."""
    return f"{size}x" if size else ""


def conversions(node: Node) -> list[Conversion]:
    """Return the conversions of all leaves of the node that are not shown as they are stored."""
    if isinstance(node, PlacedLeaf):
        to_value = node.coding.to_value
        return [Conversion(0, 1, to_value)] if to_value else []
    found: list[Conversion] = []
    if not node.leaves:
        return found
    if isinstance(node, PlacedStruct):
        for before, child in zip(node.firsts, node.nodes, strict=True):
            found += [Conversion(c.start + before, c.stop + before, c.to_value) for c in conversions(child)]
        return found
    element = conversions(node.element)
    if element and element[0].stop - element[0].start == node.element.leaves:
        return [Conversion(0, node.leaves, element[0].to_value)]
    for before in range(0, node.leaves if element else 0, node.element.leaves):
        found += [Conversion(c.start + before, c.stop + before, c.to_value) for c in element]
    return found
