"""The panes of the race: its head, the table scan by scan, the chosen scan in full."""

from __future__ import annotations

from typing import ClassVar, Final

from textual import events
from textual.binding import Binding, BindingType

from trcvtui.rig.scenario.race import InstanceRace, Note, Race, Row
from trcvtui.rig.scenario.race_report import DIALECT_NAMES, summary
from trcvtui.tui.formatting import count, pad, plain, wrapped
from trcvtui.tui.messages import DialectToggled, RaceRowSelected
from trcvtui.tui.race.race_lines import detail_lines, head_parts, row_parts
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, row
from trcvtui.tui.widgets.line_view import Row as Line
from trcvtui.udt.literals import format_time

NAMES: Final = DIALECT_NAMES
Entry = Row | Note | str


class RaceHead(LineView, can_focus=False):
    """Two lines: what is raced, and the dialects as toggles, each with its digit."""

    DEFAULT_CSS = "RaceHead { height: 2; background: $background; padding: 0 1; }"

    def __init__(self) -> None:
        super().__init__(id="race-head")
        self._what: list[Part] = []
        self._chosen: tuple[str, ...] = ()

    def draw(self, what: list[Part], chosen: tuple[str, ...]) -> None:
        """Show this."""
        self._what, self._chosen = what, chosen
        self.show()

    def row_count(self) -> int:
        """Return 2."""
        return 2

    def row_at(self, y: int) -> Line:
        """Return a line."""
        if y == 0:
            return row(*self._what)
        parts: list[Part] = [("dialects  ", "dim")]
        for digit, name in enumerate(NAMES, 1):
            on = name in self._chosen
            parts += [(f"{digit}", "key"), (" ■ " if on else " □ ", "on" if on else "faint")]
            parts += [(name, "strong" if on else "dim"), ("  ", "")]
        return row(*parts)

    def on_click(self, event: events.Click) -> None:
        """Toggle the dialect under the mouse."""
        place, left = self.place_of(event), len("dialects  ")
        if place is None or place[1] != 1:
            return
        for digit, name in enumerate(NAMES, 1):
            right = left + 4 + len(name)
            if left <= place[0] < right:
                self.post_message(DialectToggled(digit))
            left = right + 2


class RaceColumns(LineView, can_focus=False):
    """The names above the columns, in the frame of the table."""

    DEFAULT_CSS = "RaceColumns { height: 1; }"

    def __init__(self) -> None:
        super().__init__(id="race-columns")
        self.raced: InstanceRace | None = None

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def row_at(self, y: int) -> Line:
        """Return the names."""
        return row(*head_parts(self.raced, self.line_width - 1)) if self.raced and not y else EMPTY


class RaceTable(LineView, inherit_bindings=False):
    """One line for each run of scans in which nothing changes, then the notes; the cursor chooses one."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "move(1)", show=False),
        Binding("up,k", "move(-1)", show=False),
        Binding("pagedown", "page(1)", show=False),
        Binding("pageup", "page(-1)", show=False),
        Binding("home,g", "edge(-1)", show=False),
        Binding("end,G", "edge(1)", show=False),
    ]

    def __init__(self) -> None:
        super().__init__(id="race-table")
        self.raced: InstanceRace | None = None
        self.only_differing = False
        self.cursor = 0
        self.entries: list[Entry] = []

    def take(self, raced: InstanceRace | None, race: Race | None) -> None:
        """Show another instance or race; the cursor stays with its scan."""
        here = self.chosen
        self.raced = raced
        rows = raced.rows if raced is not None else ()
        self.entries = [each for each in rows if each.differs or not self.only_differing]
        if race is not None and race.notes:
            self.entries += ["notes", *race.notes]
        scan = here.scan if isinstance(here, Row) else 0
        places = [n for n, each in enumerate(self.entries) if isinstance(each, Row) and each.scan <= scan]
        self.cursor = places[-1] if places else 0
        self.refresh()
        self.show()
        self.keep_in_view(self.cursor)

    @property
    def chosen(self) -> Entry | None:
        """Return what stands under the cursor."""
        return self.entries[self.cursor] if self.cursor < len(self.entries) else None

    def row_count(self) -> int:
        """Return the number of lines."""
        return max(1, len(self.entries))

    def row_at(self, y: int) -> Line:
        """Return one line."""
        if y >= len(self.entries):
            return row(("no scan was called", "dim")) if self.raced and not y else EMPTY
        entry = self.entries[y]
        style = ("cursor" if self.has_focus else "cursor-blurred") if y == self.cursor else ""
        match entry:
            case str():
                return row((f"  {entry}", "strong"), style=style)
            case Note():
                return row((f"  {entry.dialect}: ", "warn"), (note_text(entry), "dim"), style=style)
            case Row():
                assert self.raced is not None
                return row(*row_parts(entry, self.raced, self.line_width - 1), style=style)

    def go_to(self, cursor: int) -> None:
        """Choose a line."""
        self.cursor = max(0, min(len(self.entries) - 1, cursor))
        self.keep_in_view(self.cursor)
        self.show()
        self.post_message(RaceRowSelected())

    def action_move(self, rows: int) -> None:
        """Choose another line."""
        self.go_to(self.cursor + rows)

    def difference(self, step: int) -> bool:
        """Go to the next row in which they differ, or the one before; return whether there is one."""
        places = range(self.cursor + step, len(self.entries) if step > 0 else -1, step)
        found = (n for n in places if isinstance(each := self.entries[n], Row) and each.differs)
        place = next(found, None)
        if place is not None:
            self.go_to(place)
        return place is not None

    def on_click(self, event: events.Click) -> None:
        """Choose the line under the mouse."""
        place = self.place_of(event)
        if place is not None and place[1] < len(self.entries):
            self.go_to(place[1])


class RaceScan(LineView):
    """The chosen scan in words, or a note in full."""

    def __init__(self) -> None:
        super().__init__(id="race-scan")
        self._rows: list[Line] = []
        self._shown: tuple[Entry | None, InstanceRace | None, int] = (None, None, 0)

    def draw(self, entry: Entry | None, raced: InstanceRace | None, interval_ns: int) -> None:
        """Show what is chosen."""
        self._shown = entry, raced, interval_ns
        self._break()

    def on_resize(self) -> None:
        """Break the lines anew."""
        self._break()

    def _break(self) -> None:
        entry, raced, interval_ns = self._shown
        if isinstance(entry, Row) and raced is not None:
            self._rows = [row(*parts) for parts in detail_lines(entry, raced, interval_ns)]
        elif isinstance(entry, Note):
            lines = wrapped(f"{entry.dialect}: {note_text(entry)}", max(20, self.line_width))
            self._rows = [row((line, "")) for line in lines]
        else:
            self._rows = []
        self.show()

    def row_count(self) -> int:
        """Return the number of lines."""
        return len(self._rows)

    def row_at(self, y: int) -> Line:
        """Return one line."""
        return self._rows[y] if y < len(self._rows) else EMPTY


def note_text(note: Note) -> str:
    """Return what a note says."""
    return plain(f"step {note.step}: {note.text}" if note.step else note.text)


def race_parts(race: Race, hidden: int) -> list[Part]:
    """Return the first line of the head: which race, how long, what was left out."""
    told = [f"{count(race.scans, 'scan')} of {format_time(race.interval_ns)}"]
    if hidden:
        told.append(f"shown since the mark behind scan {hidden}")
    if race.expectations:
        told.append(f"{race.expectations} expect left out")
    if race.notes:
        told.append(f"{count(len(race.notes), 'note')} below")
    return [(pad("race", 10), "dim"), (plain(race.name), "strong"), (f" · {' · '.join(told)}", "dim")]


def instance_title(raced: InstanceRace, place: int, instances: int) -> str:
    """Return what the frame of the table says of an instance."""
    which = f" {place + 1}/{instances}" if instances > 1 else ""
    return f"{plain(raced.instance)} ({raced.block}){which} · {summary(raced)}"
