"""The table of decoded members as Markdown and as CSV.

Rule: bytes are data; in Markdown no character of a value is markup.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.layout.codec import Data
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.value_text import NO_DATA
from trcvtui.udt.report import decoded_rows

HEAD: Final = ("offset", "type", "member", "value")


def member_rows(
    layout: Layout, content: Data, name: str, missing: str = NO_DATA, most: int | None = None
) -> Iterator[tuple[str, ...]]:
    """Yield offset, type, path and value of the first `most` members; `name` is the path of a lone value."""
    return islice(decoded_rows(layout, content, name, missing), most)


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
