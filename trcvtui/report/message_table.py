"""Messages as a table: its columns, and each row as a line of csv, jsonl or text.

Rule: a value is written as by `udt decode`. A text in csv has no quotes. If a spreadsheet would run the
text as a formula, a `'` is put before it. A member without bytes in a message is empty, never 0.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from io import StringIO
from itertools import chain
from typing import Any, Final, NamedTuple, TextIO

from trcvtui.engine.message_filter import find_member, path_prefixes, unknown_member_error
from trcvtui.errors import mistake, one_line
from trcvtui.history.messages import MessageRow
from trcvtui.project.project import DataDecl
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout, Leaf, layout_shape
from trcvtui.udt.layout.layout_tree import LeafValues
from trcvtui.udt.layout.value_text import odd_text, real_text, value_text
from trcvtui.udt.layout.values import decode, decode_leaves
from trcvtui.udt.report import json_members, json_value, own_bytes
from trcvtui.udt.types import Elementary, StringType, ValueKind
from trcvtui.wording import SECOND, format_columns, json_text, utc_text

INSTANCE_COLUMNS: Final = ("instance",)
CONVERSATION_COLUMNS: Final = ("conversation", "direction")
FIRST: Final = ("n", "time", "t_s", "scan", "gap_ms")
LAST: Final = ("length", "status", "reason", "hex")
_RESERVED: Final = frozenset((*FIRST, *INSTANCE_COLUMNS, *CONVERSATION_COLUMNS, *LAST, "marks", "escaped"))
MOST_MEMBERS: Final = 1024  # columns
FORMULA_STARTS: Final = ("=", "+", "-", "@", "\t", "\r")
HEX_SHOWN: Final = 16  # bytes in text
MOST_SPACED_HEX: Final = 43_690  # bytes as hex with blanks, so that no program reads them as a number, and
MOST_HEX: Final = 65_535  # without: Python's csv reads no cell of more than 131,072 characters
WIDTH_ROWS: Final = 256  # rows that set the widths of text columns: a wider cell later moves its line

_MEMBER_PATTERN: Final = re.compile(r'(?:"[^"]*"|\[[^]]*\]|[^,])+')  # of `a, b.c[1,2], "a,b"`

CellFormatter = Callable[[Any, bytes], object]  # a value, and the bytes of its message


class MessageType(NamedTuple):
    """The type of the messages of an instance (its DATA), or of one direction of a capture."""

    instance: str
    data: DataDecl | Layout

    @property
    def layout(self) -> Layout:
        return self.data.layout if isinstance(self.data, DataDecl) else self.data


class MessageTable:
    """Writes rows as they come. If there are too many members, `left_out` of them have no column."""

    def __init__(
        self,
        out: TextIO,
        form: str,
        types: Sequence[MessageType],
        labels: Sequence[str] = INSTANCE_COLUMNS,
        members: str = "",
        begun_ns: int | None = None,
    ) -> None:
        chosen = _choose_members(types, members)
        is_one = len({_key(one.data) for one in types}) == 1
        if is_one:
            chosen = [tuple(dict.fromkeys(chain.from_iterable(chosen)))]
        self.left_out = max(0, sum(map(len, chosen)) - MOST_MEMBERS)
        if members and self.left_out:
            raise mistake("--members", f"{MOST_MEMBERS + self.left_out} of them", f"at most {MOST_MEMBERS}")
        parts, self._names = list[_Fields](), list[str]()
        for one, numbers in zip(types, chosen, strict=not is_one):
            numbers = numbers[: MOST_MEMBERS - len(self._names)]
            parts.append(_Fields(one.layout, numbers, "" if is_one else one.instance, len(self._names), form))
            self._names += parts[-1].names
        parts *= len(types) if is_one else 1
        self._parts = {one.instance: part for one, part in zip(types, parts, strict=True)}
        self._out, self._columns, self._begun_ns, self.rows = out, (*FIRST, *labels, *LAST), begun_ns, 0
        self._form, self._put_csv = form, csv.writer(out, lineterminator="\n").writerow
        self._held: list[list[str]] = []  # the first rows of text
        self._widths: list[int] = []
        self._second, self._date = -1, ""

    def write(self, labels: tuple[str, ...], row: MessageRow, of: str | None = None) -> None:
        """Write a row. `of` is the instance or direction with the row's type, or None for `labels[0]`."""
        if not self.rows and self._form != "jsonl":
            self._write_cells([*self._columns, *self._names])
        self.rows += 1
        number, scan, t_ns, gap_ns, size, status, _, _, reason, have, content, _ = row
        content = (content or b"")[:have]
        part = self._parts.get(labels[0] if of is None else of)
        seconds = f"{abs(t_ns) // SECOND}.{abs(t_ns) % SECOND:09d}"
        cells = [
            number, self._time(t_ns), seconds if t_ns >= 0 else f"-{seconds}", scan or "",
            "" if gap_ns is None else f"{gap_ns / 1e6:.6f}", *labels,
            size, f"{status:04X}" if status >= 0 else "", reason, self._hex(content),
        ]  # fmt: skip
        if self._form == "jsonl":
            self._write_json(cells, row, part, content)
            return
        members = part.cells(content) if part is not None and content else []
        if len(members) < len(self._names):
            before = part.first if part is not None and members else 0
            members = [*[""] * before, *members, *[""] * (len(self._names) - before - len(members))]
        self._write_cells(cells + members)

    def finish(self) -> None:
        if self._held:
            self._widths = [max(map(len, column)) for column in zip(*self._held, strict=True)]
            lines = format_columns(map(tuple, self._held), "r" * len(self._widths))
            self._out.write("".join(f"{line}\n" for line in lines))
            self._held = []

    def _write_cells(self, cells: list[Any]) -> None:
        if self._form == "csv":
            self._put_csv(cells)
        elif self._widths:
            self._out.write("  ".join(map(str.rjust, map(str, cells), self._widths)).rstrip() + "\n")
        else:
            self._held.append([*map(str, cells)])
            if len(self._held) > WIDTH_ROWS:
                self.finish()

    def _write_json(self, cells: list[Any], row: MessageRow, part: _Fields | None, content: bytes) -> None:
        cells[2], cells[4] = row.t_ns / SECOND, None if row.gap_ns is None else row.gap_ns / 1e6
        record = {name: None if cell == "" else cell for name, cell in zip(self._columns, cells, strict=True)}
        record["hex"] = None if row.content is None else cells[-1]
        if part is not None:
            values, odd = json_members(part.named, part.values(content), content)
            record |= values | odd
        self._out.write(json_text(record, separators=(",", ":")) + "\n")

    def _hex(self, content: bytes) -> str:
        if self._form == "text":
            return content[:HEX_SHOWN].hex(" ") + " .." * (len(content) > HEX_SHOWN)
        return content.hex(" ") if len(content) <= MOST_SPACED_HEX else content[:MOST_HEX].hex()

    def _time(self, t_ns: int) -> str:
        if self._begun_ns is None:
            return ""
        second, ns = divmod(self._begun_ns + t_ns, SECOND)
        if second != self._second:
            self._second, self._date = second, utc_text(second * SECOND).partition(".")[0]
        return f"{self._date}.{ns:09d}Z"


def format_csv(
    messages: Iterable[MessageRow], type_: MessageType | None, instance: str, begun_ns: int | None
) -> str:
    """Return the messages of an instance as a whole file of csv."""
    text = StringIO(newline="")
    table = MessageTable(text, "csv", [type_] if type_ is not None else [], begun_ns=begun_ns)
    for row in messages:
        table.write((instance,), row)
    return text.getvalue()


def _choose_members(types: Sequence[MessageType], members: str) -> list[Sequence[int]]:
    """Return the leaves of each type that get columns; raise UserError for a name that is no member."""
    names = [name.strip() for name in _MEMBER_PATTERN.findall(members) if name.strip()]
    if not names:
        return [range(one.layout.leaf_count) for one in types]
    chosen = [dict[int, None]() for _ in types]
    for name in names:
        found = [find_member(one.layout, name, *path_prefixes(one.instance, one.data)) for one in types]
        if not any(found):
            paths = chain.from_iterable(_paths(one.layout) for one in types)
            raise unknown_member_error("--members", name, paths)
        for numbers, place in zip(chosen, found, strict=True):
            if place is not None:
                numbers.update(dict.fromkeys(range(place[0], place[0] + place[1].leaves)))
    return [tuple(numbers) for numbers in chosen]


def is_same_type(one: DataDecl | Layout | None, other: DataDecl | Layout | None) -> bool:
    """Return whether two DATA have the same layout and the same names of members."""
    return one is other or (one is not None and other is not None and _key(one) == _key(other))


def _key(data: DataDecl | Layout) -> object:
    layout = data.layout if isinstance(data, DataDecl) else data
    return layout_shape(layout), *_paths(layout)


def _paths(layout: Layout) -> list[str]:
    return [leaf.path or layout.name for leaf in layout.leaves(0, MOST_MEMBERS)]


class _Fields:
    """The columns of one type. `first` is the number of columns of other types before these."""

    def __init__(self, layout: Layout, numbers: Sequence[int], instance: str, first: int, form: str) -> None:
        self.layout, self.first = layout, first
        leaves = [layout.leaf(number) for number in numbers]
        self._numbers = None if [*numbers] == [*range(layout.leaf_count)] else numbers
        taken = _RESERVED.union(map(str.casefold, _paths(layout)))
        self.names = [_column_name(leaf.path or layout.name, taken, instance) for leaf in leaves]
        self.named = [*zip(self.names, leaves, strict=True)]
        cells = enumerate(map(_text_cell if form == "text" else _csv_cell, leaves))
        self._cells = [(place, cell) for place, cell in cells if cell is not None]

    def values(self, content: bytes) -> LeafValues:
        """Return the values of the columns; a value is None if the message has no bytes for it."""
        if self._numbers is None:
            return decode(self.layout, content)
        return tuple([decode_leaves(self.layout, content, n, n + 1)[0] for n in self._numbers])

    def cells(self, content: bytes) -> list[Any]:
        values: list[Any] = [*self.values(content)]
        for place, cell in self._cells:
            if values[place] is not None:
                values[place] = cell(values[place], content)
        return values


def _column_name(path: str, taken: frozenset[str], instance: str) -> str:
    name = one_line(path)
    if instance:
        return f"{instance}.{name}"
    if name.casefold() in _RESERVED:
        name = f"data.{name}"
        while name.casefold() in taken:
            name = f"data.{name}"
    return name


# -- formatters of cells; None: the value as it is ----------------------------------------------------------


def _csv_cell(leaf: Leaf) -> CellFormatter | None:
    kind = leaf.type.kind if isinstance(leaf.type, Elementary) else None
    if isinstance(leaf.type, StringType) or kind is ValueKind.CHARACTER:
        return _guard_formula
    if kind is ValueKind.REAL:
        return lambda value, _: real_text(value, leaf.size)
    return partial(_format_marked, leaf) if kind is ValueKind.BOOL or leaf.coding.odd is not None else None


def _guard_formula(value: str, _: bytes) -> str:
    text = one_line(str(json_value(value)))
    return f"'{text}" if value.startswith(FORMULA_STARTS) else text


def _format_marked(leaf: Leaf, value: Value, content: bytes) -> str:
    text = str(value).upper() if isinstance(value, bool) else str(value)
    mark = odd_text(leaf, own_bytes(leaf, content))
    return f"{text} ({mark})" if mark else text


def _text_cell(leaf: Leaf) -> CellFormatter:
    return lambda value, content: value_text(leaf, value, own_bytes(leaf, content))
