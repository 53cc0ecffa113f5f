"""What can be taken away from the screen: yanks in every format, a picture, the mouse, a saved session."""

from __future__ import annotations

import csv
import io
import json
import os
import stat
from dataclasses import replace
from pathlib import Path

import pytest

from tests.tui.fakes import TELEGRAM, bench_project, picture, story
from tests.tui.looking import BOTH, SMALL, WIDE, Looker, looking
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui import clipboard_and_files as keepsake
from trcvtui.tui.clipboard_and_files import copy_by_program, save_text
from trcvtui.tui.copy_formats import FORMATS, CopySource, make_copy_source


def subject(content: bytes = TELEGRAM) -> CopySource:
    project = bench_project()
    return CopySource(project, content, project.data_decl("rx"), story())


def written(letter: str, of: CopySource) -> str:
    return next(form for form in FORMATS if form.letter == letter).write(of)


# -- formats -------------------------------------------------------------------------------------------


def test_each_format_has_a_letter_of_its_own() -> None:
    letters = [form.letter for form in FORMATS]
    assert letters == ["h", "i", "v", "j", "s", "m", "r"], "y and q are the menu's own"


@pytest.mark.parametrize("content", [TELEGRAM, bytes(range(256)), b"\x1b[31m"], ids=["udt", "all", "escape"])
def test_the_bytes_come_back_from_every_format_of_bytes(content: bytes) -> None:
    of = subject(content)
    assert bytes.fromhex(written("h", of)) == content
    assert _numbers(written("i", of), "16#") == content


def _numbers(text: str, prefix: str) -> bytes:
    words = text.replace(",", " ").split()
    return bytes(int(word.removeprefix(prefix), 16) for word in words if word.startswith(prefix))


def test_members_are_written_as_csv_and_json() -> None:
    of = subject()
    rows = list(csv.reader(io.StringIO(written("v", of))))
    assert rows[0] == ["offset", "type", "member", "value"]
    decoded = json.loads(written("j", of))
    assert decoded["complete"] is True
    assert [row[2] for row in rows[1:]] == list(decoded["values"])


def test_members_go_as_far_as_the_bytes() -> None:
    decoded = json.loads(written("j", subject(TELEGRAM[:5])))
    values = list(decoded["values"].values())
    assert decoded["complete"] is False
    assert values[0] == 41 and values[1] is None


def test_the_history_is_written_edge_by_edge() -> None:
    lines = written("s", subject()).splitlines()
    assert lines[0].split()[:2] == ["scan", "t"]
    assert len(lines) == len(story()) + 1
    assert "16#80A7" in lines[-4] and "ERROR" in lines[-4]


# -- the menu ------------------------------------------------------------------------------------------


async def _yanked(looker: Looker, *keys: str) -> str:
    await looker.press(*keys)
    await looker.app.workers.wait_for_complete()
    await looker.settle()
    return looker.app.clipboard


@BOTH
async def test_the_menu_names_each_format_and_a_letter_takes_it(size: tuple[int, int], state: Path) -> None:
    async with looking(size) as looker:
        await looker.press("5", "y")
        assert "Yank · 24 bytes of rx" in looker.text
        for form in FORMATS:
            assert f"{form.letter}  {form.name}" in looker.text
        assert await _yanked(looker, "h") == f"{TELEGRAM[:16].hex(' ')}\n{TELEGRAM[16:].hex(' ')}"
        (file,) = (state / "trcvtui" / "yanks").iterdir()
        assert file.read_text() == looker.app.clipboard
        told = " ".join(looker.text.split())
        assert "yanked bytes as hex, 71 characters: to the terminal (OSC 52), to " in told
        assert str(file) in told.replace(" ", "")


@pytest.mark.parametrize(
    ("pane", "begins"), [("2", "29 00"), ("4", "scan"), ("5", "29 00"), ("6", "offset,"), ("1", "29 00")]
)
async def test_y_twice_takes_what_the_pane_is_about(state: Path, pane: str, begins: str) -> None:
    async with looking(SMALL, picture(lines=story())) as looker:
        assert (await _yanked(looker, pane, "y", "y")).startswith(begins)


async def test_the_menu_can_be_walked_clicked_and_left(state: Path) -> None:
    async with looking(WIDE) as looker:
        await looker.press("5", "y", "escape")
        assert "Yank" not in looker.text and looker.app.clipboard == ""
        assert "16#29" in await _yanked(looker, "y", "down", "enter")
        await looker.press("y")
        await looker.pilot.click("#yank", offset=(6, 3))
        await looker.app.workers.wait_for_complete()
        await looker.settle()
        assert looker.app.clipboard.startswith("offset,"), "the third line: members as CSV"


async def test_a_job_without_bytes_is_passed_over(state: Path) -> None:
    async with looking(WIDE, picture(data=b"")) as looker:
        await looker.press("5", "y")
        assert "nothing to yank" in looker.line("h  bytes as hex")
        await looker.press("h")
        assert "Yank" in looker.text, "there is nothing to take"


JOBS = bytes(range(1, 25)), bytes(range(101, 125))


async def two_jobs(looker: BenchLooker) -> None:
    """Let TRCV_C_1 have two jobs, and drop half of a third; the stream is open."""
    looker.connect()
    for content in (*JOBS, JOBS[0][:9]):
        looker.bench.do(f"peer P1 send hex {content.hex()}", scans=5)
    looker.bench.do("set TRCV_C_1 EN_R=0", scans=2)
    await looker.press("5", "H")
    await looker.pictures()


@pytest.mark.parametrize("pane", ["5", "6"])
@pytest.mark.parametrize("letter", [form.letter for form in FORMATS])
async def test_a_job_of_the_past_is_yanked_and_named(state: Path, pane: str, letter: str) -> None:
    async with on_a_bench(SMALL) as looker:
        await two_jobs(looker)
        await looker.press("g")
        await looker.pictures()
        await looker.press(pane, "y")
        assert "Yank · job 1, 24 bytes" in looker.text
        view_model = looker.app.view_model
        past = make_copy_source(view_model, False, False, ("TRCV_C_1", 1, JOBS[0]))
        past = replace(past, message=JOBS[0] if pane == "5" else b"")
        assert view_model.data == JOBS[1], "what DATA holds now is another message"
        assert await _yanked(looker, letter) == written(letter, past)


async def test_of_the_past_dropped_bytes_are_yanked_and_those_that_were_never_read_are_not(
    state: Path,
) -> None:
    async with on_a_bench(WIDE) as looker:
        await two_jobs(looker)
        await looker.press("G")
        await looker.pictures()
        await looker.press("y")
        assert "Yank · thrown away, 9 bytes" in looker.text
        await looker.press("escape")
        looker.bench.do(f"peer P1 send hex {JOBS[0].hex()}", scans=3)
        looker.bench.do("set TRCV_C_1 CONT=0", scans=3)
        await looker.pictures()
        await looker.press("G")
        await looker.pictures()
        await looker.press("y")
        assert "nothing to yank: 24 B dropped, disconnected" in looker.text
        looker.app.main.yank("h")
        assert await _yanked(looker, "H", "5", "y") == ""
        assert "Yank · 24 bytes of rx" in looker.text, "DATA now, by name"


async def test_another_job_of_a_connect_is_named_with_its_instance() -> None:
    async with on_a_bench(WIDE) as looker:
        await two_jobs(looker)
        other = make_copy_source(looker.app.view_model, False, False, ("TRCV_C_2", 7, JOBS[0]))
        assert (other.title, other.declared) == ("TRCV_C_2 job 7, 24 bytes", None)


@pytest.mark.parametrize("key", ["j", "k"])
async def test_in_the_menu_no_letter_moves_the_cursor(state: Path, key: str) -> None:
    async with looking(SMALL) as looker:
        await looker.press("5", "y", "down")
        await _yanked(looker, key)
        assert looker.app.clipboard == (written("j", subject()) if key == "j" else "")
        if key == "k":
            assert "▸ i  bytes as 16#.. list" in looker.text


async def test_the_jobs_bytes_are_yanked_from_the_job(state: Path) -> None:
    async with looking(WIDE) as looker:
        await looker.press("6", "v", "y")
        assert "Yank · running job, 17 bytes" in looker.text
        assert bytes.fromhex(await _yanked(looker, "h")) == TELEGRAM[:17]


# -- files and clipboards ------------------------------------------------------------------------------


def test_files_are_new_ones_and_bounded(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keepsake, "MOST_FILES", 3)
    kept = [save_text(str(number), "yank", ".txt") for number in range(5)]
    folder = kept[0].parent
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {path.read_text() for path in folder.iterdir()} == {"2", "3", "4"}
    assert kept[-1].read_text() == "4"


def test_a_clipboard_program_gets_the_text_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.name == "nt":
        pytest.skip("needs a POSIX shell script")
    program = tmp_path / "xclip"
    program.write_text(f'#!/bin/sh\nexec cat > "{tmp_path}/$2"\n')
    program.chmod(0o700)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("DISPLAY", ":0")
    assert copy_by_program("$(rm x); ä\n") == "xclip"
    assert (tmp_path / "clipboard").read_text(encoding="utf-8") == "$(rm x); ä\n"


def test_a_clipboard_program_that_hangs_or_fails_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, script in (("xclip", "exec sleep 30"), ("xsel", "exit 1")):
        program = tmp_path / name
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o700)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(keepsake, "CLIPBOARD_TIMEOUT_S", 0.1)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("DISPLAY", ":0")
    assert copy_by_program("x") == ""


# -- picture, mark ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "shown"), [((), "TRCV_C_1"), (("J",), "Doctor"), (("question_mark",), "Here:")]
)
async def test_a_picture_of_the_screen_is_saved_and_its_path_is_told(
    keys: tuple[str, ...], shown: str, state: Path
) -> None:
    async with looking(WIDE) as looker:
        await looker.press(*keys)
        above = looker.app.screen
        await looker.press("P")
        (file,) = (state / "trcvtui" / "yanks").iterdir()
        assert file.name.startswith("screen-")
        assert shown in file.read_text(encoding="utf-8") and looker.app.screen is above
        told = looker.text + "".join(note.message for note in looker.app._notifications)
        assert str(file) in "".join(told.split())


@BOTH
async def test_a_mark_and_a_saved_session_are_commands_whose_answers_are_shown(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("K")
        assert looker.lines == ["mark"]
        told = "3 commands, 30 scans in /home/me/a/folder/whose/name/is/long/for/a/narrow/screen/story.toml"
        await looker.show(picture(answers=[LineAnswer(1, "mark", "", told)]))
        assert told.replace(" ", "") in "".join(looker.text.split())
