"""The answers of `trcvtui udt show | decode | encode`, as plain values and as text (contracts 4.1, 4.4)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import attrgetter, itemgetter
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.layout.coding import SURROGATE, Value
from trcvtui.udt.layout.layout import Layout, Leaf
from trcvtui.udt.layout.layout_tree import Data, LeafValues
from trcvtui.udt.layout.value_text import NO_DATA, odd_text, special_text, value_text
from trcvtui.udt.layout.values import decode_leaves, encode
from trcvtui.udt.types import Enumeration, Pointer, StringType, type_text
from trcvtui.wording import format_columns, json_text

Row = tuple[str, ...]


def layout_json(layout: Layout) -> str:
    """Return the object of `udt show`. Its members are the leaves in offset order."""
    members: list[dict[str, object]] = []
    for leaf in sorted(layout.leaves(), key=attrgetter("offset")):
        bit = {} if leaf.bit is None else {"bit": leaf.bit}
        type_ = leaf_type_text(layout, leaf)
        members.append({"path": leaf.path, "type": type_, "offset": leaf.offset, **bit, "size": leaf.size})
    record = {
        "type": layout.name,
        "size": layout.size,
        "align": layout.align,
        "layout": layout.rules.name,
        "byte_order": layout.rules.byte_order,
        "members": members,
        "padding": [{"offset": offset, "size": size} for offset, size in layout.padding()],
    }
    return indented_json(record)


def layout_table(layout: Layout) -> str:
    """Return the table of `udt show`: every leaf and every gap in offset order."""
    head = f"{one_line(layout.name)}: {layout.size} bytes, align {layout.align}, {_layout_text(layout)}"
    table = format_columns([("offset", "size", "type", "path"), *_show_rows(layout)], "rrll")
    return "\n".join([head, *table, *_unverified_notes(layout)])


def _show_rows(layout: Layout) -> Iterator[Row]:
    rows: list[tuple[int, Row]] = []
    for leaf in layout.leaves():
        named = f" ({leaf.type.name})" if isinstance(leaf.type, Enumeration) and leaf.type.name else ""
        type_ = leaf_type_text(layout, leaf) + named
        rows.append((leaf.offset, (place_text(leaf), str(leaf.size), type_, leaf.path or layout.name)))
    rows += [(offset, (str(offset), str(size), "", "(padding)")) for offset, size in layout.padding()]
    return (row for _, row in sorted(rows, key=itemgetter(0)))


def place_text(leaf: Leaf) -> str:
    """Return the offset. For a bit add its number in the byte, as `2.5`."""
    return str(leaf.offset) if leaf.bit is None else f"{leaf.offset}.{leaf.bit}"


def decoded_json(layout: Layout, data: Data, name: str = "", most: int | None = None) -> str:
    """Return the object of `udt decode`, with values by path, null past the end, and oddities as `marks`.

    The object has the first `most` members. `name` is the path of a type that is a single value. `escaped`
    are the paths of texts with code units that are not characters.
    """
    leaves = layout.leaves(0, most)
    named = [(leaf.path or name, leaf) for leaf in leaves]
    head = {"type": layout.name, "size": layout.size, "complete": len(data) >= layout.size}
    texts, odd = json_members(named, decode_leaves(layout, data, 0, len(leaves)), data)
    return indented_json({**head, "values": texts, **odd})


def json_members(
    named: Sequence[tuple[str, Leaf]], values: LeafValues, data: Data
) -> tuple[dict[str, Value | None], dict[str, object]]:
    """Return the values of leaves by name, and what is odd in them as `marks` and `escaped`."""
    found = {name: value for (name, _), value in zip(named, values, strict=True)}
    marks = {name: mark for name, leaf in named if (mark := odd_text(leaf, own_bytes(leaf, data)))}
    escaped = [name for name, value in found.items() if isinstance(value, str) and SURROGATE.search(value)]
    odd = ("marks", marks), ("escaped", escaped)
    return {name: json_value(each) for name, each in found.items()}, {key: some for key, some in odd if some}


def own_bytes(leaf: Leaf, data: Data) -> bytes:
    return bytes(data[leaf.offset : leaf.offset + leaf.size])


def decoded_text(layout: Layout, data: Data) -> str:
    """Return the table of `udt decode`: every leaf with its value, and how far the bytes go."""
    head = f"{one_line(layout.name)}: {_extent_text(len(data), layout.size)}, {_layout_text(layout)}"
    rows = member_rows(layout, data, layout.name)
    table = format_columns([("offset", "type", "path", "value"), *rows], "rlll")
    return "\n".join([head, *table, *_unverified_notes(layout)])


def member_rows(
    layout: Layout, data: Data, name: str, missing: str = NO_DATA, most: int | None = None
) -> Iterator[Row]:
    """Yield offset, type, path and value of the first `most` members. A lone value has the path `name`."""
    leaves = layout.leaves(0, most)
    for leaf, value in zip(leaves, decode_leaves(layout, data, 0, len(leaves)), strict=True):
        shown = missing if value is None else value_text(leaf, value, own_bytes(leaf, data))
        yield place_text(leaf), leaf_type_text(layout, leaf), leaf.path or name, shown


def encode_values(layout: Layout, values: Mapping[str, object]) -> bytes:
    """Return the bytes of values by path. `values` may be the whole object that `udt decode` prints."""
    inner, paths = values.get("values"), values.get("escaped")
    escaped = set(map(str, paths)) if isinstance(paths, list) else ()
    inner = inner if isinstance(inner, Mapping) else values
    return encode(layout, {path: _unescape(v) if path in escaped else v for path, v in inner.items()})


def json_value(value: Value | None) -> Value | None:
    """Return the value as JSON holds it: NaN and infinities as text, a lone surrogate as `\\udc00`."""
    if isinstance(value, str) and SURROGATE.search(value):
        return value.replace("\\", "\\\\").encode(errors="backslashreplace").decode()
    return special_text(value) if isinstance(value, float) and not math.isfinite(value) else value


def _unescape(value: object) -> object:
    if not isinstance(value, str):
        return value
    escape = r"(?i)\\(?:\\|u(d[89a-f][\da-f]{2}))"
    return re.sub(escape, lambda found: chr(int(found[1], 16)) if found[1] else "\\", value)


def leaf_type_text(layout: Layout, leaf: Leaf) -> str:
    """Return the stored type: a STRING with its length, an enumeration as its base type."""
    if isinstance(leaf.type, StringType):
        return type_text(StringType(layout.rules.text.length(leaf.type), leaf.type.wide))
    if isinstance(leaf.type, Pointer):
        return leaf.type.text
    return layout.rules.storage(leaf.type).name


def unverified_types(layout: Layout) -> list[str]:
    """Return the types in this layout whose bytes no page of the vendor describes."""
    kinds = {id(leaf.type): leaf for leaf in layout.leaves()}.values()
    texts = {leaf_type_text(layout, leaf).partition("[")[0] for leaf in kinds}
    return sorted(texts & layout.rules.unverified)


def _layout_text(layout: Layout) -> str:
    return f"layout {layout.rules.name}, {layout.rules.byte_order}-endian"


def _extent_text(have: int, size: int) -> str:
    if have > size:
        return f"{size} bytes, {have - size} more after them"
    return f"{size} bytes" if have == size else f"{have} of {size} bytes"


def _unverified_notes(layout: Layout) -> list[str]:
    names = unverified_types(layout)
    return [f"unverified for this layout: {', '.join(names)}"] if names else []


def indented_json(record: object) -> str:
    """Return the text of `json.dumps(..., indent=2)`, but faster: `json` is slow for many members."""
    import msgspec  # here, since the tables that shell loops ask for do not need it

    return msgspec.json.format(json_text(record), indent=2)


# Rule: bytes are data: no character of a value becomes Markdown markup.

TABLE_HEAD: Final = ("offset", "type", "member", "value")


def markdown(rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a Markdown table; nothing for no rows."""
    for number, row in enumerate(rows):
        if not number:
            yield from map(_markdown_row, (TABLE_HEAD, ("---:", "---", "---", "---")))
        yield _markdown_row(row)


def _markdown_row(cells: Iterable[str]) -> str:
    escaped = [re.sub(r"([\\|`*_<>\[\]])", r"\\\1", one_line(cell)) for cell in cells]
    return f"| {' | '.join(escaped)} |"


def csv_lines(rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of CSV, the column names first; nothing for no rows."""
    import csv
    import io

    for number, row in enumerate(rows):
        for cells in (row,) if number else (TABLE_HEAD, row):
            text = io.StringIO()
            csv.writer(text, lineterminator="").writerow(map(one_line, cells))
            yield text.getvalue()
