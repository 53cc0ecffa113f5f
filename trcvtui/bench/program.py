"""The `program` of a project: bench commands that are carried out in sequence while scans pass.

Rule: a program writes only inputs and DATA. All else comes from peers and the user.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Protocol

from msgspec.structs import replace

from trcvtui.bench.conditions import WatchedBench, describe_now, holds
from trcvtui.commands import words
from trcvtui.commands.table import parse_script
from trcvtui.errors import Problem, UserError
from trcvtui.project.project import Project

WRITE_COMMANDS: Final = (words.SetInputs, words.PulsePin, words.WriteBytes)
WAIT_COMMANDS: Final = (words.RunScans, words.RunFor, words.Wait)


class ProgrammedBench(WatchedBench, Protocol):
    def do(self, command: words.BenchCommand) -> str: ...

    def note(self, subject: str, what: str, detail: str = "") -> None: ...


def read_program(project: Project) -> tuple[words.Step, ...]:
    """Return the steps of `program`; raise UserError with every mistake."""
    where = f"{project.path}: program"
    steps = tuple(parse_script(project.program, project, where))
    foreign = [step for step in steps if not isinstance(step.command, WRITE_COMMANDS + WAIT_COMMANDS)]
    if foreign:  # what a PLC's program cannot do
        expected = "set, pulse, write, run or wait"
        raise UserError(Problem(f"{where}: step {s.number}", f"'{s.line}'", expected) for s in foreign)
    return steps


class Program:
    """Runs steps once on one bench. A `wait` that times out ends the program, and the ledger notes this."""

    def __init__(self, steps: Sequence[words.Step], bench: ProgrammedBench) -> None:
        self._bench = bench
        self._steps = steps
        self._at = 0  # the next or running step
        self._scans_to_pass: int | None = None  # in the running step
        self.is_over = False

    def filter_steps(self, left_of: Callable[[words.BenchCommand], words.BenchCommand | None]) -> None:
        """Replace each command by the result of `left_of`; if that is None, by a command without effect."""
        nothing = words.RunScans(0)
        self._steps = [replace(step, command=left_of(step.command) or nothing) for step in self._steps]

    def advance(self) -> None:
        """Do what is due before the next scan."""
        while self._at < len(self._steps):
            if self._do_or_wait(self._steps[self._at]):
                return
            self._at, self._scans_to_pass = self._at + 1, None
        self.is_over = True

    def _do_or_wait(self, step: words.Step) -> bool:
        match step.command:
            case words.RunScans(scans):
                most = scans
            case words.RunFor(ns) | words.Wait(_, ns):
                most = ns // self._bench.runtime.interval_ns
            case command:
                name = getattr(command, "instance", "")
                if not name or self._bench.project.instance(name) is not None:  # it may have been deleted
                    self._bench.do(command)
                return False
        awaited = step.command.condition if isinstance(step.command, words.Wait) else None
        if awaited is not None and holds(self._bench, awaited):
            return False
        scans = most if self._scans_to_pass is None else self._scans_to_pass
        self._scans_to_pass = scans - 1
        if scans <= 0 and awaited is not None:
            self._give_up(step, awaited)
        return scans > 0

    def _give_up(self, step: words.Step, condition: words.Condition) -> None:
        self._bench.note("program", f"gave up at `{step.line}`", describe_now(self._bench, condition))
        self._at = len(self._steps)
