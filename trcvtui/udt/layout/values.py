"""Decodes the bytes of a layout to values and encodes values. In a UNION every member keeps its value.

Rules: decoding never fails. An incomplete leaf is None, and surplus bytes are ignored. If leaves overlap,
leaves in which every bit counts are written first. Then come BOOL, texts and other leaves that can store a
value in several forms. Each of these changes as few bytes as its value needs.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from itertools import product

from trcvtui.errors import Problem, UserError, collect_problems, raise_all_problems
from trcvtui.udt.layout.coding import Value, ValueRefused
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout
from trcvtui.udt.layout.layout_tree import Data, Leaf, LeafValues
from trcvtui.udt.types import StringType


def decode(layout: Layout, data: Data) -> LeafValues:
    """Return the values of all leaves, None for each that is not complete."""
    if layout.whole_decoder is not None and len(data) >= layout.size:
        return layout.whole_decoder.read(data)
    return decode_leaves(layout, data, 0, layout.leaf_count)


def decode_leaves(layout: Layout, data: Data, start: int, stop: int) -> LeafValues:
    """Return the values of the leaves of number start..stop-1, None for each that is not complete."""
    parts = ((leaf, data[leaf.offset : leaf.offset + leaf.size]) for leaf in layout.leaves(start, stop))
    return tuple(decode_leaf(layout, leaf, part) if len(part) == leaf.size else None for leaf, part in parts)


def decode_leaf(layout: Layout, leaf: Leaf, part: Data) -> Value:
    """Return the value of a leaf from its own bytes. A bit's own byte is the byte that contains the bit."""
    if leaf.bit is not None:
        return bool(part[0] >> leaf.bit & 1)
    (raw,) = struct.unpack(BYTE_ORDERS[layout.rules.byte_order] + leaf.coding.code, part)
    value: Value = leaf.coding.to_value(raw) if leaf.coding.to_value else raw
    return value


def _write_overlapping(layout: Layout, data: bytearray, parts: Sequence[tuple[Leaf, bytes]]) -> None:
    """Write leaves that share bytes. `taken` are the bits that earlier values need."""
    taken = bytearray(len(data))
    for leaf, part in sorted(parts, key=lambda row: _write_order(layout, *row)):
        place = slice(leaf.offset, leaf.offset + leaf.size)
        own = bytes([1 << leaf.bit]) if leaf.bit is not None else b"\xff" * leaf.size
        value = decode_leaf(layout, leaf, part)
        needed = _needed_mask(layout, leaf, part) if isinstance(leaf.type, StringType) else own
        free = bytes(ours & ~theirs for ours, theirs in zip(own, taken[place], strict=True))
        # The free bits first, then those it needs, then all; each as given and in an equivalent form.
        for mask, form in (*product((free, needed), (part, _equal_bytes(layout, leaf, part))), (own, part)):
            written = bytes(b & ~m | f & m for b, f, m in zip(data[place], form, mask, strict=True))
            if _is_same_value(decode_leaf(layout, leaf, written), value):
                break
        data[place] = written
        taken[place] = bytes(ours | theirs for ours, theirs in zip(needed, taken[place], strict=True))


def _equal_bytes(layout: Layout, leaf: Leaf, part: bytes) -> bytes:
    """Return other bytes of this value. TRUE becomes 16#FF, a full text gets a length beyond its field."""
    if not isinstance(leaf.type, StringType):
        return b"\xff" * len(part) if any(part) and leaf.coding.code == "?" else part
    if not layout.rules.text.header:
        return part
    unit = 2 if leaf.type.wide else 1
    return part[:unit] + b"\xff" * unit + part[2 * unit :]


def _needed_mask(layout: Layout, leaf: Leaf, part: bytes) -> bytes:
    """Return a mask of the bytes that a text needs, without its longest length and bytes after its end."""
    assert isinstance(leaf.type, StringType)
    unit = 2 if leaf.type.wide else 1
    size = len(leaf.coding.to_raw(decode_leaf(layout, leaf, part)))
    first, last = (unit, size) if layout.rules.text.header else (0, size + unit)
    return bytes(255 if first <= at < last else 0 for at in range(len(part)))


def _write_order(layout: Layout, leaf: Leaf, part: bytes) -> int:
    """Return a rank, higher if more other bytes store the same value. The rank is 0 if every bit counts."""
    if isinstance(leaf.type, StringType):
        return 2 if leaf.type.wide else 1
    value = decode_leaf(layout, leaf, part)
    is_loose = leaf.coding.code.endswith("s") or (value is True and leaf.bit is None) or value != value  # NaN
    return 3 if is_loose else 0


def _is_same_value(one: Value, other: Value) -> bool:
    return one == other or (one != one and other != other)


LONGEST_VALUE_SHOWN = 60


def encode(layout: Layout, values: Mapping[str, object]) -> bytes:
    """Return the bytes of values by path; missing values, None and gaps are 0.

    Where members overlap, a later member leaves bytes unchanged that already mean its value.
    Raise UserError with one problem for each unknown path and each value out of range.
    """
    data = bytearray(layout.size)
    parts: list[tuple[Leaf, bytes]] = []
    with raise_all_problems() as problems:
        for path, value in values.items():
            with collect_problems(problems):
                number = layout.leaf_number(path)
                if value is None:
                    continue
                if layout.root.overlaps:
                    leaf = layout.leaf(number)
                    parts.append((leaf, encode_leaf(layout, leaf, value)))
                else:
                    write_leaf(layout, data, number, value)
    _write_overlapping(layout, data, parts)
    return bytes(data)


def write_leaf(layout: Layout, data: bytearray, number: int, value: object) -> None:
    """Write one leaf into the bytes of the whole layout; raise UserError when the value does not fit."""
    leaf = layout.leaf(number)
    part = encode_leaf(layout, leaf, value)
    if leaf.bit is not None:  # keep the other bits of the byte
        part = bytes([data[leaf.offset] & ~(1 << leaf.bit) | part[0]])
    data[leaf.offset : leaf.offset + leaf.size] = part


def encode_leaf(layout: Layout, leaf: Leaf, value: object) -> bytes:
    """Return the bytes of a JSON value, or of a text such as `16#FF`, `T#5s`, `TRUE`.

    For a bit, return the byte that contains the bit, with all other bits 0.
    """
    try:
        raw = leaf.coding.to_raw(value)
    except ValueRefused as refused:
        where = f"{layout.name}.{leaf.path}" if leaf.path else layout.name
        raise UserError(Problem(where, _describe_value(value), str(refused))) from None
    if leaf.bit is not None:
        return bytes([raw << leaf.bit])
    return struct.pack(BYTE_ORDERS[layout.rules.byte_order] + leaf.coding.code, raw)


def _describe_value(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 128:  # Python refuses to print 4301 digits
        return f"a number of {value.bit_length()} bits"
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "an object"
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE_SHOWN else text[:LONGEST_VALUE_SHOWN] + "..."
