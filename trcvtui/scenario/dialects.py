"""One scenario in several dialects: the STATUS walks side by side, and where the walks differ.

Rule 1: each dialect runs the whole scenario alone, as `trcvtui scenario` does, with its own verdict.
Rule 2: dialects are not aligned. A row is one scan, so the rows show if a dialect is later.
Rule 3: a partner sends the same bytes as in the scenario's own dialect, even if the layout is another.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.commands import words
from trcvtui.commands.reader import project_after
from trcvtui.commands.table import parse_line
from trcvtui.errors import UserError, mistake, one_line
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.project.convert_dialect import convert_project, find_dialect
from trcvtui.project.project import Project
from trcvtui.scenario.report import JsonLines, Text, Write, json_line
from trcvtui.scenario.runner import NO_DELIVERIES, SentCounts, Verdict
from trcvtui.scenario.scenario import Scenario
from trcvtui.wording import format_columns

MOST_CHANGES: Final = 100_000  # kept for an instance in a dialect
FORMAT_NAMES: Final = ("text", "jsonl")
DIFFERS_MARK, NOTHING_MARK = "≠", "-"
TRAFFIC_COMMANDS: Final = (words.PeerSend, words.PeerPlaySequence, words.AddReply)


def convert_scenario(names: Sequence[str], scenario: Scenario, path: Path) -> list[Scenario]:
    """Return the scenario in each of these dialects. Each line of `about` says what the dialect lacks.

    Raises UserError if one of these dialects cannot describe a CONNECT.
    """
    dialects = [find_dialect(name) for name in names]
    if len(set(names)) < max(2, len(names)):
        raise mistake("--dialect", ", ".join(names), "two different dialects or more, each once")
    made = []
    for dialect in dialects:
        project, notes = convert_project(scenario.project, dialect)
        lacks = [*notes]
        start = tuple(_convert_steps(scenario.start, project, lacks))
        steps = tuple(_convert_steps(scenario.steps, replace(project, base=path.parent), lacks))
        made.append(replace(scenario, about="\n".join(lacks), project=project, start=start, steps=steps))
    return made


def _convert_steps(steps: Iterable[words.Step], project: Project, lacks: list[str]) -> Iterator[words.Step]:
    for step in steps:
        if isinstance(step.command, TRAFFIC_COMMANDS):  # rule 3: its bytes are laid out already
            yield step
            continue
        try:
            command = parse_line(step.line, project, f"step {step.number}, {step.line}")
        except UserError as wrong:
            lacks += [f"left out: {problem}" for problem in wrong.problems]
            continue
        if command is not None:
            yield replace(step, command=command)
            project = project_after(command, project)


class DialectRun:
    """The run in one dialect. `changes` has outputs by instance and first scan; None is the run's end."""

    def __init__(self, scenario: Scenario) -> None:
        self.dialect = scenario.project.dialect.name
        self.notes = scenario.about.splitlines()
        self.blocks: dict[str, str] = {}
        self.changes: dict[str, dict[int, Outputs | None]] = {}
        self.verdict: Verdict | None = None

    def add_change(self, scan: int, edge: StatusEdge) -> None:
        self.blocks[edge.instance] = edge.block
        changes = self.changes.setdefault(edge.instance, {})
        if len(changes) < MOST_CHANGES:
            changes[scan] = edge.outputs

    def close(self, verdict: Verdict) -> None:
        self.verdict = verdict
        for changes in self.changes.values():
            changes[verdict.scans + 1] = None


class DialectReport(JsonLines):
    """The report of files that run in all dialects. After each file comes a comparison."""

    def __init__(self, write: Write, form: str, dialects: int) -> None:
        if form not in FORMAT_NAMES:
            raise mistake("--format", f"'{form}'", f"with --dialect one of {', '.join(FORMAT_NAMES)}")
        super().__init__(write)
        self._is_json = form == "jsonl"
        self._dialects = dialects
        self._runs: list[DialectRun] = []

    def begin_file(self, path: Path, scenario: Scenario, bench: Bench) -> None:
        super().begin_file(path, scenario, bench)
        self._runs.append(DialectRun(scenario))

    def write_record(self, record: Mapping[str, object]) -> None:
        """Write a line with the name of its dialect; the line of a file with mistakes has no dialect."""
        if self._is_json:
            super().write_record({"dialect": self._runs[-1].dialect, **record} if self._runs else record)

    def write_scan(
        self, scan: int, changed: Iterable[StatusEdge], deliveries: Mapping[str, SentCounts] = NO_DELIVERIES
    ) -> None:
        super().write_scan(scan, changed, deliveries)
        for edge in changed:
            self._runs[-1].add_change(scan, edge)

    def write_verdict(self, verdict: Verdict) -> None:
        super().write_verdict(verdict)
        if self._runs:
            self._runs[-1].close(verdict)
        if len(self._runs) == self._dialects:
            self._write_comparison()

    def write_error(self, path: Path, error: UserError) -> None:
        self._runs.clear()
        super().write_error(path, error)

    def _write_comparison(self) -> None:
        blocks = {name: block for run in self._runs for name, block in run.blocks.items()}
        for name, block in blocks.items():
            walk = WalkComparison(name, block, self._runs)
            text = json_line(walk.record()) if self._is_json else "".join(f"{x}\n" for x in walk.lines())
            self._write(text)
        for run in () if self._is_json else self._runs:
            assert run.verdict is not None
            Text(self._write).write_verdict(
                replace(run.verdict, scenario=f"{run.dialect}: {run.verdict.scenario}", traces=())
            )
            self._write("".join(f"    {one_line(note)}\n" for note in run.notes))
        self._runs.clear()


class WalkComparison:
    """One instance in all dialects. Each of `rows` has first scan, last scan, and outputs by dialect."""

    def __init__(self, instance: str, block: str, runs: Sequence[DialectRun]) -> None:
        self._head = f"{instance} ({block})"
        self._instance = instance
        self._dialects = [run.dialect for run in runs]
        changes = [run.changes.get(instance, {}) for run in runs]
        self._having = [name for name, each in zip(self._dialects, changes, strict=True) if each]
        now: list[Outputs | None] = [None] * len(runs)
        self.rows: list[tuple[int, int, tuple[Outputs | None, ...]]] = []
        for scan, following in pairwise(sorted({scan for each in changes for scan in each})):
            now = [each.get(scan, before) for each, before in zip(changes, now, strict=True)]
            self.rows.append((scan, following - 1, tuple(now)))
        self._different = [row for row in self.rows if len({*row[2]} - {None}) > 1]

    def record(self) -> dict[str, object]:
        """Return the differences as an object of JSON."""
        first = self._different[0][0] if self._different else None
        return {
            "instance": self._instance,
            "dialects": self._dialects,
            "differing": self._differing_scans,
            "first": first,
        }

    @property
    def _differing_scans(self) -> int:
        return sum(last - first + 1 for first, last, _ in self._different)

    def lines(self) -> Iterator[str]:
        """Yield a line on the differences, then the table."""
        where = "no difference" if self._having == self._dialects else f"in {', '.join(self._having)} alone"
        if self._different:
            first, _, shown = self._different[0]
            cells = " vs ".join(map(_cell, shown))
            where = f"first differ in scan {first}: {cells}; {self._differing_scans} scans differ"
        yield one_line(f"{self._head}: {where}")
        yield from format_columns(self._table(), "rl" + "l" * len(self._dialects))

    def _table(self) -> Iterator[tuple[str, ...]]:
        yield ("    scan", "", *self._dialects)
        for row in self.rows:
            first, last, shown = row
            mark = DIFFERS_MARK if len({*shown} - {None}) > 1 else ""
            yield (str(first) if first == last else f"{first}-{last}", mark, *map(_cell, shown))


def _cell(shown: Outputs | None) -> str:
    """Return outputs as in `7008 D 8 B`: STATUS, lit lamps, RCVD_LEN."""
    if shown is None:
        return NOTHING_MARK
    lamps = "B" * shown.busy + "D" * shown.done + "E" * shown.error
    return " ".join(
        filter(None, (f"{shown.status:04X}", lamps, f"{shown.rcvd_len} B" * bool(shown.rcvd_len)))
    )
