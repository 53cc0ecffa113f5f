"""The base of every pane. A pane draws its own lines and repaints only the lines that changed.

A subclass returns the number of its rows and, for each row, texts with the names of their styles. Text is
never markup. Control characters in rows and titles are spelled out, so that a partner's bytes stay text.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from time import monotonic
from typing import ClassVar, Final, NamedTuple, Self

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.binding import Binding, BindingType
from textual.content import Content
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.selection import Selection
from textual.strip import Strip
from textual.widget import Widget

from trcvtui.tui.formatting import measure, plain
from trcvtui.tui.widgets.theme import compose_style

Part = tuple[str, str]


class Row(NamedTuple):
    """One line: its parts as (text, style names), and a style that lies under the styles of all parts."""

    parts: tuple[Part, ...] = ()
    style: str = ""


EMPTY = Row()
BAR_KEPT_S: Final = 5.0  # a scroll bar that comes twice within this time stays


def hidden_bindings(actions: Mapping[str, str]) -> list[BindingType]:
    """Return bindings that no footer shows. `actions` maps keys, separated by commas, to an action."""
    return [Binding(keys, action, show=False) for keys, action in actions.items()]


# Keys that move in rows: arrows, and vi's letters unless they mean something else.
ARROW_KEYS: Final = hidden_bindings({
    "down": "move(1)", "up": "move(-1)", "pagedown": "page(1)", "pageup": "page(-1)", "home,g": "edge(-1)",
    "end,G": "edge(1)",
})  # fmt: skip
MOVES: Final = [*hidden_bindings({"down,j": "move(1)", "up,k": "move(-1)"}), *ARROW_KEYS[2:]]
LAMP_STYLES: Final = frozenset(("busy", "done", "error", "on", "warn"))  # styles that show a present state


def rule(width: int, *parts: Part) -> Row:
    """Return a row of these parts followed by a horizontal line to the end of the row."""
    used = sum(measure(text) for text, _ in parts)
    return Row((*parts, ("─" * max(0, width - used), "faint")))


def row(*parts: Part, style: str = "") -> Row:
    return Row(parts, style)


def pane_title(digit: int | None, name: str, detail: str = "") -> Content:
    """Return the title in the border of a pane; text, never markup."""
    mark = [(f"{digit} ", "bold $accent")] if digit is not None else []
    return Content.assemble(
        *mark, (plain(name), "bold"), (f" · {plain(detail)}" if detail else "", "not bold")
    )


class LineView(ScrollView, can_focus=True, inherit_bindings=False):
    """Rows of text. `KEYS` are the keys that the footer names while this pane has the focus."""

    BINDINGS: ClassVar[list[BindingType]] = MOVES
    DEFAULT_CSS = """
    LineView {
        overflow-x: hidden; overflow-y: auto; scrollbar-size-vertical: 1;
        background: $surface; color: $foreground;
        &:ansi { background: ansi_default; color: ansi_default; }
    }
    """
    KEYS: ClassVar[tuple[tuple[str, str], ...]] = ()

    def __init__(self, id: str) -> None:
        super().__init__(id=id)
        self._painted: dict[int, Row] = {}
        self._fresh: dict[int, Row] = {}  # rows that `show` has found changed
        self._ready_styles: dict[str, Style] = {}
        self._title = ""
        self.more_keys: tuple[tuple[str, str], ...] = ()  # of a mode, such as a search
        self._bar_came: deque[float] = deque(maxlen=2)  # when the scroll bar came
        self._bar_wanted = False
        self._is_over = self._paints = False
        self._strips_in_view: tuple[Region, list[Strip]] | None = None

    # -- for subclasses ------------------------------------------------------------------------------

    def row_count(self) -> int:
        raise NotImplementedError

    def row_at(self, y: int) -> Row:
        """Return row `y`, counted from 0 at the top of all rows."""
        raise NotImplementedError

    def keys(self) -> tuple[tuple[str, str], ...]:
        """Return the keys to name in the last line while this pane has the focus."""
        return (*self.more_keys, *self.KEYS)

    def cursor_style(self, is_chosen: bool) -> str:
        """Return the style of the row under the cursor, "" for any other row."""
        return "" if not is_chosen else "cursor" if self.has_focus else "cursor-blurred"

    # -- painting -----------------------------------------------------------------------------------

    def show(self) -> None:
        """Repaint the rows in view that differ from what was painted."""
        if not self.size.height:
            return
        self.apply_row_count()
        top, count = self.scroll_offset.y, self.row_count()
        for y in range(top, top + self.size.height):
            fresh = self.row_at(y) if y < count else EMPTY
            if self._painted.get(y) != fresh:
                self.refresh_line(y)
                self._fresh[y] = fresh
            else:
                self._fresh.pop(y, None)  # it changed, and changed back before it was painted

    def apply_row_count(self) -> None:
        """Apply the number of rows; lay the screen out again only if something would move."""
        count, height = self.row_count(), self.container_size.height
        is_wanted = 0 < height < count
        if is_wanted and not self._bar_wanted:
            self._bar_came.append(monotonic())
        self._bar_wanted = is_wanted
        if self.virtual_size.height == count:
            return
        bar_turns = height and is_wanted != self.show_vertical_scrollbar
        # A bar that comes or goes lays out the whole screen: half of the cost of a picture.
        bar_stays = len(self._bar_came) == 2 and monotonic() < self._bar_came[0] + BAR_KEPT_S
        if bar_turns and not is_wanted and bar_stays:
            count = height + 1  # one row more than fits keeps the bar
        elif bar_turns or self.styles.is_auto_height:
            self.virtual_size = Size(0, count)
            return
        self.set_reactive(LineView.virtual_size, Size(0, count))  # without a new layout
        if self.show_vertical_scrollbar:
            self.vertical_scrollbar.window_virtual_size = count
        self.scroll_y = self.validate_scroll_y(self.scroll_y)

    def refresh(
        self, *regions: Region, repaint: bool = True, layout: bool = False, recompose: bool = False
    ) -> Self:
        self._strips_in_view = None
        if not regions:
            self._fresh.clear()
        return super().refresh(*regions, repaint=repaint, layout=layout, recompose=recompose)

    def render_lines(self, crop: Region) -> list[Strip]:
        """Return the lines in view; while nothing has changed, the same lines as the last time.

        Textual asks every pane for all of its lines whenever a line of any pane has changed.
        """
        if self._strips_in_view is None or self._strips_in_view[0] != crop:
            self._paints = True
            self._strips_in_view = crop, super().render_lines(crop)
            self._paints = False
        return self._strips_in_view[1]

    def render_line(self, y: int) -> Strip:
        number = y + self.scroll_offset.y
        if not self._paints:  # Textual asks which character is under the mouse
            return self._strip(self._row_or_empty(number)).apply_offsets(0, number)
        fresh = self._fresh.pop(number, None) or self._row_or_empty(number)
        if len(self._painted) > 4 * self.size.height + 64:  # the bound: rows that scrolled away
            self._painted.clear()
        self._painted[number] = fresh
        return self._with_selection(self._strip(fresh), number)

    def _row_or_empty(self, number: int) -> Row:
        return self.row_at(number) if number < self.row_count() else EMPTY

    @property
    def line_width(self) -> int:
        """Return the width of a row in columns, without the scrollbar."""
        return self.container_size.width - self.scrollbar_size_vertical

    def _strip(self, line: Row) -> Strip:
        base = self.named_style(line.style)
        segments = [
            Segment(plain(text), self.named_style(f"{style} {line.style}")) for text, style in line.parts
        ]
        strip, width = Strip(segments), self.line_width
        if strip.cell_length > width > 0:
            strip = Strip([*strip.crop(0, width - 1), Segment("…", base)])
        return strip.adjust_cell_length(width, base)

    # -- selecting text by mouse --------------------------------------------------------------------

    def _with_selection(self, strip: Strip, number: int) -> Strip:
        span = self.text_selection.get_span(number) if self.text_selection is not None else None
        if span is None:
            return strip
        ends = [measure(strip.text[:place]) if place >= 0 else strip.cell_length for place in span]
        before, chosen, after = strip.divide([*ends, strip.cell_length])
        marked = [
            Segment(text, (style or Style()) + Style(reverse=not (style and style.reverse)))
            for text, style, _ in chosen
        ]
        return Strip([*before, *marked, *after], strip.cell_length)

    def get_selection(self, selection: Selection) -> tuple[str, str]:
        """Return the selected text as it is drawn; a missing start or end means the edge of the view."""
        top = self.scroll_offset.y
        first = selection.start.y if selection.start is not None else top
        last = selection.end.y if selection.end is not None else top + self.size.height - 1
        lines = []
        for number in range(first, last + 1):
            start, end = selection.get_span(number) or (0, 0)
            text = self._strip(self._row_or_empty(number)).text
            lines.append(text[start : end if end >= 0 else None].rstrip())
        return "\n".join(lines), "\n"

    def text_select_all(self) -> None:
        """Select nothing on a double click; the second click acts like a first click."""

    @property
    def select_container(self) -> Widget:
        """Return the pane itself, so that a triple click selects no more than a double click."""
        return self

    async def on_event(self, event: events.Event) -> None:
        """Drop the click that ends a selection, as it would press the row or button under the mouse."""
        if not (isinstance(event, events.Click) and self.screen.selections):
            await super().on_event(event)

    # -- looks -------------------------------------------------------------------------------------

    def set_stale(self, is_over: bool) -> None:
        """If `is_over`, draw the lamps grey, as they are out of date. Else draw the lamps in colour."""
        self._is_over = is_over
        self._ready_styles.clear()
        self.refresh()

    def named_style(self, names: str) -> Style:
        """Return the style for style names such as `cursor dim`. Each style is made once for a theme."""
        if self._is_over:
            names = " ".join("faint" if name in LAMP_STYLES else name for name in names.split())
        if names not in self._ready_styles:
            self._ready_styles[names] = compose_style(self, names.split())
        return self._ready_styles[names]

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._ready_styles.clear()
        self._strips_in_view = None

    def on_mount(self) -> None:
        self.apply_row_count()

    def on_resize(self) -> None:
        """Draw again: rows may have changed while the pane was hidden, and lines may wrap elsewhere."""
        self.show()

    def watch_show_vertical_scrollbar(self) -> None:
        """Wrap lines again: a new scrollbar takes a column, but there is no Resize event."""
        self.show()

    def on_focus(self) -> None:
        self.show()

    on_blur = on_focus

    def set_title(self, digit: int | None, name: str, detail: str = "") -> None:
        title = f"{digit} {name} {detail}"
        if title == self._title:
            return
        self._title = title
        self.border_title = pane_title(digit, name, detail)

    # -- moving -------------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        self.scroll_to(y=self.scroll_offset.y + rows, animate=False)

    def action_page(self, pages: int) -> None:
        self.action_move(pages * max(1, self.size.height - 1))

    def action_edge(self, direction: int) -> None:
        self.action_move(direction * self.row_count())

    def keep_in_view(self, y: int) -> None:
        """Scroll as little as needed to have row `y` in view."""
        top, height = self.scroll_offset.y, self.size.height
        if y < top:
            self.scroll_to(y=y, animate=False)
        elif height and y >= top + height:
            self.scroll_to(y=y - height + 1, animate=False)

    def on_click(self, event: events.Click) -> None:
        place = self.place_of(event)
        if place is not None and place[1] < self.row_count():
            self.click(*place)

    def click(self, x: int, y: int) -> None:
        """Handle a click on column `x` of row `y`."""

    def place_of(self, event: events.MouseEvent) -> tuple[int, int] | None:
        """Return column and row (of all rows) under the mouse, None outside the rows."""
        offset = event.get_content_offset(self)
        return None if offset is None else (offset.x, offset.y + self.scroll_offset.y)


class OneLine(LineView, can_focus=False):
    """A line that never scrolls: header, tabs, keys, column headings."""

    DEFAULT_CSS = "OneLine { height: 1; }"

    def row_count(self) -> int:
        return 1

    def row_at(self, y: int) -> Row:
        return self.line()

    def line(self) -> Row:
        raise NotImplementedError


class TextView(LineView):
    """A view that makes all rows at once by `make_rows`, again for each width. `_rows` has these rows."""

    def __init__(self, id: str) -> None:
        super().__init__(id=id)
        self._rows: list[Row] = []

    def make_rows(self) -> list[Row]:
        """Return all rows, wrapped for the present width."""
        return self._rows

    def draw(self) -> None:
        self._rows = self.make_rows()
        self.apply_row_count()  # also while it has no height yet
        self.show()

    def on_resize(self) -> None:
        self.draw()

    def row_count(self) -> int:
        return len(self._rows)

    def row_at(self, y: int) -> Row:
        return self._rows[y]
