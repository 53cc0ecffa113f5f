"""A format of type files, a layout is one row: whoever lists them asks the row.

Each made-up row is added in its one place, and found in the help, in the completion, in the lab, by
reading and writing; the page docs/udt.md has to name it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from tests.cli.conftest import Run
from tests.cli.conftest import run as run
from tests.scenario.scenarios import CONFIGS
from tests.tui.conftest import own_folders as own_folders  # yanks go there
from tests.tui.lab.test_lab_screen import lab, project
from trcvtui.project.file import load_project
from trcvtui.tui.completion import complete
from trcvtui.tui.lab.lab import PROFILE_WORDS
from trcvtui.udt.byte_text import BYTE_FORMS
from trcvtui.udt.exports import LANGUAGES
from trcvtui.udt.layout.layout import Profile, profiles_for
from trcvtui.udt.layout.rules import LAYOUTS, TEXT_FORMS, layout_names
from trcvtui.udt.sources import FORMATS, TypeFormat, extensions, read_files
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.types import ELEMENTARY

PAGE = (Path(__file__).parents[1] / "docs" / "udt.md").read_text(encoding="utf-8").lower()
TYPE = "TYPE Telegram : STRUCT a : INT; END_STRUCT END_TYPE"
MADE_UP_FORMAT = TypeFormat("Made-up text", (".made",), read_st)


def not_on_the_page() -> list[str]:
    """Return the names of rows that docs/udt.md does not have between back ticks."""
    quoted = {word for text in re.findall(r"`([^`]+)`", PAGE) for word in re.split(r"[\s|\\]+", text)}
    known = [*extensions(), *LANGUAGES, *layout_names(), *BYTE_FORMS]
    return [name for name in known if name not in quoted and name.removeprefix("codesys") not in quoted]


def help_of(command: str, run: Run) -> str:
    return " ".join(run("udt", command, "--help")[1].split())


def test_every_row_stands_on_the_page() -> None:
    assert not_on_the_page() == []


async def test_a_made_up_format_is_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    monkeypatch.setitem(FORMATS, MADE_UP_FORMAT.name, MADE_UP_FORMAT)
    file = tmp_path / "a.made"
    file.write_text(TYPE)
    assert read_files([file]).names() == ["Telegram"]
    assert ".made (Made-up text)" in help_of("show", run)
    here = structs.replace(load_project(CONFIGS / "udt-mismatch.toml"), base=tmp_path)
    assert complete("udt open a", here) == "udt open a.made"
    assert not_on_the_page() == [".made"]
    async with lab(project(tmp_path)) as stage:
        [menu] = [
            command.help
            for command in stage.app.get_system_commands(stage.app.screen)
            if command.title == "Open a type file"
        ]
        assert ".made (Made-up text)" in menu


def test_a_made_up_layout_is_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    assert PROFILE_WORDS[: len(layout_names())] == tuple(layout_names())
    made = replace(LAYOUTS["packed"], name="made-up", text_forms=("nul",))
    monkeypatch.setitem(LAYOUTS, made.name, made)
    (tmp_path / "a.st").write_text(TYPE)
    assert ", made-up," in help_of("show", run)
    _, shown, _ = run("udt", "show", str(tmp_path / "a.st"), "--layout", "made-up")
    assert "2 bytes, align 1, layout made-up" in shown
    assert Profile("made-up", "little") in profiles_for(ELEMENTARY["INT"])
    assert not_on_the_page() == ["made-up"]
    assert set(made.text_forms) <= set(TEXT_FORMS)
