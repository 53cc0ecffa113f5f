"""Messages as a table: what its columns are, and each row as a line of csv, jsonl or text.

Rule: a value is as `udt decode` has it, but a text in csv has no quotes of ours: `'` before one that a
spreadsheet would run. A member that no byte of a message says is empty, never 0.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from io import StringIO
from itertools import chain
from typing import Any, Final, NamedTuple, TextIO

from trcvtui.engine.message_filter import find_member, names_before, unknown_member
from trcvtui.errors import mistake, one_line
from trcvtui.history.messages import MessageRow
from trcvtui.project.project import DataDecl
from trcvtui.udt.layout.coding import HALF, Value
from trcvtui.udt.layout.layout import Layout, Leaf, shape
from trcvtui.udt.layout.layout_tree import Values
from trcvtui.udt.layout.value_text import mark_text, real_text, value_text
from trcvtui.udt.layout.values import decode, decode_leaves
from trcvtui.udt.report import json_value
from trcvtui.udt.types import Elementary, StringType, ValueKind
from trcvtui.wording import SECOND, in_columns, json_text, utc_text

OF_AN_INSTANCE: Final = ("instance",)
OF_A_CONVERSATION: Final = ("conversation", "direction")
FIRST: Final = ("n", "time", "t_s", "scan", "gap_ms")
LAST: Final = ("length", "status", "reason", "hex")
MARKS, ESCAPED = "marks", "escaped"
_TAKEN: Final = frozenset((*FIRST, *OF_AN_INSTANCE, *OF_A_CONVERSATION, *LAST, MARKS, ESCAPED))
MOST_MEMBERS: Final = 1024  # columns
FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
HEX_SHOWN: Final = 16  # bytes in text
SPACED: Final = 43_690  # bytes as hex with blanks, so that no program takes them for a number, and
MOST_HEX: Final = 65_535  # without: Python's csv reads no cell of more than 131,072 characters
LOOKED_AT: Final = 256  # rows, for the width of the columns of text


class MessageType(NamedTuple):
    """The DATA of an instance; or "" and the type of all messages."""

    instance: str
    data: DataDecl | Layout

    @property
    def layout(self) -> Layout:
        return self.data.layout if isinstance(self.data, DataDecl) else self.data

    def find(self, name: str) -> range | None:
        """Return the numbers of the leaves that a name stands for; None: it is no member."""
        found = find_member(self.layout, name, *names_before(self.instance, self.data))
        return range(found[0], found[0] + found[1].leaves) if found is not None else None


class MessageTable:
    """Writes rows as they come. `left_out`: how many members have no column, as there are too many."""

    def __init__(
        self,
        out: TextIO,
        form: str,
        types: Sequence[MessageType],
        labels: Sequence[str] = OF_AN_INSTANCE,
        members: str = "",
        begun_ns: int | None = None,
    ) -> None:
        chosen = _chosen(types, members)
        is_one = len({(shape(one.layout), *_paths(one.layout)) for one in types}) == 1
        if is_one:
            chosen = [tuple(dict.fromkeys(chain.from_iterable(chosen)))]
        self.left_out = max(0, sum(map(len, chosen)) - MOST_MEMBERS)
        if members and self.left_out:
            raise mistake("--members", f"{MOST_MEMBERS + self.left_out} of them", f"at most {MOST_MEMBERS}")
        parts, names = list[_Part](), list[str]()
        for one, numbers in zip(types, chosen, strict=not is_one):
            numbers = numbers[: MOST_MEMBERS - len(names)]
            parts.append(_Part(one.layout, numbers, "" if is_one else one.instance, len(names)))
            names += parts[-1].names
        parts *= len(types) if is_one else 1
        self._parts = {one.instance: part for one, part in zip(types, parts, strict=True)}
        self._form = FORMS[form](out, (*FIRST, *labels, *LAST), names)
        self._begun_ns, self.rows = begun_ns, 0
        self._second, self._date = -1, ""

    def write(self, labels: tuple[str, ...], row: MessageRow, of: str | None = None) -> None:
        """Write a row; `of`: whose type it has, without it that of its instance, its label."""
        if not self.rows:
            self._form.begin()
        self.rows += 1
        part = self._parts.get(labels[0] if of is None else of)
        self._form.row(self._time(row.t_ns), labels, row, part)

    def finish(self) -> None:
        if self.rows:
            self._form.finish()

    def _time(self, t_ns: int) -> str:
        if self._begun_ns is None:
            return ""
        second, ns = divmod(self._begun_ns + t_ns, SECOND)
        if second != self._second:
            self._second, self._date = second, utc_text(second * SECOND).partition(".")[0]
        return f"{self._date}.{ns:09d}Z"


def csv_of(
    messages: Iterable[MessageRow], type_: MessageType | None, instance: str, begun_ns: int | None
) -> str:
    """Return the messages of an instance as a whole file of csv."""
    text = StringIO(newline="")
    table = MessageTable(text, "csv", [type_] if type_ is not None else [], begun_ns=begun_ns)
    for row in messages:
        table.write((instance,), row)
    table.finish()
    return text.getvalue()


def _chosen(types: Sequence[MessageType], members: str) -> list[Sequence[int]]:
    """Return the leaves of each type that become columns; raise UserError for a name that is no member."""
    if not members:
        return [range(one.layout.leaf_count) for one in types]
    chosen = [dict[int, None]() for _ in types]
    for name in re.split(r",(?![^\[]*\])", members):
        found = [one.find(name.strip()) for one in types]
        if not any(each is not None for each in found):
            raise unknown_member("--members", name.strip(), types[0].layout if types else None)
        for numbers, each in zip(chosen, found, strict=True):
            numbers.update(dict.fromkeys(each or ()))
    return [tuple(numbers) for numbers in chosen]


def _paths(layout: Layout) -> list[str]:
    return [leaf.path or layout.name for leaf in layout.leaves(0, MOST_MEMBERS)]


class _Part:
    """The columns of one type, from column `first` of all members on."""

    def __init__(self, layout: Layout, numbers: Sequence[int], instance: str, first: int) -> None:
        self.layout, self.first = layout, first
        self.leaves = [layout.leaf(number) for number in numbers]
        self._numbers = None if [*numbers] == [*range(layout.leaf_count)] else numbers
        taken = _TAKEN.union(map(str.casefold, _paths(layout)))
        self.names = [_column_name(leaf.path or layout.name, taken, instance) for leaf in self.leaves]

    def values(self, content: bytes) -> Values:
        """Return the values of the columns, None for each that the bytes do not have."""
        if self._numbers is None:
            return decode(self.layout, content)
        return tuple([decode_leaves(self.layout, content, n, n + 1)[0] for n in self._numbers])


def _column_name(path: str, taken: frozenset[str], instance: str) -> str:
    name = one_line(path)
    if instance:
        return f"{instance}.{name}"
    if name.casefold() in _TAKEN:
        name = f"data.{name}"
        while name.casefold() in taken:
            name = f"data.{name}"
    return name


# -- the forms -----------------------------------------------------------------------------------------------


class _Form:
    """One way to write a row; it stands in the columns, then in the members."""

    def __init__(self, out: TextIO, columns: tuple[str, ...], members: list[str]) -> None:
        self.out, self.columns, self.names = out, columns, (*columns, *members)
        self.count = len(members)

    def begin(self) -> None:
        """Make ready for the first row: without one nothing is written."""

    def row(self, time: str, labels: tuple[str, ...], row: MessageRow, part: _Part | None) -> None:
        raise NotImplementedError

    def finish(self) -> None:
        """Write what is held."""


def _head(time: str, labels: tuple[str, ...], row: MessageRow) -> list[Any]:
    gap = "" if row.gap_ns is None else f"{row.gap_ns / 1e6:.6f}"
    status = f"{row.status:04X}" if row.status >= 0 else ""
    t_s = f"{row.t_ns // SECOND}.{row.t_ns % SECOND:09d}"
    return [row.number, time, t_s, row.scan or "", gap, *labels, row.size, status, row.reason]


def _hex(content: bytes) -> str:
    return content.hex(" ") if len(content) <= SPACED else content[:MOST_HEX].hex()


Cell = Callable[[Any, bytes], object]


class _Csv(_Form):
    def begin(self) -> None:
        self._write = csv.writer(self.out, lineterminator="\n").writerow
        self._write(self.names)
        self._cells: dict[int, list[tuple[int, Cell]]] = {}

    def row(self, time: str, labels: tuple[str, ...], row: MessageRow, part: _Part | None) -> None:
        content = (row.content or b"")[: row.have]
        cells = [*_head(time, labels, row), _hex(content)]
        if part is None or not content:
            self._write(cells + [""] * self.count)
            return
        values: list[Any] = [*part.values(content)]
        for place, cell in self._cells.get(part.first) or self._cells_of(part):
            if values[place] is not None:
                values[place] = cell(values[place], content)
        if len(values) == self.count:
            self._write(cells + values)
        else:
            self._write(
                [*cells, *[""] * part.first, *values, *[""] * (self.count - part.first - len(values))]
            )

    def _cells_of(self, part: _Part) -> list[tuple[int, Cell]]:
        cells = enumerate(map(_csv_cell, part.leaves))
        self._cells[part.first] = [(place, cell) for place, cell in cells if cell is not None]
        return self._cells[part.first]


def _csv_cell(leaf: Leaf) -> Cell | None:
    """Return how a value becomes a cell; None: as it is."""
    kind = leaf.type.kind if isinstance(leaf.type, Elementary) else None
    if isinstance(leaf.type, StringType) or kind is ValueKind.CHARACTER:
        return _text_cell
    if kind is ValueKind.REAL:
        return lambda value, _: real_text(value, leaf.size)
    if kind is not ValueKind.BOOL and leaf.coding.odd is None:
        return None
    return partial(_marked, leaf)


def _text_cell(value: str, _: bytes) -> str:
    text = one_line(str(json_value(value)))
    return f"'{text}" if value.startswith(FORMULA) else text


def _marked(leaf: Leaf, value: Value, content: bytes) -> str:
    text, mark = str(value).upper() if isinstance(value, bool) else str(value), _mark(leaf, content)
    return f"{text} ({mark})" if mark else text


def _mark(leaf: Leaf, content: bytes) -> str:
    return mark_text(leaf, content[leaf.offset : leaf.offset + leaf.size])


class _Jsonl(_Form):
    def row(self, time: str, labels: tuple[str, ...], row: MessageRow, part: _Part | None) -> None:
        content = (row.content or b"")[: row.have]
        cells = [None if cell == "" else cell for cell in _head(time, labels, row)]
        cells.append(None if row.content is None else _hex(content))
        record = dict(zip(self.columns, cells, strict=True))
        record |= {"t_s": row.t_ns / 1e9, "gap_ms": None if row.gap_ns is None else row.gap_ns / 1e6}
        if part is not None:
            values = dict(zip(part.names, part.values(content), strict=True))
            record |= {name: json_value(value) for name, value in values.items()}
            leaves = zip(part.names, part.leaves, strict=True)
            marks = {name: mark for name, leaf in leaves if (mark := _mark(leaf, content))}
            escaped = [
                name for name, value in values.items() if isinstance(value, str) and HALF.search(value)
            ]
            record |= {key: odd for key, odd in ((MARKS, marks), (ESCAPED, escaped)) if odd}
        self.out.write(json_text(record, separators=(",", ":")) + "\n")


class _Text(_Form):
    """Columns as wide as the first rows need: a wider cell of a later one moves the rest of its line."""

    def begin(self) -> None:
        self._held: list[tuple[str, ...]] | None = [self.names]
        self._widths: list[int] = []

    def row(self, time: str, labels: tuple[str, ...], row: MessageRow, part: _Part | None) -> None:
        content = (row.content or b"")[: row.have]
        shown = content[:HEX_SHOWN].hex(" ") + " .." * (len(content) > HEX_SHOWN)
        members = [""] * self.count
        found = zip(part.leaves, part.values(content), strict=True) if part is not None else ()
        for place, (leaf, value) in enumerate(found, part.first if part is not None else 0):
            if value is not None:
                members[place] = value_text(leaf, value, content[leaf.offset : leaf.offset + leaf.size])
        cells = (*map(str, _head(time, labels, row)), shown, *members)
        if self._held is None:
            self.out.write("  ".join(map(str.rjust, cells, self._widths)).rstrip() + "\n")
            return
        self._held.append(cells)
        if len(self._held) > LOOKED_AT:
            self.finish()

    def finish(self) -> None:
        held, self._held = self._held, None
        if held is not None:
            self._widths = [max(map(len, column)) for column in zip(*held, strict=True)]
            self.out.write("".join(f"{line}\n" for line in in_columns(held, "r" * len(held[0]))))


FORMS: Final[dict[str, type[_Form]]] = {"text": _Text, "csv": _Csv, "jsonl": _Jsonl}
