"""Play a script on a bench without a stop: its steps in order, every scan observed, one verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from trcvtui.plc.ledger import StatusEdge
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.commands import words as words
from trcvtui.rig.scenario.delivery import Delivery, deliveries
from trcvtui.rig.scenario.errors_told import Errors, ErrorTold
from trcvtui.rig.scenario.step_runner import Failure, Stage


@dataclass(frozen=True, slots=True)
class Taken:
    """One step that was carried out: when it was over, in ns of the run, and what failed in it."""

    step: words.Step
    until_ns: int
    failure: Failure | None
    errors: tuple[ErrorTold, ...] = ()  # where it failed: the newest before


@dataclass(frozen=True, slots=True)
class Verdict:
    """How one scenario ended. `traces` are the STATUS runs of each instance over the whole scenario.

    `taken` are the steps in order; a failed `wait` is the last one. `errors`: oldest first.
    """

    scenario: str
    scans: int
    failures: tuple[Failure, ...]
    traces: tuple[tuple[str, str], ...]
    taken: tuple[Taken, ...]
    errors: tuple[ErrorTold, ...] = ()

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
    """One scenario on one bench; `on_scan` is told what changed in each scan, and how far sent bytes are."""

    def __init__(
        self,
        bench: Bench,
        name: str,
        pace: Pace,
        on_scan: Callable[[int, Iterable[StatusEdge], Mapping[str, Delivery]], None],
    ) -> None:
        self._bench = bench
        self._name = name
        self._pace = pace
        self._on_scan = on_scan
        self._stage = Stage(bench)
        self._taken: list[Taken] = []
        self._errors = Errors()

    def play(self, steps: Iterable[words.Step]) -> Verdict:
        """Carry out the steps in order; a failed `wait` ends the file."""
        for step in steps:
            for _ in self._stage.take(step):
                self._scan()
            failure = self._stage.failure
            errors = self._errors.newest() if failure is not None else ()
            self._taken.append(Taken(step, self._elapsed(), failure, errors))
            if self._stage.is_over:
                break
        return Verdict(
            self._name,
            self._bench.runtime.scans,
            tuple(taken.failure for taken in self._taken if taken.failure is not None),
            tuple((name, str(trace)) for name, trace in self._stage.traces.items()),
            tuple(self._taken),
            self._errors.all(),
        )

    def _elapsed(self) -> int:
        """Return the end of the last scan's interval: virtual time, or the clock's on a live bench."""
        runtime = self._bench.runtime
        return self._bench.now + runtime.interval_ns if runtime.scans else 0

    def _scan(self) -> None:
        runtime = self._bench.runtime
        self._pace.next_scan(self._bench)
        self._stage.scanned()
        if runtime.changed:
            self._errors.see(runtime.scans, runtime.changed)
            self._on_scan(runtime.scans, runtime.changed, deliveries(self._bench, runtime.changed))
