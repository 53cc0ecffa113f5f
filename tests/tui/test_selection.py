"""Text is selected with the mouse and copied with ctrl+c: what stands on the screen, nothing else."""

from __future__ import annotations

import pytest
from msgspec.structs import replace
from textual.events import MouseDown, MouseMove, MouseUp

from tests.tui.fakes import TELEGRAM, bench_project, picture, story
from tests.tui.looking import BOTH, SMALL, WIDE, Looker, looking
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui import clipboard_and_files


@pytest.fixture(autouse=True)
def programs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    given: list[str] = []
    monkeypatch.setattr(clipboard_and_files, "copy_by_program", given.append)
    return given


async def drag(looker: Looker, start: tuple[int, int], end: tuple[int, int]) -> None:
    for kind, (x, y) in ((MouseDown, start), (MouseMove, end), (MouseUp, end)):
        looker.app.post_message(kind(None, x, y, 0, 0, 1, False, False, False, screen_x=x, screen_y=y))
        await looker.settle()


async def click(looker: Looker, at: tuple[int, int]) -> None:
    await drag(looker, at, at)


def place(looker: Looker, words: str, pane: str = "") -> tuple[int, int]:
    top = looker.app.main.query_one(f"#{pane}").region.y if pane else 0
    lines = looker.text.splitlines()
    row = next(y for y, line in enumerate(lines) if y >= top and words in line)
    return lines[row].index(words), row


def reversed_text(looker: Looker) -> str:
    strips = looker.app.screen._compositor.render_strips()
    words = (s.text for strip in strips for s in strip if s.style and s.style.reverse)
    return "".join(words).strip(" ▁▂▃▄▅▆▇█")


@BOTH
async def test_dragged_rows_are_copied_as_they_stand(size: tuple[int, int], programs: list[str]) -> None:
    async with looking(size, picture(lines=story())) as looker:
        await looker.press("4")
        top = looker.app.main.history.content_region
        rows = [line[top.x : top.right].rstrip(" │┃▁▂▃▄▅▆▇█") for line in looker.text.splitlines()[top.y :]]
        x = rows[1].index("16#")
        await drag(looker, (top.x + x, top.y), (top.x + x + 6, top.y + 2))
        await looker.press("ctrl+c")
        assert looker.app.clipboard.splitlines() == [rows[0][x:], rows[1], rows[2][: x + 7]]
        assert "\x1b" not in looker.app.clipboard and programs == [looker.app.clipboard]
        assert rows[1].strip() in reversed_text(looker)


async def test_markup_and_wide_characters_come_as_they_are() -> None:
    told = LineAnswer(1, "mark", "", "[b]测量值[/b] and more")
    async with looking(SMALL, picture(data=TELEGRAM, answers=[told])) as looker:
        await looker.press("K")
        await looker.show(picture(answers=[told]))
        row = next(y for y, line in enumerate(looker.text.splitlines()) if "测量值" in line)
        x = looker.text.splitlines()[row].index("[b]")
        await drag(looker, (x, row), (x + 7, row))  # the last of three, each of two columns
        assert reversed_text(looker) == "[b]测量值"
        await looker.press("ctrl+c")
        assert looker.app.clipboard == "[b]测量值"


async def test_a_drag_presses_nothing_and_a_click_ends_the_selection() -> None:
    async with looking(WIDE) as looker:
        x, y = place(looker, "CONT ─┤")
        await drag(looker, (x, y), (x + 9, y))
        assert looker.lines == [] and looker.app.screen.get_selected_text() == "CONT ─┤ ■"
        await click(looker, (x, y))
        assert looker.lines == ["set TRCV_C_1 CONT=0"]
        assert reversed_text(looker) == "" and looker.app.screen.get_selected_text() is None


async def test_a_second_click_acts_and_selects_nothing() -> None:
    async with looking(WIDE) as looker:
        for _ in range(3):
            await click(looker, place(looker, "CONT ─┤"))
        assert len(looker.lines) == 3 and looker.app.screen.selections == {}


async def test_a_drag_from_pane_to_pane_takes_no_frame() -> None:
    async with looking(WIDE) as looker:
        start, (x, y) = place(looker, "TRCV_C_2"), place(looker, "STATUS ─")
        await drag(looker, start, (x + 2, y + 2))
        await looker.press("ctrl+c")
        assert "TRCV_C_2" in looker.app.clipboard
        assert not set("│┃╭╮━") & set(looker.app.clipboard)


@pytest.mark.parametrize("keys", [(), ("question_mark",), ("colon",), ("y",), ("S",), ("E",)])
async def test_ctrl_c_ends_nothing(keys: tuple[str, ...]) -> None:
    async with looking(WIDE) as looker:
        await looker.press(*keys, "ctrl+c", "ctrl+c")
        assert looker.app.is_running and not looker.app._exit


async def test_a_place_that_is_asked_for_before_a_repaint_does_not_lose_it() -> None:
    async with looking(WIDE) as looker:
        project = replace(bench_project(), model="T9")
        looker.app.view_model.accept_picture(replace(picture(), project=project, project_number=1))
        looker.app.screen.get_widget_and_offset_at(9, 0)  # as the mouse does, between picture and paint
        looker.app.main.header.show()
        await looker.settle()
        assert "T9" in looker.text
