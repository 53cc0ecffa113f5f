"""What a stranger looks for: the projects by name, the decisions, the changes, how to report."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from trcvtui import __version__
from trcvtui.cli.main import main
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect
from trcvtui.paths import configs_path

ROOT = Path(__file__).parents[1]
DECISIONS = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")


def own_projects() -> list[str]:
    """Return the files of configs/ that are projects; a folder of scenarios counts as one."""
    root = configs_path()
    folders = [path for path in root.rglob("*") if path.is_dir() and path.name != "scenarios"]
    named = [*root.glob("*.toml"), *root.glob("*/*.toml"), *folders]
    return [path.relative_to(root).as_posix() + "/" * path.is_dir() for path in named]


def test_the_page_of_the_projects_names_each_of_them_with_a_sentence() -> None:
    page = (configs_path() / "README.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^(?:\||##) `([^`]+)`(?: \||:) (.+)$", page, re.MULTILINE))
    assert [name for name in own_projects() if name not in told] == []


def test_examples_lists_projects_and_stories_with_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["examples"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if ".toml" in line]
    assert sorted(line.split()[0].removeprefix("configs/") for line in lines) == sorted(
        path.relative_to(configs_path()).as_posix()
        for pattern in ("*.toml", "*/*.toml", "scenarios/stories/*.toml")
        for path in configs_path().glob(pattern)
    )
    assert all(len(line.split()) > 6 for line in lines)
    assert main(["examples", "80C5"]) == 0
    assert "configs/scenarios/baosky/80c5-partner-closes.toml" in capsys.readouterr().out


@pytest.mark.parametrize("dialect", DIALECTS.values(), ids=DIALECTS)
def test_each_switch_of_a_dialect_stands_in_a_decision(dialect: Dialect) -> None:
    named = set(re.findall(r"`([a-z0-9_]+)`", DECISIONS))
    assert [switch.name for switch in dialect.switches if switch.name not in named] == []


def test_the_decisions_fit() -> None:
    assert len(DECISIONS.encode()) <= 40_000


def test_the_newest_changes_are_dated_and_few() -> None:
    page = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    title, rest = re.split(r"^## \[Unreleased\]\n", page, flags=re.MULTILINE)
    version = r"[\d.]+" if ".dev" in __version__ else re.escape(__version__)  # a .dev has no date yet
    newest = re.search(rf"^## \[{version}\] - \d{{4}}-\d\d-\d\d\n(.*?)^## ", rest, re.M | re.S)
    assert title and newest and 0 < len(re.findall(r"^- ", newest[1], re.MULTILINE)) <= 20


def test_a_workflow_that_has_never_run_says_so_first() -> None:
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        assert "has never run" in path.read_text(encoding="utf-8").partition("\n")[0]


def test_the_files_of_github_have_the_keys_that_it_asks_for_and_no_tab() -> None:
    asked = {"test": {"name", "on", "jobs"}, "config": {"blank_issues_enabled"}}
    for path in (ROOT / ".github").rglob("*.yml"):
        text = path.read_text(encoding="utf-8")
        keys = set(re.findall(r"^([a-z_]+):", text, re.MULTILINE))
        assert asked.get(path.stem, {"name", "description", "body"}) <= keys and "\t" not in text, path
