"""A project that is not there yet: what is offered, and that nothing is written before a yes."""

from __future__ import annotations

import io
import subprocess
from pathlib import Path

import pytest

from tests.e2e.terminal import TRCVTUI
from trcvtui.dialects import DIALECTS
from trcvtui.engine.project_edits import can_create_project, offer_project
from trcvtui.project.file import load_project


def answered(path: Path, text: str) -> bool:
    return offer_project(path, io.StringIO(text), io.StringIO())


@pytest.mark.parametrize("yes", ["\n", "y\n", "1\n", "baosky\n", "what\n\n"])
def test_a_yes_writes_a_project_of_the_proposed_dialect(tmp_path: Path, yes: str) -> None:
    path = tmp_path / "new.toml"
    assert can_create_project(path) and answered(path, yes)
    assert load_project(path).dialect.name == "baosky"


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_can_be_chosen_by_its_name(tmp_path: Path, dialect: str) -> None:
    path = tmp_path / "new.toml"
    path.write_text("")
    assert can_create_project(path) and answered(path, f"{dialect}\n")
    assert load_project(path).dialect.name == dialect


@pytest.mark.parametrize("no", ["n\n", "", "no\n", "x\n" * 9])
def test_nothing_is_written_before_a_yes(tmp_path: Path, no: str) -> None:
    path = tmp_path / "new.toml"
    assert not answered(path, no)
    assert not path.exists()


def test_what_is_there_or_has_no_folder_is_not_offered(tmp_path: Path) -> None:
    full = tmp_path / "full.toml"
    full.write_text('dialect = "baosky"\n')
    assert not can_create_project(full)
    assert not can_create_project(tmp_path / "away" / "new.toml")
    assert not can_create_project(tmp_path / "new.txt")
    assert not can_create_project(tmp_path)


def test_without_a_terminal_it_stays_one_line_and_exit_2(tmp_path: Path) -> None:
    ran = subprocess.run(
        [TRCVTUI, "run", "new.toml"], cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1 and "new.toml" in ran.stderr
    assert list(tmp_path.iterdir()) == []
