"""Bytes to values: as far as the bytes go, in leaf order.

Rule: no data is an error. A leaf that is not wholly there is None; surplus bytes are ignored.
"""

from __future__ import annotations

from trcvtui.udt.codec import Values
from trcvtui.udt.layout import Layout

Data = bytes | bytearray | memoryview


def decode(layout: Layout, data: Data) -> Values:
    """Return the values of all leaves, None for each that is missing or partly present."""
    codec = layout.codec
    if len(data) >= codec.end:
        return codec.read(data)
    return codec.read_part(data, layout.leaves_within(len(data)))


def decode_leaves(layout: Layout, data: Data, start: int, stop: int) -> Values:
    """Return the values of the leaves of number start..stop-1; the cost does not grow with the layout."""
    page = layout.page(start, stop)
    if len(data) >= page.codec.end:
        return page.codec.read(data)
    present = layout.leaves_within(len(data)) - page.start
    return page.codec.read_part(data, min(max(present, 0), page.codec.count))
