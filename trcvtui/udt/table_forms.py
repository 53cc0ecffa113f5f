"""The table of decoded members as Markdown and as CSV.

Rule: bytes are data; in Markdown no character of a value is markup.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.codec import Data
from trcvtui.udt.decode import decode_leaves
from trcvtui.udt.layout import Layout
from trcvtui.udt.report import leaf_type_text
from trcvtui.udt.value_text import NO_DATA, value_text

Row = tuple[str, str, str, str]

HEAD: Final = ("offset", "type", "member", "value")


def member_rows(
    layout: Layout, content: Data, name: str, missing: str = NO_DATA, most: int | None = None
) -> Iterator[Row]:
    """Yield offset, type, path and value of the first `most` members; `name` is the path of a lone value."""
    stop = layout.leaf_count if most is None else min(layout.leaf_count, most)
    leaves = layout.page(0, stop).leaves
    for leaf, value in zip(leaves, decode_leaves(layout, content, 0, stop), strict=True):
        place = str(leaf.offset) if leaf.bit is None else f"{leaf.offset}.{leaf.bit}"
        raw = bytes(content[leaf.offset : leaf.offset + leaf.size])
        shown = missing if value is None else value_text(leaf, value, raw)
        yield place, leaf_type_text(layout, leaf), leaf.path or name, shown


def markdown(rows: Iterable[Row]) -> str:
    """Return a Markdown table; nothing for no rows."""
    rows = list(rows)
    return "\n".join(map(_markdown_row, [HEAD, ("---:", "---", "---", "---"), *rows])) if rows else ""


def _markdown_row(cells: Iterable[str]) -> str:
    escaped = [re.sub(r"([\\|`*_<>\[\]])", r"\\\1", one_line(cell)) for cell in cells]
    return f"| {' | '.join(escaped)} |"


def csv_text(rows: Iterable[Row]) -> str:
    """Return CSV with a line of names; nothing for no rows."""
    import csv
    import io

    rows, text = list(rows), io.StringIO()
    if rows:
        escaped = [[one_line(cell) for cell in row] for row in rows]
        csv.writer(text, lineterminator="\n").writerows([HEAD, *escaped])
    return text.getvalue()
