"""Texts of the product as they are read, in lists in tests/golden; UPDATE_GOLDEN=1 writes the texts anew.

A list has sections, one a test. A case is a line, what is said of it stands indented below. A case may begin
with its kind, `missing: set X`, which the switch leaves as it is: a new case is a new line of the list.
Tests assert on kinds, places and numbers; the sentences stand here alone, and are read as prose in review.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path

from trcvtui.errors import Problem, UserError

FOLDER = Path(__file__).with_name("golden")
SECTION = re.compile(r"^== (.*) ==\n\n", re.MULTILINE)


def cases(name: str, section: str) -> list[tuple[str, str]]:
    lines = _sections(name)[section].splitlines()
    found = [line.partition(": ") for line in lines if line and not line.startswith(" ")]
    return [(kind, text) for kind, _, text in found]


def agree(name: str, section: str, said: Iterable[tuple[str, Iterable[str]]]) -> None:
    """Compare the cases of a section, each with its lines, with the list of that name."""
    written = "\n".join(f"{case}\n" + "".join(f"    {line}\n" for line in lines) for case, lines in said)
    path, sections = FOLDER / f"{name}.txt", _sections(name)
    if os.environ.get("UPDATE_GOLDEN"):
        sections[section] = f"{written}\n"
        path.write_text(
            "".join(f"== {title} ==\n\n{sections[title]}" for title in sorted(sections)), encoding="utf-8"
        )
    else:
        assert f"{written}\n" == sections.get(section), f"run `UPDATE_GOLDEN=1 pytest -n 0`, and read {path}"


def mistakes(section: str, read: Callable[[str], object]) -> None:
    """Let each case of a section of `file_mistakes` be read: its first problem is of the kind before it.

    `read` raises UserError or returns a tuple of problems; `\\n` in a case is the end of a line.
    """
    said: list[tuple[str, list[str]]] = []
    wrong: list[tuple[str, str]] = []
    for kind, case in cases("file_mistakes", section):
        try:
            found = read(case.replace("\\n", "\n").replace("\\r", "\r").replace("\\t", "\t"))
            problems: tuple[Problem, ...] = found if isinstance(found, tuple) else ()
        except UserError as refused:
            problems = refused.problems
        said.append((f"{kind}: {case}", [str(problem) for problem in problems]))
        if not problems or problems[0].kind != kind:
            wrong.append((case, problems[0].kind if problems else "no mistake"))
    assert wrong == []
    agree("file_mistakes", section, said)


def answers(section: str, read: Callable[[str], Iterable[str]], name: str = "file_mistakes") -> None:
    """Let each case of a section be answered; the lines are those of the list."""
    agree(name, section, [(f"{kind}: {case}", read(case)) for kind, case in cases(name, section)])


def _sections(name: str) -> dict[str, str]:
    path = FOLDER / f"{name}.txt"
    parts = SECTION.split(path.read_text(encoding="utf-8") if path.exists() else "")
    return dict(zip(parts[1::2], parts[2::2], strict=True))
