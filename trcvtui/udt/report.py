"""What `trcvtui udt show | decode | encode` answers, as plain values and as text (contracts 4.1 and 4.4)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain, islice
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.layout.codec import Data
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout, Leaf
from trcvtui.udt.layout.layout_tree import PlacedLeaf
from trcvtui.udt.layout.value_text import NO_DATA, special_text, text_of
from trcvtui.udt.layout.values import encode, stream, values_of
from trcvtui.udt.types import Enumeration, Pointer, StringType, type_text
from trcvtui.wording import in_columns

Row = tuple[str, ...]


def show_json(layout: Layout) -> Iterator[str]:
    """Yield the lines of the object of `udt show`: members are leaves in offset order."""

    def made(leaf: Leaf) -> tuple[str, str]:
        bit = "" if leaf.bit is None else f',\n      "bit": {leaf.bit}'
        type_ = json_text(leaf_type_text(layout, leaf))
        before = f'{json_text(leaf.path)[1:]},\n      "type": {type_},\n      "offset": '
        return before, f'{bit},\n      "size": {leaf.size}\n    }}'

    members = (
        f'    {{\n      "path": "{json_text(path)[1:-1]}{before}{offset}{after}'
        for offset, path, (before, after) in stream(layout, made, by_offset=True)
    )
    padding = (
        f'    {{\n      "offset": {offset},\n      "size": {size}\n    }}'
        for offset, size in layout.padding()
    )
    head = {
        "type": layout.name,
        "size": layout.size,
        "align": layout.align,
        "layout": layout.rules.name,
        "byte_order": layout.rules.byte_order,
    }
    yield from json_head(head)
    yield from json_many('  "members": [', members, "  ],")
    yield from json_many('  "padding": [', padding, "  ]")
    yield "}"


def show_text(layout: Layout) -> Iterator[str]:
    """Yield the table of `udt show`: every leaf and every gap in offset order."""
    yield f"{one_line(layout.name)}: {layout.size} bytes, align {layout.align}, {_layout_text(layout)}"
    yield from in_columns(chain([("offset", "size", "type", "path")], _shown(layout)), "rrll")
    yield from _notes(layout)


def _shown(layout: Layout) -> Iterator[Row]:
    def made(leaf: Leaf) -> tuple[str, str, str, str]:
        named = f" ({leaf.type.name})" if isinstance(leaf.type, Enumeration) and leaf.type.name else ""
        bit = "" if leaf.bit is None else f".{leaf.bit}"
        return bit, str(leaf.size), leaf_type_text(layout, leaf) + named, leaf.path

    gaps = layout.padding()
    gap = next(gaps, None)
    for offset, path, (bit, size, type_, rest) in stream(layout, made, by_offset=True):
        while gap and gap[0] < offset:
            yield str(gap[0]), str(gap[1]), "", "(padding)"
            gap = next(gaps, None)
        yield f"{offset}{bit}", size, type_, f"{path}{rest}" or layout.name
    while gap:
        yield str(gap[0]), str(gap[1]), "", "(padding)"
        gap = next(gaps, None)


def decode_json(layout: Layout, data: Data) -> Iterator[str]:
    """Yield the lines of the object of `udt decode`: values by path, null where the bytes ended."""
    rows = zip(stream(layout, lambda leaf: json_text(leaf.path)[1:]), values_of(layout, data), strict=True)
    path_text = lru_cache(maxsize=1)(json_text)  # the members of an element have the same path before theirs
    values = (
        f'    "{path_text(path)[1:-1]}{rest}: {json_text(json_value(value))}'
        for (_, path, rest), value in rows
    )
    yield from json_head({"type": layout.name, "size": layout.size, "complete": len(data) >= layout.size})
    yield from json_many('  "values": {', values, "  }")
    yield "}"


def decode_text(layout: Layout, data: Data) -> Iterator[str]:
    """Yield the table of `udt decode`: every leaf with its value, and how far the bytes go."""
    yield f"{one_line(layout.name)}: {_extent(len(data), layout.size)}, {_layout_text(layout)}"
    rows = member_rows(layout, data, layout.name)
    yield from in_columns(chain([("offset", "type", "path", "value")], rows), "rlll")
    yield from _notes(layout)


def member_rows(
    layout: Layout, data: Data, name: str, missing: str = NO_DATA, most: int | None = None
) -> Iterator[Row]:
    """Yield offset, type, path and value of the first `most` members; `name` is the path of a lone value."""

    def made(leaf: Leaf) -> tuple[str, str, str, int, Callable[[Value, bytes], str]]:
        bit = "" if leaf.bit is None else f".{leaf.bit}"
        odd_size = leaf.size if leaf.coding.odd else 0
        return bit, leaf_type_text(layout, leaf), leaf.path, odd_size, text_of(leaf)

    rows = zip(stream(layout, made), values_of(layout, data), strict=True)
    for (offset, path, (bit, type_, rest, odd_size, text)), value in islice(rows, most):
        shown = missing if value is None else text(value, bytes(data[offset : offset + odd_size]))
        yield f"{offset}{bit}", type_, f"{path}{rest}" or name, shown


def encode_values(layout: Layout, values: Mapping[str, object]) -> bytes:
    """Return the bytes of values by path; what `udt decode` gave as JSON is taken as it is."""
    inner = values.get("values")
    return encode(layout, inner if isinstance(inner, Mapping) else values)


def json_value(value: Value | None) -> Value | None:
    """Return the value as JSON can hold it: NaN and infinities as text."""
    return special_text(value) if isinstance(value, float) and not math.isfinite(value) else value


def leaf_type_text(layout: Layout, leaf: Leaf | PlacedLeaf) -> str:
    """Return the type that decides the bytes: a STRING with its length, an enumeration as its base type."""
    if isinstance(leaf.type, StringType):
        return type_text(StringType(layout.rules.text.length(leaf.type), leaf.type.wide))
    if isinstance(leaf.type, Pointer):
        return leaf.type.text
    return layout.rules.stored(leaf.type).name


def unverified(layout: Layout) -> list[str]:
    """Return the types in this layout whose bytes no page of the vendor describes, to be said beside them."""
    texts = {leaf_type_text(layout, leaf).partition("[")[0] for leaf in layout.kinds()}
    return sorted(texts & layout.rules.unverified)


def _layout_text(layout: Layout) -> str:
    return f"layout {layout.rules.name}, {layout.rules.byte_order}-endian"


def _extent(have: int, size: int) -> str:
    if have > size:
        return f"{size} bytes, {have - size} more after them"
    return f"{size} bytes" if have == size else f"{have} of {size} bytes"


def _notes(layout: Layout) -> list[str]:
    names = unverified(layout)
    return [f"unverified for this layout: {', '.join(names)}"] if names else []


# -- JSON, in the form of `json.dumps(..., indent=2)` --------------------------------------------------------


def json_text(value: object) -> str:
    """Return a value as JSON in ASCII: bytes from a wire stay data. DEL is the one control character left."""
    if type(value) is int:
        return str(value)
    if type(value) is bool:
        return "true" if value else "false"
    import json  # a table of members, which shells ask for in loops, does without it

    return json.dumps(value, allow_nan=False).replace("\x7f", "\\u007f")


def json_head(record: Mapping[str, object]) -> Iterator[str]:
    """Yield the begin of an object: its first keys."""
    yield "{"
    yield from (f"  {json_text(key)}: {json_text(value)}," for key, value in record.items())


def json_many(before: str, items: Iterator[str], after: str) -> Iterator[str]:
    """Yield a key with the items of its list or object."""
    held = next(items, None)
    if held is None:
        yield before + after.lstrip()
        return
    yield before
    for item in items:
        yield held + ","
        held = item
    yield held
    yield after


# Rule: bytes are data; in Markdown no character of a value is markup.

HEAD: Final = ("offset", "type", "member", "value")


def markdown(rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a Markdown table; nothing for no rows."""
    for number, row in enumerate(rows):
        if not number:
            yield from map(_markdown_row, (HEAD, ("---:", "---", "---", "---")))
        yield _markdown_row(row)


def _markdown_row(cells: Iterable[str]) -> str:
    escaped = [re.sub(r"([\\|`*_<>\[\]])", r"\\\1", one_line(cell)) for cell in cells]
    return f"| {' | '.join(escaped)} |"


def csv_lines(rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of CSV, that of names first; nothing for no rows."""
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="")
    for number, row in enumerate(rows):
        for cells in (row,) if number else (HEAD, row):
            writer.writerow(map(one_line, cells))
            yield text.getvalue()
            text.seek(0)
            text.truncate()
