"""The number that one member has in each known message, decoded only once."""

from __future__ import annotations

import math
import sys
from typing import Final

from trcvtui.history.messages import HOLE_REASON, MessageRow
from trcvtui.tui.view_model.known_messages import KnownMessages
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.values import decode_leaf

Number = int | float
NOT_KNOWN: Final = math.nan  # compare by identity: a message may hold a NaN, too


def is_number(layout: Layout, leaf: Leaf) -> bool:
    """Return whether a member can be drawn on an axis: it is not a text, a date or a time."""
    return not isinstance(decode_leaf(layout, leaf, bytes(leaf.size)), str)


def number_in(layout: Layout, leaf: Leaf, row: MessageRow) -> Number | None:
    """Return the member's number in a message, None if the message did not write this member."""
    is_cut = row.reason not in ("", HOLE_REASON)
    if is_cut or row.size < leaf.offset + leaf.size:
        return None
    part = (row.content or b"")[leaf.offset : leaf.offset + leaf.size]
    value = decode_leaf(layout, leaf, part) if len(part) == leaf.size else NOT_KNOWN
    return NOT_KNOWN if isinstance(value, str) else value


class MemberNumbers:
    """One member's numbers in the newest messages, at most `most` numbers."""

    def __init__(self, layout: Layout, leaf: Leaf, most: int = sys.maxsize) -> None:
        self.layout, self.leaf = layout, leaf
        self.first = 0  # the index of the first one among all messages of the instance
        self.numbers: list[Number | None] = []
        self._most = most

    def update_numbers(self, known: KnownMessages, stop: int) -> list[Number | None]:
        """Return the member's numbers in the messages before message `stop`, the newest last."""
        first = max(known.first, stop - self._most)
        low, high = max(first, self.first), min(stop, self.first + len(self.numbers))
        if low > high:  # nothing known is of use
            low = high = first
        kept = self.numbers[low - self.first : high - self.first]
        self.numbers = [*self._decode(known, first, low), *kept, *self._decode(known, high, stop)]
        self.first = first
        gone = max(0, min(known.first_full, stop) - first)
        self.numbers[:gone] = [NOT_KNOWN] * gone
        return self.numbers

    def _decode(self, known: KnownMessages, first: int, stop: int) -> list[Number | None]:
        rows = known.rows[first - known.first : stop - known.first]
        return [number_in(self.layout, self.leaf, row) for row in rows]
