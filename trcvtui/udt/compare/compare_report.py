"""What `trcvtui udt compare` answers: two layouts side by side, as text and as JSON; do they agree?

Rule: rows are made once; table, summary and exit code come from the same count of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.compare.compare import VALUE, Cell, Comparison, Count, Row
from trcvtui.udt.layout.decode import decode_leaf
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.report import in_columns, json_head, json_many, json_text, json_value

MARK: Final = "*"
NOTHING: Final = "-"


def is_equal(comparison: Comparison, count: Count) -> bool:
    """Return whether both store every member alike at the same place, and read the same value there."""
    ours, theirs = comparison.ours, comparison.theirs
    same = ours.size == theirs.size and ours.rules.byte_order == theirs.rules.byte_order
    return same and not count.differing


def compare_json(comparison: Comparison, data: bytes, count: Count) -> Iterator[str]:
    """Yield the lines of the object of `udt compare`, all rows counted on the way.

    Rows stand in our order, null where a side has no such member.
    """
    ours, theirs = comparison.ours, comparison.theirs
    yield from json_head({"ours": _side(ours), "theirs": _side(theirs)})
    yield from json_many('  "rows": [', _rows(comparison, data, count), "  ],")
    yield f'  "equal": {json_text(is_equal(comparison, count))}'
    yield "}"


def _rows(comparison: Comparison, data: bytes, count: Count) -> Iterator[str]:
    for row in comparison.rows(data):
        count.add(row)
        ours, theirs = _cell(comparison.ours, row.ours, data), _cell(comparison.theirs, row.theirs, data)
        record = {"path": row.path, "differs": row.differs, "ours": ours, "theirs": theirs}
        yield f"    {json_text(record)}"


def compare_text(comparison: Comparison, data: bytes, count: Count) -> Iterator[str]:
    """Yield the table of `udt compare`, all rows counted on the way; one that differs begins with `*`."""
    yield f"ours    {_extent(comparison.ours)}"
    yield f"theirs  {_extent(comparison.theirs)}"
    yield from in_columns(_table(comparison, data, count), "llrlrll" if data else "llrrl")
    yield str(comparison.summed(count))
    orders = comparison.ours.rules.byte_order, comparison.theirs.rules.byte_order
    if orders[0] != orders[1]:
        yield f"byte order: ours {orders[0]}, theirs {orders[1]}"


def _table(comparison: Comparison, data: bytes, count: Count) -> Iterator[tuple[str, ...]]:
    with_values = bool(data)
    values = ("value",) if with_values else ()
    yield ("", "path", "ours", *values, "theirs", *values, "differs")
    for row in comparison.rows(data):
        count.add(row)
        yield (*_cells(row, comparison.ours.name, with_values), ", ".join(row.differs))


def _cells(row: Row, name: str, with_values: bool) -> tuple[str, ...]:
    mark, path = MARK if row.differs else "", row.path or name
    if not with_values:
        return mark, path, _place(row.ours), _place(row.theirs)
    return mark, path, _place(row.ours), _value(row.ours), _place(row.theirs), _value(row.theirs)


def _place(cell: Cell | None) -> str:
    return cell.place_text if cell else NOTHING


def _value(cell: Cell | None) -> str:
    return cell.value if cell else ""


def _extent(layout: Layout) -> str:
    rules = layout.rules
    return f"{one_line(layout.name)}: {layout.size} bytes, layout {rules.name}, {rules.byte_order}-endian"


def _side(layout: Layout) -> dict[str, object]:
    rules = layout.rules
    return {
        "type": layout.name,
        "layout": rules.name,
        "byte_order": rules.byte_order,
        "text": rules.text.name,
        "size": layout.size,
    }


def _cell(layout: Layout, cell: Cell | None, data: bytes) -> dict[str, object] | None:
    if cell is None:
        return None
    leaf = cell.leaf
    part = data[leaf.offset : leaf.offset + leaf.size]
    value = json_value(decode_leaf(layout, leaf, part)) if len(part) == leaf.size else None
    bit = {} if leaf.bit is None else {"bit": leaf.bit}
    return {"type": cell.type, "offset": leaf.offset, **bit, "size": leaf.size, VALUE: value}
