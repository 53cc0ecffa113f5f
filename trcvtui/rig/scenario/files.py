"""The scenario files that lie about: which there are, and what a reader sees of one before it is played.

Bounds: MOST_FILES files, MOST_ENTRIES directory entries below each place, MOST_BYTES of a file. To read one
takes about a millisecond, so a screen reads them one by one.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final

from trcvtui.errors import UserError
from trcvtui.files import read_bytes
from trcvtui.rig import configs_path
from trcvtui.rig.scenario.scenario import load_scenario

MOST_FILES: Final = 500
MOST_ENTRIES: Final = 5000
MOST_DEPTH: Final = 4
MOST_BYTES: Final = 1 << 18
MOST_LINES: Final = 5000
LONGEST_TEXT: Final = 2000
SCENARIOS: Final = "scenarios"
_TABLE: Final = re.compile(rb"^[ \t]*\[[ \t]*scenario[ \t]*\]", re.MULTILINE)
_STEPS: Final = re.compile(r"\s*steps\s*=\s*(?:\"\"\"|''')\s*")


@dataclass(frozen=True, slots=True)
class ScriptLine:
    """One line of the steps as it stands in the file; `step` is 0 where it is blank or a comment."""

    place: int
    step: int
    text: str


@dataclass(frozen=True, slots=True)
class ScenarioFile:
    """What a scenario file says of itself; `problem` is the first mistake in it, in one line."""

    path: Path
    name: str
    about: str
    lines: tuple[ScriptLine, ...]
    problem: str = ""


# -- where they lie ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Found:
    """TOML files in reading order, each once; `is_cut` where there were more than are looked at."""

    paths: tuple[Path, ...]
    is_cut: bool


def find_files(project: Path) -> Found:
    """Return the TOML files beside a project, in its scenarios/, in ./configs/scenarios, those shipped."""
    looked = _Looking()
    looked.below(project.parent, depth=0)
    for folder in (project.parent, Path("configs"), configs_path()):
        looked.below(folder / SCENARIOS, MOST_DEPTH)
    return Found(tuple(looked.found.values()), looked.is_cut)


class _Looking:
    """What has been found so far, by its real path."""

    def __init__(self) -> None:
        self.found: dict[str, Path] = {}
        self.is_cut = False
        self._entries = 0

    def below(self, folder: Path, depth: int) -> None:
        """Take the TOML files of a folder, then those of the folders in it, so many levels deep."""
        self._entries = 0
        self._into(folder, depth)

    def _into(self, folder: Path, depth: int) -> None:
        folders: list[Path] = []
        for entry in self._entries_of(folder):
            path = folder / entry.name
            if entry.is_dir(follow_symlinks=False):
                folders.append(path)
            elif entry.name.endswith(".toml") and path.is_file():  # a pipe would never end
                self._take(path)
        for inner in folders if depth else ():
            self._into(inner, depth - 1)

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

    def _take(self, path: Path) -> None:
        real = os.path.realpath(path)
        if real in self.found:
            return
        if len(self.found) == MOST_FILES:
            self.is_cut = True
            return
        self.found[real] = path


# -- what one says -----------------------------------------------------------------------------------------


def read_scenario_file(path: Path) -> ScenarioFile | None:
    """Return what a file says of itself, None where it holds no scenario."""
    try:
        content = read_bytes(path, MOST_BYTES)
    except OSError as failed:
        return ScenarioFile(path, path.stem, "", (), f"{path}: found {failed.strerror}, expected a file")
    if b"scenario" not in content:
        return None
    if len(content) > MOST_BYTES:
        too_large = f"{path}: found a larger file, expected at most {MOST_BYTES} bytes for this list"
        return ScenarioFile(path, path.stem, "", (), too_large) if _TABLE.search(content) else None
    return _described(path, content)


def _described(path: Path, content: bytes) -> ScenarioFile | None:
    text = content.decode("utf-8-sig", errors="replace")
    try:
        table = tomllib.loads(text).get("scenario")
    except (ValueError, RecursionError):
        if not _TABLE.search(content):
            return None
        return ScenarioFile(path, path.stem, "", (), _problem_of(path))
    if table is None:
        return None
    said: dict[str, Any] = table if isinstance(table, dict) else {}
    name, about, steps = (_text(said.get(key)) for key in ("name", "about", "steps"))
    lines = tuple(islice(_script(steps, text.replace("\r\n", "\n").split("\n")), MOST_LINES))
    return ScenarioFile(path, _cut(name or path.stem), _cut(about), lines, _problem_of(path))


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _problem_of(path: Path) -> str:
    try:
        load_scenario(path)
    except UserError as wrong:
        return _cut(wrong.lines()[0])
    return ""


def _script(steps: str, file: list[str]) -> Iterator[ScriptLine]:
    """Yield the lines of the steps with their places in the file; from 1 where it writes them otherwise."""
    lines = steps.rstrip().split("\n")
    head = next((at for at, line in enumerate(file) if _STEPS.fullmatch(line)), -1) + 1
    first = head + 1 if head and file[head : head + len(lines)] == lines else 1
    step = 0
    for place, line in enumerate(lines, first):
        is_step = bool(line.strip()) and not line.strip().startswith("#")
        step += is_step
        yield ScriptLine(place, step if is_step else 0, _cut(line.strip()))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 3] + "..."
