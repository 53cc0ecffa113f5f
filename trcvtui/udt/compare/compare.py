"""Two profiles, or two declarations, side by side on the same bytes: ours and theirs, member by member.

Rules: a row costs only when it is asked for; members are the same when their paths are, in any case. What
lies alike on both sides is one run, however long; table, summary and exit code come from one count.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import islice, product
from typing import Final, NamedTuple

from trcvtui.errors import one_line
from trcvtui.udt.layout.codec import Data
from trcvtui.udt.layout.layout import Layout, Leaf, has_text
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, index_text
from trcvtui.udt.layout.value_text import NO_DATA, form_text, stored_form, value_text
from trcvtui.udt.layout.values import decode_leaf, decode_leaves
from trcvtui.udt.report import json_head, json_many, json_text, json_value, leaf_type_text
from trcvtui.udt.types import StringType
from trcvtui.wording import in_columns


class Run(NamedTuple):
    """`leaves` of them in a row; the number of the first on either side, None where that side has none."""

    ours: int | None
    theirs: int | None
    leaves: int


def pair(ours: Node, theirs: Node) -> list[Run]:
    """Return the runs that hold every leaf of both: what only theirs has stands after its siblings."""
    joined: list[Run] = []
    for run in _Pairing().runs(ours, theirs, 0, 0):
        last = joined[-1] if joined else None
        if last is not None and _follows(last, run):
            joined[-1] = last._replace(leaves=last.leaves + run.leaves)
        elif run.leaves:
            joined.append(run)
    return joined


def _follows(last: Run, run: Run) -> bool:
    ours = None if last.ours is None else last.ours + last.leaves
    theirs = None if last.theirs is None else last.theirs + last.leaves
    return (ours, theirs) == (run.ours, run.theirs)


class _Pairing:
    def __init__(self) -> None:
        self._same: dict[tuple[int, int], bool] = {}

    def runs(self, ours: Node, theirs: Node, a: int, b: int) -> Iterator[Run]:
        if self.same(ours, theirs):
            yield Run(a, b, ours.leaves)
        elif isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct):
            yield from self._struct(ours, theirs, a, b)
        elif (
            isinstance(ours, PlacedArray)
            and isinstance(theirs, PlacedArray)
            and len(ours.bounds) == len(theirs.bounds)
        ):
            yield from self._array(ours, theirs, a, b)
        else:
            yield Run(a, None, ours.leaves)
            yield Run(None, b, theirs.leaves)

    def _struct(self, ours: PlacedStruct, theirs: PlacedStruct, a: int, b: int) -> Iterator[Run]:
        waiting = dict(_members(theirs, b))
        for name, (first, node) in _members(ours, a):
            other = waiting.pop(name, None)
            if other is None:
                yield Run(first, None, node.leaves)
            else:
                yield from self.runs(node, other[1], first, other[0])
        for first, node in waiting.values():
            yield Run(None, first, node.leaves)

    def _array(self, ours: PlacedArray, theirs: PlacedArray, a: int, b: int) -> Iterator[Run]:
        our, their = ours.element, theirs.element
        for number, index in enumerate(product(*[range(low, high + 1) for low, high in ours.bounds])):
            first, other = a + number * our.leaves, theirs.number_of(index)
            if other is None:
                yield Run(first, None, our.leaves)
            else:
                yield from self.runs(our, their, first, b + other * their.leaves)
        for number, index in enumerate(product(*[range(low, high + 1) for low, high in theirs.bounds])):
            if ours.number_of(index) is None:
                yield Run(None, b + number * their.leaves, their.leaves)

    def same(self, ours: Node, theirs: Node) -> bool:
        key = id(ours), id(theirs)
        if key not in self._same:
            self._same[key] = self._are_same(ours, theirs)
        return self._same[key]

    def _are_same(self, ours: Node, theirs: Node) -> bool:
        if isinstance(ours, PlacedArray) and isinstance(theirs, PlacedArray):
            return ours.bounds == theirs.bounds and self.same(ours.element, theirs.element)
        if isinstance(ours, PlacedStruct) and isinstance(theirs, PlacedStruct):
            our, their = list(_members(ours, 0)), list(_members(theirs, 0))
            return [name for name, _ in our] == [name for name, _ in their] and all(
                self.same(mine, other) for (_, (_, mine)), (_, (_, other)) in zip(our, their, strict=True)
            )
        return isinstance(ours, PlacedLeaf) and isinstance(theirs, PlacedLeaf)


def _members(node: PlacedStruct, first: int) -> Iterator[tuple[str, tuple[int, Node]]]:
    return ((one.name.casefold(), (one.first, one.node)) for one in node.flat(first=first))


NAMED: Final = 3  # members that a sentence names
MOST_FOUND: Final = 256  # differences that are counted


class Apart(NamedTuple):
    """A member that differs, with both sides in words; `is_place`: in its place, else in its stored form."""

    path: str
    ours: str
    theirs: str
    is_place: bool


def difference(a: Layout, b: Layout) -> str:
    """Return in what two layouts of one type differ; of the elements of an ARRAY the first is named."""
    parts = []
    if a.size != b.size:
        parts.append(f"the size, {a.size} and {b.size} bytes")
    other_text = a.rules.text.name != b.rules.text.name and has_text(a.type)
    found = list(
        islice(_DifferenceWalk(a, b, not other_text).apart(a.root, b.root, "", (0, 0), (0, 0)), MOST_FOUND)
    )
    for words, is_place in (("the place of", True), ("the stored form of", False)):
        members = [one for one in found if one.is_place is is_place]
        if members:
            shown = [f"{one.path or a.name} ({one.ours} and {one.theirs})" for one in members[:NAMED]]
            more = f" and {len(members) - NAMED} more" if len(members) > NAMED else ""
            parts.append(f"{words} {', '.join(shown)}{more}")
    if a.rules.byte_order != b.rules.byte_order:
        parts.append("the byte order")
    if other_text:
        parts.append(f"the STRING form, {a.rules.text.name} and {b.rules.text.name}")
    return "; ".join(parts) or "nothing"


class _DifferenceWalk:
    def __init__(self, a: Layout, b: Layout, with_texts: bool) -> None:
        self.a, self.b, self.with_texts = a.rules, b.rules, with_texts
        self._alike: dict[tuple[int, int], bool] = {}

    def apart(
        self, a: Node, b: Node, path: str, at: tuple[int, int], bits: tuple[int, int]
    ) -> Iterator[Apart]:
        if not a.leaves or (at[0] == at[1] and bits[0] == bits[1] and self.alike(a, b)):
            return
        if isinstance(a, PlacedLeaf) and isinstance(b, PlacedLeaf):
            yield from self.leaf(a, b, path, at, bits)
        elif isinstance(a, PlacedArray) and isinstance(b, PlacedArray):
            found = False
            for number in range(min(a.count, 2)):  # the second one shows a distance
                (our, our_bit), (their, their_bit) = a.place(number), b.place(number)
                below, places = path + index_text(a, number), (at[0] + our, at[1] + their)
                for one in self.apart(a.element, b.element, below, places, (our_bit, their_bit)):
                    found = True
                    yield one
                if found:
                    return
        elif isinstance(a, PlacedStruct) and isinstance(b, PlacedStruct):
            for number, (name, our_node, their_node) in enumerate(
                zip(a.names, a.nodes, b.nodes, strict=True)
            ):
                below = f"{path}.{name}" if path and name else name or path
                places = at[0] + a.offsets[number], at[1] + b.offsets[number]
                yield from self.apart(our_node, their_node, below, places, (a.bits[number], b.bits[number]))

    def leaf(
        self, a: PlacedLeaf, b: PlacedLeaf, path: str, at: tuple[int, int], bits: tuple[int, int]
    ) -> Iterator[Apart]:
        ours, theirs = _place(a, at[0], bits[0]), _place(b, at[1], bits[1])
        if ours != theirs:
            yield Apart(path, ours, theirs, is_place=True)
        if not self.same_form(a, b):
            yield Apart(path, form_text(a.type, self.a), form_text(b.type, self.b), is_place=False)

    def alike(self, a: Node, b: Node) -> bool:
        key = id(a), id(b)
        if key not in self._alike:
            self._alike[key] = self._are_alike(a, b)
        return self._alike[key]

    def _are_alike(self, a: Node, b: Node) -> bool:
        if isinstance(a, PlacedLeaf) and isinstance(b, PlacedLeaf):
            return a.is_bit == b.is_bit and self.same_form(a, b)
        if isinstance(a, PlacedArray) and isinstance(b, PlacedArray):
            return (a.pitch == b.pitch or a.count == 1) and self.alike(a.element, b.element)
        if isinstance(a, PlacedStruct) and isinstance(b, PlacedStruct):
            same = (a.offsets, a.bits) == (b.offsets, b.bits)
            return same and all(map(self.alike, a.nodes, b.nodes))
        return False

    def same_form(self, a: PlacedLeaf, b: PlacedLeaf) -> bool:
        if isinstance(a.type, StringType) and not self.with_texts:
            return True
        return stored_form(a.type, self.a) == stored_form(b.type, self.b)


def _place(leaf: PlacedLeaf, offset: int, bit: int) -> str:
    return f"{offset}.{bit}" if leaf.is_bit else str(offset)


MOST_COUNTED: Final = 65536  # rows of a quick summary: more members than TRCV_C takes bytes

PLACE: Final = "place"
TYPE: Final = "type"
FORM: Final = "form"
VALUE: Final = "value"
ONLY_OURS: Final = "only ours"
ONLY_THEIRS: Final = "only theirs"


class ComparedLeaf(NamedTuple):
    """One side of a row: the leaf, the type that decides its bytes, how it is stored, its value as text."""

    leaf: Leaf
    type: str
    form: tuple[object, ...]
    value: str

    @property
    def place(self) -> tuple[int, int | None, int]:
        """Return offset, bit and size."""
        return self.leaf.offset, self.leaf.bit, self.leaf.size

    @property
    def place_text(self) -> str:
        """Return the offset, of a bit such as `2.5`."""
        leaf = self.leaf
        return str(leaf.offset) if leaf.bit is None else f"{leaf.offset}.{leaf.bit}"


class ComparedRow(NamedTuple):
    """One member on both sides; None where a side has none of that path. `differs` says in what."""

    path: str
    ours: ComparedLeaf | None
    theirs: ComparedLeaf | None
    differs: tuple[str, ...]


class Summary(NamedTuple):
    """Both sizes, how many rows differ, and the first byte on either side of one that does.

    `counted` is the number of rows that were looked at, of `rows`; no difference: `first_offset` is None.
    """

    our_size: int
    their_size: int
    rows: int
    counted: int
    differing: int
    first_offset: int | None

    def __str__(self) -> str:
        sizes = f"ours {self.our_size} bytes, theirs {self.their_size}"
        of = f"of the first {self.counted} members" if self.counted < self.rows else f"of {self.rows} members"
        if self.first_offset is None:
            return f"{sizes}; none {of} differs"
        verb = "differs" if self.differing == 1 else "differ"
        return f"{sizes}; {self.differing} {of} {verb}, the first at byte {self.first_offset}"


class Comparison:
    """Two layouts, of the same declaration or of two. Rows stand in our order, what only theirs has at the
    end of the STRUCT that it is in.
    """

    def __init__(self, ours: Layout, theirs: Layout) -> None:
        self.ours, self.theirs = ours, theirs
        self._runs = pair(ours.root, theirs.root)
        self._starts: list[int] = []
        self.row_count = 0
        for run in self._runs:
            self._starts.append(self.row_count)
            self.row_count += run.leaves

    def rows(self, data: Data, start: int = 0, stop: int | None = None) -> Iterator[ComparedRow]:
        """Yield the rows of number start..stop-1 (default: all); the bytes may end anywhere."""
        start, stop = max(start, 0), self.row_count if stop is None else min(stop, self.row_count)
        number = max(bisect_right(self._starts, start) - 1, 0)
        for run, first in zip(self._runs[number:], self._starts[number:], strict=True):
            if first >= stop:
                return
            yield from self._rows_of(run, data, max(start - first, 0), min(stop - first, run.leaves))

    def _rows_of(self, run: Run, data: Data, start: int, stop: int) -> Iterator[ComparedRow]:
        for at in range(start, stop, _PAGE):
            end = min(at + _PAGE, stop)
            ours = _cells(self.ours, data, run.ours, at, end)
            theirs = _cells(self.theirs, data, run.theirs, at, end)
            for our, their in zip(ours, theirs, strict=True):
                shown = our or their
                yield ComparedRow(shown.leaf.path if shown else "", our, their, _differs(our, their))

    def summary(self, data: Data, most: int = MOST_COUNTED) -> Summary:
        """Return the summary of the first `most` rows."""
        count = Count()
        for row in self.rows(data, 0, most):
            count.add(row)
        return self.summed(count)

    def summed(self, count: Count) -> Summary:
        """Return the summary of rows that were counted on their way."""
        sizes = self.ours.size, self.theirs.size
        return Summary(*sizes, self.row_count, count.rows, count.differing, count.first)


class Count:
    """Rows counted one by one: how many there were, how many differ, the first byte of one that does."""

    def __init__(self) -> None:
        self.rows = self.differing = 0
        self.first: int | None = None

    def add(self, row: ComparedRow) -> None:
        self.rows += 1
        if row.differs:
            self.differing += 1
            at = min(cell.leaf.offset for cell in (row.ours, row.theirs) if cell)
            self.first = at if self.first is None else min(self.first, at)


def compare(ours: Layout, theirs: Layout) -> Comparison:
    """Return both layouts side by side."""
    return Comparison(ours, theirs)


_PAGE: Final = 512  # rows that are decoded at once, when all are asked for


def _cells(layout: Layout, data: Data, first: int | None, start: int, stop: int) -> list[ComparedLeaf | None]:
    if first is None:
        return [None] * (stop - start)
    start, stop = first + start, first + stop
    leaves = tuple(layout.leaves(start, stop))
    forms: dict[int, tuple[str, tuple[object, ...]]] = {}  # by type: leaves of an ARRAY share theirs
    for leaf in leaves:
        if id(leaf.type) not in forms:
            forms[id(leaf.type)] = leaf_type_text(layout, leaf), stored_form(leaf.type, layout.rules)
    texts = _texts(layout, leaves, data, start, stop)
    return [ComparedLeaf(leaf, *forms[id(leaf.type)], text) for leaf, text in zip(leaves, texts, strict=True)]


def _texts(layout: Layout, leaves: Sequence[Leaf], data: Data, start: int, stop: int) -> list[str]:
    if all(leaf.offset >= len(data) for leaf in leaves):  # a page is compiled only for bytes that are there
        return [NO_DATA] * len(leaves)
    values = decode_leaves(layout, data, start, stop)
    return [
        value_text(leaf, value, bytes(data[leaf.offset : leaf.offset + leaf.size]))
        for leaf, value in zip(leaves, values, strict=True)
    ]


def _differs(ours: ComparedLeaf | None, theirs: ComparedLeaf | None) -> tuple[str, ...]:
    if ours is None or theirs is None:
        return (ONLY_THEIRS if ours is None else ONLY_OURS,)
    same_type = ours.type == theirs.type  # another type has a form of its own
    told = (
        (PLACE, ours.place != theirs.place),
        (TYPE, not same_type),
        (FORM, same_type and ours.form != theirs.form),
    )
    found = [word for word, is_so in told if is_so]
    return (*found, VALUE) if ours.value != theirs.value else tuple(found)


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
        yield (*_texts_of(row, comparison.ours.name, with_values), ", ".join(row.differs))


def _texts_of(row: ComparedRow, name: str, with_values: bool) -> tuple[str, ...]:
    mark, path = MARK if row.differs else "", row.path or name
    if not with_values:
        return mark, path, _place_of(row.ours), _place_of(row.theirs)
    return mark, path, _place_of(row.ours), _value(row.ours), _place_of(row.theirs), _value(row.theirs)


def _place_of(cell: ComparedLeaf | None) -> str:
    return cell.place_text if cell else NOTHING


def _value(cell: ComparedLeaf | None) -> str:
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


def _cell(layout: Layout, cell: ComparedLeaf | None, data: bytes) -> dict[str, object] | None:
    if cell is None:
        return None
    leaf = cell.leaf
    part = data[leaf.offset : leaf.offset + leaf.size]
    value = json_value(decode_leaf(layout, leaf, part)) if len(part) == leaf.size else None
    bit = {} if leaf.bit is None else {"bit": leaf.bit}
    return {"type": cell.type, "offset": leaf.offset, **bit, "size": leaf.size, VALUE: value}
