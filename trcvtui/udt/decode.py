"""Bytes to values: as far as the bytes go, in leaf order.

Rule: no data is an error. A leaf that is not wholly there is None; surplus bytes are ignored.
"""

from __future__ import annotations

import struct

from trcvtui.udt.codec import Data, Values
from trcvtui.udt.layout import Layout


def decode(layout: Layout, data: Data) -> Values:
    """Return the values of all leaves, None for each that is missing or partly present."""
    try:
        return layout.codec.read(data)
    except struct.error:
        return layout.codec.read_part(data, layout.leaves_within(len(data)))


def decode_leaves(layout: Layout, data: Data, start: int, stop: int) -> Values:
    """Return the values of the leaves of number start..stop-1; the cost does not grow with the layout."""
    page = layout.page(start, stop)
    try:
        return page.codec.read(data)
    except struct.error:
        present = layout.leaves_within(len(data)) - page.start
        return page.codec.read_part(data, min(max(present, 0), page.codec.count))
