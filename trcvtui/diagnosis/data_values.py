"""The symptoms of DATA, without a guess why: members not written, values that no machine sends."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Final, NamedTuple

from trcvtui.diagnosis.receiver import Receiver
from trcvtui.udt.compare.likelihood import leaf_evidence
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout, Leaf, lay_out
from trcvtui.udt.types import Elementary, Struct, ValueKind

MOST_LEAVES: Final = 256  # members that are examined
MOST_NAMED: Final = 2  # members in a sentence


class UnwrittenMembers(NamedTuple):
    """The members after the last byte of a frame. If `is_cut`, the frame ends inside the first member."""

    names: str
    is_cut: bool


def make_data_layout(receiver: Receiver) -> Layout | None:
    """Return the layout of DATA, or None if DATA has no members that give the bytes a meaning."""
    if receiver.rules is None or not isinstance(receiver.type, Struct):
        return None
    return lay_out(receiver.type, receiver.rules, receiver.type_name)


def find_unwritten_members(receiver: Receiver, size: int) -> UnwrittenMembers | None:
    """Return the members that frames of `size` bytes do not write, or None if there are none."""
    layout = make_data_layout(receiver)
    if layout is None or not 0 < size < layout.size:
        return None
    first, last = layout.count_leaves_within(size), layout.leaf_count
    if first == last:
        return None  # padding alone
    names = ", ".join(f"`{leaf.path}`" for leaf in layout.leaves(first, min(first + MOST_NAMED, last)))
    more = f" and {last - first - MOST_NAMED} more" if last - first > MOST_NAMED else ""
    return UnwrittenMembers(names + more, layout.leaf(first).offset < size)


def describe_odd_values(receiver: Receiver, frames: Sequence[bytes]) -> tuple[str, ...]:
    """Return a text for each member with a value that no machine sends, in at least two of three frames.

    Numbers that are not finite do not count: devices send them for "no value".
    """
    if receiver.type is None or receiver.rules is None or not frames:
        return ()
    layout = lay_out(receiver.type, receiver.rules, receiver.type_name)
    texts = []
    for leaf in layout.leaves(0, min(layout.leaf_count, MOST_LEAVES)):
        parts = [one[leaf.offset : leaf.offset + leaf.size] for one in frames]
        whys = [why for part in parts if len(part) == leaf.size and (why := _explain_odd(layout, leaf, part))]
        if whys and len(whys) * 3 >= len(frames) * 2:
            texts.append(f"{leaf.path or 'the value'}: {whys[-1]}")
    return tuple(texts)


def _explain_odd(layout: Layout, leaf: Leaf, part: bytes) -> str:
    said = leaf_evidence(leaf, part, layout.rules)
    if said is None or not said.is_odd:
        return ""
    row = leaf.type
    if isinstance(row, Elementary) and row.kind is ValueKind.REAL:
        (number,) = struct.unpack(BYTE_ORDERS[layout.rules.byte_order] + row.code, part)
        return f"{number:.7g} is {said.why}" if math.isfinite(number) else ""
    return said.why
