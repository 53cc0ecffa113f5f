"""What-if: a recorded run, the same run with other parameters, their first difference, and their results.

Rule 1: partners repeat their recorded acts at the recorded times (replay/partners.py).
Rule 2: only keys that are declared replayable may change. A recording cannot show the effect of other keys.
Rule 3: commands act in their recorded scans. Commands that write a pin with a kept value are left out and
counted.
Rule 4: with another interval both runs advance by time, and the recorded run is a scan ahead.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import sub
from typing import Final, NamedTuple, cast

from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.commands import words
from trcvtui.errors import UserError, mistake
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.project.convert_dialect import convert_project, find_dialect
from trcvtui.project.keys import is_replayable
from trcvtui.project.project import Project
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.partners import GuessReason, ReplayedPartners
from trcvtui.replay.recorded_run import InheritedSocket, RecordedRun
from trcvtui.replay.run_again import REST_LINE, ReplayRun, RunRoots, roots_of
from trcvtui.scenario.report import JsonLines, outputs_record
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.values import decode_leaves
from trcvtui.wording import count

RECORDED_RUN, WHAT_IF_RUN = "recorded", "what-if"
GUESS_TEXTS: Final = {
    GuessReason.PARTNER: "the partner might do something else",
    GuessReason.BYTES: "the run needs bytes that the recording lacks",
    GuessReason.TIME: "something came between two scans, and the recording does not say when",
}
LEAVES_PER_READ: Final = 1024
QUIET_SCANS: Final = 3  # scans without a change, after which time alone changes something
Change = Callable[[Sequence[str], str | None], tuple[Project, Sequence[str]]]


class RunTotals(NamedTuple):
    """The results of a run: jobs with DONE, ERRORs, bytes that blocks read."""

    jobs: int
    errors: int
    bytes: int


class ValueDifference(NamedTuple):
    """The first DONE at which a value differs between both runs: the scan, the member, and both values."""

    scan: int
    member: str
    recorded: Value | None
    what_if: Value | None


class _HeldPins:
    """Pins that keep their values. `skipped` counts the commands that would have written such a pin."""

    def __init__(self, pins: frozenset[tuple[str, str]]) -> None:
        self._pins = pins
        self.skipped = 0

    def filter_command(self, command: words.BenchCommand) -> words.BenchCommand | None:
        """Return the command without pins that keep their values, None if nothing remains."""
        match command:
            case words.SetInputs(name, pins):
                left = tuple([each for each in pins if (name, each[0]) not in self._pins])
                self.skipped += len(left) < len(pins)
                return replace(command, pins=left) if left else None
            case words.PulsePin(name, pin) if (name, pin) in self._pins:
                self.skipped += 1
                return None
        return command


def _split_paths(sets: Sequence[str]) -> list[list[str]]:
    paths = [text.partition("=")[0].strip().split(".") for text in sets]
    return [path for path in paths if len(path) == 3]


def find_changed_pins(sets: Sequence[str]) -> frozenset[tuple[str, str]]:
    return frozenset((path[1], path[2]) for path in _split_paths(sets) if path[0] == "instance")


class _ChangedRun(ReplayRun):
    """The run with other parameters: it gets the commands of the recorded run."""

    def prepare(self, partners: ReplayedPartners, held: _HeldPins) -> None:
        self._partners, self._held, self._quiet = partners, held, 0
        self.notes: list[str] = []
        self.bench.filter_program(held.filter_command)

    def run_lines_and_scan(self, lines: Sequence[str]) -> None:
        self._quiet = 0
        for line in lines:
            if line == REST_LINE:
                self.bench.step_peers_alone()
                continue
            try:
                self._run_line(line)
            except UserError as wrong:
                self.notes.append(f"scan {self.bench.runtime.scans + 1}: left out: {wrong.problems[0]}")
        self.bench.step()
        self._partners.compare_scan()

    def pass_quiet_scans(self, most: int) -> None:
        runtime, interval = self.bench.runtime, self.bench.runtime.interval_ns
        if self._quiet >= QUIET_SCANS:
            until = self.bench.quiet_until()
            scans = most if until is None else min(most, -(-until // interval) - runtime.scans)
            if scans > 0:
                self.bench.skip(scans)
                return
        seq = runtime.ledger.last_seq
        with self._partners.pause_partners():
            self.bench.step()
        is_quiet = not runtime.changed and runtime.ledger.last_seq == seq
        self._quiet = self._quiet + 1 if is_quiet else 0

    def run_command(self, command: words.BenchCommand) -> None:
        left = self._held.filter_command(command)
        if left is not None:
            super().run_command(left)


class WhatIf:
    """Both runs, scan by scan. `recorded` and `what_if` are the benches of the two runs.

    If the run was made from a capture, `change` makes the project with other parameters.
    """

    def __init__(
        self, keyframes: Keyframes, sets: Sequence[str], dialect: str | None, change: Change | None = None
    ) -> None:
        self._keyframes, self._sets = keyframes, tuple(sets)
        self.recorded_run = recorded = keyframes.start_run()
        recorded.take_lines()  # a keyframe may have some from long before
        self._where = recorded.where
        if recorded.replay.has_lost_entries:
            found = "a file that begins in the middle, without a keyframe"
            raise mistake(self._where, found, "the run's beginning or a keyframe: a what-if needs one")
        self._is_late = keyframes.first > 0
        self._check_answerable()
        self._changed, self._notes = self._change_roots(dialect, change)
        self._peers = frozenset(peer.name for peer in self.recorded.project.peers)
        standing = [InheritedSocket(*one) for one in self.recorded.runtime.sockets()] if self._is_late else ()
        self._source = RecordedRun(self._peers, standing, recorded.replay.scan)
        self._source.read_beginning(keyframes.read_entries())
        self._held = _HeldPins(self.pins)
        self._lines: list[str] | None = None  # before a recorded scan that the other run has yet to do
        self._is_over = False
        self._before = self._count_results(self.recorded)
        self._shown: tuple[dict[str, Outputs], dict[str, Outputs]] = {}, {}  # at the same time (Rule 4)
        self._later: list[tuple[int, Sequence[str], Sequence[StatusEdge]]] = []  # recorded scans, by time
        # What the last scan changed in the recorded run and in the other one.
        self.edges: tuple[Sequence[StatusEdge], Sequence[StatusEdge]] = (), ()
        self.parts_at: int | None = None
        self.guess_from: int | None = None
        self.guess_why: GuessReason | None = None
        self.value: ValueDifference | None = None
        self.trouble = ""  # why the recorded run ends early
        self._what_if = self._start_what_if()

    def _check_answerable(self) -> None:
        """Raise UserError for a key that decides what a partner sees or does (Rule 2)."""
        for text in self._sets:
            path = text.partition("=")[0].strip()
            if is_replayable(path.split(".")):
                continue
            begins = self.recorded_run.begins
            expected = "an input, data, a task's interval or priority, an option, or --dialect"
            if begins.is_scenario and begins.kernel == "sim":
                expected += f"; for this key start a new run: trcvtui scenario {begins.path} --set {text}"
            raise mistake(self._where, f"--set {text}: a recording cannot answer this", expected)

    def _change_roots(self, dialect: str | None, change: Change | None) -> tuple[RunRoots, list[str]]:
        begins, scenario, project = self._keyframes.roots
        if change is not None:
            made, remarks = change(self._sets, dialect)
            return (begins, None, made), [*remarks]
        notes: list[str] = []
        if self._sets:
            begins, scenario, project = roots_of(begins, self.recorded_run.replay.files, self._sets)
        if dialect is not None:
            project, remarks = convert_project(project, find_dialect(dialect))
            notes += remarks
        if self._is_late:
            self._check_late_changes(project, dialect)
            notes.append(f"changed from scan {self._keyframes.first + 1} on: the file begins there")
        return (begins, scenario, project), notes

    def _check_late_changes(self, project: Project, dialect: str | None) -> None:
        """Raise UserError for a --set or --dialect that cannot apply in the middle of a run."""
        wrong = "" if dialect is None else "--dialect"
        for text in self._sets:
            match text.partition("=")[0].strip().split("."):
                case ["instance", name, pin] if pin in dict(self.recorded.runtime.inputs(name)):
                    continue
                case ["data", name, "layout" | "byte_order"]:
                    had, has = self.recorded.project.data_decl(name), project.data_decl(name)
                    if had is not None and has is not None and had.size == has.size:
                        continue
                    wrong = f"--set {text}, which changes the size"
                case _:
                    wrong = f"--set {text}"
        if wrong:
            expected = (
                "an input of an instance, layout or byte_order of data: all else needs the run's beginning"
            )
            raise mistake(self._where, f"{wrong} on a file that begins in the middle", expected)

    @property
    def pins(self) -> frozenset[tuple[str, str]]:
        return find_changed_pins(self._sets)

    @property
    def project(self) -> Project:
        return self._changed[2]

    @property
    def recorded(self) -> Bench:
        return self.recorded_run.bench

    @property
    def what_if(self) -> Bench:
        return self._what_if.bench

    def scan(self) -> bool:
        """Let one scan pass in both runs, or in one run; return False if both runs have ended."""
        if not (self._scan_in_step() if self._partners.intervals_ns is None else self._scan_in_time()):
            return False
        if self.parts_at is not None and self.what_if.plan.active:
            self._partners.note_guess(GuessReason.TIME)  # a planned fault counts calls
        if self.guess_from is None and self._partners.guess_from is not None:
            self.guess_from, self.guess_why = self.scans, self._partners.guess_why
        return True

    def _scan_in_step(self) -> bool:
        if self._lines is None and not self._is_over:
            self._is_over = not self._scan_recorded()
        between = self.recorded.runtime.scans - self.what_if.runtime.scans - (not self._is_over)
        if between > 0:
            self._what_if.pass_quiet_scans(between)
        elif self._lines is None:
            return False
        else:
            self._what_if.run_lines_and_scan(self._lines)
            self._lines = None
        was = () if self._lines is not None else self.recorded.runtime.changed
        self.edges = was, now = was, self.what_if.runtime.changed
        if self.parts_at is None and _map_outputs(was) != _map_outputs(now):
            self.parts_at = self.scans
        if self.value is None:
            self._compare_values(was, now)
        return True

    def _scan_in_time(self) -> bool:
        partners, recorded = self._partners, self.recorded
        until = partners.due_ns + partners.slack_ns
        if not self._is_over and (not self._later or self._later[-1][0] <= until):
            self._is_over = not self._scan_recorded()
            if not self._is_over:
                self._later.append((recorded.now, self._lines or (), recorded.runtime.changed))
                self.edges, self._lines = (recorded.runtime.changed, ()), None
                return True
        if self._is_over and recorded.now < partners.due_ns:
            return False
        passed = [each for each in self._later if each[0] <= until]
        self._later = self._later[len(passed) :]
        self._what_if.run_lines_and_scan([line for _, lines, _ in passed for line in lines])
        self.edges = (), self.what_if.runtime.changed
        was = [edge for *_, edges in passed for edge in edges]
        for shown, edges in zip(self._shown, (was, self.edges[1]), strict=True):
            shown.update(_map_outputs(edges))
        if self.parts_at is None and self._shown[0] != self._shown[1]:
            self.parts_at = self.scans
        return True

    def _start_what_if(self) -> _ChangedRun:
        partners = self._partners = ReplayedPartners(self._source, self._peers)
        if not self._is_late:
            run = _ChangedRun(iter(()), self._where, partners, roots=self._changed)
        else:
            run = self._keyframes.start_other_run(_ChangedRun, partners)
        run.prepare(partners, self._held)
        intervals = run.bench.runtime.interval_ns, self.recorded.runtime.interval_ns
        if intervals[0] != intervals[1]:
            partners.intervals_ns = intervals
        if not self._is_late:
            return run
        project = self._changed[2]
        for kind, name, key in _split_paths(self._sets):
            decl = project.instance(name) if kind == "instance" else None
            if decl is not None:
                run.bench.do(words.SetInputs(name, ((key, dict(decl.inputs)[key]),)))
        run.bench.project = replace(run.bench.project, data=project.data)
        return run

    def _scan_recorded(self) -> bool:
        try:
            if self.recorded_run.scan():
                self._source.advance()
                self._lines = self.recorded_run.take_lines()
                return True
            self.trouble = "" if self.recorded_run.is_whole else str(self.recorded_run.make_end_error())
        except UserError as wrong:
            self.trouble = str(wrong)
        return False

    @property
    def scans(self) -> int:
        """Return the last scan of the run with other parameters."""
        return self.what_if.runtime.scans

    def run_to_end(self) -> None:
        while self.scan():
            pass

    def _compare_values(self, was: Sequence[StatusEdge], now: Sequence[StatusEdge]) -> None:
        also = {edge.instance for edge in now if edge.outputs.done}
        for edge in was:
            if edge.outputs.done and edge.instance in also and self.value is None:
                self.value = self._find_difference(edge.instance)

    def _find_difference(self, instance: str) -> ValueDifference | None:
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
        for start in range(0, count, LEAVES_PER_READ):
            stop = min(start + LEAVES_PER_READ, count)
            pairs = zip(
                decode_leaves(decl.layout, before, start, stop),
                decode_leaves(other.layout, after, start, stop),
                strict=True,
            )
            for number, (one, two) in enumerate(pairs, start):
                if one != two and not (one != one and two != two):  # NaN is not equal to itself
                    path = decl.layout.leaf(number).path
                    member = f"{decl.name}.{path}" if path else decl.name
                    return ValueDifference(was.runtime.scans, member, one, two)
        return None

    def get_totals(self) -> tuple[RunTotals, RunTotals]:
        return (
            RunTotals(*self._count_since_begin(self.recorded), self._source.bytes_read),
            RunTotals(*self._count_since_begin(self.what_if), self._partners.bytes_read),
        )

    @staticmethod
    def _count_results(bench: Bench) -> tuple[int, int]:
        instances = bench.runtime.snapshot().instances
        return sum(i.jobs_done for i in instances), sum(i.errors for i in instances)

    def _count_since_begin(self, bench: Bench) -> tuple[int, int]:
        return cast(tuple[int, int], tuple(map(sub, self._count_results(bench), self._before)))

    def make_record(self) -> dict[str, object]:
        was, now = self.get_totals()
        return {
            "parts_at_scan": self.parts_at,
            "guess_from_scan": self.guess_from,
            "guess_why": self.guess_why,
            "recorded": was._asdict(),
            "what_if": now._asdict(),
        }

    def describe(self) -> Iterator[str]:
        was, now = self.get_totals()
        same = "in each scan" if self._partners.intervals_ns is None else "at each time"
        yield (f"first difference at scan {self.parts_at}" if self.parts_at else f"STATUS is the same {same}")
        if self.value is not None:
            value = self.value
            yield (
                f"scan {value.scan}: {value.member} is {_format_value(value.recorded)} recorded, "
                f"{_format_value(value.what_if)} what-if"
            )
        yield f"recorded: {was.jobs} DONE, {was.errors} ERROR, {was.bytes} bytes read"
        yield f"what-if:  {now.jobs} DONE, {now.errors} ERROR, {now.bytes} bytes read"
        if self.guess_why is not None:
            yield f"from scan {self.guess_from} on the what-if is a guess: {GUESS_TEXTS[self.guess_why]}"
        if self._held.skipped:
            yield f"{count(self._held.skipped, 'command')} left out: a pin held by the what-if is not written"
        for scan, part in self._source.failures.items():
            yield f"scan {scan}: {part} had an internal error only in the recorded run"
        yield from (*self._notes, *self._what_if.notes)


def _map_outputs(edges: Sequence[StatusEdge]) -> Mapping[str, Outputs]:
    return {edge.instance: edge.outputs for edge in edges}


def _format_value(value: Value | None) -> str:
    return json.dumps(value) if isinstance(value, str) else str(value)


def print_both_runs(run: WhatIf, write: Callable[[str], object]) -> None:
    """Write the records of both runs in scan order, then their results."""
    benches, names = (run.recorded, run.what_if), (RECORDED_RUN, WHAT_IF_RUN)
    reports = [JsonLines(write, bench.runtime.interval_ns, bench) for bench in benches]
    while run.scan():
        guess = {"guess": True} if run.guess_from is not None else {}
        for report, bench, name, edges in zip(reports, benches, names, run.edges, strict=True):
            more = guess if name == WHAT_IF_RUN else {}
            for edge in edges:
                report.write_line(bench.runtime.scans, {"run": name, **outputs_record(edge), **more})
    reports[0].write_record(run.make_record())
