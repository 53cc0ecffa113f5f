"""The panes of the race: its head, the table scan by scan, the chosen scan in full."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Final

from textual import events
from textual.binding import BindingType

from trcvtui.scenario.race import (
    CALLED,
    DIALECT_NAMES,
    InstanceRace,
    Note,
    Race,
    ScanRow,
    Shown,
    summary,
    title_of,
)
from trcvtui.tui.formatting import clip, count, lamp, moment, pad, plain, wrapped
from trcvtui.tui.messages import DialectToggled, RaceRowSelected
from trcvtui.tui.widgets.line_view import EMPTY, MOVES, LineView, OneLine, Part, Row, TextView, row
from trcvtui.udt.literals import format_time

SCANS, SIGN = 13, 3  # columns of the scan numbers, and of the sign that marks a difference
DIFFERS: Final = "≠"
LAMPS: Final = ("BUSY", "DONE", "ERROR")
LAMP_STYLES: Final = {"BUSY": "busy", "DONE": "done", "ERROR": "error"}
DRAWN: Final = 25  # columns from which on the lamps are drawn as in the list of instances
TITLED: Final = 46  # columns from which on the words of the STATUS stand beside it


def column_width(width: int, dialects: int) -> int:
    return max(8, (width - SCANS - SIGN) // max(1, dialects))


def head_parts(raced: InstanceRace, width: int) -> list[Part]:
    """Return the names above the columns."""
    each = column_width(width, len(raced.dialects))
    names = [(pad(clip(name, each - 1), each), "strong") for name in raced.dialects]
    return [(pad("scan", SCANS - 1, right=True), "dim"), (" " * (SIGN + 1), ""), *names]


def row_parts(row: ScanRow, raced: InstanceRace, width: int) -> list[Part]:
    """Return one run of equal scans."""
    differs = row.differs
    parts: list[Part] = [
        (pad(scans_of(row), SCANS - 1, right=True), "strong" if differs else "dim"),
        (f" {DIFFERS if differs else ' '}  ", "warn strong"),
    ]
    each = column_width(width, len(raced.dialects))
    for number, (dialect, shown) in enumerate(zip(raced.dialects, row.shown, strict=True)):
        changed = _changed(row, number)
        parts += _cut(list(_cell(shown, raced.block, dialect, changed, each)), each)
    return parts


def scans_of(row: ScanRow) -> str:
    return str(row.scan) if row.scans == 1 else f"{row.scan}-{row.scan + row.scans - 1}"


def _changed(row: ScanRow, number: int) -> frozenset[str]:
    """Return in what a dialect differs from the first one; the first from none."""
    first, shown = row.shown[0], row.shown[number]
    if not number or first == shown:
        return frozenset()
    if first is None or shown is None:
        return frozenset((CALLED, "STATUS"))
    names = ("STATUS", *LAMPS, "RCVD_LEN", "DATA")
    return frozenset(name for name in names if _value(first, name) != _value(shown, name))


def _value(shown: Shown, name: str) -> object:
    return getattr(shown, name.lower())


def _cell(
    shown: Shown | None, block: str, dialect: str, changed: frozenset[str], width: int
) -> Iterator[Part]:
    if shown is None:
        yield "not called" if width > DRAWN else "-", "changed" if changed else "faint"
        return
    yield f"{shown.status:04X}", f"{_status_style(shown)}{' changed' if 'STATUS' in changed else ''}"
    yield " ", ""
    for name in LAMPS:
        on = bool(_value(shown, name))
        text = f"{name[0]}{lamp(on)}" if width >= DRAWN else name[0] if on else "·"
        style = LAMP_STYLES[name] if on else "faint"
        yield text, f"{style}{' changed' if name in changed else ''}"
        if width >= DRAWN:
            yield " ", ""
    if shown.rcvd_len:
        yield " ", ""
        yield f"{shown.rcvd_len} B", "changed" if "RCVD_LEN" in changed else "strong"
    if "DATA" in changed:
        yield " ", ""
        yield "DATA", "changed"
    if width >= TITLED:
        yield f"  {title_of(dialect, block, shown.status)}", "dim"


def _status_style(shown: Shown) -> str:
    return "error" if shown.error else "done" if shown.done else "busy" if shown.busy else "strong"


def _cut(parts: list[Part], width: int) -> Iterator[Part]:
    left = width - 1
    for text, style in parts:
        if left > 0:
            yield clip(text, left), style
            left -= len(text)
    yield " " * (max(0, left) + 1), ""


# -- one row in full ---------------------------------------------------------------------------------------


def detail_lines(row: ScanRow, raced: InstanceRace, interval_ns: int) -> Iterator[list[Part]]:
    """Yield a row in words: when, in what they differ, then each dialect in full."""
    differs = f"{DIFFERS} {', '.join(row.differs)}" if row.differs else "all alike"
    when = f"scan {scans_of(row)} · {count(row.scans, 'scan')} from {moment((row.scan - 1) * interval_ns)} s"
    yield [(f"{when} · ", "dim"), (differs, "warn strong" if row.differs else "dim")]
    wide = max(len(name) for name in raced.dialects)
    for number, (dialect, shown) in enumerate(zip(raced.dialects, row.shown, strict=True)):
        parts: list[Part] = [(f"{dialect:<{wide}}  ", "strong")]
        if shown is None:
            yield [*parts, ("not called", "faint")]
            continue
        changed = _changed(row, number)
        parts += _cell(shown, raced.block, dialect, changed, DRAWN)
        if shown.data and "DATA" in row.differs:
            parts.append((f"  DATA {shown.data}", "changed" if "DATA" in changed else ""))
        yield [*parts, (f"  {title_of(dialect, raced.block, shown.status)}", "dim")]


NAMES: Final = DIALECT_NAMES
Entry = ScanRow | Note | str


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
        return 2

    def row_at(self, y: int) -> Row:
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


class RaceColumns(OneLine):
    """The names above the columns, in the frame of the table."""

    def __init__(self) -> None:
        super().__init__(id="race-columns")
        self.raced: InstanceRace | None = None

    def line(self) -> Row:
        """Return the names."""
        return row(*head_parts(self.raced, self.line_width - 1)) if self.raced else EMPTY


class RaceTable(LineView, inherit_bindings=False):
    """One line for each run of scans in which nothing changes, then the notes; the cursor chooses one."""

    BINDINGS: ClassVar[list[BindingType]] = MOVES

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
        scan = here.scan if isinstance(here, ScanRow) else 0
        places = [n for n, each in enumerate(self.entries) if isinstance(each, ScanRow) and each.scan <= scan]
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

    def row_at(self, y: int) -> Row:
        """Return one line."""
        if y >= len(self.entries):
            return row(("no scan was called", "dim")) if self.raced and not y else EMPTY
        entry = self.entries[y]
        style = self.cursor_style(y == self.cursor)
        match entry:
            case str():
                return row((f"  {entry}", "strong"), style=style)
            case Note():
                return row((f"  {entry.dialect}: ", "warn"), (note_text(entry), "dim"), style=style)
            case ScanRow():
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
        found = (n for n in places if isinstance(each := self.entries[n], ScanRow) and each.differs)
        place = next(found, None)
        if place is not None:
            self.go_to(place)
        return place is not None

    def on_click(self, event: events.Click) -> None:
        """Choose the line under the mouse."""
        place = self.place_of(event)
        if place is not None and place[1] < len(self.entries):
            self.go_to(place[1])


class RaceScan(TextView):
    """The chosen scan in words, or a note in full."""

    def __init__(self) -> None:
        super().__init__(id="race-scan")
        self._shown: tuple[Entry | None, InstanceRace | None, int] = (None, None, 0)

    def take(self, entry: Entry | None, raced: InstanceRace | None, interval_ns: int) -> None:
        """Show what is chosen."""
        self._shown = entry, raced, interval_ns
        self.draw()

    def make_rows(self) -> list[Row]:
        """Return what is chosen in words."""
        entry, raced, interval_ns = self._shown
        if isinstance(entry, ScanRow) and raced is not None:
            return [row(*parts) for parts in detail_lines(entry, raced, interval_ns)]
        if isinstance(entry, Note):
            lines = wrapped(f"{entry.dialect}: {note_text(entry)}", max(20, self.line_width))
            return [row((line, "")) for line in lines]
        return []


def note_text(note: Note) -> str:
    """Return what a note says."""
    return plain(f"step {note.step}: {note.text}" if note.step else note.text)


def race_parts(race: Race, hidden: int) -> list[Part]:
    """Return the first line of the head: which race, how long, what was left out."""
    told = [f"{count(race.scans, 'scan')} of {format_time(race.interval_ns)}"]
    if hidden:
        told.append(f"shown since the mark after scan {hidden}")
    if race.expectations:
        told.append(f"{race.expectations} expect left out")
    if race.notes:
        told.append(f"{count(len(race.notes), 'note')} below")
    return [(pad("race", 10), "dim"), (plain(race.name), "strong"), (f" · {' · '.join(told)}", "dim")]


def instance_title(raced: InstanceRace, place: int, instances: int) -> str:
    """Return what the frame of the table says of an instance."""
    which = f" {place + 1}/{instances}" if instances > 1 else ""
    return f"{plain(raced.instance)} ({raced.block}){which} · {summary(raced)}"
