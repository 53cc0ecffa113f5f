"""A layout compiled: one `struct.Struct` for all leaves, and what becomes of its raw values."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout_tree import Leaf

Data = bytes | bytearray | memoryview
Values = tuple[Value | None, ...]


class Codec:
    """Reads bytes as values, in leaf order; raises struct.error when there are too few."""

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

    def read(self, data: Data) -> Values:
        raw = self._unpack(data)
        if not self._conversions:
            return raw
        values = list(raw)
        for number, to_value in self._conversions:
            values[number] = to_value(values[number])
        return tuple(values)


def codec_of(leaves: Sequence[Leaf], order: str) -> Codec | None:
    """Return the codec of leaves of which each begins where the one before ends, or later; else None.

    Bits share their byte, the members of a UNION all of theirs: these are read one by one.
    """
    end = 0
    for leaf in leaves:
        if leaf.bit is not None or leaf.offset < end:
            return None
        end = leaf.offset + leaf.size
    return Codec(leaves, order)
