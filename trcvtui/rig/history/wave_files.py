"""Waves as files: VCD for GTKWave and PulseView, SVG for a report, plain text for a mail."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.blocks.parameters import SHOWS
from trcvtui.errors import mistake
from trcvtui.files import write_file
from trcvtui.plc.ledger import StatusEdge
from trcvtui.rig.history.pin_waveform import Lane, Window
from trcvtui.rig.history.wave import Wave
from trcvtui.rig.history.wave_text import CODES, WATCH, WORDS, drawn, lane_of, row_names, ruler, value_text
from trcvtui.rig.history.waveform_delta import OUTPUTS, pins_of

MS: Final = 1_000_000
LINE: Final = 100  # columns of a line of text
MOST_COLUMNS: Final = 4000
MOST_EDGES: Final = 2000  # in a text file
LABEL: Final = 14


class Span(NamedTuple):
    """The scans that go into the file."""

    first: int
    last: int


# -- VCD --------------------------------------------------------------------------------------------------


def vcd_text(waves: Sequence[Wave], span: Span) -> str:
    """Return the waves as a Value Change Dump: 1 ns, a scope for each instance, x where nobody knows.

    Several changes of one pin in one scan stand 1 ns apart, so that none of them is lost.
    """
    from vcd import VCDWriter  # read when first asked for
    from vcd.writer import Variable

    out = StringIO()
    changes: list[tuple[int, int, Variable[int], int | None]] = []
    with VCDWriter(
        out, timescale="1 ns", comment="trcvtui: pins and STATUS at the end of each scan"
    ) as writer:
        for wave in waves:
            for pin, lane in wave.lanes.items():
                kind = "reg" if pin in WORDS else "wire"
                scope = _vcd_name(wave.instance)
                var = writer.register_var(scope, pin, kind, size=WORDS.get(pin, 1), init=None)
                told = enumerate(_vcd_changes(lane, wave, span))
                changes += [(t_ns, number, var, value) for number, (t_ns, value) in told]
        for t_ns, _, var, value in sorted(changes, key=lambda change: change[:2]):
            writer.change(var, t_ns, "x" if value is None else value)
        writer.close(max(wave.time_at(min(span.last, wave.until_scan))[0] for wave in waves))
    return out.getvalue()


def _vcd_changes(lane: Lane, wave: Wave, span: Span) -> Iterator[tuple[int, int | None]]:
    before, last_t = lane.at(span.first - 1), -1
    if before is not None:
        last_t = wave.time_at(span.first - 1)[0] if span.first > 1 else 0
        yield last_t, before
    for scan, t_ns, value in zip(lane.scans, lane.times, lane.values, strict=True):
        if span.first <= scan <= span.last:
            last_t = max(t_ns, last_t + 1)
            yield last_t, value


def _vcd_name(instance: str) -> str:
    return "".join(c if c.isalnum() or c == "_" else "_" for c in instance)


# -- text -------------------------------------------------------------------------------------------------


def plain_text(waves: Sequence[Wave], span: Span, zoom: int) -> str:
    """Return the rows of the pane, line after line, then every STATUS edge with its cause."""
    while (span.last - span.first) // zoom >= MOST_COLUMNS:
        zoom *= 2
    names = {wave.instance: row_names(wave) for wave in waves}
    label = max(LABEL, *(len(name) + 1 for rows in names.values() for name in rows))
    lines = [f"scans {span.first} to {span.last}, {zoom} scan{'s' * (zoom > 1)} a column", ""]
    for column in range((span.first - 1) // zoom, (span.last - 1) // zoom + 1, LINE):
        window = Window(column, min(LINE, (span.last - 1) // zoom + 1 - column), zoom)
        lines.append(" " * label + _joined(ruler(window, span.last, ())))
        for wave in waves:
            if len(waves) > 1:
                lines.append(wave.instance)
            lines += [f"{name:<{label}}{_joined(drawn(wave, name, window))}" for name in names[wave.instance]]
        lines.append("")
    for wave in waves:
        lines += [wave.instance, *_edge_lines(wave, span), ""]
    return "\n".join(line.rstrip() for line in lines)


def _joined(pieces: Iterable[tuple[str, str]]) -> str:
    return "".join(text for text, _ in pieces)


def _edge_lines(wave: Wave, span: Span) -> Iterator[str]:
    lines = wave.edges_in(*span)
    if len(lines) > MOST_EDGES:
        yield f"  {len(lines) - MOST_EDGES} older STATUS edges are left out here; a VCD has them all"
    for line in lines[-MOST_EDGES:]:
        edge = line.event
        if isinstance(edge, StatusEdge):
            lamps = " ".join(pin for pin, value in pins_of(edge) if value and pin not in WORDS)
            status = f"{edge.status}" if edge.block in OUTPUTS else f"16#{edge.status:04X}"
            shown = f"{status} {edge.condition}"
            place = f"  scan {line.scan:>8}  {line.t_ns / MS:>12.3f} ms"
            yield f"{place}  {shown:<27} {lamps:<7} {edge.cause.name}"


# -- SVG --------------------------------------------------------------------------------------------------

WIDE, ROW, LEFT, HIGH_Y, LOW_Y = 1200, 26, 220, 5, 19
COLOURS: Final = {"error": "#b3343f", "done": "#2f7d32", "busy": "#1f6f9c"}


def svg_text(waves: Sequence[Wave], span: Span) -> str:
    """Return the waves as a drawing: exact edges, STATUS as boxes with their codes, times at the foot."""
    rows = [(wave, name) for wave in waves for name in row_names(wave) if name != CODES]
    height = 24 + ROW * len(rows) + 24
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {LEFT + WIDE + 20} {height}" '
        'font-family="monospace" font-size="12" fill="none">',
        f'<rect width="{LEFT + WIDE + 20}" height="{height}" fill="#fbfaf7"/>',
    ]
    step = WIDE / (span.last - span.first + 1)

    def at(scan: int) -> float:
        return LEFT + max(0, min(WIDE, (scan - span.first) * step))

    for number, (wave, name) in enumerate(rows):
        top = 24 + ROW * number
        label = f"{wave.instance} {name}" if len(waves) > 1 else name
        parts.append(_words(8, top + 16, label, "#1f2933"))
        draw = _boxes if name.removeprefix(WATCH) in WORDS else _levels
        parts += draw(wave, name, span, at, top)
    last = waves[0].time_at(min(span.last, waves[0].until_scan))[0] / MS
    first = waves[0].time_at(span.first)[0] / MS
    foot = f"scan {span.first} at {first:.3f} ms  to  scan {span.last} at {last:.3f} ms"
    return "\n".join([*parts, _words(LEFT, height - 8, foot, "#5a6570"), "</svg>", ""])


At = Callable[[int], float]


def _stretches(lane: Lane, wave: Wave, span: Span) -> Iterator[tuple[int, int, int | None]]:
    """Yield (first scan, scan behind the last, value) of everything in the span."""
    for place, (scan, value) in enumerate(zip(lane.scans, lane.values, strict=True)):
        behind = lane.scans[place + 1] if place + 1 < len(lane.scans) else wave.until_scan + 1
        if behind >= span.first and scan <= span.last:
            yield max(scan, span.first), min(behind, span.last + 1), value


def _levels(wave: Wave, name: str, span: Span, at: At, top: int) -> Iterator[str]:
    for is_known, run in groupby(_stretches(lane_of(wave, name), wave, span), key=lambda s: s[2] is not None):
        points = []
        for first, behind, value in run:
            y = top + (HIGH_Y if value else LOW_Y)
            points += [f"{at(first):.2f},{y}", f"{at(behind):.2f},{y}"]
        if is_known:
            yield f'<polyline points="{" ".join(points)}" stroke="#1f6f9c" stroke-width="1.2"/>'


def _boxes(wave: Wave, name: str, span: Span, at: At, top: int) -> Iterator[str]:
    pin = name.removeprefix(WATCH)
    for first, behind, value in _stretches(lane_of(wave, name), wave, span):
        if value is None:
            continue
        left, width = at(first), max(0.5, at(behind) - at(first))
        colour = _colour(wave, first) if SHOWS.get(name) == "status" else "#5a6570"
        yield (
            f'<rect x="{left:.2f}" y="{top + HIGH_Y - 1}" width="{width:.2f}" height="{LOW_Y - HIGH_Y + 2}" '
            f'stroke="{colour}"/>'
        )
        label = value_text(pin, value)
        if width > 8 * len(label):
            yield _words(left + 3, top + 16, label, colour)


def _colour(wave: Wave, scan: int) -> str:
    line = wave.edge_at(scan)
    edge = line.event if line is not None else None
    if not isinstance(edge, StatusEdge):
        return "#5a6570"
    return COLOURS["error" if edge.error else "done" if edge.done else "busy"]


def _words(x: float, y: float, text: str, colour: str) -> str:
    return f'<text x="{x:.2f}" y="{y}" fill="{colour}">{escape(text)}</text>'


# -- files ------------------------------------------------------------------------------------------------

FORMATS: Final = {"vcd": ".vcd", "svg": ".svg", "text": ".txt"}


def known_format(format: str) -> str:
    """Return the format; raise UserError where there is none of that name."""
    if format not in FORMATS:
        raise mistake("export timing", f"'{format}'", ", ".join(FORMATS))
    return format


def free_path(folder: Path, name: str, format: str) -> Path:
    """Return a path in a folder under which nothing stands yet."""
    plain = _vcd_name(name) or "timing"
    names = (f"{plain}{'' if n == 1 else f'-{n}'}{FORMATS[known_format(format)]}" for n in range(1, 100_000))
    return next(folder / name for name in names if not (folder / name).exists())


def write_waves(path: Path, format: str, waves: Sequence[Wave], span: Span, zoom: int) -> int:
    """Write a file that is not there yet; return its size; raise UserError where it cannot be written."""
    known_format(format)
    if not any(wave.lanes for wave in waves):
        raise mistake("export timing", "no scan yet", "a bench that has scanned")
    texts = {
        "vcd": lambda: vcd_text(waves, span),
        "svg": lambda: svg_text(waves, span),
        "text": lambda: plain_text(waves, span, zoom),
    }
    payload = texts[format]().encode()
    write_file(path, payload, "export timing", is_new=True)
    return len(payload)


def target_folder(project: Path) -> Path:
    """Return the folder of the project; of one that came with trcvtui, or is read-only, the working one."""
    folder = project.absolute().parent
    own = Path(__file__).resolve().parents[2]
    shipped = own in folder.resolve().parents or folder.resolve() == own
    return folder if not shipped and os.access(folder, os.W_OK) else Path.cwd()
