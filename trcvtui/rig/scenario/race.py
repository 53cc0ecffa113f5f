"""Dialect race: the same pins and the same partners through several dialects at once, scan by scan.

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

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2s
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.blocks.conditions import Condition
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect
from trcvtui.errors import UserError, mistake
from trcvtui.project.convert_dialect import in_dialect
from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.commands import words as words
from trcvtui.rig.commands.instances import after
from trcvtui.rig.commands.table import parse_line, parse_script
from trcvtui.rig.scenario.scenario import Scenario, load_scenario, start_steps
from trcvtui.rig.scenario.session_file import partners_left_out
from trcvtui.rig.scenario.step_runner import Stage

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
        self._stage = Stage(self.bench)
        self._steps = steps  # by place in the scenario
        self._going: Iterator[None] = iter(())
        self._hashes: dict[str, str] = {}

    def step(self, place: int) -> words.Step | None:
        return self._steps.get(place)

    def begin(self, step: words.Step) -> None:
        self._going = self._stage.take(step)
        self._hashes.clear()  # a command may write DATA

    def wants_scan(self) -> bool:
        """Go on with the step; return whether a scan has to pass for it."""
        return next(self._going, _OVER) is not _OVER

    def wrong(self) -> str:
        """Return what failed in the step that is over."""
        return self._stage.failure.found if self._stage.failure is not None else ""

    def scan(self) -> dict[str, tuple[str, Shown]]:
        """Let one scan pass; return the block and the outputs of each instance that was due."""
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
    """Return what a block says with a code."""
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
        """Take every step in all lanes, one after the other."""
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
        """Let scans pass until the step is over in every lane, or patience is."""
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
            self._note(lane, step, f"{PATIENCE_SCANS} scans behind another dialect it still does not hold")

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
        """Yield each instance with the dialects that have called it at all."""
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


def known_dialects() -> tuple[tuple[str, str], ...]:
    """Return the name and the title of each dialect that can take part."""
    return tuple((dialect.name, dialect.title) for dialect in DIALECTS.values())


def race_file(path: Path, names: Sequence[str]) -> Race:
    """Race a scenario file through these dialects; raise UserError for mistakes of the file or the names."""
    scenario = load_scenario(path)
    return race(scenario, _chosen(names, scenario.project), path.parent)


def race_lines(project: Project, lines: Iterable[str], names: Sequence[str]) -> Race:
    """Race what was done on a bench, as a session keeps it; `project` is what it began with."""
    steps = tuple(parse_script("\n".join(lines), project, "race"))
    scenario = Scenario(project.path.stem, "", project, start_steps(project), steps)
    return race(scenario, _chosen(names, project))


def _chosen(names: Sequence[str], project: Project) -> list[Dialect]:
    """Return the dialects; one name alone races against the project's own, which is then the first."""
    own = project.dialect.name
    chosen = [_named(name) for name in ([own, *names] if len(names) == 1 else names)]
    if len({dialect.name for dialect in chosen}) < max(2, len(chosen)):
        found = ", ".join(dialect.name for dialect in chosen) or "none"
        raise mistake("--dialect", found, f"two different dialects, or one besides {own}")
    return chosen


def _named(name: str) -> Dialect:
    if name not in DIALECTS:
        raise mistake("--dialect", shown(name), expected_name(name, DIALECTS, "dialect"))
    return DIALECTS[name]


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
            project = project if base is None else replace(project, base=base)
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
    """Return the steps as this dialect reads them, by place; what it cannot read is noted and left edge."""
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
                read[place] = replace(step, command=command)
                project = after(command, project)
    return read
