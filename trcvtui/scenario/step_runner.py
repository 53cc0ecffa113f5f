"""Runs a step on a bench: carries out its command or checks its expectation. Keeps each scan's STATUS.

Rule: a step lets no scan pass by itself, but asks for each scan. So a runner can let the scan pass at once
or at the clock's pace, and an engine can serve its screen between two scans.
Bounds of an instance's trace: MOST_NEWEST_RUNS runs of the newest scans (64 bytes each, 6.4 MB),
MOST_FIRST_RUNS runs of the oldest. A run is any number of equal scans, so a waiting instance needs one run.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator
from itertools import islice, repeat
from typing import TYPE_CHECKING, Final

from msgspec import Struct

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.bench.conditions import describe_now, holds
from trcvtui.bench.split_test import SplitTest
from trcvtui.commands import words
from trcvtui.commands.patterns import ANY_SCANS, Scan, ScanRun, TracePattern, format_trace, matches

if TYPE_CHECKING:
    from trcvtui.bench.doctor_requests import Judge

NOT_KEPT_TEXT: Final = "a run that is not kept; `trcvtui scenario` and the prompt of a bench keep it"
DOCTOR_CHECK_NS: Final = 2_000_000  # between two checks whether the doctor has ended
MOST_NEWEST_RUNS: Final = 100_000
MOST_FIRST_RUNS: Final = 5000


class TraceSection(Struct, frozen=True):
    """The scans between two `trace` lines; the oldest `lost` scans are no longer kept."""

    runs: tuple[ScanRun, ...]
    lost: int

    def fits(self, pattern: TracePattern) -> bool:
        """Return whether the pattern describes all scans. Only `...` can describe lost scans."""
        return (not self.lost or pattern.atoms[0] == ANY_SCANS) and matches(pattern, self.runs)

    def __str__(self) -> str:
        lost = f"{self.lost} older scans, not kept (only {MOST_NEWEST_RUNS} changes are), then "
        return lost * bool(self.lost) + format_trace(self.runs)


class Trace:
    """The STATUS of one instance in all scans that called it."""

    def __init__(self) -> None:
        self._since: deque[ScanRun] = deque()
        self._lost = 0
        self._first: list[ScanRun] = []
        self._is_cut = False
        self._known: dict[Scan, Scan] = {}  # equal scans share one tuple

    def add(self, scan: Scan) -> None:
        scan = self._known.setdefault(scan, scan)
        if not _lengthen_run(self._since, scan):
            self._since.append((scan, 1))
            if len(self._since) > MOST_NEWEST_RUNS:
                self._lost += self._since.popleft()[1]
        if not self._is_cut and not _lengthen_run(self._first, scan):
            self._is_cut = len(self._first) == MOST_FIRST_RUNS
            if not self._is_cut:
                self._first.append((scan, 1))

    def take_section(self) -> TraceSection:
        """Return the scans since the last call of this method, and begin a new section."""
        section = TraceSection(tuple(self._since), self._lost)
        self._since.clear()
        self._lost = 0
        return section

    def newest_text(self, most: int) -> str:
        """Return the newest groups of equal scans as a pattern, with `...` for earlier groups."""
        kept = self._since if self._is_cut else self._first
        runs = list(islice(reversed(kept), most))[::-1]
        older = self._is_cut or len(kept) > most
        return "... " * older + (format_trace(runs) if runs else "")

    def __str__(self) -> str:
        """Return the scans of the whole scenario in the notation of a pattern, `...` where they are cut."""
        return (format_trace(self._first) if self._first else "") + " ..." * self._is_cut


def _lengthen_run(runs: deque[ScanRun] | list[ScanRun], scan: Scan) -> bool:
    if not runs or runs[-1][0] != scan:
        return False
    runs[-1] = (scan, runs[-1][1] + 1)
    return True


class Failure(Struct, frozen=True):
    """An expectation that did not hold: the number of its command, its line, what was found."""

    step: int
    line: str
    found: str


class StepRunner:
    """Runs steps. The last step set `failure` and the doctor's `answer`. A failed `wait` sets `is_over`."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.failure: Failure | None = None
        self.is_over = False
        self.answer = ""
        self.judge: Judge | None = None  # of the run, if it is kept
        self.trial: SplitTest | None = None  # the last one
        self.traces: dict[str, Trace] = defaultdict(Trace)  # an instance may be created on the way
        for decl in bench.project.instances:
            self.traces[decl.name] = Trace()

    def run_step(self, step: words.Step) -> Iterator[None]:
        """Run one step. At each yield, the caller lets one scan pass and calls `note_scan`."""
        self.failure, self.answer = None, ""
        match step.command:
            case words.RunScans(scans):
                yield from repeat(None, scans)
            case words.RunFor(ns):
                end = self.scans_end_ns + ns
                while self.scans_end_ns + self.bench.runtime.interval_ns <= end:
                    yield
            case words.Wait(condition, within_ns):
                yield from self._wait_for(step, condition, within_ns)
                self.is_over = self.failure is not None
            case words.Expect(condition, within_ns):
                yield from self._wait_for(step, condition, within_ns or 0)
            case words.ExpectTrace(instance, pattern):
                section = self.traces[instance].take_section()
                if not section.fits(pattern):
                    self._fail(step, str(section))
            case words.TrySplits() as command:
                yield from self._try_splits(step, command)
            case words.AskDoctor() as command:
                yield from self._ask_doctor(step, command)
            case command:
                self._run_command(step, command)

    def note_scan(self) -> None:
        for edge in self.bench.runtime.due_edges:
            self.traces[edge.instance].add((edge.outputs.status, edge.outputs.error))

    @property
    def scans_end_ns(self) -> int:
        """Return the end of the last scan's interval, in virtual time; on a live bench in real time."""
        runtime = self.bench.runtime
        return self.bench.now + runtime.interval_ns if runtime.scans else 0

    def _run_command(self, step: words.Step, command: words.BenchCommand) -> None:
        # Not a wait for a send: when `do` returns, the local kernel has taken all bytes that it can take now.
        error = self.bench.do(command)
        if error:
            self._fail(step, error)

    def _wait_for(self, step: words.Step, condition: words.Condition, within_ns: int) -> Iterator[None]:
        scans_left = self._scans_in(within_ns)
        while not holds(self.bench, condition):
            if scans_left == 0:
                self._fail(step, describe_now(self.bench, condition))
                return
            scans_left -= 1
            yield

    def _try_splits(self, step: words.Step, command: words.TrySplits) -> Iterator[None]:
        self.trial = SplitTest(self.bench, command)
        yield from self.trial.run()
        wrong = self.trial.verdict()
        if wrong:
            self._fail(step, wrong)

    def _ask_doctor(self, step: words.Step, command: words.AskDoctor) -> Iterator[None]:
        """Ask the doctor. Until the doctor answers, scans pass on a live bench, but not in virtual time."""
        from trcvtui.bench.doctor_requests import BenchDoctor

        if self.judge is None:
            self._fail(step, NOT_KEPT_TEXT)
            return
        doctor = BenchDoctor()
        doctor.ask(self.judge, self.bench, step.number, step.line, command)
        while not (answers := [*doctor.advance(self.judge, self.bench, is_wanted=False)]):
            if self.bench.kernel_name == "live":
                yield
            else:
                clock.sleep_until(clock.now_ns() + DOCTOR_CHECK_NS)
        self.answer = answers[0].message
        if answers[0].error:
            self._fail(step, answers[0].error)

    def _fail(self, step: words.Step, what: str) -> None:
        self.failure = Failure(step.number, step.line, what)

    def _scans_in(self, ns: int) -> int:
        return ns // self.bench.runtime.interval_ns
