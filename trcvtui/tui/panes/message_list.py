"""The messages of the selected instance, one a row, newest last.

Rule: a row is drawn from its bytes when it comes into view; 10,000 rows cost what one page costs.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from typing import ClassVar, Final, NamedTuple

from textual.binding import Binding

from trcvtui.errors import UserError
from trcvtui.history.messages import MessageRow
from trcvtui.history.records import NOW
from trcvtui.project.project import DataDecl
from trcvtui.tui.formatting import clip, pad, squeeze
from trcvtui.tui.messages import MessageChosen
from trcvtui.tui.view_model.known_messages import KnownMessages
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, OneLine, Part, Row, row
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode_leaves
from trcvtui.wording import duration, stamp


class Column(NamedTuple):
    """A column before the members; where the newest message needs more room it is wider."""

    name: str
    width: int
    text: Callable[[MessageRow], str]
    style: str = "dim"


SCAN: Final = Column("scan", 7, lambda shown: str(shown.scan))
COLUMNS: Final = (
    Column("n", 5, lambda shown: str(shown.number)),
    SCAN,
    Column("t in s", 9, lambda shown: stamp(shown.t_ns)),
    Column("gap", 9, lambda shown: "" if shown.gap_ns is None else clip(duration(shown.gap_ns), 8)),
    Column("B", 6, lambda shown: str(shown.size), "strong"),
    Column("STATUS", 7, lambda shown: f"{shown.status:04X}" if shown.status >= 0 else "", ""),
)
WITH_SCAN: Final = 96  # columns of the screen's from which there is room for the scan
LEAST_MEMBER, MOST_MEMBER = 9, 18  # columns of one


class MessageList(LineView):
    """Rows that pass the filter. The newest is followed until one is chosen.

    A replay has those of the whole recording: the newest is that of the scan that is shown.
    """

    KEYS: ClassVar = (("↑↓", "message"), ("end", "follow"), ("/", "filter"), ("y", "CSV"), ("D", "DATA now"))
    BINDINGS: ClassVar = [
        Binding("n,right_square_bracket", "move(1)", show=False),
        Binding("N,left_square_bracket", "move(-1)", show=False),
        Binding("escape", "leave", show=False),
    ]

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="messages")
        self._view_model = view_model
        self.text = self.wrong = ""  # the filter in force; what is wrong with that which was typed last
        self._typed = ""
        self._passes: Callable[[MessageRow], bool] = lambda shown: True
        self._of: tuple[KnownMessages, str] | None = None  # whose the rows are
        self._declared: DataDecl | None = None  # whose the members and the filter are
        self._found: list[int] = []  # numbers of those that pass, from 0, among all rows of the instance
        self._looked, self._oldest = 0, 0  # up to where; the first that has values
        self._at: int | None = None  # the chosen one, None: the newest
        self.columns: tuple[tuple[Column, int], ...] = ()
        self.leaves: tuple[Leaf, ...] = ()
        self.width = LEAST_MEMBER  # of a member
        self._drawn: dict[int, tuple[Part, ...]] = {}
        self._look: object = None

    # -- rows ------------------------------------------------------------------------------------------

    @property
    def _known(self) -> KnownMessages:
        """Return the rows of the selected instance: before they come, none of another one."""
        known = self._view_model.known_messages
        return known if known.instance == self._view_model.selected else KnownMessages()

    def _row(self, number: int) -> MessageRow:
        known = self._view_model.known_messages
        return known.rows[number - known.first]

    def rows(self) -> Iterator[MessageRow]:
        return map(self._row, self._found)

    def chosen(self) -> MessageRow | None:
        return self._row(self._found[self._place]) if self._found else None

    @property
    def is_followed(self) -> bool:
        return self._at is None

    @property
    def _place(self) -> int:
        last = len(self._found) - 1
        if self._at is not None:
            return min(last, bisect_left(self._found, self._at))
        return (
            max(0, bisect_right(self._found, self._now, key=self._scan_of) - 1) if self._now < NOW else last
        )

    @property
    def _now(self) -> int:
        """Return the scan after which messages are still to come."""
        position = self._view_model.position
        return position.scan if position is not None else NOW

    def _scan_of(self, number: int) -> int:
        return self._row(number).scan

    def follow(self) -> None:
        self._at = None

    def show(self) -> None:
        self._catch_up()
        self._measure()
        self.resize_rows()
        if self._at is None and self._now < NOW:
            self.keep_in_view(self._place)
        elif self._at is None:
            self.scroll_to(y=self.row_count(), animate=False)
        super().show()

    def _catch_up(self) -> None:
        view_model, known = self._view_model, self._known
        of = view_model.known_messages, view_model.selected
        if of != self._of or view_model.message_type is not self._declared:
            self._at = self._at if of == self._of else None
            self._of, self._declared = of, view_model.message_type
            self._drawn.clear()
            self._begin_anew()
            self.text, self._passes = "", lambda shown: True
            self.narrow(self._typed)
        if known.stop < self._looked:
            self._begin_anew()
        gone = bisect_left(self._found, known.first)
        if gone:
            del self._found[:gone]
            if self._at is not None:  # what is in view stays in view
                self.scroll_to(y=max(0, self.scroll_offset.y - gone), animate=False)
        if self._oldest != known.oldest:  # a condition on members is false where there are none any more
            old = bisect_left(self._found, known.oldest)
            self._found[:old] = [number for number in self._found[:old] if self._passes(self._row(number))]
            self._oldest = known.oldest
        fresh = range(max(self._looked, known.first), known.stop)
        self._found += [number for number in fresh if self._passes(self._row(number))]
        self._looked = known.stop

    def _begin_anew(self) -> None:
        self._found, self._looked, self._oldest = [], 0, 0

    def _measure(self) -> None:
        """Give the columns what the newest row needs, and the members what is left."""
        last = self._row(self._found[-1]) if self._found else None
        self.columns = tuple(
            (each, max(each.width, len(each.text(last)) + 1 if last is not None else 0))
            for each in COLUMNS
            if each is not SCAN or self.line_width >= WITH_SCAN
        )
        room = max(0, self.line_width - 1 - sum(width for _, width in self.columns))
        declared = self._view_model.message_type
        layout = declared.layout if declared is not None else None
        self.leaves = layout.leaves(0, min(room // LEAST_MEMBER, layout.leaf_count)) if layout else ()
        self.width = min(MOST_MEMBER, room // len(self.leaves)) if self.leaves else LEAST_MEMBER
        look = self.columns, self.width, len(self.leaves), self._oldest
        if look != self._look or len(self._drawn) > 4 * self.size.height + 64:
            self._look = look
            self._drawn.clear()

    # -- drawing ---------------------------------------------------------------------------------------

    def row_count(self) -> int:
        return len(self._found)

    def row_at(self, y: int) -> Row:
        if y >= len(self._found):
            return EMPTY
        number, is_chosen = self._found[y], y == self._place
        if number not in self._drawn:
            self._drawn[number] = tuple(self._cells(self._row(number)))
        sign: Part = ("▸" if is_chosen else " ", "key")
        cells, is_later = self._drawn[number], self._scan_of(number) > self._now
        cells = tuple((text, "faint") for text, _ in cells) if is_later else cells
        return row(sign, *cells, style=self.cursor_style(is_chosen))

    def _cells(self, shown: MessageRow) -> Iterator[Part]:
        for column, width in self.columns:
            yield pad(column.text(shown), width, right=True), "warn" if shown.reason else column.style
        declared, content = self._view_model.message_type, (shown.content or b"")[: shown.have]
        if shown.reason:
            yield f"  {shown.reason}", "warn"
        elif declared is not None:
            values = decode_leaves(declared.layout, content, 0, len(self.leaves))
            for leaf, value in zip(self.leaves, values, strict=True):
                part = content[leaf.offset : leaf.offset + leaf.size]
                yield self.member("" if value is None else value_text(leaf, value, part)), "printable"

    def member(self, text: str) -> str:
        """Return a text in the columns of a member: its beginning and its end, where it is too long."""
        return pad(squeeze(text, self.width - 1), self.width, right=True)

    # -- moving ----------------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        if self._found and (rows < 0 or self._at is not None or self._place < len(self._found) - 1):
            self._choose(max(0, min(len(self._found) - 1, self._place + rows)))

    def action_edge(self, direction: int) -> None:
        if direction > 0:
            self._follow()
        elif self._found:
            self._choose(0)

    def action_leave(self) -> None:
        """Let all rows through; without a filter: follow the newest; then give the screen back."""
        if self._typed:
            self.narrow("")
        elif self._at is not None:
            self._follow()
        else:
            self.post_message(MessageChosen(None, is_over=True))

    def on_mouse_scroll_up(self) -> None:
        if self._found and self._at is None:
            self._choose(self._place)

    def click(self, x: int, y: int) -> None:
        self._choose(y)

    def _follow(self) -> None:
        self._at = None
        self.post_message(MessageChosen(None))

    def _choose(self, place: int) -> None:
        self._at = self._found[place]
        self.keep_in_view(place)
        self.post_message(MessageChosen(self._row(self._at)))

    # -- the filter ------------------------------------------------------------------------------------

    def narrow(self, text: str) -> None:
        """Let through what a condition says; one that cannot be read leaves the last in force."""
        from trcvtui.engine.message_filter import read_filter  # read when first asked for

        self._typed, self.wrong = text.strip(), ""
        project, selected = self._view_model.project, self._view_model.selected
        try:
            if not self._typed or project.instance(selected) is None:
                self._passes = lambda shown: True
            else:
                self._passes = read_filter(self._typed, project, selected)
        except UserError as wrong:
            self.wrong = wrong.lines()[0]
        else:
            self.text = self._typed
            self._begin_anew()

    def words(self) -> str:
        """Return what is to be known of the rows as a whole, for the title."""
        known = self._known
        size = f"{len(known.rows)} of {known.count}" if len(known.rows) != known.count else f"{known.count}"
        passing = f"{len(self._found)} of {size} with {self.text}" if self.text else size
        words = [self.wrong, f"{self._view_model.selected}, {passing}"]
        if known.oldest >= known.stop and known.rows:
            words.append("all values gone")
        elif known.oldest > known.first:
            words.append(f"values from {known.rows[known.oldest - known.first].number} on")
        words.append(f"{known.left_out} left out" if known.left_out else "")
        words.append(f"reading … {known.share:.0%}" if known.share < 1 else "")
        words.append("frozen" if self._view_model.is_frozen else "" if self.is_followed else "end follows")
        return " · ".join(filter(None, words))


class MessageHead(OneLine):
    """The names of the columns; of a path the beginning and the end."""

    def __init__(self, list_: MessageList) -> None:
        super().__init__(id="message-head")
        self._list = list_

    def line(self) -> Row:
        names = [pad(column.name, width, right=True) for column, width in self._list.columns]
        names += [self._list.member(leaf.path) for leaf in self._list.leaves]
        return row((" " + "".join(names), "dim"))
