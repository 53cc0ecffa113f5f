"""A scenario file: a project (its own or another file's) and `[scenario]` with name, about and steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from trcvtui.errors import Problem, UserError
from trcvtui.plc.project import Project
from trcvtui.plc.project_file import load_project, load_scenario_document
from trcvtui.plc.tables import TEXT, Table
from trcvtui.rig.bench import parse_script
from trcvtui.rig.bench_words import ExpectTrace, RunFor, RunScans, Step, Wait
from trcvtui.rig.routine import read_routines

LETS_SCANS_PASS: Final = (RunScans, RunFor, Wait, ExpectTrace)


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
    if table.problems or text is None:
        raise UserError(table.problems)
    return Scenario(name, about, project, start_steps(project), tuple(parse_script(text, project, str(path))))


def load_bench(path: Path) -> Project:
    """Return the project of a file; raise UserError for its mistakes, those of its bench commands too."""
    project = load_project(path)
    start_steps(project)
    read_routines(project)
    return project


def start_steps(project: Project) -> tuple[Step, ...]:
    """Return the commands of `start`; they come before scan 1 and can let no scan pass."""
    where = f"{project.path}: start"
    steps = tuple(parse_script(project.start, project, where))
    waiting = [step for step in steps if isinstance(step.command, LETS_SCANS_PASS)]
    if waiting:
        expected = "commands that let no scan pass"
        raise UserError(Problem(f"{where}: step {s.number}", f"'{s.line}'", expected) for s in waiting)
    return steps
