"""Type files while they are edited: what is good stays until something better is saved."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from trcvtui.tui.lab.lab import TypeFiles

GOOD = "TYPE T : STRUCT a : INT; END_STRUCT END_TYPE\n"
LONGER = "TYPE T : STRUCT a : INT; b : DINT; END_STRUCT END_TYPE\n"
BROKEN = "TYPE T : STRUCT a : INTEGERR; END_STRUCT END_TYPE\n"


def saved(path: Path, text: str, at: int) -> None:
    path.write_text(text, encoding="utf-8")
    os.utime(path, (at, at))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    found = tmp_path / "t.st"
    saved(found, GOOD, 1)
    return found


def members(files: TypeFiles) -> int:
    return len(files.types.get_type("T").members)  # type: ignore[union-attr]


def test_a_file_that_did_not_change_is_not_read_again(path: Path) -> None:
    files = TypeFiles([path], {})
    types = files.types
    assert not files.reload_if_changed() and files.types is types


def test_a_broken_save_keeps_the_last_good_type_and_says_one_line(path: Path) -> None:
    files = TypeFiles([path], {})
    saved(path, BROKEN, 2)
    assert not files.reload_if_changed() and members(files) == 1
    assert "t.st:1:21: " in files.trouble and "INTEGERR" in files.trouble and "\n" not in files.trouble
    saved(path, LONGER, 3)
    assert files.reload_if_changed() and members(files) == 2 and files.trouble == ""


def test_a_file_that_is_gone_for_a_moment_changes_nothing(path: Path) -> None:
    files = TypeFiles([path], {})
    path.unlink()
    assert not files.reload_if_changed() and members(files) == 1 and "No such file" in files.trouble
    saved(path, LONGER, 3)
    assert files.reload_if_changed() and members(files) == 2


def test_a_bad_type_more_does_not_hold_the_good_ones_back(path: Path) -> None:
    files = TypeFiles([path], {})
    saved(path, LONGER + "TYPE U : STRUCT x : NOBODY; END_STRUCT END_TYPE\n", 2)
    assert files.reload_if_changed() and members(files) == 2
    assert [problem.found for problem in files.types.problems] == ["'NOBODY'"]


def test_constants_are_asked_for_and_then_known(tmp_path: Path) -> None:
    path = tmp_path / "c.st"
    saved(path, "TYPE T : STRUCT a : ARRAY[1..GVL.MAX] OF INT; END_STRUCT END_TYPE\n", 1)
    files = TypeFiles([path], {})
    assert files.types.unknown_constants == ("GVL.MAX",) and not files.types.types
    assert files.add_constants({"GVL.MAX": 10}) and files.types.names() == ["T"]
