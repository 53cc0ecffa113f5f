"""Play a script on a bench: commands in order, expectations judged, every scan observed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from trcvtui.plc.instance import Outputs
from trcvtui.rig import bench_words as words
from trcvtui.rig.assembly import Bench
from trcvtui.rig.conditions import found, holds
from trcvtui.rig.trace import Trace


@dataclass(frozen=True, slots=True)
class Failure:
    """An expectation that did not hold: the number of its command, its line, what was found."""

    step: int
    line: str
    found: str


@dataclass(frozen=True, slots=True)
class Taken:
    """One step that was carried out: when it was over, in ns of the run, and what failed in it."""

    step: words.Step
    until_ns: int
    failure: Failure | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """How one scenario ended. `traces` are the STATUS runs of each instance over the whole scenario.

    `taken` are the steps in order; a failed `wait` is the last one.
    """

    scenario: str
    scans: int
    failures: tuple[Failure, ...]
    traces: tuple[tuple[str, str], ...]
    taken: tuple[Taken, ...]

    @property
    def passed(self) -> bool:
        """Return whether every expectation held."""
        return not self.failures


class Pace(Protocol):
    """How scans follow each other: the simulation's virtual time, or the clock's."""

    def next_scan(self, bench: Bench) -> None:
        """Let one scan pass at its time."""
        ...


class VirtualPace:
    """Scans follow each other at once, at the multiples of the interval."""

    def next_scan(self, bench: Bench) -> None:
        """Let one scan pass."""
        bench.step()


class Runner:
    """One scenario on one bench; `on_scan` is told the outputs that changed in each scan."""

    def __init__(
        self,
        bench: Bench,
        name: str,
        pace: Pace,
        on_scan: Callable[[int, Iterable[Outputs]], None],
    ) -> None:
        self._bench = bench
        self._name = name
        self._pace = pace
        self._on_scan = on_scan
        self._traces = {decl.name: Trace() for decl in bench.project.instances}
        self._failures: list[Failure] = []
        self._taken: list[Taken] = []
        self._running = True

    def play(self, steps: Iterable[words.Step]) -> Verdict:
        """Carry out the steps in order; a failed `wait` ends the file."""
        for step in steps:
            known = len(self._failures)
            self._take(step)
            failed = self._failures[known:]  # one at most: a step ends with its failure
            self._taken.append(Taken(step, self._elapsed(), failed[0] if failed else None))
            if not self._running:
                break
        return Verdict(
            self._name,
            self._bench.runtime.scans,
            tuple(self._failures),
            tuple((name, str(trace)) for name, trace in self._traces.items()),
            tuple(self._taken),
        )

    def _take(self, step: words.Step) -> None:
        match step.command:
            case words.RunScans(scans):
                self._run(scans)
            case words.RunFor(ns):
                self._run(self._scans_in(ns))
            case words.Wait(condition, within_ns):
                self._running = self._until(step, condition, within_ns)
            case words.Expect(condition, within_ns):
                self._until(step, condition, within_ns or 0)
            case words.ExpectTrace(instance, pattern):
                section = self._traces[instance].take()
                if not section.fits(pattern):
                    self._fail(step, str(section))
            case command:
                self._do(step, command)

    def _do(self, step: words.Step, command: words.BenchCommand) -> None:
        # No wait: when `do` returns, the local kernel has taken all of a send that it can take now.
        error = self._bench.do(command)
        if error:
            self._fail(step, error)

    def _until(self, step: words.Step, condition: words.Condition, within_ns: int) -> bool:
        left = self._scans_in(within_ns)
        while not holds(self._bench, condition):
            if left == 0:
                self._fail(step, found(self._bench, condition))
                return False
            left -= 1
            self._run(1)
        return True

    def _fail(self, step: words.Step, what: str) -> None:
        self._failures.append(Failure(step.number, step.line, what))

    def _elapsed(self) -> int:
        """Return the end of the last scan's interval: virtual time, or the clock's on a live bench."""
        runtime = self._bench.runtime
        return self._bench.now + runtime.interval_ns if runtime.scans else 0

    def _scans_in(self, ns: int) -> int:
        return ns // self._bench.runtime.interval_ns

    def _run(self, scans: int) -> None:
        runtime = self._bench.runtime
        for _ in range(scans):
            self._pace.next_scan(self._bench)
            for out in runtime.called:
                self._traces[out.instance].add((out.status, out.error))
            if runtime.changed:
                self._on_scan(runtime.scans, runtime.changed)
