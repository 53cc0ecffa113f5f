"""Pane 8: a logic analyser over scans: every pin and STATUS, no pulse of one scan is ever sampled away."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, Final, NamedTuple

from textual import events

from trcvtui.plc.ledger import StatusEdge
from trcvtui.rig.wave import Wave
from trcvtui.rig.wave_lane import Window
from trcvtui.rig.wave_text import (
    WATCH,
    Mark,
    Piece,
    drawn,
    lane_of,
    pin_of,
    row_names,
    ruler,
    split_at,
    value_text,
)
from trcvtui.tui.formatting import MS, SECOND, US, count, plain
from trcvtui.tui.messages import EdgeSelected
from trcvtui.tui.scene import Scene
from trcvtui.tui.voice import Voice
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row
from trcvtui.tui.widgets.timing_view import TimingView

LABEL: Final = 20  # mark, name, value under the cursor
HIGH_STYLES: Final = {"DONE": "done", "ERROR": "error", "BUSY": "busy"}
STYLES: Final = {"": "faint", "pulse": "glow", "gap": "warn", "mark": "key", "high": "strong"}
ASKED: Final = "write as   v VCD   s SVG   t text   esc not at all"


class _Drawn(NamedTuple):
    """One row of one instance; without a name it is the head of that instance."""

    wave: Wave
    name: str


class Timing(LineView):
    """The selected instance, and with `c` every other one of its CONNECT below it."""

    KEYS: ClassVar = (
        ("←→", "scan"), ("n N", "edge"), ("!", "ERROR"), ("+-", "zoom"), ("m", "marker"), ("e", "export"),
    )  # fmt: skip
    BINDINGS: ClassVar = [
        ("left,h", "step(-1)", "scan back"),
        ("right,l", "step(1)", "scan on"),
        ("shift+left", "any_edge(-1)", "edge back"),
        ("shift+right", "any_edge(1)", "edge on"),
        ("n", "row_edge(1)", "edge of the row"),
        ("N", "row_edge(-1)", "edge of the row, back"),
        ("exclamation_mark", "next_error", "next ERROR"),
        ("slash", "ask_code", "next code"),
        ("plus,equals_sign", "zoom_in(1)", "fewer scans a column"),
        ("minus", "zoom_in(-1)", "more scans a column"),
        ("f,F", "follow", "follow"),
        ("m", "mark", "marker"),
        ("c", "neighbours", "all of this CONNECT"),
        ("e", "ask_format", "export"),
        ("v", "write('vcd')", "VCD"),
        ("s", "write('svg')", "SVG"),
        ("t", "write('text')", "text"),
        ("escape", "now", "now"),
    ]

    def __init__(self, scene: Scene, voice: Voice) -> None:
        super().__init__(id="timing")
        self._scene = scene
        self._voice = voice
        self.view = TimingView()
        self._rows: list[_Drawn] = []
        self._chosen = 0
        self._asks = False
        self._note = ""
        self._last_code = ""

    # -- what is drawn ------------------------------------------------------------------------------

    @property
    def wave(self) -> Wave:
        """Return the wave of the selected instance."""
        return self._scene.waves.of(self._scene.selected)

    @property
    def waves(self) -> list[Wave]:
        """Return the waves that are drawn."""
        return [self._scene.waves.of(name) for name in self._scene.drawn_instances]

    @property
    def _until(self) -> int:
        return self.wave.until_scan

    @property
    def _columns(self) -> int:
        return max(1, self.line_width - LABEL)

    @property
    def _window(self) -> Window:
        return self.view.window(self._columns, self._until)

    def show(self) -> None:
        """Repaint what changed."""
        if self.size.height:
            waves = self.waves
            heads = len(waves) > 1
            self._rows = [
                _Drawn(wave, name) for wave in waves for name in ([""] if heads else []) + row_names(wave)
            ]
            self._chosen = min(self._chosen, max(0, len(self._rows) - 1))
            self.set_title(8, "Timing", self._detail())
            self._set_subtitle()
        super().show()

    def _set_subtitle(self) -> None:
        view, interval = self.view, self.wave.interval_ns
        text = f"{count(view.zoom, 'scan')} a column, {view.zoom * interval / MS:g} ms"
        text += " · follows" if view.follows else " · stands, f follows"
        if self.border_subtitle != text:
            self.border_subtitle = text

    def _detail(self) -> str:
        if self._asks:
            return ASKED
        if self._note:
            return self._note
        cursor, stretch = self.view.cursor, self.view.stretch
        parts = [f"scan {cursor} at {self._time(cursor)}"] if cursor is not None else []
        if stretch is not None:
            parts.append(self._distance(*stretch))
        return " · ".join(parts) or self._what_a_watch_table_saw()

    def _time(self, scan: int) -> str:
        t_ns, is_exact = self.wave.time_at(scan)
        return f"{'' if is_exact else '≈'}{t_ns // SECOND}.{t_ns % SECOND // US:06d} s"

    def _distance(self, first: int, last: int) -> str:
        (begin, exact), (end, also) = self.wave.time_at(first), self.wave.time_at(last)
        ends = "1→2" if len(self.view.markers) == 2 else "1→cursor"
        sign = "" if exact and also else "≈"
        return f"{ends} {count(last - first, 'scan')}, {sign}{(end - begin) / MS:.3f} ms"

    def _what_a_watch_table_saw(self) -> str:
        window = self._window
        first, last = window.scans_of(0)[0], window.scans_of(window.count - 1)[1]
        done = self.wave.lane("DONE").rises(first, last)
        seen = self.wave.polled("DONE").rises(first, last)
        return f"a 100 ms watch table saw {seen} of {done} DONE" if done else ""

    def row_count(self) -> int:
        """Return the ruler and the rows of all instances."""
        return len(self._rows) + 1

    def row_at(self, y: int) -> Row:
        """Return the ruler or one row."""
        window = self._window
        if y == 0:
            pieces = ruler(window, self._until, self._marks())
            return row(("".ljust(LABEL), ""), *[(text, STYLES.get(kind, kind)) for text, kind in pieces])
        if y > len(self._rows):
            return EMPTY
        wave, name = self._rows[y - 1]
        if not name:
            return row((f" {plain(wave.instance)} ", "label"), ("─" * self.line_width, "faint"))
        return row(*self._label(wave, name, y - 1 == self._chosen), *self._parts(wave, name, window))

    def _marks(self) -> list[Mark]:
        marks = [Mark(scan, sign) for scan, sign in zip(self.view.markers, "12", strict=False)]
        return marks if self.view.cursor is None else [*marks, Mark(self.view.cursor, "▼")]

    def _label(self, wave: Wave, name: str, is_chosen: bool) -> list[Part]:
        at = self._until if self.view.cursor is None else self.view.cursor
        pin = pin_of(name)
        value = "" if name == "codes" else value_text(pin, lane_of(wave, name).at(at))
        style = ("cursor" if self.has_focus else "cursor-blurred") if is_chosen else ""
        ghost = "ghost" if name.startswith(WATCH) else "label"
        sign = "▸" if is_chosen else " "
        return [(f"{sign}{name:<12}", f"{ghost} {style}"), (f"{value:>6} ", style)]

    def _parts(self, wave: Wave, name: str, window: Window) -> list[Part]:
        pieces: list[Piece] = drawn(wave, name, window)
        high = "ghost" if name.startswith(WATCH) else HIGH_STYLES.get(name, "strong")
        parts = [(text, high if kind == "high" else STYLES.get(kind, kind)) for text, kind in pieces]
        if name.startswith(WATCH):
            parts = [(text, "ghost") for text, _ in parts]
        if self.view.cursor is not None:
            x = window.column_of(self.view.cursor)
            parts = split_at(parts, x, lambda style: f"{style} byte-cursor")
        return parts

    # -- moving -------------------------------------------------------------------------------------

    def go_to(self, scan: int | None, nothing: str = "") -> None:
        """Put the cursor into a scan and explain what is in force there; None: say that there is nothing."""
        self._note, self._asks = nothing if scan is None else "", False
        if scan is not None:
            self.view.go_to(scan, self._until)
            line = self.wave.edge_at(self.view.cursor or scan)
            if line is not None:
                self.post_message(EdgeSelected(line.seq, line))
        self.show()

    @property
    def _here(self) -> int:
        return self._until if self.view.cursor is None else self.view.cursor

    def action_step(self, scans: int) -> None:
        """Go scan by scan."""
        self.go_to(self._here + scans)

    def action_any_edge(self, direction: int) -> None:
        """Go to the next change of any pin."""
        self.go_to(self.wave.next_edge(self._here, direction), "no further edge is known")

    def action_row_edge(self, direction: int) -> None:
        """Go to the next change of the row's pin."""
        drawn_row = self._rows[self._chosen] if self._rows else None
        if drawn_row is not None and drawn_row.name:
            edge = lane_of(*drawn_row).next_edge(self._here, direction)
            self.go_to(edge, f"no further edge of {pin_of(drawn_row.name)} is known")

    def action_next_error(self) -> None:
        """Go to the next ERROR; from the present to the newest one, behind the last to the first."""
        self._search(lambda edge: edge.error, "no ERROR")

    def action_ask_code(self) -> None:
        """Ask for the code to search."""
        self._voice.open_prompt(f"find {self._last_code}")

    def find(self, status: int) -> None:
        """Go to the next edge to this STATUS."""
        self._last_code = f"{status:04X}"
        self._search(lambda edge: edge.status == status, f"no {self._last_code}")

    def _search(self, holds: Callable[[StatusEdge], bool], nothing: str) -> None:
        wave, here = self.wave, self.view.cursor
        if here is None:
            newest = (e for e in reversed(wave.edges) if isinstance(e.event, StatusEdge) and holds(e.event))
            found = next((line.scan for line in newest), None)
        else:
            found = wave.next_where(here, holds) or wave.next_where(0, holds)
        self.go_to(found, f"{nothing} in what is known of {plain(wave.instance)}")

    def action_move(self, rows: int) -> None:
        """Choose another row."""
        self._chosen = max(0, min(len(self._rows) - 1, self._chosen + rows))
        self.keep_in_view(self._chosen + 1 if self._chosen else 0)
        self.show()

    def action_page(self, pages: int) -> None:
        """Go a whole view on or back in time."""
        self.view.page(pages, self._until)
        self.go_to(self.view.cursor)

    def action_edge(self, direction: int) -> None:
        """Go to the first scan that is known, or to the last."""
        self.go_to(self._until if direction > 0 else self.wave.first_scan)

    def action_zoom_in(self, steps: int) -> None:
        """Take fewer scans into a column, or more."""
        self.view.zoom_by(-steps, self._until)
        self.show()

    def action_follow(self) -> None:
        """Follow the newest scan, or let the view stand."""
        self.view.follow()
        self.show()

    def action_mark(self) -> None:
        """Set a marker under the cursor."""
        self.view.mark(self._until)
        self.show()

    def action_neighbours(self) -> None:
        """Draw the other instances of this CONNECT too, or no longer."""
        self._scene.draws_neighbours = not self._scene.draws_neighbours
        self.show()

    def action_now(self) -> None:
        """Go back to the present."""
        self._asks, self._note = False, ""
        self.view.now()
        self.view.markers = []
        self.post_message(EdgeSelected(None))
        self.show()

    def point_at(self, scan: int | None, seq: int | None) -> None:
        """Follow a choice that was made in another pane."""
        if scan is None:
            self.view.now()
        elif (line := self.wave.edge_at(self._here)) is None or line.seq != seq or self.view.cursor is None:
            self.view.go_to(scan, self._until)
        self.show()

    def forget(self) -> None:
        """Another instance was selected, or another bench: back to the present."""
        self.view.now()
        self.view.markers, self._note, self._asks = [], "", False

    # -- mouse --------------------------------------------------------------------------------------

    def on_click(self, event: events.Click) -> None:
        """Choose row and scan under the mouse; an edge inside the column is what was meant."""
        place = self.place_of(event)
        if place is None or place[1] > len(self._rows):
            return
        self._chosen = max(0, place[1] - 1)
        window, x = self._window, place[0] - LABEL
        if not 0 <= x < window.count or not self._rows:
            self.show()
            return
        first, last = window.scans_of(x)
        wave, name = self._rows[self._chosen]
        edge = lane_of(wave, name).next_edge(first - 1, 1) if name and window.zoom > 1 else None
        self.go_to(edge if edge is not None and edge <= last else first)

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Zoom in."""
        event.stop()
        event.prevent_default()
        self.action_zoom_in(1)

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Zoom out."""
        event.stop()
        event.prevent_default()
        self.action_zoom_in(-1)

    # -- files --------------------------------------------------------------------------------------

    def action_ask_format(self) -> None:
        """Ask in which format the waves shall be written."""
        self._asks = True
        self.show()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Let the letters of the formats through while nobody asks for one."""
        return self._asks if action == "write" else True

    def action_write(self, format: str) -> None:
        """Write a file in a format, between the markers where there are two."""
        self._asks = False
        self._voice.submit(f"export timing {format}")
        self.show()

    def write(self, format: str, path: Path | None) -> tuple[Path, int]:
        """Write the waves that are drawn; return where, and how many bytes; raise UserError."""
        from trcvtui.rig.wave_files import Span, free_path, target_folder, write_waves  # read when asked for

        markers = sorted(self.view.markers)
        known = Span(self.wave.first_scan, max(1, self._until))
        span = Span(*markers) if len(markers) == 2 else known
        folder = target_folder(self._scene.project.path)
        path = path or free_path(folder, f"timing-{self.wave.instance}", format)
        return path, write_waves(path, format, self.waves, span, self.view.zoom)
