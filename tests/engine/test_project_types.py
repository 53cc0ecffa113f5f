"""`udt reload` and `udt constant`: the project's type files read again while the bench runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.engine.test_project_save import driven, say
from tests.local_driver import LocalDriver
from trcvtui.project.file import load_project

PROJECT = """# mine
dialect = "baosky"
[[udt]]
file = "t.st"
[[data]]
name = "rx"
type = "T"
[constants]
KNOWN = 2  # kept
"""
TYPES = """TYPE T : STRUCT a : INT; END_STRUCT END_TYPE
TYPE U : STRUCT b : ARRAY[1..GVL.MAX] OF INT; c : ARRAY[1..KNOWN] OF INT; END_STRUCT END_TYPE
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a project with one type that needs a constant."""
    (tmp_path / "p.toml").write_text(PROJECT, encoding="utf-8")
    (tmp_path / "t.st").write_text(TYPES, encoding="utf-8")
    return tmp_path


@pytest.fixture
def driver(folder: Path) -> Iterator[LocalDriver]:
    yield from driven(folder / "p.toml")


def test_a_changed_type_comes_into_data_by_resize_only(driver: LocalDriver, folder: Path) -> None:
    (folder / "t.st").write_text(TYPES.replace("a : INT", "a : LINT"), encoding="utf-8")
    (answer,) = say(driver, "udt reload").answers
    assert answer.error == "" and "`resize` takes a changed one into DATA" in answer.message
    bench = driver.console.bench
    assert bench.project.data[0].size == 4
    say(driver, "resize rx T")
    assert bench.project.data[0].size == 8


def test_a_type_that_data_has_and_that_is_bad_now_is_refused(driver: LocalDriver, folder: Path) -> None:
    (folder / "t.st").write_text(TYPES.replace("a : INT", "a : NOBODY"), encoding="utf-8")
    types = driver.console.bench.project.types
    (answer,) = say(driver, "udt reload").answers
    assert "t.st:1:21: found 'NOBODY'" in answer.error
    assert driver.console.bench.project.types is types


def test_a_constant_makes_a_type_good_and_is_saved(driver: LocalDriver, folder: Path) -> None:
    picture = say(driver, "udt constant GVL.MAX=16#0A")
    assert picture.answers[-1].error == "" and picture.unsaved == 1
    assert driver.console.bench.project.types.names() == ["T", "U"]
    picture = say(driver, "save project")
    assert picture.answers[-1].error == "" and picture.unsaved == 0
    assert load_project(folder / "p.toml").constants == {"KNOWN": 2, "GVL.MAX": 10}
    assert (folder / "p.toml").read_text(encoding="utf-8") == PROJECT + '"GVL.MAX" = 10\n'


@pytest.mark.parametrize("line", ["udt", "udt reload now", "udt constant", "udt constant A", "udt open t.st"])
def test_what_is_no_such_line_is_refused(driver: LocalDriver, line: str) -> None:
    (answer,) = say(driver, line).answers
    assert answer.error and "\n" not in answer.error
