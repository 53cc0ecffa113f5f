"""Values to bytes, the inverse of decode: little more than a table look-up and a list of refusals."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from trcvtui.errors import Problem, UserError
from trcvtui.udt.layout.coding import Refused
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout, Leaf
from trcvtui.udt.layout.overlay import Overlay

LONGEST_SHOWN = 60


def encode(layout: Layout, values: Mapping[str, object]) -> bytes:
    """Return the bytes of values by path; what is missing or None, and every gap, is 0.

    Of members that overlap a later one leaves what the earlier ones wrote, as far as that says its value too.
    Raise UserError with one problem for each unknown path and each value out of range.
    """
    data = bytearray(layout.size)
    overlay = Overlay(layout, data) if layout.root.overlaps else None
    problems: list[Problem] = []
    for path, value in values.items():
        try:
            number = layout.number_of(path)
            if value is None:
                continue
            if overlay is None:
                put(layout, data, number, value)
            else:
                leaf = layout.leaf(number)
                overlay.add(leaf, encode_leaf(layout, leaf, value))
        except UserError as refused:
            problems.extend(refused.problems)
    if problems:
        raise UserError(problems)
    if overlay is not None:
        overlay.write()
    return bytes(data)


def put(layout: Layout, data: bytearray, number: int, value: object) -> None:
    """Write one leaf into the bytes of the whole layout; raise UserError when the value does not fit."""
    leaf = layout.leaf(number)
    part = encode_leaf(layout, leaf, value)
    if leaf.bit is not None:  # its neighbours in the byte stay
        part = bytes([data[leaf.offset] & ~(1 << leaf.bit) | part[0]])
    data[leaf.offset : leaf.offset + leaf.size] = part


def encode_leaf(layout: Layout, leaf: Leaf, value: object) -> bytes:
    """Return the bytes of one leaf: from a JSON value or a text such as `16#FF`, `T#5s`, `TRUE`.

    Of a bit it is the byte it lies in, all other bits 0.
    """
    try:
        raw = leaf.coding.to_raw(value)
    except Refused as refused:
        where = f"{layout.name}.{leaf.path}" if leaf.path else layout.name
        raise UserError(Problem(where, _shown(value), str(refused))) from None
    if leaf.bit is not None:
        return bytes([raw << leaf.bit])
    return struct.pack(BYTE_ORDERS[layout.rules.byte_order] + leaf.coding.code, raw)


def _shown(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 128:  # Python writes no number of 4301 digits
        return f"a number of {value.bit_length()} bits"
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "an object"
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "..."
