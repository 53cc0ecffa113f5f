"""Waveforms drawn in characters, and written to VCD files for GTKWave and PulseView.

Each sign differs without colour:
▁ 0   ▔ 1   █ 1 for one scan   ╱ ╲ one edge inside the column   ┃ a pulse or more inside it   ░ not known
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import StringIO
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.blocks.table import find_pin, outcome_field
from trcvtui.errors import mistake
from trcvtui.files import write_file
from trcvtui.history.pin_waveform import Column, PinWaveform, ScanWindow, Waveform
from trcvtui.plc.ledger import Line, StatusEdge

LOW_SIGN, HIGH_SIGN, ONE_SCAN_SIGN, RISE_SIGN, FALL_SIGN, INSIDE_SIGN, GAP, UNKNOWN_SIGN = "▁▔█╱╲┃░·"
CODES: Final = "codes"
WATCH: Final = "watch "  # before the pin that a watch table shows
TYPE_BITS: Final = {"BYTE": 8, "WORD": 16, "UINT": 16, "DINT": 32, "UDINT": 32, "TIME": 32}  # bits
TICK_COLUMNS: Final = 20
LABEL_WIDTH: Final = 5  # of a code with its edge
ROW_ORDER: Final = (
    "STATUS", CODES, "EN_R", "REQ", "DONE", f"{WATCH}STATUS", f"{WATCH}DONE", "ERROR", "BUSY", "CONT",
    "RCVD_LEN", "LEN", "ADHOC", "COM_RST",
    "DataReceived", "StringReceived", "ByteReceived", "ReceivedByte", "Error", "busy", "Busy", "RxTimeout",
    "LenReceiveData", "watch DataReceived", "watch StringReceived", "watch ByteReceived", "watch Error",
    "EN", "Length", "SendByte", "LenPrefix", "LenSuffix", "SizeReceiveData", "Timeout", "Reset",
)  # fmt: skip

Piece = tuple[str, str]  # characters, and what they are: high, pulse, gap, error, done, busy or ""


class RulerMark(NamedTuple):
    """Something in one scan that is drawn into the ruler."""

    scan: int
    sign: str


def row_names(wave: Waveform) -> list[str]:
    """Return the rows of an instance, the most important first."""
    pins = set(wave.lanes)
    rows = {f"{WATCH}{pin}" for pin in wave.watched_pins} | ({CODES} if "STATUS" in pins else set())
    return [name for name in ROW_ORDER if name in pins | rows] + sorted(pins - set(ROW_ORDER))


def get_row_pin(name: str) -> str:
    return "STATUS" if name == CODES else name.removeprefix(WATCH)


def count_pin_bits(name: str) -> int:
    """Return how many bits a numeric pin has; 0 for any other pin."""
    pin = find_pin(name)
    return 0 if pin is None or pin.is_bool else TYPE_BITS[pin.iec_type]


def format_value(pin: str, value: int | None) -> str:
    """Return a value as it is written: STATUS in hex, other numbers in decimals."""
    if value is None:
        return "?"
    return f"{value:04X}" if pin == "STATUS" else str(value)


def get_lane(wave: Waveform, name: str) -> PinWaveform:
    return wave.get_polled(get_row_pin(name)) if name.startswith(WATCH) else wave.lanes[get_row_pin(name)]


def draw_row(wave: Waveform, name: str, window: ScanWindow) -> list[Piece]:
    if name == CODES:
        return _draw_codes(wave, window)
    columns = wave.list_columns(get_lane(wave, name), window)
    if name == "RCVD_LEN":
        return list(_draw_lengths(wave, window, columns))
    if count_pin_bits(get_row_pin(name)):
        return list(_draw_numbers(wave, name, window, columns))
    if not wave.gaps and columns.count(columns[0]) == window.width:  # most pins do not change in view
        sign, kind = _draw_level(wave, window, columns, 0)
        return [(sign * window.width, kind)]
    return merge_pieces(_draw_level(wave, window, columns, x) for x in range(window.width))


# -- levels -----------------------------------------------------------------------------------------------


def _draw_level(wave: Waveform, window: ScanWindow, columns: list[Column | None], x: int) -> Piece:
    column = columns[x]
    if column is None:
        return " ", ""
    if wave.gaps and wave.is_gap(*window.column_scans(x)):
        return (GAP, "gap") if column.is_level else ("▒", "pulse")
    if column.low is None:
        return UNKNOWN_SIGN, ""
    if column.is_level:
        if not column.low:
            return LOW_SIGN, ""
        alone = window.zoom == 1 and _is_low(columns, x - 1) and _is_low(columns, x + 1)
        return (ONE_SCAN_SIGN, "pulse") if alone else (HIGH_SIGN, "high")
    if column.changes == 1:
        return (RISE_SIGN if column.end else FALL_SIGN), "high"
    return INSIDE_SIGN, "pulse"


def _is_low(columns: list[Column | None], x: int) -> bool:
    column = columns[x] if 0 <= x < len(columns) else None
    return column is not None and column.high == 0


# -- numbers ----------------------------------------------------------------------------------------------


def _draw_numbers(
    wave: Waveform, name: str, window: ScanWindow, columns: list[Column | None]
) -> Iterator[Piece]:
    pin, x = get_row_pin(name), 0
    is_word = outcome_field(pin) == "status" and not name.startswith(WATCH)
    keys = (_segment_key(wave, window, columns[x], x) for x in range(len(columns)))
    for (kind, value), run in groupby(keys):
        width = sum(1 for _ in run)
        last = window.column_scans(x + width - 1)[1]
        x += width
        if kind != "level":
            sign = {"none": " ", "gap": GAP, "inside": INSIDE_SIGN}[kind]
            yield sign * width, "pulse" if kind == "inside" else kind if kind == "gap" else ""
            continue
        label = format_value(pin, value) if value is not None else ""
        edge = "│" if value is not None else UNKNOWN_SIGN
        text = INSIDE_SIGN if width == 1 and label else edge + (label if len(label) < width else "")
        style = _get_edge_kind(wave.edge_at(min(last, wave.until_scan))) if is_word else ""
        yield text[:width].ljust(width, "─" if value is not None else UNKNOWN_SIGN), style


def _segment_key(wave: Waveform, window: ScanWindow, column: Column | None, x: int) -> tuple[str, int | None]:
    if column is None:
        return "none", None
    if wave.gaps and wave.is_gap(*window.column_scans(x)):
        return "gap", None
    return ("level", column.low) if column.is_level else ("inside", None)


def _get_edge_kind(line: Line | None) -> str:
    edge = line.event if line is not None else None
    if not isinstance(edge, StatusEdge):
        return ""
    return edge.outputs.lit_lamp


def _draw_lengths(wave: Waveform, window: ScanWindow, columns: list[Column | None]) -> Iterator[Piece]:
    """Yield the row of RCVD_LEN. A value other than 0 lasts one scan, and is written if there is room."""
    pulses = [x for x, column in enumerate(columns) if column is not None and column.high]
    nexts = dict(zip(pulses, [*pulses[1:], window.width], strict=False))
    x = 0
    while x < window.width:
        column = columns[x]
        text = f"╵{column.high}" if column is not None and column.high else ""
        if text and len(text) <= nexts[x] - x:
            yield text, "done"
            x += len(text)
        else:
            yield _draw_level(wave, window, columns, x) if not text else (INSIDE_SIGN, "pulse")
            x += 1


# -- codes that have no room in their segment -------------------------------------------------------------

KIND_RANKS: Final = {"error": 0, "done": 1, "busy": 2, "": 3}


def _draw_codes(wave: Waveform, window: ScanWindow) -> list[Piece]:
    columns = wave.list_columns(wave.lanes["STATUS"], window)
    found = []
    for x, column in enumerate(columns):
        if column is not None and column.changes and _is_narrow(columns, x):
            edges = wave.list_edges(*window.column_scans(x))[:64]
            if edges:
                ranks = [KIND_RANKS[_get_edge_kind(line)] for line in edges]
                found.append((min(ranks), x, edges[ranks.index(min(ranks))], edges))
    taken: dict[int, tuple[str, str]] = {}
    free = [True] * (window.width + 1)
    for _, x, line, edges in sorted(found, key=lambda place: place[:2]):
        text = f"╵{format_value('STATUS', _get_status(line))}" + "+" * (len({*map(_get_status, edges)}) > 1)
        end = x + len(text)
        if end <= window.width and all(free[x : end + 1]):
            free[x:end] = [False] * len(text)
            taken[x] = text, _get_edge_kind(line)
    return _place_labels(taken, window.width)


def _get_status(line: Line) -> int:
    return line.event.outputs.status if isinstance(line.event, StatusEdge) else 0


def _is_narrow(columns: list[Column | None], x: int) -> bool:
    here = columns[x]
    if here is None or not here.is_level:
        return True
    ahead = columns[x + 1 : x + LABEL_WIDTH]
    return not all(c is not None and c.is_level and c.low == here.low and not c.changes for c in ahead)


def _place_labels(taken: dict[int, tuple[str, str]], width: int) -> list[Piece]:
    pieces: list[Piece] = []
    x = 0
    for at in sorted(taken):
        text, kind = taken[at]
        pieces += [(" " * (at - x), ""), (text, kind)]
        x = at + len(text)
    return [*pieces, (" " * (width - x), "")]


# -- ruler ------------------------------------------------------------------------------------------------


def draw_ruler(window: ScanWindow, until: int, marks: Iterable[RulerMark]) -> list[Piece]:
    """Return the ruler with ticks and their scan numbers. The marks overwrite ticks and numbers."""
    signs = [" "] * window.width
    for x in range(-window.first % TICK_COLUMNS, window.width, TICK_COLUMNS):
        first = window.column_scans(x)[0]
        for offset, sign in enumerate(f"╷{first}" if 0 < first <= until else ""):
            if x + offset < window.width:
                signs[x + offset] = sign
    pieces: list[Piece] = [(sign, "") for sign in signs]
    for mark in marks:
        x = window.find_column(mark.scan)
        if 0 <= x < window.width:
            pieces[x] = mark.sign, "mark"
    return merge_pieces(pieces)


def restyle_column(pieces: list[Piece], x: int, restyle: Callable[[str], str]) -> list[Piece]:
    """Return the pieces with the one character in column x restyled."""
    out: list[Piece] = []
    left = 0
    for text, kind in pieces:
        here = x - left
        left += len(text)
        if 0 <= here < len(text):
            parts = (text[:here], kind), (text[here], restyle(kind)), (text[here + 1 :], kind)
            out += [part for part in parts if part[0]]
        else:
            out.append((text, kind))
    return out


def merge_pieces(pieces: Iterable[Piece]) -> list[Piece]:
    """Return pieces with neighbours of one kind put together: fewer to paint."""
    return [("".join(text for text, _ in run), kind) for kind, run in groupby(pieces, key=lambda p: p[1])]


class ScanRange(NamedTuple):
    """The first and the last scan that go into the VCD file."""

    first: int
    last: int


# -- VCD --------------------------------------------------------------------------------------------------


def format_vcd(waves: Sequence[Waveform], span: ScanRange) -> str:
    """Return the waves as a Value Change Dump: unit 1 ns, a scope for each instance, x for unknown values.

    Several changes of one pin in one scan are 1 ns apart, so that none of them is lost.
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
                kind = "reg" if count_pin_bits(pin) else "wire"
                scope = _make_vcd_name(wave.instance)
                var = writer.register_var(scope, pin, kind, size=count_pin_bits(pin) or 1, init=None)
                numbered = enumerate(_list_vcd_changes(lane, wave, span))
                changes += [(t_ns, number, var, value) for number, (t_ns, value) in numbered]
        for t_ns, _, var, value in sorted(changes, key=lambda change: change[:2]):
            writer.change(var, t_ns, "x" if value is None else value)
        writer.close(max(wave.time_at(min(span.last, wave.until_scan))[0] for wave in waves))
    return out.getvalue()


def _list_vcd_changes(lane: PinWaveform, wave: Waveform, span: ScanRange) -> Iterator[tuple[int, int | None]]:
    before, last_t = lane.value_at(span.first - 1), -1
    if before is not None:
        last_t = wave.time_at(span.first - 1)[0] if span.first > 1 else 0
        yield last_t, before
    for scan, t_ns, value in zip(lane.scans, lane.times, lane.values, strict=True):
        if span.first <= scan <= span.last:
            last_t = max(t_ns, last_t + 1)
            yield last_t, value


def _make_vcd_name(instance: str) -> str:
    return "".join(c if c.isalnum() or c == "_" else "_" for c in instance)


# -- files ------------------------------------------------------------------------------------------------

VCD_SUFFIX: Final = "vcd"


def free_path(folder: Path, name: str) -> Path:
    """Return the path for a new VCD file in a folder; no file has this path yet."""
    plain = _make_vcd_name(name) or "timing"
    names = (f"{plain}{'' if n == 1 else f'-{n}'}.{VCD_SUFFIX}" for n in range(1, 100_000))
    return next(folder / name for name in names if not (folder / name).exists())


def write_vcd(path: Path, waves: Sequence[Waveform], span: ScanRange) -> int:
    """Write a new file and return its size. Raise UserError if the file cannot be written."""
    if not any(wave.lanes for wave in waves):
        raise mistake("export timing", "no scan yet", "a bench that has scanned")
    payload = format_vcd(waves, span).encode()
    write_file(path, payload, "export timing", is_new=True)
    return len(payload)


def export_folder(project: Path) -> Path:
    """Return the project's folder, or the working directory if that folder is trcvtui's or read-only."""
    folder = project.absolute().parent
    own = Path(__file__).resolve().parents[1]
    shipped = own in folder.resolve().parents or folder.resolve() == own
    return folder if not shipped and os.access(folder, os.W_OK) else Path.cwd()
