"""Bytes to values: as far as the bytes go, in leaf order.

Rule: no data is an error. A leaf that is not wholly there is None; surplus bytes are ignored.
"""

from __future__ import annotations

import struct

from trcvtui.udt.layout.codec import Data, Values, present
from trcvtui.udt.layout.coded import Value
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout, Leaf


def decode(layout: Layout, data: Data) -> Values:
    """Return the values of all leaves, None for each that is missing or partly present."""
    try:
        return layout.codec.read(data)
    except struct.error:
        values = layout.codec.read_filled(data)
    if layout.root.overlaps:
        return present(layout.leaves(), values, len(data))
    within = layout.leaves_within(len(data))
    return values[:within] + (None,) * (len(values) - within)


def decode_leaves(layout: Layout, data: Data, start: int, stop: int) -> Values:
    """Return the values of the leaves of number start..stop-1; the cost does not grow with the layout."""
    page = layout.page(start, stop)
    try:
        return page.read(data)
    except struct.error:
        return page.read_part(data)


def decode_leaf(layout: Layout, leaf: Leaf, part: Data) -> Value:
    """Return the value of one leaf from its own bytes, of a bit the byte it lies in."""
    if leaf.bit is not None:
        return bool(part[0] >> leaf.bit & 1)
    (raw,) = struct.unpack(BYTE_ORDERS[layout.rules.byte_order] + leaf.coding.code, part)
    value: Value = leaf.coding.to_value(raw) if leaf.coding.to_value else raw
    return value
