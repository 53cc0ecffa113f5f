"""The rows of the timing pane in styles: ruler, heads of instances, labels with values, waves, cursor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from trcvtui.rig.history.pin_waveform import Window
from trcvtui.rig.history.wave import LAMPS, Wave
from trcvtui.rig.history.wave_text import (
    CODES,
    WATCH,
    Mark,
    drawn,
    lane_of,
    pin_of,
    row_names,
    ruler,
    split_at,
    value_text,
)
from trcvtui.tui.formatting import plain
from trcvtui.tui.panes.timing_view import LABEL, NAME, TimingView
from trcvtui.tui.widgets.line_view import Part, Row, row

STYLES: Final = {"": "faint", "pulse": "glow", "gap": "warn", "mark": "key", "high": "strong"}


class Drawn(NamedTuple):
    """One row of one instance; without a name it is the head of that instance."""

    wave: Wave
    name: str


def rows_of(waves: Sequence[Wave], is_strip: bool = False) -> list[Drawn]:
    """Return the rows of these instances, each with a head where there are several; a strip has no codes."""
    heads = [""] if len(waves) > 1 else []
    rows = [Drawn(wave, name) for wave in waves for name in heads + row_names(wave)]
    return [shown for shown in rows if not (is_strip and shown.name == CODES)]


def label_width(rows: Sequence[Drawn]) -> int:
    """Return the columns in front of the waves: as wide as the longest name asks for."""
    return LABEL + max(0, *(len(shown.name) - NAME for shown in rows)) if rows else LABEL


def ruler_row(window: Window, until: int, view: TimingView, label: int) -> Row:
    """Return the scans with cursor and markers."""
    marks = [Mark(scan, sign) for scan, sign in zip(view.markers, "12", strict=False)]
    if view.cursor is not None:
        marks.append(Mark(view.cursor, "▼"))
    pieces = ruler(window, until, marks)
    return row(("".ljust(label), ""), *[(text, STYLES.get(kind, kind)) for text, kind in pieces])


def wave_row(
    shown: Drawn, window: Window, cursor: int | None, until: int, label_style: str | None, label: int
) -> Row:
    """Return one row behind `label` columns; `label_style` None: it is not the chosen one."""
    wave, name = shown
    if not name:
        return row((f" {plain(wave.instance)} ", "label"), ("─" * (label + window.width), "faint"))
    at = until if cursor is None else cursor
    return row(*_label(wave, name, at, label_style, label), *_parts(wave, name, window, cursor))


def _label(wave: Wave, name: str, at: int, label_style: str | None, label: int) -> list[Part]:
    value = "" if name == CODES else value_text(pin_of(name), lane_of(wave, name).at(at))
    kind = "ghost" if name.startswith(WATCH) else "label"
    sign, style = (" ", "") if label_style is None else ("▸", label_style)
    return [(f"{sign}{name:<{NAME + label - LABEL}}", f"{kind} {style}"), (f"{value:>6} ", style)]


def _parts(wave: Wave, name: str, window: Window, cursor: int | None) -> list[Part]:
    pieces = drawn(wave, name, window)
    if name.startswith(WATCH):
        parts = [(text, "ghost") for text, _ in pieces]
    else:
        high = LAMPS.get(name, "strong")
        parts = [(text, high if kind == "high" else STYLES.get(kind, kind)) for text, kind in pieces]
    if cursor is None:
        return parts
    return split_at(parts, window.column_of(cursor), lambda style: f"{style} byte-cursor")
