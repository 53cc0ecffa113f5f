"""Reads a scenario file: `[scenario]`, and a project in this or another file. Lists such files."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, Final

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.bench.program import read_program
from trcvtui.commands.peer import check_all_messages, read_replies, read_routines
from trcvtui.commands.reader import project_after
from trcvtui.commands.table import parse_script
from trcvtui.commands.words import BenchCommand, Expect, ExpectTrace, RunFor, RunScans, Step, TrySplits, Wait
from trcvtui.errors import Problem, UserError, collect_problems, raise_all_problems
from trcvtui.files import read_bounded, reason_of
from trcvtui.paths import configs_path
from trcvtui.project.file import load_project, load_scenario_document
from trcvtui.project.project import Project
from trcvtui.project.tables import TEXT, Table, parse_toml

START_STEP: Final = 0  # the steps of a scenario count from 1


class Scenario(Struct, frozen=True):
    """One scenario: its project, the `start` steps before scan 1, and its own steps."""

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
    text = table.require("steps", TEXT)
    table.report_unread_keys()
    steps: list[Step] = []
    start = _read_commands(project, table.problems)
    # A file that a step names is beside the scenario, even if the project is in another folder.
    here = replace(project, base=path.parent)
    for step in start:
        here = project_after(step.command, here)
    with collect_problems(table.problems):
        steps = parse_script(text or "", here, str(path))
    if table.problems:
        raise UserError(table.problems)
    return Scenario(name, about, project, start, tuple(steps))


def _read_commands(project: Project, problems: list[Problem]) -> tuple[Step, ...]:
    """Return the commands of `start`; add the mistakes in all bench commands to `problems`."""
    start: tuple[Step, ...] = ()
    with collect_problems(problems):
        start = read_start_steps(project)
    for read in (read_program, read_routines, read_replies, check_all_messages):
        with collect_problems(problems):
            read(project)
    return start


def load_bench_project(path: Path, overrides: Sequence[str] = ()) -> Project:
    """Return the project of a file; raise UserError for mistakes in the project or its bench commands."""
    project = load_project(path, overrides)
    check_bench_commands(project)
    return project


def check_bench_commands(project: Project) -> None:
    """Raise UserError with every mistake in the bench commands of a project."""
    with raise_all_problems() as problems:
        _read_commands(project, problems)


def read_start_steps(project: Project) -> tuple[Step, ...]:
    """Return the commands of `start`, all as step 0. These steps run before scan 1 and let no scan pass."""
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


# Bounds: MOST_FILES files, MOST_ENTRIES directory entries in each place, MOST_BYTES of a file. Reading one
# takes about a millisecond, so a screen reads them one by one.

MOST_FILES: Final = 500
MOST_ENTRIES: Final = 5000
MOST_DEPTH: Final = 4
MOST_BYTES: Final = 1 << 18
MOST_LINES: Final = 5000
LONGEST_TEXT: Final = 2000
SCENARIO_FOLDER: Final = "scenarios"
_TABLE_PATTERN: Final = re.compile(rb"^[ \t]*\[[ \t]*scenario[ \t]*\]", re.MULTILINE)
_STEPS_PATTERN: Final = re.compile(r"\s*steps\s*=\s*(?:\"\"\"|''')\s*")


class ScriptLine(Struct, frozen=True):
    """One line of the steps as in the file; `step` is 0 for a blank line or a comment."""

    place: int
    step: int
    text: str


class ScenarioFile(Struct, frozen=True):
    """A scenario file as a list shows it. `problem` is the first mistake in the file, in one line.

    `blocks` (each once) and `dialect` are of the file's project, and empty if the file has a mistake.
    """

    path: Path
    name: str
    about: str
    lines: tuple[ScriptLine, ...]
    problem: str = ""
    blocks: tuple[str, ...] = ()
    dialect: str = ""


# -- the list of files -------------------------------------------------------------------------------------


class ScenarioFiles(Struct, frozen=True):
    """TOML files in reading order, each once. If `is_cut`, more files exist than are listed."""

    paths: tuple[Path, ...]
    is_cut: bool


def find_files(project: Path) -> ScenarioFiles:
    """Return the TOML files beside a project, in its scenarios/, in ./configs/scenarios, and shipped ones."""
    search = _Search()
    search.search_below(project.parent, depth=0)
    for folder in (project.parent, Path("configs"), configs_path()):
        search.search_below(folder / SCENARIO_FOLDER, MOST_DEPTH)
    return ScenarioFiles(tuple(search.found.values()), search.is_cut)


class _Search:
    """A search for files. `found` has the files by real path."""

    def __init__(self) -> None:
        self.found: dict[str, Path] = {}
        self.is_cut = False
        self._entries = 0

    def search_below(self, folder: Path, depth: int) -> None:
        self._entries = 0
        self._search_folder(folder, depth)

    def _search_folder(self, folder: Path, depth: int) -> None:
        folders: list[Path] = []
        for entry in self._entries_of(folder):
            path = folder / entry.name
            if entry.is_dir(follow_symlinks=False):
                folders.append(path)
            elif entry.name.endswith(".toml") and path.is_file():  # reading a pipe could wait for ever
                self._add_file(path)
        for inner in folders if depth else ():
            self._search_folder(inner, depth - 1)

    def _entries_of(self, folder: Path) -> list[os.DirEntry[str]]:
        room = MOST_ENTRIES - self._entries
        try:
            with os.scandir(folder) as entries:
                seen = list(islice(entries, room + 1))
        except OSError:
            return []
        self.is_cut |= len(seen) > room
        self._entries += len(seen)
        return sorted(seen[:room], key=lambda entry: entry.name)

    def _add_file(self, path: Path) -> None:
        real = os.path.realpath(path)
        if real in self.found:
            return
        if len(self.found) == MOST_FILES:
            self.is_cut = True
            return
        self.found[real] = path


# -- one file ----------------------------------------------------------------------------------------------


def read_scenario_file(path: Path) -> ScenarioFile | None:
    """Return a file as a row of the list, None if the file has no scenario."""
    try:
        content = read_bounded(path, MOST_BYTES)
    except OSError as failed:
        return ScenarioFile(path, path.stem, "", (), f"{path}: found {reason_of(failed)}, expected a file")
    if b"scenario" not in content:
        return None
    if len(content) > MOST_BYTES:
        too_large = (
            f"{path}: found a file that is too large, expected at most {MOST_BYTES} bytes for this list"
        )
        return ScenarioFile(path, path.stem, "", (), too_large) if _TABLE_PATTERN.search(content) else None
    return _parse_file(path, content)


def _parse_file(path: Path, content: bytes) -> ScenarioFile | None:
    text = content.decode("utf-8-sig", errors="replace")
    try:
        table = parse_toml(text, str(path)).get("scenario")
    except UserError:
        if not _TABLE_PATTERN.search(content):
            return None
        return ScenarioFile(path, path.stem, "", (), **_project_fields(path))
    if table is None:
        return None
    keys: dict[str, Any] = table if isinstance(table, dict) else {}
    name, about, steps = (_text_or_empty(keys.get(key)) for key in ("name", "about", "steps"))
    lines = tuple(islice(_script_lines(steps, text.replace("\r\n", "\n").split("\n")), MOST_LINES))
    return ScenarioFile(path, cut_text(name or path.stem), cut_text(about), lines, **_project_fields(path))


def _text_or_empty(value: object) -> str:
    return value if isinstance(value, str) else ""


def _project_fields(path: Path) -> dict[str, Any]:
    try:
        project = load_scenario(path).project
    except UserError as wrong:
        return {"problem": cut_text(wrong.lines()[0])}
    blocks = dict.fromkeys(each.block for each in project.instances)
    return {"blocks": tuple(blocks), "dialect": project.dialect.name}


def _script_lines(steps: str, file: list[str]) -> Iterator[ScriptLine]:
    """Yield the steps with their line numbers in the file. If the steps are not found, count from 1."""
    lines = steps.rstrip().split("\n")
    head = next((at for at, line in enumerate(file) if _STEPS_PATTERN.fullmatch(line)), -1) + 1
    first = head + 1 if head and file[head : head + len(lines)] == lines else 1
    step = 0
    for place, line in enumerate(lines, first):
        is_step = bool(line.strip()) and not line.strip().startswith("#")
        step += is_step
        yield ScriptLine(place, step if is_step else 0, cut_text(line.strip()))


def cut_text(text: str) -> str:
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 3] + "..."
