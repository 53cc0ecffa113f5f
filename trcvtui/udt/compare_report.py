"""What `trcvtui udt compare` answers: two layouts side by side, as text and as JSON; do they agree?

Rule: rows are made once; table, summary and exit code come from the same count of all of them.
"""

from __future__ import annotations

from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.compare import VALUE, Cell, Comparison, Count, Row
from trcvtui.udt.decode import decode_leaf
from trcvtui.udt.layout import Layout
from trcvtui.udt.report import in_columns, json_value

MARK: Final = "*"
NOTHING: Final = "-"


def _is_equal(comparison: Comparison, count: Count) -> bool:
    """Return whether both store every member alike at the same place, and read the same value there."""
    ours, theirs = comparison.ours, comparison.theirs
    same = ours.size == theirs.size and ours.rules.byte_order == theirs.rules.byte_order
    return same and not count.differing


def compare_json(comparison: Comparison, data: bytes) -> tuple[dict[str, object], bool]:
    """Return the object of `udt compare`, and whether both are equal.

    Rows stand in our order, null where a side has no such member.
    """
    ours, theirs = comparison.ours, comparison.theirs
    count, rows = Count(), []
    for row in comparison.rows(data):
        count.add(row)
        cells = {"ours": _cell(ours, row.ours, data), "theirs": _cell(theirs, row.theirs, data)}
        rows.append({"path": row.path, "differs": list(row.differs), **cells})
    equal = _is_equal(comparison, count)
    return {"ours": _side(ours), "theirs": _side(theirs), "equal": equal, "rows": rows}, equal


def compare_text(comparison: Comparison, data: bytes) -> tuple[str, bool]:
    """Return the table of `udt compare`, and whether both are equal; a row that differs begins with `*`."""
    count = Count()
    with_values = bool(data)
    sides = "llrlrll" if with_values else "llrrl"
    values = ("value",) if with_values else ()
    rows: list[tuple[str, ...]] = [("", "path", "ours", *values, "theirs", *values, "differs")]
    for row in comparison.rows(data):
        count.add(row)
        rows.append((*_cells(row, comparison.ours.name, with_values), ", ".join(row.differs)))
    lines = [f"ours    {_extent(comparison.ours)}", f"theirs  {_extent(comparison.theirs)}"]
    orders = comparison.ours.rules.byte_order, comparison.theirs.rules.byte_order
    last = [] if orders[0] == orders[1] else [f"byte order: ours {orders[0]}, theirs {orders[1]}"]
    text = "\n".join([*lines, *in_columns(rows, sides), str(comparison.summed(count)), *last])
    return text, _is_equal(comparison, count)


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
