"""A row of a race as parts of a line: a column a dialect, what differs marked by a sign and by its style."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from trcvtui.rig.scenario.race import CALLED, InstanceRace, Row, Shown
from trcvtui.rig.scenario.race_report import title_of
from trcvtui.tui.formatting import clip, count, lamp, moment, pad
from trcvtui.tui.widgets.line_view import Part

SCANS, SIGN = 13, 3  # columns of the scan numbers, and of the sign that marks a difference
DIFFERS: Final = "≠"
LAMPS: Final = ("BUSY", "DONE", "ERROR")
LAMP_STYLES: Final = {"BUSY": "busy", "DONE": "done", "ERROR": "error"}
DRAWN: Final = 25  # columns from which on the lamps are drawn as in the list of instances
TITLED: Final = 46  # columns from which on the words of the STATUS stand beside it


def column_width(width: int, dialects: int) -> int:
    """Return the columns that each dialect has."""
    return max(8, (width - SCANS - SIGN) // max(1, dialects))


def head_parts(raced: InstanceRace, width: int) -> list[Part]:
    """Return the names above the columns."""
    each = column_width(width, len(raced.dialects))
    names = [(pad(clip(name, each - 1), each), "strong") for name in raced.dialects]
    return [(pad("scan", SCANS - 1, right=True), "dim"), (" " * (SIGN + 1), ""), *names]


def row_parts(row: Row, raced: InstanceRace, width: int) -> list[Part]:
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


def scans_of(row: Row) -> str:
    """Return `3` or `3-7`."""
    return str(row.scan) if row.scans == 1 else f"{row.scan}-{row.scan + row.scans - 1}"


def _changed(row: Row, number: int) -> frozenset[str]:
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
    """Yield the parts in exactly so many columns, the last one of them a blank."""
    left = width - 1
    for text, style in parts:
        if left > 0:
            yield clip(text, left), style
            left -= len(text)
    yield " " * (max(0, left) + 1), ""


# -- one row in full ---------------------------------------------------------------------------------------


def detail_lines(row: Row, raced: InstanceRace, interval_ns: int) -> Iterator[list[Part]]:
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
