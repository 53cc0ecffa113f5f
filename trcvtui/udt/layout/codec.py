"""A layout compiled: one `struct.Struct` for all leaves, and what follows it.

Most leaves are one raw value of the `struct` each. Bits that share bytes, and the members of a UNION, which
share all of them, are one raw value together, bytes that expand to many values.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout_tree import Leaf, Node, PlacedLeaf, PlacedStruct, PlacedUnion

Data = bytes | bytearray | memoryview
Values = tuple[Value | None, ...]
Reading = Callable[[Data], Values]

BITS = tuple(tuple(bool(byte >> bit & 1) for bit in range(8)) for byte in range(256))


class Conversion(NamedTuple):
    """The raw values of number start..stop-1 become shown values by `to_value`."""

    start: int
    stop: int
    to_value: Callable[[Any], Value]


class Expansion(NamedTuple):
    """The raw value of that number, bytes, becomes the values of several leaves."""

    at: int
    to_values: Callable[[bytes], Iterable[Value | None]]


class Plan(NamedTuple):
    """A node compiled: `struct` format without byte order, the raw values it gives, what becomes of them."""

    format: str
    slots: int = 0
    conversions: tuple[Conversion, ...] = ()
    expansions: tuple[Expansion, ...] = ()


class Codec:
    """Reads bytes as values, in leaf order.

    `read` returns the values of all leaves; it raises struct.error when the data is too short.
    """

    __slots__ = ("conversions", "expansions", "packer", "read")

    def __init__(self, plan: Plan, order: str) -> None:
        self.packer = struct.Struct(order + plan.format)
        self.conversions, self.expansions = plan.conversions, plan.expansions
        # Where nothing is to convert, the whole decode is the one call into `struct`.
        direct: Reading = self.packer.unpack_from
        is_direct = not (plan.conversions or plan.expansions)
        self.read = direct if is_direct else self._read

    def _read(self, data: Data) -> Values:
        values = list(self.packer.unpack_from(data))
        for start, stop, to_value in self.conversions:
            values[start:stop] = map(to_value, values[start:stop])
        return tuple(self._expanded(values) if self.expansions else values)

    def _expanded(self, raw: list[Any]) -> list[Value | None]:
        values: list[Value | None] = []
        done = 0
        for at, to_values in self.expansions:
            values += raw[done:at]
            values += to_values(raw[at])
            done = at + 1
        return values + raw[done:]

    def read_filled(self, data: Data) -> Values:
        """Return the values of all leaves of data that may end anywhere, zeros after it."""
        size = self.packer.size
        return self.read(bytes(data[:size]).ljust(size, b"\0"))


def present(leaves: Iterable[Leaf], values: Values, length: int) -> Values:
    """Return the values with None for each leaf that is not wholly in the first `length` bytes."""
    pairs = zip(leaves, values, strict=True)
    return tuple(value if leaf.offset + leaf.size <= length else None for leaf, value in pairs)


# -- a whole layout ------------------------------------------------------------------------------------------


def codec_of(root: Node, order: str) -> Codec:
    """Compile the whole layout; `order` is the byte order mark of `struct`."""
    return Codec(plan_of(root, order), order)


def plan_of(node: Node, order: str) -> Plan:
    """Return the node compiled, gaps as pad bytes."""
    if not node.leaves:
        return Plan(gap(node.size))
    if isinstance(node, PlacedLeaf):
        return _leaf_plan(node)
    if isinstance(node, PlacedUnion):
        readings = tuple(codec_of(member, order).read for member in node.nodes)
        return _expanding(node.size, partial(_all_members, readings))
    if isinstance(node, PlacedStruct):
        return _struct_plan(node, order)
    if node.is_bits:
        return _expanding(node.size, partial(_rows_of_bits, node.row_size, node.columns))
    return array_plan(node.element, node.count, node.pitch, order)


def _leaf_plan(node: PlacedLeaf) -> Plan:
    if node.is_bit:
        return _expanding(1, partial(_first_bits, 1))
    to_value = node.coding.to_value
    return Plan(node.coding.code, 1, (Conversion(0, 1, to_value),) if to_value else ())


def _expanding(size: int, to_values: Callable[[bytes], Iterable[Value | None]]) -> Plan:
    return Plan(f"{size}s", 1, (), (Expansion(0, to_values),))


def _struct_plan(node: PlacedStruct, order: str) -> Plan:
    parts: list[str] = []
    conversions: list[Conversion] = []
    expansions: list[Expansion] = []
    end = count = number = 0
    while number < len(node.nodes):
        offset, child = node.offsets[number], node.nodes[number]
        bits = _bits_from(node, number)
        plan = _expanding(1, partial(_first_bits, bits)) if bits else plan_of(child, order)
        parts.append(gap(offset - end) + plan.format)
        conversions += [Conversion(c.start + count, c.stop + count, c.to_value) for c in plan.conversions]
        expansions += [Expansion(e.at + count, e.to_values) for e in plan.expansions]
        end, count, number = offset + child.size, count + plan.slots, number + max(bits, 1)
    return Plan("".join(parts) + gap(node.size - end), count, tuple(conversions), tuple(expansions))


def _bits_from(node: PlacedStruct, number: int) -> int:
    """Return how many members from that number on are bits of one byte, beginning with its first."""
    stop = number
    while stop < len(node.nodes) and node.offsets[stop] == node.offsets[number]:
        child = node.nodes[stop]
        if not (isinstance(child, PlacedLeaf) and child.is_bit):
            break
        stop += 1
    return stop - number


def array_plan(element: Node, elements: int, pitch: int, order: str) -> Plan:
    """Return so many elements compiled, the first bytes of which are `pitch` bytes apart."""
    plan = plan_of(element, order)
    text = plan.format + gap(pitch - element.size)
    whole = f"{elements}{text}" if len(text) == 1 else text * elements
    count, starts = plan.slots * elements, range(0, plan.slots * elements, plan.slots)
    conversions = plan.conversions
    if conversions and conversions[0].stop - conversions[0].start == plan.slots:
        conversions = (Conversion(0, count, conversions[0].to_value),)
    elif conversions:
        conversions = tuple(
            Conversion(c.start + n, c.stop + n, c.to_value) for n in starts for c in conversions
        )
    expansions = tuple(Expansion(e.at + n, e.to_values) for n in starts for e in plan.expansions)
    return Plan(whole, count, conversions, expansions if plan.expansions else ())


def gap(size: int) -> str:
    """Return the `struct` format of a gap."""
    return f"{size}x" if size else ""


# -- bytes that are several values ---------------------------------------------------------------------------


def _first_bits(count: int, raw: bytes) -> tuple[bool, ...]:
    return BITS[raw[0]][:count]


def _rows_of_bits(row_size: int, columns: int, raw: bytes) -> list[bool]:
    values: list[bool] = []
    for start in range(0, len(raw), row_size):
        row = chain.from_iterable(map(BITS.__getitem__, raw[start : start + row_size]))
        values += [*row][:columns]
    return values


def _all_members(readings: tuple[Reading, ...], raw: bytes) -> Iterable[Value | None]:
    return chain.from_iterable(read(raw) for read in readings)
