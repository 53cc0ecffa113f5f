"""Two profiles, or two declarations, side by side on the same bytes: ours and theirs, member by member.

Rule: a row costs only when it is asked for; members are the same when their paths are, in any case.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from trcvtui.udt.compare.difference import Run, pair
from trcvtui.udt.layout.codec import Data
from trcvtui.udt.layout.decode import decode_leaves
from trcvtui.udt.layout.layout import Layout, Leaf
from trcvtui.udt.layout.stored_form import stored_form
from trcvtui.udt.layout.value_text import NO_DATA, value_text
from trcvtui.udt.report import leaf_type_text

MOST_COUNTED: Final = 65536  # rows of a quick summary: more members than TRCV_C takes bytes

PLACE: Final = "place"
TYPE: Final = "type"
FORM: Final = "form"
VALUE: Final = "value"
ONLY_OURS: Final = "only ours"
ONLY_THEIRS: Final = "only theirs"


class Cell(NamedTuple):
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


class Row(NamedTuple):
    """One member on both sides; None where a side has none of that path. `differs` says in what."""

    path: str
    ours: Cell | None
    theirs: Cell | None
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
        """Return the sentence."""
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

    def rows(self, data: Data, start: int = 0, stop: int | None = None) -> Iterator[Row]:
        """Yield the rows of number start..stop-1 (default: all); the bytes may end anywhere."""
        start, stop = max(start, 0), self.row_count if stop is None else min(stop, self.row_count)
        number = max(bisect_right(self._starts, start) - 1, 0)
        for run, first in zip(self._runs[number:], self._starts[number:], strict=True):
            if first >= stop:
                return
            yield from self._rows_of(run, data, max(start - first, 0), min(stop - first, run.leaves))

    def _rows_of(self, run: Run, data: Data, start: int, stop: int) -> Iterator[Row]:
        for at in range(start, stop, _PAGE):
            end = min(at + _PAGE, stop)
            ours = _cells(self.ours, data, run.ours, at, end)
            theirs = _cells(self.theirs, data, run.theirs, at, end)
            for our, their in zip(ours, theirs, strict=True):
                shown = our or their
                yield Row(shown.leaf.path if shown else "", our, their, _differs(our, their))

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

    def add(self, row: Row) -> None:
        """Count one row."""
        self.rows += 1
        if row.differs:
            self.differing += 1
            at = min(cell.leaf.offset for cell in (row.ours, row.theirs) if cell)
            self.first = at if self.first is None else min(self.first, at)


def compare(ours: Layout, theirs: Layout) -> Comparison:
    """Return both layouts side by side."""
    return Comparison(ours, theirs)


_PAGE: Final = 512  # rows that are decoded at once, when all are asked for


def _cells(layout: Layout, data: Data, first: int | None, start: int, stop: int) -> list[Cell | None]:
    if first is None:
        return [None] * (stop - start)
    start, stop = first + start, first + stop
    leaves = tuple(layout.leaves(start, stop))
    forms: dict[int, tuple[str, tuple[object, ...]]] = {}  # by type: leaves of an ARRAY share theirs
    for leaf in leaves:
        if id(leaf.type) not in forms:
            forms[id(leaf.type)] = leaf_type_text(layout, leaf), stored_form(leaf.type, layout.rules)
    texts = _texts(layout, leaves, data, start, stop)
    return [Cell(leaf, *forms[id(leaf.type)], text) for leaf, text in zip(leaves, texts, strict=True)]


def _texts(layout: Layout, leaves: Sequence[Leaf], data: Data, start: int, stop: int) -> list[str]:
    if all(leaf.offset >= len(data) for leaf in leaves):  # a page is compiled only for bytes that are there
        return [NO_DATA] * len(leaves)
    values = decode_leaves(layout, data, start, stop)
    return [
        value_text(leaf, value, bytes(data[leaf.offset : leaf.offset + leaf.size]))
        for leaf, value in zip(leaves, values, strict=True)
    ]


def _differs(ours: Cell | None, theirs: Cell | None) -> tuple[str, ...]:
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
