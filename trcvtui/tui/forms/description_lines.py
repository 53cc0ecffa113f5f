"""A connection description as lines: offset, field, bytes, value; remark or flaw below its field."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest
from typing import Final

from trcvtui.project.connect_view import DescriptionView, Row
from trcvtui.tui.formatting import pad, plain, wrapped
from trcvtui.tui.widgets.line_view import EMPTY, row
from trcvtui.tui.widgets.line_view import Row as Line

OFFSET, FIELD, BYTES = 7, 24, 8  # columns, columns, bytes a line
BYTES_WIDTH: Final = 3 * BYTES + 1
INDENT: Final = " " * (OFFSET + 2)
REPEATED: Final = 2  # lines of zeros from which on they are told in one


def description_rows(view: DescriptionView, width: int) -> list[Line]:
    """Return the whole view; the field with the flaw is marked by a sign and by its style."""
    rows = [row((line, "strong")) for line in wrapped(f"{view.structure} · {view.says}", width)]
    if view.warning:
        rows += [row((line, "error strong")) for line in wrapped(f"! {view.warning}", width)]
    if view.flaw:
        rows += [row((line, "error")) for line in wrapped(f"✗ {plain(view.flaw)}", width)]
    rows.append(EMPTY)
    for each in view.rows:
        if each.field or each.data:  # what is wrong with the whole stands above
            rows += _of(each, width)
    return rows


def _of(each: Row, width: int) -> Iterator[Line]:
    is_flaw = each.remark.startswith("! ")
    field = plain(each.field) or ("(no field)" if each.data else "")
    style = "error strong" if is_flaw else "faint" if not each.field else ""
    lines = list(_bytes(each.data)) or [(0, "")]
    values = wrapped(each.value, width - 2 - OFFSET - FIELD - BYTES_WIDTH)
    for number, (part, value) in enumerate(zip_longest(lines, values)):
        offset, text = part or (None, "")
        where = "" if offset is None else f"{each.offset + offset:>{OFFSET - 3}}"
        yield row(
            ("✗ " if is_flaw and not number else "  ", "error strong"),
            (pad(where, OFFSET), "dim"),
            (pad("" if number else field, FIELD), style),
            (pad(text, BYTES_WIDTH), "printable"),
            (value or "", "strong"),
        )
    if each.remark:
        text = f"✗ {each.remark[2:]}" if is_flaw else each.remark
        for line in wrapped(plain(text), width - len(INDENT)):
            yield row((INDENT, ""), (line, "error" if is_flaw else "dim"))


def _bytes(data: bytes) -> Iterator[tuple[int, str]]:
    """Yield the bytes line by line; long stretches of zeros in one."""
    at = 0
    while at < len(data):
        zeros = len(data[at:]) - len(data[at:].lstrip(b"\0"))
        if zeros > REPEATED * BYTES and at % BYTES == 0:
            yield at, f"00 × {zeros}"
            at += zeros
            continue
        yield at, data[at : at + BYTES].hex(" ")
        at += BYTES
