"""What the PLC's own program does while scans pass: `program` of a project, one course of bench commands.

Rule: it writes what a program can write, inputs and DATA; whatever else happens comes from peers and people.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import repeat
from typing import Final, Protocol

from trcvtui.errors import Problem, UserError
from trcvtui.project.project import Project
from trcvtui.rig.bench.conditions import Watched, found, holds
from trcvtui.rig.commands import words as words
from trcvtui.rig.commands.table import parse_script

WRITES: Final = (words.Set, words.Pulse, words.Write)
PASSES: Final = (words.RunScans, words.RunFor, words.Wait)


class Programmed(Watched, Protocol):
    """The bench that a program runs on."""

    def do(self, command: words.BenchCommand) -> str:
        """Carry out a command."""
        ...

    def note(self, subject: str, what: str, detail: str = "") -> None:
        """Write into the ledger."""
        ...


def read_program(project: Project) -> tuple[words.Step, ...]:
    """Return the steps of `program`; raise UserError with every mistake."""
    where = f"{project.path}: program"
    steps = tuple(parse_script(project.program, project, where))
    foreign = [step for step in steps if not isinstance(step.command, WRITES + PASSES)]
    if foreign:
        expected = "set, pulse, write, run or wait"
        raise UserError(Problem(f"{where}: step {s.number}", f"'{s.line}'", expected) for s in foreign)
    return steps


class Program:
    """One course of steps on one bench; a `wait` that runs out ends it, and the ledger says so."""

    def __init__(self, steps: Sequence[words.Step], bench: Programmed) -> None:
        self._bench = bench
        self._course = self._play(steps)
        self.is_over = False

    def go_on(self) -> None:
        """Do what is due before the next scan."""
        self.is_over = next(self._course, self) is self

    def _play(self, steps: Sequence[words.Step]) -> Iterator[None]:
        """Play the steps; each time this yields, one scan passes."""
        for step in steps:
            match step.command:
                case words.RunScans(scans):
                    yield from repeat(None, scans)
                case words.RunFor(ns):
                    yield from repeat(None, self._scans_in(ns))
                case words.Wait(condition, within_ns):
                    yield from self._until(condition, within_ns)
                    if not holds(self._bench, condition):
                        self._give_up(step, condition)
                        return
                case command:
                    self._bench.do(command)

    def _until(self, condition: words.Condition, within_ns: int) -> Iterator[None]:
        for _ in range(self._scans_in(within_ns)):
            if holds(self._bench, condition):
                return
            yield

    def _give_up(self, step: words.Step, condition: words.Condition) -> None:
        self._bench.note("program", f"gave up at `{step.line}`", found(self._bench, condition))

    def _scans_in(self, ns: int) -> int:
        return ns // self._bench.runtime.interval_ns
