"""The list of `trcvtui fleet`. A row is a production line or a group's head; only rows in view are made.

Rule: the list is sorted again while you read. The cursor stays on the worst row until you move the cursor.
From then on the cursor stays on the same line, and this line keeps its place on the screen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, Final, NamedTuple

from textual import events
from textual.binding import BindingType

from trcvtui.fleet.fleet_list import Entry, GroupHead
from trcvtui.fleet.seen_fleet import AWAY, ERROR, FINDING, GOOD, HAD, OFFLINE, STALE, STATES, STUCK, FleetLine
from trcvtui.tui.formatting import SECOND, clip, clip_middle, pad, plain
from trcvtui.tui.messages import FleetEntryOpened
from trcvtui.tui.widgets.line_view import MOVES, LineView, OneLine, Part, Row, hidden_bindings, row
from trcvtui.wording import age_text, count

STATE_WIDTH, CODE_WIDTH, SINCE_WIDTH, SPARK_WIDTH, HOUR = 13, 5, 7, 12, 5  # columns
FIXED_WIDTH: Final = 4 + STATE_WIDTH + CODE_WIDTH + 1 + SINCE_WIDTH + 1 + SPARK_WIDTH + HOUR
NAME: Final = 32  # columns; the text of the STATUS gets the rest
LEAST_TEXT_WIDTH, MOST_TEXT_WIDTH = 12, 60
STATE_STYLES: Final = {  # by the state of a line: the lamp, its style, the style of the words
    OFFLINE: ("✗", "error", "error"),
    STALE: ("✗", "error", "error"),
    ERROR: ("■", "error", "error"),
    FINDING: ("▲", "warn", "warn"),
    STUCK: ("▲", "warn", "warn"),
    AWAY: ("□", "warn", "warn"),
    HAD: ("◆", "warn", ""),
    GOOD: ("■", "done", ""),
}
SPARK_BLOCKS: Final = "·▁▂▃▄▅▆▇█"  # none, 1, 2 and more, 4 and more .. 128 and more
NO_AGENT_LINES: Final = (
    "  no line yet: no agent has published below trcvtui/v1",
    "  trcvtui agent PROJECT.toml --mqtt ... publishes a project",
)


def spark_parts(errors: Sequence[int]) -> list[Part]:
    """Return a sparkline; all lines have the same scale, so that you can compare rows."""
    drawn = "".join(SPARK_BLOCKS[min(each.bit_length(), len(SPARK_BLOCKS) - 1)] for each in errors)
    return [(drawn, "error" if any(errors) else "faint")]


def age_since_text(t: float | None, wall: float) -> str:
    return "" if t is None else age_text(int(max(0.0, wall - t) * SECOND))


def state_of(line: FleetLine) -> str:
    """Return a line's state: offline, no scan, finding or stuck, else the state of its connection."""
    if line.shows in (ERROR, AWAY, HAD, GOOD):
        return line.figures.state if line.figures else "?"
    return STATES[line.shows]


def describe_status(line: FleetLine) -> str:
    """Return the worst instance's finding, or `5 of 8 bytes` if it is stuck, else its STATUS."""
    status = line.worst_instance.status if line.worst_instance is not None else None
    if status is None:
        return ""
    if line.shows == FINDING:
        return status.finding
    return f"{status.here} of {status.wanted} bytes" if line.shows == STUCK else status.text


class FleetColumns(NamedTuple):
    """Widths of the columns that depend on the width of the screen."""

    name: int
    text: int


def columns_of(width: int) -> FleetColumns:
    """Return the widths; the STATUS text gets width 0 if too little room remains beside the names."""
    left = max(8, width - FIXED_WIDTH)
    text = min(MOST_TEXT_WIDTH, left - NAME - 1)
    return FleetColumns(left - text - 1, text) if text >= LEAST_TEXT_WIDTH else FleetColumns(left, 0)


class FleetColumnHead(OneLine):
    def __init__(self) -> None:
        super().__init__(id="fleet-heads")

    def line(self) -> Row:
        columns = columns_of(self.line_width - 1)
        names = [
            pad("   site/agent/line", columns.name + 4),
            pad("state", STATE_WIDTH),
            pad("STATUS", CODE_WIDTH + 1 + columns.text + bool(columns.text)),
            pad("since", SINCE_WIDTH, right=True),
            pad(" errors an hour", SPARK_WIDTH + HOUR + 1, right=True),
        ]
        return row(("".join(names), "dim"))


class FleetTable(LineView, inherit_bindings=False):
    KEYS: ClassVar = (("↑↓", "line"), ("enter", "card"))
    BINDINGS: ClassVar[list[BindingType]] = [
        *MOVES[:4],  # `g` groups
        *hidden_bindings({"home": "edge(-1)", "end,G": "edge(1)", "enter,right": "open", "left": "shut"}),
    ]

    def __init__(self, wall: Callable[[], float]) -> None:
        super().__init__(id="fleet-table")
        self._wall = wall
        self.entries: Sequence[Entry] = ()
        self.cursor = 0
        self._is_moved = False  # by a key or the mouse (the rule)
        self.nothing: Sequence[str] = NO_AGENT_LINES

    # -- what is shown ------------------------------------------------------------------------------

    @property
    def chosen_entry(self) -> Entry | None:
        return self.entries[self.cursor] if self.cursor < len(self.entries) else None

    def set_entries(self, entries: Sequence[Entry]) -> None:
        here, before, top = self.chosen_entry, self.cursor, self.scroll_offset.y
        self.entries = entries
        place = _find_row(here, entries) if self._is_moved else 0
        self.cursor = min(before, max(0, len(entries) - 1)) if place is None else place
        self.apply_row_count()
        if self._is_moved and self.cursor != before:  # its line keeps its place on the screen (the rule)
            self.scroll_to(y=top + self.cursor - before, animate=False)
        self.show()

    def row_count(self) -> int:
        return len(self.entries) or len(self.nothing)

    def row_at(self, y: int) -> Row:
        if not self.entries:
            return row((self.nothing[y], "dim"))
        entry, columns = self.entries[y], columns_of(self.line_width - 1)
        parts = self._group(entry, columns) if isinstance(entry, GroupHead) else self._line(entry, columns)
        mark = ("▸" if y == self.cursor else " ", "key")
        return row(mark, *parts, style=self.cursor_style(y == self.cursor))

    def _line(self, line: FleetLine, columns: FleetColumns) -> list[Part]:
        wall, worst = self._wall(), line.worst_instance
        lamp, lamp_style, style = STATE_STYLES[line.shows]
        name = plain(f"{line.agent.site}/{line.agent.name}/{line.name}")
        code = worst.status.status if worst is not None and worst.status is not None else ""
        last = line.newest_error if line.errors_hour and line.shows != ERROR else None
        more = f" was {last.status}" if last is not None and last.status else ""
        more += f" +{len(line.instances) - 1}" if len(line.instances) > 1 else ""
        more += " clock?" if line.agent.skew_s else ""
        return [
            (f"{lamp} ", lamp_style),
            (pad(clip_middle(name, columns.name), columns.name + 1), "strong"),
            (pad(clip(plain(state_of(line)), STATE_WIDTH - 1), STATE_WIDTH), style),
            (pad(code, CODE_WIDTH), "error" if line.shows == ERROR else style),
            *self._text(plain(describe_status(line)), more, columns.text, style),
            *self._hour(age_since_text(line.shown_since(wall), wall), line.sparkline(wall), line.errors_hour),
        ]

    def _text(self, text: str, more: str, width: int, style: str) -> list[Part]:
        return [(pad(clip(text, width - len(more)), width - len(more)) + f"{more} ", style)] if width else []

    def _group(self, group: GroupHead, columns: FleetColumns) -> list[Part]:
        sick = "".join(f" · {number} {STATES[shows]}" for shows, number in group.shown)
        style = "error" if any(shows <= ERROR for shows, _ in group.shown) else "warn" if sick else "dim"
        words = f"  {count(group.lines, 'line')}{sick}"
        room = columns.name + STATE_WIDTH + CODE_WIDTH + 1 + columns.text + bool(columns.text)
        name = clip(plain(group.name), max(8, room - len(words) - 1))
        return [
            ("● ", style) if sick else ("◆ ", "warn") if group.errors_an_hour else ("○ ", "done"),
            (name, "strong"),
            (pad(clip(words, room - len(name)), room - len(name)), style),
            *self._hour("", group.sparkline, group.errors_an_hour),
        ]

    def _hour(self, since: str, errors: Sequence[int], hour: int) -> list[Part]:
        return [
            (pad(clip(since, SINCE_WIDTH), SINCE_WIDTH, right=True), "dim"),
            (" ", ""),
            *spark_parts(errors),
            (pad(str(hour) if hour < 10_000 else "9999+", HOUR, right=True), "strong" if hour else "faint"),
        ]

    # -- moving -------------------------------------------------------------------------------------

    def go_to(self, cursor: int) -> None:
        self._is_moved = True
        self.cursor = max(0, min(len(self.entries) - 1, cursor))
        self.keep_in_view(self.cursor)
        self.show()

    def action_move(self, rows: int) -> None:
        self.go_to(self.cursor + rows)

    def action_edge(self, direction: int) -> None:
        """Go to the last or the first row; after a move to the first, the cursor stays on the worst row."""
        self.go_to(direction * len(self.entries))
        self._is_moved = direction > 0

    def action_open(self) -> None:
        if self.chosen_entry is not None:
            self.post_message(FleetEntryOpened(self.chosen_entry))

    def action_shut(self) -> None:
        for y in range(self.cursor, -1, -1):
            if isinstance(self.entries[y] if y < len(self.entries) else None, GroupHead):
                self.go_to(y)
                return

    def on_click(self, event: events.Click) -> None:
        place = self.place_of(event)
        if place is None or place[1] >= len(self.entries):
            return
        # The first click only moves the cursor, unless it is already on this row by your choice.
        is_open = place[1] == self.cursor and (self._is_moved or event.chain > 1)
        self.go_to(place[1])
        if is_open:
            self.action_open()


def _find_row(entry: Entry | None, entries: Sequence[Entry]) -> int | None:
    if isinstance(entry, GroupHead):
        name = entry.name
        found = (y for y, each in enumerate(entries) if isinstance(each, GroupHead) and each.name == name)
    else:
        found = (y for y, each in enumerate(entries) if each is entry)
    return next(found, None)
