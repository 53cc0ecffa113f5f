"""Compares two profiles, or two declarations, on the same bytes: ours and theirs, member by member.

Rules: paths that are equal except for case are one member. Table, summary and exit code use the same rows.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Final, NamedTuple

from trcvtui.errors import one_line
from trcvtui.udt.layout.layout import Layout, Leaf, has_text
from trcvtui.udt.layout.layout_tree import Data, Node, PlacedArray, PlacedLeaf, PlacedStruct, indices
from trcvtui.udt.layout.value_text import odd_text, stored_form, stored_form_text, value_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.report import json_value, leaf_type_text, place_text
from trcvtui.udt.types import StringType
from trcvtui.wording import format_columns, json_text

LeafPair = tuple[int | None, int | None]  # the number of a leaf on each side; None if a side lacks it


def pair_leaves(ours: Node, theirs: Node, a: int = 0, b: int = 0) -> Iterator[LeafPair]:
    """Yield pairs of leaf numbers from `a` and `b` on. A leaf only in theirs comes last in its STRUCT."""
    if isinstance(ours, PlacedLeaf) and isinstance(theirs, PlacedLeaf):
        yield a, b
        return
    waiting = _child_nodes(theirs, b)
    for name, (first, node) in _child_nodes(ours, a).items():
        if name in waiting:
            other, their_node = waiting.pop(name)
            yield from pair_leaves(node, their_node, first, other)
        else:
            yield from ((number, None) for number in range(first, first + node.leaves))
    for first, node in waiting.values():
        yield from ((None, number) for number in range(first, first + node.leaves))


def _child_nodes(node: Node, first: int) -> dict[str, tuple[int, Node]]:
    match node:
        case PlacedStruct():
            return {one.name.casefold(): (one.first, one.node) for one in node.flat_members(first=first)}
        case PlacedArray(element=element):
            return {
                index: (first + number * element.leaves, element)
                for number, index in enumerate(indices(node) if node.leaves else ())
            }
        case _:
            return {"": (first, node)}


MOST_NAMED: Final = 3  # members that a sentence names
MOST_DIFFERENCES: Final = 256  # differences that are counted


class MemberDifference(NamedTuple):
    """A member that differs, both sides in words. If `is_place` the place differs, else the stored form."""

    path: str
    ours: str
    theirs: str
    is_place: bool


def describe_difference(a: Layout, b: Layout) -> str:
    """Return how two layouts of a type differ; of an ARRAY, only the first differing element is named."""
    parts = []
    if a.size != b.size:
        parts.append(f"the size, {a.size} and {b.size} bytes")
    other_text = a.rules.text.name != b.rules.text.name and has_text(a.type)
    found = list(islice(_find_differences(a, b, not other_text), MOST_DIFFERENCES))
    for words, is_place in (("the place of", True), ("the stored form of", False)):
        members = [one for one in found if one.is_place is is_place]
        if members:
            shown = [f"{one.path or a.name} ({one.ours} and {one.theirs})" for one in members[:MOST_NAMED]]
            more = f" and {len(members) - MOST_NAMED} more" if len(members) > MOST_NAMED else ""
            parts.append(f"{words} {', '.join(shown)}{more}")
    if a.rules.byte_order != b.rules.byte_order:
        parts.append("the byte order")
    if other_text:
        parts.append(f"the STRING form, {a.rules.text.name} and {b.rules.text.name}")
    return "; ".join(parts) or "nothing"


def _find_differences(a: Layout, b: Layout, with_texts: bool) -> Iterator[MemberDifference]:
    named: dict[str, str] = {}  # by path of an ARRAY: the index of its first element that differs
    for ours, theirs in zip(a.leaves(), b.leaves(), strict=True):
        places = place_text(ours), place_text(theirs)
        counts = with_texts or not isinstance(ours.type, StringType)
        same_form = not counts or stored_form(ours.type, a.rules) == stored_form(theirs.type, b.rules)
        if places[0] == places[1] and same_form:
            continue
        elements = [(ours.path[: one.start()], one[0]) for one in re.finditer(r"\[[^]]*\]", ours.path)]
        if any(named.setdefault(path, index) != index for path, index in elements):
            continue
        if places[0] != places[1]:
            yield MemberDifference(ours.path, *places, is_place=True)
        if not same_form:
            forms = stored_form_text(ours.type, a.rules), stored_form_text(theirs.type, b.rules)
            yield MemberDifference(ours.path, *forms, is_place=False)


PLACE: Final = "place"
TYPE: Final = "type"
FORM: Final = "form"
VALUE: Final = "value"


class ComparedLeaf(NamedTuple):
    """One side of a row: the leaf, its stored type, its stored form, its value as text."""

    leaf: Leaf
    type: str
    form: tuple[object, ...]
    value: str

    @property
    def place(self) -> tuple[int, int | None, int]:
        """Return offset, bit and size."""
        return self.leaf.offset, self.leaf.bit, self.leaf.size


class ComparedRow(NamedTuple):
    """One member on both sides. A side that lacks it is None. `differs` has the kinds of difference."""

    path: str
    ours: ComparedLeaf | None
    theirs: ComparedLeaf | None
    differs: tuple[str, ...]


class Summary(NamedTuple):
    """Both sizes, numbers of all and of differing rows, lowest offset of these on either side, or None."""

    our_size: int
    their_size: int
    rows: int
    differing: int
    first_offset: int | None

    def __str__(self) -> str:
        sizes = f"ours {self.our_size} bytes, theirs {self.their_size}"
        if self.first_offset is None:
            return f"{sizes}; none of {self.rows} members differs"
        verb = "differs" if self.differing == 1 else "differ"
        of = f"{self.differing} of {self.rows} members {verb}"
        return f"{sizes}; {of}, the first at byte {self.first_offset}"


class Comparison:
    """Two layouts. Rows are in our order. Members that only theirs has are at the end of their STRUCT."""

    def __init__(self, ours: Layout, theirs: Layout) -> None:
        self.ours, self.theirs = ours, theirs
        self._pairs = list(pair_leaves(ours.root, theirs.root))
        self._forms: dict[tuple[int, int], tuple[str, tuple[object, ...]]] = {}  # leaves share their types

    @property
    def row_count(self) -> int:
        return len(self._pairs)

    def rows(self, data: Data, start: int = 0, stop: int | None = None) -> Iterator[ComparedRow]:
        """Yield the rows `start` to `stop` - 1, by default all. `data` may be shorter than the types."""
        for ours, theirs in self._pairs[start:stop]:
            our, their = self._read_leaf(self.ours, ours, data), self._read_leaf(self.theirs, theirs, data)
            shown = our or their
            yield ComparedRow(shown.leaf.path if shown else "", our, their, _list_differences(our, their))

    def _read_leaf(self, layout: Layout, number: int | None, data: Data) -> ComparedLeaf | None:
        if number is None:
            return None
        leaf = layout.leaf(number)
        key = id(layout), id(leaf.type)
        if key not in self._forms:
            self._forms[key] = leaf_type_text(layout, leaf), stored_form(leaf.type, layout.rules)
        raw = bytes(data[leaf.offset : leaf.offset + leaf.size])
        value = decode_leaf(layout, leaf, raw) if len(raw) == leaf.size else None
        return ComparedLeaf(leaf, *self._forms[key], value_text(leaf, value, raw))

    def summary(self, rows: Iterable[ComparedRow]) -> Summary:
        differing = [row for row in rows if row.differs]
        cells = [cell for row in differing for cell in (row.ours, row.theirs) if cell]
        first = min((cell.leaf.offset for cell in cells), default=None)
        return Summary(self.ours.size, self.theirs.size, self.row_count, len(differing), first)


def _list_differences(ours: ComparedLeaf | None, theirs: ComparedLeaf | None) -> tuple[str, ...]:
    if ours is None or theirs is None:
        return ("only theirs" if ours is None else "only ours",)
    same_type = ours.type == theirs.type  # types that differ have different forms anyway
    kinds = (
        (PLACE, ours.place != theirs.place),
        (TYPE, not same_type),
        (FORM, same_type and ours.form != theirs.form),
    )
    found = [word for word, is_so in kinds if is_so]
    return (*found, VALUE) if ours.value != theirs.value else tuple(found)


DIFFERS_MARK: Final = "*"
MISSING_TEXT: Final = "-"


def is_equal(comparison: Comparison, rows: Iterable[ComparedRow]) -> bool:
    """Return whether size and byte order are equal, and each member has the same place, form and value."""
    ours, theirs = comparison.ours, comparison.theirs
    same = ours.size == theirs.size and ours.rules.byte_order == theirs.rules.byte_order
    return same and not any(row.differs for row in rows)


def comparison_json(comparison: Comparison, rows: Sequence[ComparedRow], data: bytes) -> str:
    """Return the object of `udt compare`, one row in each line. A side that has no such member is null."""
    ours, theirs = comparison.ours, comparison.theirs
    records = [
        {
            "path": row.path,
            "differs": row.differs,
            "ours": _cell_json(ours, row.ours, data),
            "theirs": _cell_json(theirs, row.theirs, data),
        }
        for row in rows
    ]
    lines = ",\n".join(f"    {json_text(record)}" for record in records)
    sides = f'  "ours": {json_text(_side_json(ours))},\n  "theirs": {json_text(_side_json(theirs))},\n'
    listed = f'  "rows": [\n{lines}\n  ],\n' if lines else '  "rows": [],\n'
    return f'{{\n{sides}{listed}  "equal": {json_text(is_equal(comparison, rows))}\n}}'


def comparison_text(comparison: Comparison, rows: Sequence[ComparedRow], data: bytes) -> str:
    """Return the table of `udt compare`. A row that differs begins with `*`."""
    ours, theirs = comparison.ours, comparison.theirs
    values = ("value",) if data else ()
    head = ("", "path", "ours", *values, "theirs", *values, "differs")
    texts = [(*_row_texts(row, ours.name, bool(data)), ", ".join(row.differs)) for row in rows]
    table = format_columns([head, *texts], "llrlrll" if data else "llrrl")
    lines = [
        f"ours    {_side_text(ours)}",
        f"theirs  {_side_text(theirs)}",
        *table,
        str(comparison.summary(rows)),
    ]
    if ours.rules.byte_order != theirs.rules.byte_order:
        lines.append(f"byte order: ours {ours.rules.byte_order}, theirs {theirs.rules.byte_order}")
    return "\n".join(lines)


def _row_texts(row: ComparedRow, name: str, with_values: bool) -> tuple[str, ...]:
    texts = [DIFFERS_MARK if row.differs else "", row.path or name]
    for cell in (row.ours, row.theirs):
        texts += [place_text(cell.leaf), cell.value] if cell else [MISSING_TEXT, ""]
    return tuple(texts if with_values else texts[:3] + texts[4:5])


def _side_text(layout: Layout) -> str:
    rules = layout.rules
    return f"{one_line(layout.name)}: {layout.size} bytes, layout {rules.name}, {rules.byte_order}-endian"


def _side_json(layout: Layout) -> dict[str, object]:
    rules = layout.rules
    return {
        "type": layout.name,
        "layout": rules.name,
        "byte_order": rules.byte_order,
        "text": rules.text.name,
        "size": layout.size,
    }


def _cell_json(layout: Layout, cell: ComparedLeaf | None, data: bytes) -> dict[str, object] | None:
    if cell is None:
        return None
    leaf = cell.leaf
    part = data[leaf.offset : leaf.offset + leaf.size]
    value = json_value(decode_leaf(layout, leaf, part)) if len(part) == leaf.size else None
    mark = {"mark": mark} if (mark := odd_text(leaf, bytes(part))) else {}
    bit = {} if leaf.bit is None else {"bit": leaf.bit}
    return {"type": cell.type, "offset": leaf.offset, **bit, "size": leaf.size, VALUE: value, **mark}
