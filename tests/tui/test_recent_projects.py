"""The projects that were opened last: kept in the state folder, offered by the palette, yanked as a line."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.tui.looking import SMALL, Looker, looking
from trcvtui import paths
from trcvtui.tui.recent_projects import FILE, make_run_line, recent_projects, remember_project


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    return tmp_path / "state"


def test_the_newest_ten_are_kept_each_once_and_never_the_demo(folder: Path, tmp_path: Path) -> None:
    assert recent_projects() == []
    for number in (*range(12), 5):
        remember_project(tmp_path / f"{number}.toml")
    remember_project(paths.demo_path())
    names = [Path(each).stem for each in recent_projects()]
    assert names == ["5", "11", "10", "9", "8", "7", "6", "4", "3", "2"]
    assert os.listdir(folder) == [FILE], "nothing is left beside it"


BROKEN = pytest.mark.parametrize(
    "content", [b"{", b"\xff", b'{"a": 1}', b"[1]", b"[" * 90_000, b'["' + b"a" * 100_000 + b'"]']
)


async def entries(looker: Looker) -> dict[str, str]:
    found = {each.title: each for each in looker.app.get_system_commands(looker.app.screen)}
    mine = {title: each for title, each in found.items() if title.startswith("Recent projects")}
    for each in mine.values():
        each.callback()
    await looker.app.workers.wait_for_complete()
    await looker.settle()
    return {title: each.help for title, each in mine.items()}


@BROKEN
async def test_a_broken_file_is_one_line_and_stays(folder: Path, content: bytes) -> None:
    folder.mkdir()
    (folder / FILE).write_bytes(content)
    remember_project(Path("new.toml"))
    assert (folder / FILE).read_bytes() == content
    async with looking(SMALL) as looker:
        (told,) = (await entries(looker)).values()
        assert FILE in told and "expected a JSON list of paths" in told
        assert "✗" in looker.text


def test_a_state_folder_that_cannot_be_written_breaks_nothing(folder: Path) -> None:
    folder.write_text("a file", encoding="utf-8")
    remember_project(Path("new.toml"))
    assert folder.read_text(encoding="utf-8") == "a file"


@pytest.mark.parametrize(
    "name", ["plain.toml", "two words.toml", "it's \x1b[31m[red]\n\\1.toml", "\udcff\u202e.toml"]
)
async def test_the_line_is_one_word_of_a_shell_and_its_escape_codes_are_data(folder: Path, name: str) -> None:
    remember_project(Path("/tmp", name))
    (path,) = recent_projects()
    line = make_run_line(path)
    assert line.isprintable()
    said = subprocess.run(
        ["bash", "-c", line.replace("trcvtui run", "printf %s")], capture_output=True, check=True
    )
    assert said.stdout == os.fsencode(f"/tmp/{name}")
    async with looking(SMALL) as looker:
        (help_,) = (await entries(looker)).values()
        assert help_ == line
        assert f"{line.split(chr(92))[0]}" in " ".join(looker.text.split()), "it is printed"
        kept = [each.read_text(encoding="utf-8") for each in (folder / "yanks").iterdir()]
        assert kept == [line]


async def test_a_read_only_screen_offers_none(folder: Path) -> None:
    remember_project(Path("a.toml"))
    assert json.loads((folder / FILE).read_text(encoding="utf-8")) == [os.path.abspath("a.toml")]
    async with looking(SMALL) as looker:
        looker.app.only_looks = True
        assert await entries(looker) == {}
