"""Benches and terminals at the edge: nothing in the project, very many instances, hardly any room."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace
from textual import events

from tests.tui.fakes import FakeDriver, bench_project, picture, receiving
from tests.tui.looking import SMALL, WIDE, follow, looking, screen_text, typed
from trcvtui.project.file import load_project
from trcvtui.tui.app import BenchApp


@pytest.mark.parametrize("size", [WIDE, SMALL])
async def test_a_project_without_anything_opens(size: tuple[int, int], tmp_path: Path) -> None:
    path = tmp_path / "empty.toml"
    path.write_text('dialect = "baosky"\n', encoding="utf-8")
    seen = replace(picture(), peers=(), data=(), partial=())
    bare = replace(seen, snapshot=replace(seen.snapshot, instances=(), connections=(), data=()))
    app = BenchApp(FakeDriver(bare), load_project(path))
    async with app.run_test(size=size) as pilot:
        await follow(app, pilot)
        for key in ("2", "n", "3", "4", "down", "5", "right", "6", "down", "7", "s", "m", "question_mark"):
            await pilot.press(key)
        await pilot.press("escape")
        await pilot.press("7")
        await follow(app, pilot)
        assert "no peer: A adds one" in screen_text(app)


async def test_each_key_of_the_peer_pane_says_that_there_is_no_peer(tmp_path: Path) -> None:
    path = tmp_path / "empty.toml"
    path.write_text('dialect = "baosky"\n', encoding="utf-8")
    app = BenchApp(FakeDriver(replace(picture(), peers=())), load_project(path))
    async with app.run_test(size=WIDE) as pilot:
        await follow(app, pilot)
        await pilot.press("7")
        for key in "scfrhzuleadbimoxwp":
            app.main.prompt.show_error("nothing yet")
            await pilot.press(key)
            await follow(app, pilot)
            assert "✗ no peer: A adds one" in screen_text(app), key


@pytest.mark.parametrize("size", [(60, 20), (40, 12), (20, 6), (400, 100)])
async def test_no_size_breaks_the_screen(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        for key in "1234567":
            await looker.press(key)
        assert "TRCV" in looker.text


async def test_the_screen_may_change_its_size_while_a_pane_has_the_focus() -> None:
    async with looking(WIDE) as looker:
        await looker.press("6", "down", "down")
        await looker.pilot.resize_terminal(*SMALL)
        await looker.settle()
        assert "▸   4 state" in looker.text
        await looker.pilot.resize_terminal(*WIDE)
        await looker.settle()
        assert "▸   4 state" in looker.text
        assert "2 TRCV_C_1" in looker.text


async def test_a_project_name_with_markup_stays_text(tmp_path: Path) -> None:
    path = tmp_path / "[red]x[b].toml"
    path.write_text('dialect = "baosky"\n', encoding="utf-8")
    app = BenchApp(FakeDriver(), load_project(path))
    async with app.run_test(size=SMALL) as pilot:
        await follow(app, pilot)
        assert "[red]x[b].toml" in screen_text(app)


async def test_until_the_first_picture_the_screen_says_that_the_engine_starts() -> None:
    app = BenchApp(FakeDriver(), bench_project())
    async with app.run_test(size=SMALL) as pilot:
        await pilot.press("n", "space", "2", "5", "6")
        await follow(app, pilot)
        assert "the engine starts" in screen_text(app)
        assert "TRCV_C_2" in screen_text(app)


async def test_keys_that_come_faster_than_the_screen_follows_are_all_obeyed() -> None:
    many = tuple(replace(receiving(), name=f"TRCV_C_{n}") for n in range(1, 257))
    async with looking(SMALL, picture(*many)) as looker:
        await looker.pilot.press("1", *["j"] * 100, *["k"] * 10)
        await looker.settle()
        assert looker.app.view_model.selected == "TRCV_C_91"


# -- keys in one batch: nothing on the screen has had the time to react to the one before ----------------


async def test_a_prompt_opened_again_at_once_keeps_the_focus() -> None:
    async with looking(SMALL) as looker:
        await looker.press("colon")
        await looker.at_once("abc\x1b:")
        await looker.at_once("tanx\r")
        assert looker.lines == ["tanx"]


async def test_keys_typed_before_anything_is_there_are_obeyed_in_order() -> None:
    driver = FakeDriver(picture())
    app = BenchApp(driver, bench_project())
    # A terminal that is not the screen's yet passes enter on as a line feed.
    first = [*typed(":set TRCV_C_1 CONT=1"), events.Key("ctrl+j", "\n")]
    for key in [*first, *typed(":plc stop\r")]:
        app.post_message(key)
    async with app.run_test(size=SMALL) as pilot:
        while app._keeps_keys:  # as long as that takes here
            await pilot.pause()
        assert driver.lines == ["set TRCV_C_1 CONT=1", "plc stop"]


async def test_a_row_that_changes_and_changes_back_before_it_is_painted_stands_as_it_is() -> None:
    async with looking(WIDE) as looker:
        prompt = looker.app.main.prompt
        prompt.show_error("so it is")
        await looker.pilot.pause()
        assert "so it is" in looker.text
        prompt.show_error("so it was for no time")
        prompt.show_error("so it is")
        await looker.pilot.pause()
        assert "so it is" in looker.text and "for no time" not in looker.text
