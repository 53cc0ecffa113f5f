"""A scenario file: a project (its own or another file's) and `[scenario]` with name, about and steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

from trcvtui.errors import Problem, UserError
from trcvtui.project.file import load_project, load_scenario_document
from trcvtui.project.project import Project
from trcvtui.project.tables import TEXT, Table
from trcvtui.rig.bench.program import read_program
from trcvtui.rig.commands.instances import after
from trcvtui.rig.commands.library import check_library
from trcvtui.rig.commands.routine import read_replies, read_routines
from trcvtui.rig.commands.table import parse_script
from trcvtui.rig.commands.words import (
    BenchCommand,
    Expect,
    ExpectTrace,
    RunFor,
    RunScans,
    Step,
    TrySplits,
    Wait,
)

T = TypeVar("T")

START_STEP: Final = 0  # the steps of a scenario count from 1


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario: its project, the `start` steps that come before scan 1, and its own steps."""

    name: str
    about: str
    project: Project
    start: tuple[Step, ...]
    steps: tuple[Step, ...]


def load_scenario(path: Path, overrides: Sequence[str] = ()) -> Scenario:
    """Return a scenario; raise UserError with every mistake of the file."""
    project, raw = load_scenario_document(path, overrides)
    table = Table(raw, f"{path}: scenario", [])
    name = table.get("name", TEXT, path.stem)
    about = table.get("about", TEXT, "")
    text = table.must("steps", TEXT)
    table.finish()
    problems = table.problems
    start = _collected(problems, lambda: start_steps(project)) or ()
    _collected(problems, lambda: read_program(project))
    _collected(problems, lambda: read_routines(project))
    _collected(problems, lambda: read_replies(project))
    _collected(problems, lambda: check_library(project))
    # A file named in a step stands beside the scenario, also where the project stands elsewhere.
    here = replace(project, base=path.parent)
    for step in start:
        here = after(step.command, here)
    steps = _collected(problems, lambda: parse_script(text or "", here, str(path))) or ()
    if problems:
        raise UserError(problems)
    return Scenario(name, about, project, start, tuple(steps))


def _collected(problems: list[Problem], read: Callable[[], T]) -> T | None:
    """Return what is read; leave what is wrong with it in `problems`."""
    try:
        return read()
    except UserError as wrong:
        problems += wrong.problems
        return None


def load_bench(path: Path, overrides: Sequence[str] = ()) -> Project:
    """Return the project of a file; raise UserError for its mistakes, those of its bench commands too."""
    project = load_project(path, overrides)
    check_bench(project)
    return project


def check_bench(project: Project) -> None:
    """Raise UserError with every mistake in the bench commands of a project."""
    problems: list[Problem] = []
    _collected(problems, lambda: start_steps(project))
    _collected(problems, lambda: read_program(project))
    _collected(problems, lambda: read_routines(project))
    _collected(problems, lambda: read_replies(project))
    _collected(problems, lambda: check_library(project))
    if problems:
        raise UserError(problems)


def start_steps(project: Project) -> tuple[Step, ...]:
    """Return the commands of `start`, all as step 0; they come before scan 1 and can let no scan pass."""
    where = f"{project.path}: start"
    steps = tuple(parse_script(project.start, project, where))
    waiting = [step for step in steps if _lets_scans_pass(step.command)]
    if waiting:
        expected = "commands that let no scan pass"
        raise UserError(Problem(f"{where}: step {s.number}", f"'{s.line}'", expected) for s in waiting)
    return tuple([replace(step, number=START_STEP) for step in steps])


def _lets_scans_pass(command: BenchCommand) -> bool:
    if isinstance(command, Expect):
        return command.within_ns is not None
    return isinstance(command, RunScans | RunFor | Wait | ExpectTrace | TrySplits)
