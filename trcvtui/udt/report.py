"""What `trcvtui udt show | decode | encode` answers, as plain values and as text (contracts 4.1 and 4.4)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from trcvtui.errors import one_line
from trcvtui.udt.codec import Data
from trcvtui.udt.coding import Value
from trcvtui.udt.decode import decode
from trcvtui.udt.encode import encode
from trcvtui.udt.layout import Layout, Leaf
from trcvtui.udt.types import Enumeration, Pointer, Text, type_text
from trcvtui.udt.value_text import special_text, value_text

Row = tuple[str, ...]


def show_json(layout: Layout) -> dict[str, object]:
    """Return the object of `udt show`: members are leaves in offset order."""
    return {
        "type": layout.name,
        "size": layout.size,
        "align": layout.align,
        "layout": layout.rules.name,
        "byte_order": layout.rules.byte_order,
        "members": [_member(layout, leaf) for leaf in _in_offset_order(layout)],
        "padding": [{"offset": offset, "size": size} for offset, size in layout.padding()],
    }


def show_text(layout: Layout) -> str:
    """Return the table of `udt show`: every leaf and every gap in offset order."""
    rows: list[tuple[int, Row]] = []
    for leaf in layout.leaves():
        named = leaf.type.name if isinstance(leaf.type, Enumeration) else ""
        type_ = leaf_type_text(layout, leaf) + (f" ({named})" if named else "")
        rows.append((leaf.offset, (_place(leaf), str(leaf.size), type_, leaf.path or layout.name)))
    for offset, size in layout.padding():
        rows.append((offset, (str(offset), str(size), "", "(padding)")))
    rows.sort(key=lambda row: row[0])
    head = f"{one_line(layout.name)}: {layout.size} bytes, align {layout.align}, {_layout_text(layout)}"
    table = in_columns([("offset", "size", "type", "path"), *(row for _, row in rows)], "rrll")
    return "\n".join([head, *table, *_notes(layout)])


def decode_json(layout: Layout, data: Data) -> dict[str, object]:
    """Return the object of `udt decode`: values by path, null where the bytes ended."""
    pairs = zip(layout.leaves(), decode(layout, data), strict=True)
    return {
        "type": layout.name,
        "size": layout.size,
        "complete": len(data) >= layout.size,
        "values": {leaf.path: json_value(value) for leaf, value in pairs},
    }


def decode_text(layout: Layout, data: Data) -> str:
    """Return the table of `udt decode`: every leaf with its value, and how far the bytes go."""
    rows: list[Row] = [("offset", "type", "path", "value")]
    for leaf, value in zip(layout.leaves(), decode(layout, data), strict=True):
        raw = bytes(data[leaf.offset : leaf.offset + leaf.size])
        text = value_text(leaf, value, raw)
        rows.append((_place(leaf), leaf_type_text(layout, leaf), leaf.path or layout.name, text))
    head = f"{one_line(layout.name)}: {_extent(len(data), layout.size)}, {_layout_text(layout)}"
    return "\n".join([head, *in_columns(rows, "rlll"), *_notes(layout)])


def encode_values(layout: Layout, values: Mapping[str, object]) -> bytes:
    """Return the bytes of values by path; what `udt decode` gave as JSON is taken as it is."""
    inner = values.get("values")
    return encode(layout, inner if isinstance(inner, Mapping) else values)


def json_value(value: Value | None) -> Value | None:
    """Return the value as JSON can hold it: NaN and infinities as text."""
    return special_text(value) if isinstance(value, float) and not math.isfinite(value) else value


def leaf_type_text(layout: Layout, leaf: Leaf) -> str:
    """Return the type that decides the bytes: a STRING with its length, an enumeration as its base type."""
    if isinstance(leaf.type, Text):
        return type_text(Text(layout.rules.text.length(leaf.type), leaf.type.wide))
    if isinstance(leaf.type, Pointer):
        return leaf.type.text
    return layout.rules.stored(leaf.type).name


def unverified(layout: Layout) -> list[str]:
    """Return the types in this layout whose bytes no page of the vendor describes, to be said beside them."""
    texts = {leaf_type_text(layout, leaf).partition("[")[0] for leaf in layout.leaves()}
    return sorted(texts & layout.rules.unverified)


def _member(layout: Layout, leaf: Leaf) -> dict[str, object]:
    bit = {} if leaf.bit is None else {"bit": leaf.bit}
    place = {"path": leaf.path, "type": leaf_type_text(layout, leaf), "offset": leaf.offset}
    return {**place, **bit, "size": leaf.size}


def _in_offset_order(layout: Layout) -> Iterable[Leaf]:
    # Members of a UNION overlap: in declared order offsets would go back.
    leaves = layout.leaves()
    return sorted(leaves, key=lambda leaf: leaf.offset) if layout.root.overlaps else leaves


def _place(leaf: Leaf) -> str:
    return str(leaf.offset) if leaf.bit is None else f"{leaf.offset}.{leaf.bit}"


def _layout_text(layout: Layout) -> str:
    return f"layout {layout.rules.name}, {layout.rules.byte_order}-endian"


def _extent(have: int, size: int) -> str:
    if have > size:
        return f"{size} bytes, {have - size} more behind them"
    return f"{size} bytes" if have == size else f"{have} of {size} bytes"


def _notes(layout: Layout) -> list[str]:
    names = unverified(layout)
    return [f"unverified for this layout: {', '.join(names)}"] if names else []


def in_columns(rows: list[Row], sides: str) -> list[str]:
    """Return rows in columns; of `sides` r is to the right, l to the left. Names are data: escaped."""
    rows = [tuple(cell if cell.isprintable() else one_line(cell) for cell in row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = zip(row, widths, sides, strict=True)
        lines.append("  ".join(c.rjust(w) if side == "r" else c.ljust(w) for c, w, side in cells).rstrip())
    return lines
