"""A race as rows to look at: pure values for a screen, text for people, JSON lines for programs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from trcvtui.dialects import DIALECTS
from trcvtui.errors import one_line
from trcvtui.rig.scenario.race import CALLED, FIELDS, InstanceRace, Race, ScanRow, Shown, race_file
from trcvtui.udt.literals import format_time

NOT_CALLED: Final = "-"
DIALECT_NAMES: Final = tuple(DIALECTS)
LEAST_WIDTH: Final = 10  # of a column, in characters


# -- rows ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Cell:
    """One dialect in one row. `lamps`: `BDE` as far as they are lit; `data`: the hash, where DATA differs."""

    status: str
    lamps: str = ""
    rcvd_len: str = ""
    data: str = ""

    @property
    def text(self) -> str:
        """Return the cell as one text: `7008 D 8 B`."""
        return " ".join(part for part in (self.status, self.lamps, self.rcvd_len, self.data) if part)


@dataclass(frozen=True, slots=True)
class RaceRow:
    """One row of the table: `3` or `3-7`, a cell a dialect, and in which outputs they differ."""

    scans: str
    cells: tuple[Cell, ...]
    differs: tuple[str, ...]


def race_rows(raced: InstanceRace, only_differing: bool = False) -> tuple[RaceRow, ...]:
    """Return the table of one instance."""
    pairs = zip([None, *raced.rows], raced.rows, strict=False)
    return tuple(_race_row(row, before) for before, row in pairs if row.differs or not only_differing)


def _race_row(row: ScanRow, before: ScanRow | None) -> RaceRow:
    """Return a row; where nothing but DATA is another than before, its hash says so."""
    last = row.scan + row.scans - 1
    differs = row.differs
    looks_alike = before is not None and _without_data(before) == _without_data(row)
    cells = tuple(_cell(shown, "DATA" in differs or looks_alike) for shown in row.shown)
    return RaceRow(str(row.scan) if last == row.scan else f"{row.scan}-{last}", cells, differs)


def _without_data(row: ScanRow) -> tuple[Cell, ...]:
    return tuple(_cell(shown, with_data=False) for shown in row.shown)


def _cell(shown: Shown | None, with_data: bool) -> Cell:
    if shown is None:
        return Cell(NOT_CALLED)
    lamps = "B" * shown.busy + "D" * shown.done + "E" * shown.error
    size = f"{shown.rcvd_len} B" if shown.rcvd_len else ""
    return Cell(f"{shown.status:04X}", lamps, size, f"DATA {shown.data}" if with_data else "")


def title_of(dialect: str, block: str, status: int) -> str:
    """Return what a dialect's table calls a STATUS of a block, "" where it has none."""
    found = DIALECTS[dialect].row(status, block) if dialect in DIALECTS else None
    return found.title if found is not None else ""


def summary(raced: InstanceRace) -> str:
    """Return in one line where they differ first, and in how many scans."""
    first = raced.first
    if len(raced.dialects) == 1:
        return f"in {raced.dialects[0]} alone"
    if first is None:
        return f"no difference in {raced.scans} scans" + _kept(raced)
    name = first.differs[0]
    values = " vs ".join(_value(shown, name) for shown in first.shown)
    label = "" if name == "STATUS" else f"{name} "
    count = f"{raced.differing} of {raced.scans} scans differ"
    return f"first differ in scan {first.scan}: {label}{values}; {count}" + _kept(raced)


def _kept(raced: InstanceRace) -> str:
    return ", later ones are not kept" if raced.is_cut else ""


def _value(shown: Shown | None, name: str) -> str:
    if shown is None or name == CALLED:
        return "not called" if shown is None else "called"
    value = shown[FIELDS.index(name)]
    return f"{value:04X}" if name == "STATUS" else str(int(value) if isinstance(value, bool) else value)


# -- text ----------------------------------------------------------------------------------------------------


def race_text(race: Race) -> str:
    """Return the race as text: a table for each instance, then what was left out."""
    return "\n".join(_lines(race))


def _lines(race: Race) -> Iterator[str]:
    yield f"race  {one_line(race.name)}  ({race.scans} scans of {format_time(race.interval_ns)})"
    for raced in race.instances:
        yield ""
        yield f"{raced.instance} ({raced.block}): {summary(raced)}"
        yield from _table(raced)
    told = [f"{note.dialect}: {_step(note.step)}{one_line(note.text)}" for note in race.notes]
    if race.expectations:
        told.append(f"expect steps that were left out: {race.expectations}")
    if told:
        yield ""
        yield "notes"
        yield from (f"    {line}" for line in told)


def _step(number: int) -> str:
    return f"step {number}: " if number else ""


def _table(raced: InstanceRace) -> Iterator[str]:
    rows = race_rows(raced)
    texts = [[name, *(row.cells[n].text for row in rows)] for n, name in enumerate(raced.dialects)]
    widths = [max(LEAST_WIDTH, *map(len, column)) for column in texts]
    for label, mark, *cells in zip(
        ["scan", *(row.scans for row in rows)],
        [" ", *("≠" if row.differs else " " for row in rows)],
        *texts,
        strict=True,
    ):
        columns = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))
        yield f"{label:>13} {mark} {columns}".rstrip()


# -- JSON lines ----------------------------------------------------------------------------------------------


def race_jsonl(race: Race) -> str:
    """Return one object per dialect and run of equal scans, then the notes, then one for the race."""
    records = [*_records(race), *({"note": n.text, "dialect": n.dialect, "step": n.step} for n in race.notes)]
    told = [
        {
            "instance": raced.instance,
            "dialects": list(raced.dialects),
            "differing": raced.differing,
            "first": raced.first.scan if raced.first is not None else None,
            "summary": summary(raced),
        }
        for raced in race.instances
    ]
    end = {"race": race.name, "dialects": list(race.dialects), "scans": race.scans, "instances": told}
    return "\n".join(_line(record) for record in (*records, end))


def _records(race: Race) -> Iterator[dict[str, object]]:
    for raced in race.instances:
        for row in raced.rows:
            for dialect, shown in zip(raced.dialects, row.shown, strict=True):
                yield {
                    "scan": row.scan,
                    "scans": row.scans,
                    "t_ms": (row.scan - 1) * race.interval_ns / 1e6,
                    "instance": raced.instance,
                    "dialect": dialect,
                    **_outputs(shown),
                    "differs": list(row.differs),
                }


def _outputs(shown: Shown | None) -> dict[str, object]:
    """Return the outputs as keys; what a block does not have is left out."""
    if shown is None:
        return {}
    record = dict(zip(FIELDS, (f"{shown.status:04X}", *shown[1:]), strict=True))
    return {key: value for key, value in record.items() if value is not None and value != ""}


def _line(record: dict[str, object]) -> str:
    # ASCII: bytes from a wire stay data, for a terminal too. DEL is the one control that JSON leaves raw.
    return json.dumps(record, separators=(",", ":")).replace("\x7f", "\\u007f")


RACE_FORMATS: Final[dict[str, Callable[[Race], str]]] = {"text": race_text, "jsonl": race_jsonl}


def run_race(path: Path, dialects: Sequence[str], form: str) -> str:
    """Race a scenario file and return it in a format; raise UserError."""
    return RACE_FORMATS[form](race_file(path, dialects))
