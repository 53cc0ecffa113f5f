"""One step on a bench: its command carried out, its expectation judged, the STATUS of every scan kept.

Rule: a step lets no scan pass by itself. It asks for each one, so that a runner can let it pass at once or at
the clock's pace, and an engine between serving its screen.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import repeat

from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.bench.conditions import found, holds
from trcvtui.rig.bench.split_test import SplitTrial
from trcvtui.rig.commands import words as words
from trcvtui.rig.scenario.trace import Trace


@dataclass(frozen=True, slots=True)
class Failure:
    """An expectation that did not hold: the number of its command, its line, what was found."""

    step: int
    line: str
    found: str


class Stage:
    """Steps on one bench. `failure` is that of the last step; `is_over` once a `wait` has failed."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.failure: Failure | None = None
        self.is_over = False
        self.trial: SplitTrial | None = None  # the last one
        self.traces: dict[str, Trace] = defaultdict(Trace)  # an instance may be created on the way
        for decl in bench.project.instances:
            self.traces[decl.name] = Trace()

    def take(self, step: words.Step) -> Iterator[None]:
        """Take one step; each time this yields, one scan has to pass and `scanned` to be called."""
        self.failure = None
        match step.command:
            case words.RunScans(scans):
                yield from repeat(None, scans)
            case words.RunFor(ns):
                yield from repeat(None, self._scans_in(ns))
            case words.Wait(condition, within_ns):
                yield from self._until(step, condition, within_ns)
                self.is_over = self.failure is not None
            case words.Expect(condition, within_ns):
                yield from self._until(step, condition, within_ns or 0)
            case words.ExpectTrace(instance, pattern):
                section = self.traces[instance].take()
                if not section.fits(pattern):
                    self._fail(step, str(section))
            case words.TrySplits() as command:
                yield from self._try_splits(step, command)
            case command:
                self._do(step, command)

    def scanned(self) -> None:
        """Keep what the scan that has just passed shows."""
        for edge in self.bench.runtime.called:
            self.traces[edge.instance].add((edge.outputs.status, edge.outputs.error))

    def _do(self, step: words.Step, command: words.BenchCommand) -> None:
        # No wait: when `do` returns, the local kernel has taken all of a send that it can take now.
        error = self.bench.do(command)
        if error:
            self._fail(step, error)

    def _until(self, step: words.Step, condition: words.Condition, within_ns: int) -> Iterator[None]:
        left = self._scans_in(within_ns)
        while not holds(self.bench, condition):
            if left == 0:
                self._fail(step, found(self.bench, condition))
                return
            left -= 1
            yield

    def _try_splits(self, step: words.Step, command: words.TrySplits) -> Iterator[None]:
        self.trial = SplitTrial(self.bench, command)
        yield from self.trial.run()
        wrong = self.trial.verdict()
        if wrong:
            self._fail(step, wrong)

    def _fail(self, step: words.Step, what: str) -> None:
        self.failure = Failure(step.number, step.line, what)

    def _scans_in(self, ns: int) -> int:
        return ns // self.bench.runtime.interval_ns
