"""Pane 1 of the lab: the type as a tree, ours beside theirs; only the rows in view are decoded.

A row with the sign `≠` differs in place, size, type or value.
"""

from __future__ import annotations

from typing import ClassVar, Final, NamedTuple

from trcvtui.tui.formatting import clip, measure, pad, plain
from trcvtui.tui.lab.collapsible_tree import Place, TreeRow
from trcvtui.tui.lab.lab import OURS, THEIRS, Lab
from trcvtui.tui.messages import KeyClicked, LabRowSelected
from trcvtui.tui.widgets.line_view import EMPTY, LineView, OneLine, Part, Row, hidden_bindings, row
from trcvtui.udt.layout.layout import Layout, Leaf
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.report import leaf_type_text

MOST_COMPARED: Final = 256  # with more rows, differences are not counted: each picture would cost too much
ROW_ACTIONS: Final = ("type", "profile('ours')", "profile('theirs')")


class LabHead(LineView, can_focus=False):
    DEFAULT_CSS = "LabHead { height: 3; background: $background; padding: 0 1; }"

    def __init__(self, lab: Lab) -> None:
        super().__init__(id="lab-head")
        self._lab = lab
        self._half = 40

    def row_count(self) -> int:
        return 3

    def row_at(self, y: int) -> Row:
        if y == 0:
            return self._type_row()
        return self._side(OURS, "oES") if y == 1 else self._side(THEIRS, "pes") if y == 2 else EMPTY

    def _type_row(self) -> Row:
        lab = self._lab
        name = plain(lab.type_name) or "no type"
        text = f" {clip(name, 28)} of {clip(plain(lab.files.name), 24)}"
        self._half = len(text) + 10
        return row(
            ("t", "key"), (" type  ", "dim"), (text, "strong"), ("   ", ""),
            ("b", "key"), (" bytes ", "dim"), (lab.bytes.name, "strong"),
        )  # fmt: skip

    def _side(self, side: str, keys: str) -> Row:
        profile, layout = self._lab.profiles[side], self._lab.layout(side)
        size = f" · {layout.size} B" if layout is not None else " · cannot be laid out so"
        verdict = self._verdict() if side == THEIRS else ""
        return row(
            (keys[0], "key"), (f" {side:<7}", "dim"), (profile.layout, "strong"), (" · ", "dim"),
            (keys[1], "key"), (f" {profile.byte_order}-endian", "strong"), (" · ", "dim"),
            (keys[2], "key"), (f" STRING {profile.text}", "strong"), (size, "strong"),
            (f"  {verdict}", "warn" if verdict.startswith("≠") else "dim"),
        )  # fmt: skip

    def _verdict(self) -> str:
        comparison, tree = self._lab.comparison(), self._lab.tree
        if comparison is None or tree is None:
            return ""
        if comparison.row_count <= MOST_COMPARED:
            found = self._lab.summary()
            differing = found.differing if found is not None else 0
            sign = "≠" if differing else "="
            return f"{sign} {differing} of {comparison.row_count} differ" if differing else "= no difference"
        return "= the same places" if not tree.rows[0].moved else "≠ places differ"

    def click(self, x: int, y: int) -> None:
        self.post_message(KeyClicked("bytes" if y == 0 and x > self._half else ROW_ACTIONS[y]))


MARK_WIDTH, OPEN_SIGN, CLOSED_SIGN, DIFFERS_SIGN = 2, "▾ ", "▸ ", "≠"
LEAST_OFFSET_WIDTH, WIDE_OFFSET_WIDTH = 4, 8  # columns of an offset
LEAST_SIZE_WIDTH: Final = 5
NARROW_WIDTH: Final = 90  # in fewer columns than this, offset and type get less room


class LeafCell(NamedTuple):
    """One side of a leaf: its stored type and value as text. If `is_there`, all bytes of the leaf exist."""

    type: str
    value: str
    is_there: bool


class TreeColumns(NamedTuple):
    name: int
    type: int
    offset: int
    size: int
    value: int


def columns(width: int, lab: Lab) -> TreeColumns:
    """Return the width of each column in a pane of this `width`: offset and size as the type needs."""
    layouts = [layout for side in (OURS, THEIRS) if (layout := lab.layout(side)) is not None]
    digits = len(str(max((layout.size for layout in layouts), default=0)))
    bits = 2 if any(layout.rules.bits & {"BOOL"} or layout.rules.takes_pack for layout in layouts) else 0
    offset = max(LEAST_OFFSET_WIDTH if width < NARROW_WIDTH else WIDE_OFFSET_WIDTH, digits + bits + 1)
    size, type_ = max(LEAST_SIZE_WIDTH, digits + 1), 11 if width < NARROW_WIDTH else 16
    left = width - MARK_WIDTH - type_ - 2 * (offset + size)
    name = max(12, min(44, left * 2 // 5))
    return TreeColumns(name, type_, offset, size, max(6, (left - name) // 2))


class ColumnHead(OneLine):
    def __init__(self, lab: Lab) -> None:
        super().__init__(id="lab-columns")
        self._lab = lab

    def line(self) -> Row:
        width = columns(self.line_width, self._lab)
        text = " " * MARK_WIDTH + pad("member", width.name) + pad("type", width.type)
        offset = "offset " if width.offset > len("offset") else "at "
        for side in (OURS, THEIRS):
            text += pad(offset, width.offset, right=True) + pad("size ", width.size, right=True)
            text += pad(side, width.value)
        return row((text, "dim"))


class LabTree(LineView):
    KEYS: ClassVar = (("↑↓", "row"), ("space", "fold"), ("z", "all"), ("n N", "≠"))
    BINDINGS: ClassVar = hidden_bindings({
        "right,l": "fold(True)", "left,h": "fold(False)", "space,enter": "fold(None)", "z": "fold_all",
    })  # fmt: skip

    def __init__(self, lab: Lab) -> None:
        super().__init__(id="lab-tree")
        self._lab = lab
        self.cursor = 0
        self._rows: dict[int, TreeRow] = {}
        self._cells: dict[tuple[str, int], LeafCell] = {}
        self._shown: tuple[object, ...] = ()
        self._revision = -1
        self._folds = 0
        self._all_open: bool | None = None

    # -- what is shown ------------------------------------------------------------------------------

    def show(self) -> None:
        if self._revision != self._lab.revision:
            self._revision = self._lab.revision
            self._all_open = None
        self.cursor = max(0, min(self.cursor, self.row_count() - 1))
        self._load_rows(self.scroll_offset.y)
        super().show()

    def row_count(self) -> int:
        tree = self._lab.tree
        return len(tree.rows) if tree is not None else 0

    def _load_rows(self, top: int) -> None:
        tree, content = self._lab.tree, self._lab.bytes.content
        known = self._lab.revision, self._folds, content, top, self.size.height
        if known == self._shown:
            return
        self._shown = known
        stop = min(top + max(1, self.size.height), self.row_count())
        self._rows = {y: tree.rows[y] for y in range(top, stop)} if tree is not None else {}
        self._cells = {}
        for side in (OURS, THEIRS):
            layout = self._lab.layout(side)
            for found in self._rows.values():
                if layout is not None and found.is_leaf:
                    self._cells[side, found.leaf] = _make_cell(layout, layout.leaf(found.leaf), content)

    def row_at(self, y: int) -> Row:
        if y not in self._rows:
            self._load_rows(self.scroll_offset.y)
        found = self._rows.get(y)
        if found is None:
            return EMPTY
        chosen = y == self.cursor
        return row(*self._row_parts(found, chosen), style=self.cursor_style(chosen))

    def _row_parts(self, found: TreeRow, chosen: bool) -> list[Part]:
        width = columns(self.line_width, self._lab)
        differs = self.differs(found)
        return [
            ("▸" if chosen else " ", "key"),
            (DIFFERS_SIGN if differs else " ", "warn strong"),
            *self._member_parts(found, width.name, chosen),
            (pad(clip(plain(self._type_name(found)), width.type - 1), width.type), "dim"),
            *self._side(OURS, found, found.ours, width, differs),
            *self._side(THEIRS, found, found.theirs, width, differs),
        ]

    def _member_parts(self, found: TreeRow, width: int, chosen: bool) -> list[Part]:
        depth = len(found.key) - (1 if found.key and found.key[-1] == -1 else 0)
        indent = min(2 * depth, max(0, width - 10))
        fold = "" if found.is_open is None else OPEN_SIGN if found.is_open else CLOSED_SIGN
        name = "(padding)" if found.is_gap else plain(found.name)
        style = "faint" if found.is_gap else "strong" if chosen else ""
        return [
            (" " * indent + fold, "key"),
            (pad(clip(name, width - indent - measure(fold) - 1), width - indent - measure(fold)), style),
        ]

    def _type_name(self, found: TreeRow) -> str:
        cell = self._cells.get((OURS, found.leaf)) if found.is_leaf else None
        return found.type_text if cell is None or cell.type in found.type_text else cell.type

    def _side(self, side: str, found: TreeRow, place: Place, width: TreeColumns, differs: bool) -> list[Part]:
        style = "warn" if differs else "dim"
        is_there = self._lab.layout(side) is not None and not (found.is_gap and not place.size)
        offset = str(place) if is_there else "-"
        size = f"{place.size} " if is_there else ""
        return [
            (pad(f"{offset} ", width.offset, right=True), style),
            (pad(size, width.size, right=True), style),
            self._value_part(side, found, place, width),
        ]

    def _value_part(self, side: str, found: TreeRow, place: Place, width: TreeColumns) -> Part:
        if found.is_gap:
            return pad(clip(self._gap_text(place), width.value - 1), width.value), "faint"
        cell = self._cells.get((side, found.leaf)) if found.is_leaf else None
        if cell is None:
            return " " * width.value, "faint"
        return pad(clip(cell.value, width.value - 1), width.value), "printable" if cell.is_there else "ghost"

    def _gap_text(self, place: Place) -> str:
        if not place.size:
            return ""
        there = self._lab.bytes.content[place.offset : place.offset + place.size]
        return "░" * min(place.size, 4) + (" not 0!" if any(there) else "")  # perhaps it is no padding

    def differs(self, found: TreeRow) -> bool:
        """Return whether a row differs: a leaf by place, type or value; a branch by any part's place."""
        if self._lab.layout(THEIRS) is None:
            return False
        ours, theirs = self._cells.get((OURS, found.leaf)), self._cells.get((THEIRS, found.leaf))
        return found.moved or (found.is_leaf and ours != theirs)

    # -- the cursor ---------------------------------------------------------------------------------

    @property
    def chosen_row(self) -> TreeRow | None:
        tree = self._lab.tree
        return tree.rows[self.cursor] if tree is not None and self.cursor < len(tree.rows) else None

    def action_move(self, rows: int) -> None:
        self.go_to(max(0, min(self.row_count() - 1, self.cursor + rows)))

    def go_to(self, y: int, tells: bool = True) -> None:
        self.cursor = y
        self.apply_row_count()
        self.keep_in_view(y)
        self.show()
        if tells:
            self.post_message(LabRowSelected())

    def show_leaf(self, leaf: int, opens: bool = False) -> None:
        """Move the cursor to a leaf, or to the closed branch that hides it. `opens` opens such branches."""
        tree = self._lab.tree
        if tree is not None:
            y = tree.row_of_leaf(leaf, opens)
            self._folds += 1
            self.go_to(y, tells=opens)

    def action_fold(self, wanted: bool | None) -> None:
        """Open (True), close (False), toggle (None) a branch. If none is open, False goes to the parent."""
        tree, found = self._lab.tree, self.chosen_row
        if tree is None or found is None:
            return
        if found.is_open is not None and wanted in (None, not found.is_open):
            tree.toggle(found.key)
            self._folds += 1
            self.go_to(self.cursor)
        elif wanted is False and found.key:
            self.go_to(tree.row_of_key(found.key[:-2] if found.is_gap else found.key[:-1]))

    def action_fold_all(self) -> None:
        tree = self._lab.tree
        if tree is None:
            return
        self._all_open = {None: False, False: True, True: None}[self._all_open]
        tree.set_all_open(self._all_open)
        self._folds += 1
        self.go_to(0)

    def click(self, x: int, y: int) -> None:
        was, self.cursor = self.cursor, y
        found = self.chosen_row
        sign = MARK_WIDTH + 2 * len(found.key) if found is not None else 0
        if was == y or sign <= x < sign + 2:  # a second click on the row, or one on its fold sign
            self.action_fold(None)
        self.go_to(y)


def _make_cell(layout: Layout, leaf: Leaf, content: bytes) -> LeafCell:
    raw = content[leaf.offset : leaf.offset + leaf.size]
    if len(raw) < leaf.size:
        missing = f"{len(raw)} of {leaf.size} B" if raw else "-"
        return LeafCell(leaf_type_text(layout, leaf), missing, False)
    text = value_text(leaf, decode_leaf(layout, leaf, raw), raw)
    return LeafCell(leaf_type_text(layout, leaf), text, True)
