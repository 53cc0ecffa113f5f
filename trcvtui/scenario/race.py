"""Dialect race: the same pins and partners through several dialects at once; as rows, text, JSON lines.

Each dialect has a bench of its own with a simulated network, the same seed and the same virtual time. They
take each step together and let scans pass together: a command reaches all of them in the same scan.

Rule 1: nothing is aligned. A row is one scan; who is later is later.
Rule 2: `expect` is left edge. A `wait` is over when it holds in every dialect, at the latest PATIENCE_SCANS
after the first; in whom it did not hold is noted. A STATUS that says something else there, or nothing, is not
waited for: 0001 of one vendor is no 0001 of another.
Rule 3: a step lets a partner send the bytes that it sends in the scenario's own dialect, whatever the layout.
Bounds: MOST_ROWS runs of equal scans an instance, MOST_NOTES notes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2s
from pathlib import Path
from typing import Final, NamedTuple

from msgspec import structs

from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.commands import words
from trcvtui.commands.reader import after
from trcvtui.commands.table import parse_line
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect
from trcvtui.errors import UserError, mistake, one_line
from trcvtui.project.convert_dialect import dialect_named, in_dialect
from trcvtui.project.project import Project
from trcvtui.scenario.recorded_session import partners_left_out
from trcvtui.scenario.scenario import Scenario, load_scenario
from trcvtui.scenario.step_runner import StepRunner
from trcvtui.udt.literals import format_time

CALLED: Final = "called"
FIELDS: Final = ("STATUS", "BUSY", "DONE", "ERROR", "RCVD_LEN", "DATA")


class Shown(NamedTuple):
    """What one instance shows in one scan. `data` is a short hash of all of DATA, "" without DATA."""

    status: int
    busy: bool
    done: bool
    error: bool
    rcvd_len: int | None
    data: str


@dataclass(frozen=True, slots=True)
class ScanRow:
    """`scans` equal scans from `scan` on, one entry a dialect; None: not called in that scan."""

    scan: int
    scans: int
    shown: tuple[Shown | None, ...]

    @property
    def differs(self) -> tuple[str, ...]:
        """Return in what the dialects differ here: outputs, DATA, or whether the block was called."""
        if len(set(self.shown)) == 1:
            return ()
        called = [each for each in self.shown if each is not None]
        if len(called) < len(self.shown):
            return (CALLED,)
        columns = zip(*called, strict=True)
        return tuple(name for name, values in zip(FIELDS, columns, strict=True) if len(set(values)) > 1)


@dataclass(frozen=True, slots=True)
class InstanceRace:
    """One instance in the dialects that have it; `is_cut`: later rows are not kept."""

    instance: str
    block: str
    dialects: tuple[str, ...]
    rows: tuple[ScanRow, ...]
    is_cut: bool = False

    @property
    def scans(self) -> int:
        """Return of how many scans the rows tell."""
        return sum(row.scans for row in self.rows)

    @property
    def differing(self) -> int:
        """Return in how many of them the dialects differ."""
        return sum(row.scans for row in self.rows if row.differs)

    @property
    def first(self) -> ScanRow | None:
        """Return the first row in which they differ."""
        return next((row for row in self.rows if row.differs), None)


@dataclass(frozen=True, slots=True)
class Note:
    """What a dialect did not do as the scenario says; `step` 0: before the first one."""

    dialect: str
    step: int
    text: str


@dataclass(frozen=True, slots=True)
class Race:
    """One race from its first scan to its last."""

    name: str
    dialects: tuple[str, ...]
    interval_ns: int
    scans: int
    expectations: int  # `expect` steps that were left out
    instances: tuple[InstanceRace, ...]
    notes: tuple[Note, ...]


PATIENCE_SCANS: Final = 20
MOST_ROWS: Final = 100_000
MOST_NOTES: Final = 1000
HASH_BYTES: Final = 4
EXPECTATIONS: Final = (words.Expect, words.ExpectTrace)
TRAFFIC: Final = (words.PeerSend, words.PeerPlay, words.ReplyOn)
_OVER: Final = object()


# -- one dialect ---------------------------------------------------------------------------------------------


class _Lane:
    """One dialect on its bench."""

    def __init__(self, dialect: str, project: Project, steps: dict[int, words.Step]) -> None:
        self.dialect = dialect
        self.bench = Bench(project, "sim")
        self._stage = StepRunner(self.bench)
        self._steps = steps  # by place in the scenario
        self._going: Iterator[None] = iter(())
        self._hashes: dict[str, str] = {}

    def step(self, place: int) -> words.Step | None:
        return self._steps.get(place)

    def begin(self, step: words.Step) -> None:
        self._going = self._stage.take(step)
        self._hashes.clear()  # a command may write DATA

    def wants_scan(self) -> bool:
        return next(self._going, _OVER) is not _OVER

    def wrong(self) -> str:
        return self._stage.failure.found if self._stage.failure is not None else ""

    def scan(self) -> dict[str, tuple[str, Shown]]:
        self.bench.step()
        called = self.bench.runtime.called
        if any(edge.outputs.done for edge in called):
            self._hashes.clear()
        return {
            edge.instance: (
                edge.block,
                Shown(
                    edge.outputs.status,
                    edge.outputs.busy,
                    edge.outputs.done,
                    edge.outputs.error,
                    edge.outputs.rcvd_len,
                    self._hash(edge.instance),
                ),
            )
            for edge in called
        }

    def _hash(self, instance: str) -> str:
        if instance not in self._hashes:
            decl = self.bench.project.instance(instance)
            name = decl.data if decl is not None else None
            content = None if name is None else self.bench.runtime.data(name)
            self._hashes[instance] = (
                "" if content is None else blake2s(content, digest_size=HASH_BYTES).hexdigest()
            )
        return self._hashes[instance]

    def lacks(self, condition: words.Condition, own: Dialect) -> str:
        """Return why a condition that was written for its own dialect has no sense here, "" when it has."""
        decl = (
            self.bench.project.instance(condition.instance) if isinstance(condition, words.PinsAre) else None
        )
        if decl is None or not isinstance(condition, words.PinsAre):
            return ""
        dialect = self.bench.project.dialect
        for pin, value in condition.pins:
            if pin == "STATUS" and not _meaning(own, decl.block, value) & _meaning(
                dialect, decl.block, value
            ):
                row = dialect.row(value, decl.block)
                what = f"is '{row.title}'" if row is not None else f"is none of {decl.block}"
                return f"not waited for: here {value:04X} {what}"
        return ""


def _meaning(dialect: Dialect, block: str, code: int) -> frozenset[Condition]:
    rows = [row for row in dialect.status if row.code == code and block in row.blocks]
    return frozenset(condition for row in rows for condition in row.conditions)


# -- the race ------------------------------------------------------------------------------------------------


class _Race:
    """All lanes side by side, and what has been seen of them."""

    def __init__(self, own: Dialect, lanes: Sequence[_Lane], notes: list[Note]) -> None:
        self._own = own  # that of the scenario
        self._lanes = lanes
        self._notes = notes
        self._blocks: dict[str, str] = {}
        self._rows: dict[str, list[ScanRow]] = {}
        self._cut: set[str] = set()
        self.scans = 0

    def play(self, steps: Sequence[words.Step]) -> None:
        for place, step in enumerate(steps):
            if isinstance(step.command, EXPECTATIONS):
                continue
            going = []
            for lane in self._lanes:
                own = lane.step(place)
                if own is not None and self._can_take(lane, own):
                    lane.begin(own)
                    going.append(lane)
            self._finish(step, going)

    def _can_take(self, lane: _Lane, step: words.Step) -> bool:
        why = lane.lacks(step.command.condition, self._own) if isinstance(step.command, words.Wait) else ""
        if why:
            self._note(lane, step, why)
        return not why

    def _finish(self, step: words.Step, going: list[_Lane]) -> None:
        left = PATIENCE_SCANS if isinstance(step.command, words.Wait) else None
        somebody_held = False
        while True:
            under_way = []
            for lane in going:
                if lane.wants_scan():
                    under_way.append(lane)
                elif lane.wrong():
                    self._note(lane, step, f"found {lane.wrong()}")
                else:
                    somebody_held = True
            going = under_way
            if not going:
                return
            if left is not None and somebody_held:
                if left == 0:
                    break
                left -= 1
            self._scan()
        for lane in going:
            self._note(lane, step, f"{PATIENCE_SCANS} scans after another dialect it still does not hold")

    def _note(self, lane: _Lane, step: words.Step, text: str) -> None:
        self._notes.append(Note(lane.dialect, step.number, f"{step.line}: {text}"))

    def _scan(self) -> None:
        self.scans += 1
        seen = [lane.scan() for lane in self._lanes]
        for outputs in seen:
            for name, (block, _) in outputs.items():
                self._blocks.setdefault(name, block)
        for name in self._blocks:
            self._add(name, tuple(outputs[name][1] if name in outputs else None for outputs in seen))

    def _add(self, name: str, shown_now: tuple[Shown | None, ...]) -> None:
        rows = self._rows.setdefault(name, [])
        if name in self._cut:
            return
        if rows and rows[-1].shown == shown_now:
            rows[-1] = replace(rows[-1], scans=rows[-1].scans + 1)
        elif len(rows) < MOST_ROWS:
            rows.append(ScanRow(self.scans, 1, shown_now))
        else:
            self._cut.add(name)

    def instances(self) -> Iterator[InstanceRace]:
        for name, rows in self._rows.items():
            has = [any(row.shown[n] is not None for row in rows) for n in range(len(self._lanes))]
            yield InstanceRace(
                name,
                self._blocks[name],
                tuple(lane.dialect for lane, here in zip(self._lanes, has, strict=True) if here),
                tuple(replace(row, shown=_only(row.shown, has)) for row in rows),
                name in self._cut,
            )


def _only(shown_all: tuple[Shown | None, ...], has: Sequence[bool]) -> tuple[Shown | None, ...]:
    return tuple(each for each, here in zip(shown_all, has, strict=True) if here)


def race_file(path: Path, names: Sequence[str]) -> Race:
    """Race a scenario file through these dialects; raise UserError for mistakes of the file or the names."""
    scenario = load_scenario(path)
    return race(scenario, _chosen(names, scenario.project), path.parent)


def _chosen(names: Sequence[str], project: Project) -> list[Dialect]:
    own = project.dialect.name
    chosen = [dialect_named(name) for name in ([own, *names] if len(names) == 1 else names)]
    if len({dialect.name for dialect in chosen}) < max(2, len(chosen)):
        found = ", ".join(dialect.name for dialect in chosen) or "none"
        raise mistake("--dialect", found, f"two different dialects, or one besides {own}")
    return chosen


def race(scenario: Scenario, dialects: Sequence[Dialect], base: Path | None = None) -> Race:
    """Race a scenario through these dialects; `base` is where files that its steps name stand.

    Raises UserError where a CONNECT cannot be described in one of them.
    """
    steps = (*scenario.start, *scenario.steps)
    left_out = partners_left_out(scenario.about)
    notes = [Note(scenario.project.dialect.name, 0, left_out)] if left_out else []
    lanes: list[_Lane] = []
    try:
        for dialect in dialects:
            project, said = in_dialect(scenario.project, dialect)
            notes += [Note(dialect.name, 0, text) for text in said]
            project = project if base is None else structs.replace(project, base=base)
            lanes.append(_Lane(dialect.name, project, _read_steps(steps, project, notes)))
        course = _Race(scenario.project.dialect, lanes, notes)
        course.play(steps)
    finally:
        for lane in lanes:
            lane.bench.close()
    return Race(
        name=scenario.name,
        dialects=tuple(dialect.name for dialect in dialects),
        interval_ns=lanes[0].bench.runtime.interval_ns,
        scans=course.scans,
        expectations=sum(isinstance(step.command, EXPECTATIONS) for step in steps),
        instances=tuple(course.instances()),
        notes=tuple(notes[:MOST_NOTES]),
    )


def _read_steps(steps: Iterable[words.Step], project: Project, notes: list[Note]) -> dict[int, words.Step]:
    read: dict[int, words.Step] = {}
    for place, step in enumerate(steps):
        if isinstance(step.command, TRAFFIC):
            read[place] = step
        elif not isinstance(step.command, EXPECTATIONS):
            try:
                command = parse_line(step.line, project, "")
            except UserError as wrong:
                problem = wrong.problems[0]
                text = f"{step.line}: left out: found {problem.found}, expected {problem.expected}"
                notes.append(Note(project.dialect.name, step.number, text))
                continue
            if command is not None:
                read[place] = structs.replace(step, command=command)
                project = after(command, project)
    return read


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
            for dialect, cell in zip(raced.dialects, row.shown, strict=True):
                yield {
                    "scan": row.scan,
                    "scans": row.scans,
                    "t_ms": (row.scan - 1) * race.interval_ns / 1e6,
                    "instance": raced.instance,
                    "dialect": dialect,
                    **_outputs(cell),
                    "differs": list(row.differs),
                }


def _outputs(shown: Shown | None) -> dict[str, object]:
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
