"""What-if: a recorded run beside itself with other parameters; where they part, and what comes of it.

Rule 1: partners do what they did, when they did it (capture/partners.py).
Rule 2: commands act in their recorded scans; what writes a pin that is held is left out and counted.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

from trcvtui.capture.journal import Entry
from trcvtui.capture.partners import PartnersAgain
from trcvtui.capture.recorded_run import RecordedRun
from trcvtui.capture.replay import Replay
from trcvtui.errors import UserError, mistake
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.project.convert_dialect import dialect_named, in_dialect
from trcvtui.project.project import Project
from trcvtui.records import NamedTuple, replace
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.bench.program import read_program
from trcvtui.rig.commands import words
from trcvtui.rig.commands.table import record_row
from trcvtui.rig.replay.run_again import REST_LINE, RunAgain
from trcvtui.rig.scenario.report import JsonLines, outputs_record
from trcvtui.rig.wording import count
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.values import decode_leaves

RECORDED, WHAT_IF = "recorded", "what-if"
LEAVES_AT_ONCE: Final = 1024
Entries = Callable[[], Iterator[Entry]]


class Sum(NamedTuple):
    """What has come of a run: jobs with DONE, ERRORs, bytes that blocks have read."""

    jobs: int
    errors: int
    bytes: int


class ValueDiffers(NamedTuple):
    """The first DONE of both runs with another value: its scan, the member, both values."""

    scan: int
    member: str
    recorded: Value | None
    what_if: Value | None


class _Held:
    """Pins that keep their values; `skipped` counts commands that would have written them."""

    def __init__(self, pins: frozenset[tuple[str, str]]) -> None:
        self._pins = pins
        self.skipped = 0

    def left_of(self, command: words.BenchCommand) -> words.BenchCommand | None:
        """Return what is left of a command, None where nothing is."""
        match command:
            case words.Set(name, pins):
                left = tuple([each for each in pins if (name, each[0]) not in self._pins])
                self.skipped += len(left) < len(pins)
                return replace(command, pins=left) if left else None
            case words.Pulse(name, pin) if (name, pin) in self._pins:
                self.skipped += 1
                return None
        return command

    def program(self, project: Project) -> str:
        """Return the program of a project without these pins."""
        lines = []
        for step in read_program(project):
            left = self.left_of(step.command)
            if left is not None:
                lines.append(step.line if left is step.command else record_row(type(left)).write(left))
        return "\n".join(lines)


class _RunChanged(RunAgain):
    """The run with other parameters: it is told what the recorded run was told."""

    def __init__(
        self, told: RecordedRun, partners: PartnersAgain, where: str, sets: Sequence[str], dialect: str | None
    ) -> None:
        self.partners = partners
        self._dialect = dialect
        self._sets = sets
        self._held = _Held(frozenset())
        self.notes: list[str] = []
        super().__init__(iter(()), where, partners, sets)

    def project_to_run(self, project: Project) -> Project:
        """Return the recorded one with other parameters."""
        pins = [tuple(text.partition("=")[0].strip().split(".")) for text in self._sets]
        self._held = _Held(frozenset((p[1], p[2]) for p in pins if len(p) == 3 and p[0] == "instance"))
        if self._dialect is not None:
            project, notes = in_dialect(project, dialect_named(self._dialect))
            self.notes += notes
        return replace(project, program=self._held.program(project))

    @property
    def skipped(self) -> int:
        """Return how many commands were left out because of a pin that is held."""
        return self._held.skipped

    def follow(self, lines: Sequence[str]) -> None:
        """Do what the recorded run was told before this scan, and let the scan pass."""
        for line in lines:
            if line == REST_LINE:
                self.bench.rest()
                continue
            try:
                self._do(line)
            except UserError as wrong:
                self.notes.append(f"scan {self.bench.runtime.scans + 1}: left out: {wrong.problems[0]}")
        self.bench.step()

    def act(self, command: words.BenchCommand) -> None:
        """Carry out what is left of a command."""
        left = self._held.left_of(command)
        if left is not None:
            super().act(left)


class WhatIf:
    """Both runs, scan by scan; `recorded` and `what_if` are their benches."""

    def __init__(self, entries: Entries, where: str, sets: Sequence[str], dialect: str | None) -> None:
        if Replay(entries(), where).is_in_the_middle:
            raise mistake(where, "a file that begins in the middle", "the run's beginning, for a what-if")
        self._recorded = RunAgain(entries(), where)
        peers = frozenset(peer.name for peer in self._recorded.bench.project.peers)
        self._told = RecordedRun(entries(), peers)
        self._partners = PartnersAgain(self._told, peers)
        self._what_if = _RunChanged(self._told, self._partners, where, sets, dialect)
        self.parts_at: int | None = None
        self.value: ValueDiffers | None = None
        self.trouble = ""  # why the recorded run ends early

    @property
    def recorded(self) -> Bench:
        """Return the bench as it was."""
        return self._recorded.bench

    @property
    def what_if(self) -> Bench:
        """Return the bench with other parameters."""
        return self._what_if.bench

    @property
    def guess_from(self) -> int | None:
        """Return the first scan in which a partner would perhaps have done something else."""
        return self._partners.guess_from

    def scan(self) -> bool:
        """Let one scan of both pass; return False where the recorded run has ended."""
        try:
            if not self._recorded.scan():
                self.trouble = "" if self._recorded.is_whole else str(self._recorded.differs())
                return False
        except UserError as wrong:
            self.trouble = str(wrong)
            return False
        self._what_if.follow(self._recorded.take_lines())
        was, now = self.edges()
        if self.parts_at is None and _shown(was) != _shown(now):
            self.parts_at = self.recorded.runtime.scans
        if self.value is None:
            self._compare_values(was, now)
        return True

    def play(self) -> None:
        """Let all scans pass."""
        while self.scan():
            pass

    def edges(self) -> tuple[Sequence[StatusEdge], Sequence[StatusEdge]]:
        """Return what the last scan has changed in the recorded run and in the other one."""
        return self.recorded.runtime.changed, self.what_if.runtime.changed

    def _compare_values(self, was: Sequence[StatusEdge], now: Sequence[StatusEdge]) -> None:
        also = {edge.instance for edge in now if edge.outputs.done}
        for edge in was:
            if edge.outputs.done and edge.instance in also and self.value is None:
                self.value = self._value_of(edge.instance)

    def _value_of(self, instance: str) -> ValueDiffers | None:
        both = [(bench, bench.project.instance(instance)) for bench in (self.recorded, self.what_if)]
        found = [(b, b.project.data_decl(d.data)) for b, d in both if d is not None and d.data is not None]
        if len(found) < 2 or found[0][1] is None or found[1][1] is None:
            return None
        (was, decl), (now, other) = found
        assert decl is not None and other is not None
        before, after = was.runtime.data(decl.name), now.runtime.data(other.name)
        if decl.layout is other.layout and before == after:
            return None
        count = min(decl.layout.leaf_count, other.layout.leaf_count)
        for start in range(0, count, LEAVES_AT_ONCE):
            stop = min(start + LEAVES_AT_ONCE, count)
            pairs = zip(
                decode_leaves(decl.layout, before, start, stop),
                decode_leaves(other.layout, after, start, stop),
                strict=True,
            )
            for number, (one, two) in enumerate(pairs, start):
                if one != two and not (one != one and two != two):
                    path = decl.layout.leaf(number).path
                    member = f"{decl.name}.{path}" if path else decl.name
                    return ValueDiffers(was.runtime.scans, member, one, two)
        return None

    def sums(self) -> tuple[Sum, Sum]:
        """Return what has come of both runs."""
        return (
            _sum(self.recorded, self._told.bytes_to(self.recorded.runtime.scans)),
            _sum(self.what_if, self._partners.bytes_read),
        )

    def record(self) -> dict[str, object]:
        """Return the last line of JSON lines."""
        was, now = self.sums()
        return {
            "parts_at_scan": self.parts_at,
            "guess_from_scan": self.guess_from,
            "recorded": was._asdict(),
            "what_if": now._asdict(),
        }

    def summary(self) -> Iterator[str]:
        """Yield what there is to say in words."""
        was, now = self.sums()
        parts = f"they part at scan {self.parts_at}" if self.parts_at else "STATUS is the same in each scan"
        yield parts
        if self.value is not None:
            value = self.value
            yield (
                f"scan {value.scan}: {value.member} is {_text(value.recorded)} recorded, "
                f"{_text(value.what_if)} what-if"
            )
        yield f"recorded: {was.jobs} DONE, {was.errors} ERROR, {was.bytes} bytes read"
        yield f"what-if:  {now.jobs} DONE, {now.errors} ERROR, {now.bytes} bytes read"
        if self.guess_from is not None:
            yield f"from scan {self.guess_from} on it is a guess: the partner would perhaps do something else"
        if self._what_if.skipped:
            yield f"{count(self._what_if.skipped, 'command')} left out: a pin that is held is not written"
        yield from self._what_if.notes


def _shown(edges: Sequence[StatusEdge]) -> Mapping[str, Outputs]:
    return {edge.instance: edge.outputs for edge in edges}


def _sum(bench: Bench, size: int) -> Sum:
    instances = bench.runtime.snapshot().instances
    return Sum(sum(i.jobs_done for i in instances), sum(i.errors for i in instances), size)


def _text(value: Value | None) -> str:
    return json.dumps(value) if isinstance(value, str) else str(value)


def print_both(run: WhatIf, write: Callable[[str], object]) -> None:
    """Write the records of both runs in scan order, then what has come of them."""
    report = JsonLines(write, run.recorded.runtime.interval_ns)
    while run.scan():
        for name, edges in zip((RECORDED, WHAT_IF), run.edges(), strict=True):
            for edge in edges:
                report.line(run.recorded.runtime.scans, {"run": name, **outputs_record(edge)})
    report.write(run.record())
