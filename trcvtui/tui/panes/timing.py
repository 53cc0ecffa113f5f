"""Pane 8: every pin and the STATUS, scan by scan. Even a pulse of one scan is always drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, Final, NamedTuple

from textual import events

from trcvtui.history.pin_waveform import PinWaveform, ScanWindow, Waveform, find_lamp
from trcvtui.history.waveform_text import (
    CODES,
    WATCH,
    RulerMark,
    draw_row,
    draw_ruler,
    format_value,
    get_lane,
    get_row_pin,
    restyle_column,
    row_names,
)
from trcvtui.plc.ledger import StatusEdge
from trcvtui.snapshots.replay import WHAT_IF
from trcvtui.tui.formatting import MS, SECOND, US
from trcvtui.tui.messages import EdgeSelected, ScreenCallbacks
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView, Part, Row, row
from trcvtui.wording import count, format_ns

ZOOM_LEVELS: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
NAME_WIDTH: Final = 12  # columns of a row's name, if none is longer
LABEL_WIDTH: Final = 20  # columns: mark, name, value under the cursor
CURSOR_MARGIN: Final = 4  # columns between the cursor and the edge, if there is room


class TimingViewport:
    """The scans in view, counted from 1. If `cursor` is None, the cursor is at the present."""

    def __init__(self) -> None:
        self.cursor: int | None = None
        self.follows = True
        self.markers: list[int] = []
        self._level = 0
        self._first = 0
        self._count = 1

    @property
    def zoom(self) -> int:
        return ZOOM_LEVELS[self._level]

    def fit_window(self, count: int, newest: int) -> ScanWindow:
        """Return the window of `count` columns to draw. `newest` is the newest scan."""
        self._count = max(1, count)
        if self.follows:
            self._first = max(0, self._column(newest) - self._count + 1)
        return ScanWindow(self._first, self._count, self.zoom)

    def _column(self, scan: int) -> int:
        return max(0, scan - 1) // self.zoom

    def zoom_by(self, steps: int, until: int) -> None:
        """Put more or fewer scans into a column; the cursor stays in the same column."""
        if steps > 0 and self._count * self.zoom >= until:
            return  # the whole run is in view already
        anchor = until if self.cursor is None else self.cursor
        place = self._column(anchor) - self._first
        self._level = max(0, min(len(ZOOM_LEVELS) - 1, self._level + steps))
        self._first = max(0, self._column(anchor) - place)

    def go_to(self, scan: int, until: int) -> None:
        """Put the cursor on a scan and bring it into view; new scans no longer move the view."""
        self.cursor, self.follows = max(1, min(scan, max(1, until))), False
        margin = min(CURSOR_MARGIN, (self._count - 1) // 2)
        column = self._column(self.cursor)
        if column < self._first + margin:
            self._first = max(0, column - margin)
        elif column > self._first + self._count - 1 - margin:
            self._first = column - self._count + 1 + margin

    def follow_now(self) -> None:
        self.cursor, self.follows = None, True

    def add_marker(self, until: int) -> None:
        here = until if self.cursor is None else self.cursor
        self.markers = [*self.markers, here] if len(self.markers) < 2 else [here]

    @property
    def measured_scans(self) -> tuple[int, int] | None:
        """Return the scans to measure between: two markers, or one marker and the cursor."""
        ends = self.markers if len(self.markers) == 2 else [*self.markers, self.cursor or 0]
        if not self.markers or not ends[1]:
            return None
        return ends[0], ends[1]


STYLES: Final = {"": "faint", "pulse": "strong", "gap": "warn", "mark": "key", "high": "strong"}


class TimingRow(NamedTuple):
    """One row of an instance, such as a pin; a row without a name is the heading of the instance."""

    wave: Waveform
    name: str


def list_rows(waves: Sequence[Waveform], is_strip: bool = False) -> list[TimingRow]:
    """Return the rows of these instances. Several instances get headings. With `is_strip`, omit CODES rows.

    Below each row of an instance comes the same row of its what-if run.
    """
    others = {wave.instance: wave for wave in waves if wave.instance.startswith(WHAT_IF)}
    own = [wave for wave in waves if wave.instance not in others]
    rows = list[TimingRow]()
    for wave in own:
        other = others.get(WHAT_IF + wave.instance)
        rows += [TimingRow(wave, "")] if len(own) > 1 else []
        for names in _group_with_codes(row_names(wave)):
            rows += [TimingRow(wave, name) for name in names]
            rows += [TimingRow(other, name) for name in names if name in row_names(other)] if other else []
    return [shown for shown in rows if not (is_strip and shown.name == CODES)]


def _group_with_codes(names: Sequence[str]) -> list[list[str]]:
    found = list[list[str]]()
    for name in names:
        if name == CODES and found:
            found[-1].append(name)
        else:
            found.append([name])
    return found


def label_width(rows: Sequence[TimingRow]) -> int:
    """Return the number of columns before the waves, enough for the longest name."""
    return LABEL_WIDTH + max(0, *(len(shown.name) - NAME_WIDTH for shown in rows)) if rows else LABEL_WIDTH


def ruler_row(window: ScanWindow, until: int, view: TimingViewport, label: int) -> Row:
    marks = [RulerMark(scan, sign) for scan, sign in zip(view.markers, "12", strict=False)]
    if view.cursor is not None:
        marks.append(RulerMark(view.cursor, "▼"))
    pieces = draw_ruler(window, until, marks)
    return row(("".ljust(label), ""), *[(text, STYLES.get(kind, kind)) for text, kind in pieces])


def wave_row(
    shown: TimingRow, window: ScanWindow, cursor: int | None, until: int, label_style: str | None, label: int
) -> Row:
    """Return one row with its wave after `label` columns. Only a chosen row has a `label_style`."""
    wave, name = shown
    if not name:
        return row((f" {wave.instance} ", "label"), ("─" * (label + window.width), "faint"))
    at = until if cursor is None else cursor
    return row(*_label(wave, name, at, label_style, label), *_wave_parts(wave, name, window, cursor))


def _label(wave: Waveform, name: str, at: int, label_style: str | None, label: int) -> list[Part]:
    value = "" if name == CODES else format_value(get_row_pin(name), get_lane(wave, name).value_at(at))
    if wave.instance.startswith(WHAT_IF) and name != CODES:
        name = f"  {WHAT_IF}"
    kind = "ghost" if name.startswith(WATCH) else "label"
    sign, style = (" ", "") if label_style is None else ("▸", label_style)
    return [(f"{sign}{name:<{NAME_WIDTH + label - LABEL_WIDTH}}", f"{kind} {style}"), (f"{value:>6} ", style)]


def _wave_parts(wave: Waveform, name: str, window: ScanWindow, cursor: int | None) -> list[Part]:
    pieces = draw_row(wave, name, window)
    if name.startswith(WATCH):
        parts = [(text, "ghost") for text, _ in pieces]
    else:
        high = find_lamp(name) or "strong"
        parts = [
            (text, high if kind in ("high", "pulse") else STYLES.get(kind, kind)) for text, kind in pieces
        ]
    if cursor is None:
        return parts
    return restyle_column(parts, window.find_column(cursor), lambda style: f"{style} byte-cursor")


WAVE_NOT_KEPT: Final = "its wave begins after the frozen scan"
EXPORT_LINE: Final = "export timing vcd"
STRIP_ROWS: Final = 4  # lines of a strip: ruler, STATUS, EN_R or REQ, DONE


class Timing(LineView):
    """The waves of the selected instance. Key `o` adds the other instances on the same CONNECT below."""

    KEYS: ClassVar = (
        ("←→", "scan"), ("n N", "edge"), ("!", "ERROR"), ("+-", "zoom"), ("m", "marker"), ("e", "export"),
    )  # fmt: skip
    BINDINGS: ClassVar = [
        ("left,h", "step(-1)", "scan back"),
        ("right,l", "step(1)", "scan on"),
        ("shift+left", "any_edge(-1)", "edge before, of any pin"),
        ("shift+right", "any_edge(1)", "next edge, of any pin"),
        ("n", "row_edge(1)", "next edge of the row"),
        ("N", "row_edge(-1)", "edge before, of the row"),
        ("exclamation_mark", "next_error", "next ERROR"),
        ("slash", "ask_code", "next edge to a code"),
        ("plus,equals_sign", "zoom_in(1)", "zoom in, fewer scans a column"),
        ("minus", "zoom_in(-1)", "zoom out, more scans a column"),
        ("f", "follow", "follow the newest scan, or stay"),
        ("m", "mark", "marker here: first, second"),
        ("o", "neighbours", "the other instances of this CONNECT, too"),
        ("e", "write", "write as VCD (GTKWave, PulseView)"),
        ("escape", "now", "back to now"),
    ]

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks, digit: int = 8) -> None:
        super().__init__(id="timing")
        self._digit, self._view_model, self._actions = digit, view_model, actions
        self.view = TimingViewport()
        self._rows: list[TimingRow] = []
        self._label = LABEL_WIDTH
        self._chosen = 0
        self._ready: dict[int, Row] = {}
        self._note = ""
        self.code: int | None = None  # searched last

    # -- what is drawn ------------------------------------------------------------------------------

    @property
    def wave(self) -> Waveform:
        return self._view_model.waves.get_wave(self._view_model.selected)

    @property
    def waves(self) -> list[Waveform]:
        return [self._view_model.waves.get_wave(name) for name in self._view_model.drawn_waves]

    @property
    def _newest(self) -> int:
        return self._view_model.frozen_scan or self.wave.until_scan

    @property
    def _window(self) -> ScanWindow:
        return self.view.fit_window(max(1, self.line_width - self._label), self._newest)

    def show(self) -> None:
        self._ready.clear()
        if self.size.height:
            self._rows = list_rows(self.waves, self.size.height <= STRIP_ROWS)
            self._label = label_width(self._rows)
            self._chosen = min(self._chosen, max(0, len(self._rows) - 1))
            self.set_title(self._digit, "Timing", self._describe_cursor())
            self._set_subtitle()
        super().show()

    def _set_subtitle(self) -> None:
        snapshot, zoom = self._view_model.snapshot, self.view.zoom
        text = f"{count(zoom, 'scan')} a column"
        if snapshot is not None:
            text += f", {format_ns(zoom * snapshot.interval_ns)}"
        if self._view_model.is_frozen:
            text += " · frozen"
        else:
            text += " · follows" if self.view.follows else " · stays, f follows"
        if self.border_subtitle != text:
            self.border_subtitle = text

    def _describe_cursor(self) -> str:
        if self._note:
            return self._note
        if self._view_model.is_frozen and self._view_model.selected in self._view_model.waves.too_late:
            return WAVE_NOT_KEPT
        cursor, stretch = self.view.cursor, self.view.measured_scans
        parts = [f"scan {cursor} at {self._time(cursor)}"] if cursor is not None else []
        if stretch is not None:
            parts.append(self._distance(*stretch))
        return " · ".join(parts) or self._describe_watch_table()

    def _time(self, scan: int) -> str:
        t_ns, is_exact = self.wave.time_at(scan)
        return f"{'' if is_exact else '≈'}{t_ns // SECOND}.{t_ns % SECOND // US:06d} s"

    def _distance(self, first: int, last: int) -> str:
        (begin, exact), (end, also) = self.wave.time_at(first), self.wave.time_at(last)
        ends = "1 to 2" if len(self.view.markers) == 2 else "1 to cursor"
        sign = "" if exact and also else "≈"
        return f"{ends}: {count(abs(last - first), 'scan')}, {sign}{abs(end - begin) / MS:.3f} ms"

    def _describe_watch_table(self) -> str:
        window = self._window
        first, last = window.column_scans(0)[0], window.column_scans(window.width - 1)[1]
        pin = self.wave.find_pin("done")
        done = self.wave.lanes[pin].count_rises(first, last) if pin else 0
        seen = self.wave.get_polled(pin).count_rises(first, last) if pin else 0
        return f"a 100 ms watch table saw {seen} of {done} {pin}" if done else ""

    def row_count(self) -> int:
        return len(self._rows) + 1

    def row_at(self, y: int) -> Row:
        """Return the ruler or one row; each is drawn only once for each picture."""
        if y not in self._ready:
            self._ready[y] = self._row(y)
        return self._ready[y]

    def _row(self, y: int) -> Row:
        if y == 0:
            return ruler_row(self._window, self._newest, self.view, self._label)
        style = self.cursor_style(True) if y - 1 == self._chosen else None
        return wave_row(self._rows[y - 1], self._window, self.view.cursor, self._newest, style, self._label)

    def _chosen_lane(self) -> PinWaveform | None:
        shown = self._rows[self._chosen] if self._rows else None
        return get_lane(*shown) if shown is not None and shown.name else None

    # -- moving -------------------------------------------------------------------------------------

    def go_to(self, scan: int | None, nothing: str = "") -> None:
        """Put the cursor on a scan and explain its STATUS. If `scan` is None, show `nothing` as text."""
        self._note = nothing if scan is None else ""
        if scan is not None:
            self.view.go_to(scan, self._newest)
            line = self.wave.edge_at(self.view.cursor or scan)
            if line is not None:
                self.post_message(EdgeSelected(line.seq, line))
        self.show()

    @property
    def _scan(self) -> int:
        return self._newest if self.view.cursor is None else self.view.cursor

    def action_step(self, scans: int) -> None:
        self.go_to(self._scan + scans)

    def action_any_edge(self, direction: int) -> None:
        self.go_to(self.wave.find_next_edge(self._scan, direction), "no further edge is known")

    def action_row_edge(self, direction: int) -> None:
        lane = self._chosen_lane()
        if lane is not None:
            self.go_to(lane.find_next_edge(self._scan, direction), "no further edge of this row is known")

    def action_next_error(self) -> None:
        """Go to the next ERROR. From the present, go to the newest; from the last ERROR, to the first."""
        self._search(lambda edge: edge.outputs.error, "no ERROR")

    def action_ask_code(self) -> None:
        self._actions.open_prompt("find " if self.code is None else f"find {self.code:04X}")

    def find(self, status: int) -> None:
        self.code = status
        self._search(lambda edge: edge.outputs.status == status, f"no {status:04X}")

    def _search(self, holds: Callable[[StatusEdge], bool], nothing: str) -> None:
        wave, here = self.wave, self.view.cursor
        if here is None:
            newest = (e for e in reversed(wave.edges) if isinstance(e.event, StatusEdge) and holds(e.event))
            found = next((line.scan for line in newest), None)
        else:
            found = wave.find_next_where(here, holds) or wave.find_next_where(0, holds)
        self.go_to(found, f"{nothing} in the known history of {wave.instance}")

    def action_move(self, rows: int) -> None:
        self._chosen = max(0, min(len(self._rows) - 1, self._chosen + rows))
        self.keep_in_view(self._chosen + 1 if self._chosen else 0)
        self.show()

    def action_page(self, pages: int) -> None:
        self.go_to(self._scan + pages * self._window.width * self.view.zoom)

    def action_edge(self, direction: int) -> None:
        self.go_to(self._newest if direction > 0 else self.wave.first_scan)

    def action_zoom_in(self, steps: int) -> None:
        self.view.zoom_by(-steps, self._newest)
        self.show()

    def action_follow(self) -> None:
        """Switch following the newest scan on or off; the cursor stays at its scan."""
        self.view.follows = not self.view.follows
        self.show()

    def action_mark(self) -> None:
        self.view.add_marker(self._newest)
        self.show()

    def action_neighbours(self) -> None:
        self._view_model.draws_neighbours = not self._view_model.draws_neighbours
        self.show()

    def action_now(self) -> None:
        self._note = ""
        self.view.follow_now()
        self.view.markers = []
        self.post_message(EdgeSelected(None))
        self.show()

    def show_scan(self, scan: int | None, seq: int | None) -> None:
        if scan is None:
            self.view.follow_now()
        elif (line := self.wave.edge_at(self._scan)) is None or line.seq != seq or self.view.cursor is None:
            self.view.go_to(scan, self._newest)
        self.show()

    def reset_cursor(self) -> None:
        self.view.follow_now()
        self.view.markers, self._note = [], ""

    # -- mouse --------------------------------------------------------------------------------------

    def click(self, x: int, y: int) -> None:
        """Choose row and scan under the mouse; in a column with an edge, choose the scan of the edge."""
        self._chosen = max(0, y - 1)
        window, x = self._window, x - self._label
        if not 0 <= x < window.width or not self._rows:
            self.show()
            return
        first, last = window.column_scans(x)
        lane = self._chosen_lane()
        edge = lane.find_next_edge(first - 1, 1) if lane is not None and window.zoom > 1 else None
        self.go_to(edge if edge is not None and edge <= last else first)

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        event.stop()
        event.prevent_default()
        self.action_zoom_in(1)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        event.stop()
        event.prevent_default()
        self.action_zoom_in(-1)

    # -- files --------------------------------------------------------------------------------------

    def action_write(self) -> None:
        self._actions.submit(EXPORT_LINE)

    def write_vcd(self, path: Path | None) -> tuple[Path, int]:
        """Write the drawn waves; return the file and its size in bytes; raise UserError."""
        from trcvtui.history.waveform_text import (  # imported on first use
            ScanRange,
            export_folder,
            free_path,
            write_vcd,
        )

        markers = sorted(self.view.markers)
        known = ScanRange(self.wave.first_scan, max(1, self._newest))
        span = ScanRange(*markers) if len(markers) == 2 else known
        path = path or free_path(export_folder(self._view_model.project.path), f"timing-{self.wave.instance}")
        return path, write_vcd(path, self.waves, span)
