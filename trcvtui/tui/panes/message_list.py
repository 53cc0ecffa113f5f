"""The messages of the selected instance, one in each row, the newest last.

Rule: only rows in view are drawn from their bytes, so 10,000 rows take no more time than one page.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.history.messages import MessageRow
from trcvtui.history.records import MAX_SCAN
from trcvtui.project.project import DataDecl
from trcvtui.tui.formatting import clip, clip_middle, measure, pad, plain
from trcvtui.tui.messages import MessageChosen
from trcvtui.tui.view_model.known_messages import KnownMessages
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, OneLine, Part, Row, hidden_bindings, row
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode_leaves
from trcvtui.wording import format_ns, stamp_text

if TYPE_CHECKING:
    from trcvtui.engine.message_filter import Filter


class MessageColumn(NamedTuple):
    """A column to the left of the members. The column gets wider if the newest message needs more room."""

    name: str
    width: int
    text: Callable[[MessageRow], str]
    style: str = "dim"


MESSAGE_COLUMNS: Final = (
    MessageColumn("n", 5, lambda shown: str(shown.number)),
    MessageColumn("scan", 7, lambda shown: str(shown.scan)),
    MessageColumn("t in s", 9, lambda shown: stamp_text(shown.t_ns)),
    MessageColumn("gap", 9, lambda shown: "" if shown.gap_ns is None else clip(format_ns(shown.gap_ns), 8)),
    MessageColumn("B", 6, lambda shown: str(shown.size), "strong"),
    MessageColumn("STATUS", 7, lambda shown: f"{shown.status:04X}" if shown.status >= 0 else "", ""),
)
LEAST_SCAN_WIDTH: Final = 96  # columns of the pane from which there is room for the scan
LEAST_WIDTH, ENOUGH_WIDTH, MOST_WIDTH = 6, 9, 18  # columns of a member; below ENOUGH_WIDTH none is cut


def all_pass(shown: MessageRow) -> bool:
    return True


class MessageLines(LineView):
    """The rows that match the filter. Until you choose a row, the newest row is the chosen one.

    In a replay, all rows of the recording are listed. The newest row is then the last row up to the shown
    scan.
    """

    KEYS: ClassVar = (("↑↓", "message"), ("end", "follow"), ("/", "filter"), ("y", "CSV"), ("D", "DATA now"))
    BINDINGS: ClassVar = hidden_bindings({
        "n,right_square_bracket": "move(1)", "N,left_square_bracket": "move(-1)", "escape": "leave",
    })  # fmt: skip

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="messages")
        self._view_model = view_model
        self._typed = self._text = self._wrong = ""  # filter: as typed, in force, its mistake
        self._passes: Filter = all_pass
        self._source: tuple[KnownMessages, str] | None = None  # whose rows are listed
        self._declared: DataDecl | None = None  # DATA of the members and the filter
        self._listed: list[int] = []  # rows that pass, by number from 0 among all of the instance
        self._filtered_to, self._oldest = 0, 0  # filtered up to here; first with values
        self._at: int | None = None  # number of the chosen row, None: the newest
        self.columns: list[tuple[MessageColumn, int]] = []  # with their widths
        self.members: list[tuple[Leaf, int]] = []
        self._longest: dict[str, int] = {}  # text of each member that was drawn

    # -- rows ------------------------------------------------------------------------------------------

    @property
    def _known_messages(self) -> KnownMessages:
        """Return the known messages of the selected instance, or none if they are of another instance."""
        known = self._view_model.known_messages
        return known if known.instance == self._view_model.selected else KnownMessages()

    def _row(self, number: int) -> MessageRow | None:
        """Return a row, or None if the row was dropped since `show`."""
        known = self._known_messages
        return known.rows[number - known.first] if known.first <= number < known.next_number else None

    def rows(self) -> list[MessageRow]:
        return [shown for number in self._listed if (shown := self._row(number)) is not None]

    def find_current_row(self) -> MessageRow | None:
        return self._row(self._listed[self._chosen_place]) if self._chosen_place >= 0 else None

    @property
    def follows_newest(self) -> bool:
        return self._at is None

    @property
    def _chosen_place(self) -> int:
        """Return the index of the chosen row among filtered rows, or -1 if none is up to the shown scan."""
        last = len(self._listed) - 1
        if self._at is not None:
            return min(last, bisect_left(self._listed, self._at))
        if self._shown_scan == MAX_SCAN:
            return last
        return bisect_right(self._listed, self._shown_scan, key=self._scan_of) - 1

    @property
    def _shown_scan(self) -> int:
        """Return the shown scan of a replay: later messages are drawn faint."""
        position = self._view_model.position
        return position.scan if position is not None else MAX_SCAN

    def _scan_of(self, number: int) -> int:
        shown = self._row(number)
        return shown.scan if shown is not None else 0

    def follow_newest(self) -> None:
        self._at = None

    def show(self) -> None:
        self._catch_up()
        self._measure()
        self.apply_row_count()
        if self._at is None:
            self.keep_in_view(max(0, self._chosen_place))
        super().show()

    def _catch_up(self) -> None:
        view_model, known = self._view_model, self._known_messages
        of = view_model.known_messages, view_model.selected
        if of != self._source or view_model.message_type is not self._declared:
            self._at = self._at if of == self._source else None
            self._source, self._declared, self._longest = of, view_model.message_type, {}
            self._forget_rows()
            self._text, self._passes = "", all_pass
            self.set_filter(self._typed)
        if known.next_number < self._filtered_to:
            self._forget_rows()
        if gone := bisect_left(self._listed, known.first):
            del self._listed[:gone]
            if self._at is not None:  # what is in view stays in view
                self.scroll_to(y=max(0, self.scroll_offset.y - gone), animate=False)
        if self._oldest != known.first_full:  # without values a condition on members is false
            first, stop = (bisect_left(self._listed, each) for each in (self._oldest, known.first_full))
            self._oldest, self._listed[first:stop] = known.first_full, self._filter(self._listed[first:stop])
        self._listed += self._filter(range(max(self._filtered_to, known.first), known.next_number))
        self._filtered_to = known.next_number

    def _filter(self, rows: range | list[int]) -> list[int]:
        return [each for each in rows if (shown := self._row(each)) is not None and self._passes(shown)]

    def _forget_rows(self) -> None:
        self._listed, self._filtered_to, self._oldest = [], 0, 0

    def _measure(self) -> None:
        """Make each column as wide as its texts, and add members until the row has no room left."""
        last = self._row(self._listed[-1]) if self._listed else None
        self.columns = [
            (each, max(each.width, len(each.text(last)) + 1 if last is not None else 0))
            for each in MESSAGE_COLUMNS
            if each.name != "scan" or self.line_width >= LEAST_SCAN_WIDTH
        ]
        room = self.line_width - 1 - sum(width for _, width in self.columns)
        layout, self.members = self._declared.layout if self._declared is not None else None, []
        for leaf in layout.leaves(0, min(max(0, room) // LEAST_WIDTH, layout.leaf_count)) if layout else ():
            longest = max(measure(leaf.path), self._longest.get(leaf.path, 0))
            width = min(max(LEAST_WIDTH, longest + 1), MOST_WIDTH, room)
            if width <= longest and width < ENOUGH_WIDTH:
                break
            self.members.append((leaf, width))
            room -= width

    # -- drawing ---------------------------------------------------------------------------------------

    def row_count(self) -> int:
        return len(self._listed)

    def row_at(self, y: int) -> Row:
        shown = self._row(self._listed[y]) if y < len(self._listed) else None
        if shown is None:
            return EMPTY
        is_chosen, is_to_come = y == self._chosen_place, shown.scan > self._shown_scan
        parts = ((text, "faint" if is_to_come else style) for text, style in self._parts(shown))
        return row(("▸" if is_chosen else " ", "key"), *parts, style=self.cursor_style(is_chosen))

    def _parts(self, shown: MessageRow) -> Iterator[Part]:
        for column, width in self.columns:
            yield pad(column.text(shown), width, right=True), "warn" if shown.reason else column.style
        content = shown.content or b""
        if shown.reason:
            yield f"  {shown.reason}", "warn"
        elif self._declared is not None:
            values = decode_leaves(self._declared.layout, content, 0, len(self.members))
            for (leaf, width), value in zip(self.members, values, strict=True):
                part = content[leaf.offset : leaf.offset + leaf.size]
                text = plain(value_text(leaf, value, part)) if value is not None else ""
                self._longest[leaf.path] = max(measure(text), self._longest.get(leaf.path, 0))
                yield fit_text(text, width), "printable"

    # -- moving ----------------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        place = self._chosen_place
        if place >= 0 if rows < 0 else place < len(self._listed) - 1 or self._at is not None:
            self._choose(place + rows)

    def action_edge(self, direction: int) -> None:
        if direction < 0:
            self._choose(0)
        else:
            self._at = None
            self.post_message(MessageChosen(None))

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        return action != "leave" or bool(self._typed) or self._at is not None

    def action_leave(self) -> None:
        """Clear the filter; if there is no filter, follow the newest message."""
        if self._typed:
            self.set_filter("")
        else:
            self.action_edge(1)

    def on_mouse_scroll_up(self) -> None:
        if self._at is None and self._chosen_place >= 0:
            self._choose(self._chosen_place)

    def click(self, x: int, y: int) -> None:
        self._choose(y)

    def _choose(self, place: int) -> None:
        if self._listed:
            place = max(0, min(len(self._listed) - 1, place))
            self._at = self._listed[place]
            self.keep_in_view(place)
            self.post_message(MessageChosen(self.find_current_row()))

    # -- the filter ------------------------------------------------------------------------------------

    def set_filter(self, text: str) -> None:
        """Filter by a condition; if the condition has a mistake, the last filter stays in force."""
        from trcvtui.engine.message_filter import read_filter  # imported on first use

        self._typed, self._wrong = text.strip(), ""
        project, selected = self._view_model.project, self._view_model.selected
        # Without an instance (yet) the text is kept, and lets all through.
        has_filter = self._typed and project.instance(selected) is not None
        try:
            self._passes = read_filter(self._typed, project, selected) if has_filter else all_pass
            self._text = self._typed
            self._forget_rows()
        except UserError as wrong:
            self._wrong = wrong.lines()[0]

    def describe_rows(self) -> str:
        """Return the title's text: a mistake in the filter, the instance, row counts, remarks and state."""
        known, here = self._known_messages, len(self._known_messages.rows)
        size = f"{here} of {known.count}" if here != known.count else f"{here}"
        passing = f"{len(self._listed)} of {size} with {self._text}" if self._text else size
        state = "frozen" if self._view_model.is_frozen else "" if self.follows_newest else "end follows"
        words = self._wrong, f"{self._view_model.selected}, {passing}", *known.list_remarks(), state
        return " · ".join(filter(None, words))


class MessageHead(OneLine):
    def __init__(self, lines: MessageLines) -> None:
        super().__init__(id="message-head")
        self._lines = lines

    def line(self) -> Row:
        names = [pad(column.name, width, right=True) for column, width in self._lines.columns]
        names += [fit_text(leaf.path, width) for leaf, width in self._lines.members]
        return row((" " + "".join(names), "dim"))


def fit_text(text: str, width: int) -> str:
    """Return a text as wide as a member's column. A text that is too long loses its middle."""
    return pad(clip_middle(text, width - 1), width, right=True)
