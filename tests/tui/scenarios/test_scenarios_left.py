"""The scenarios on the screen are left and come back to, at every size, and stand there as drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.tui.looking import SMALL, WIDE, follow, looking, same_screen, typed
from tests.tui.scenario_stage import HERE, scenarios

pytestmark = pytest.mark.usefixtures("own_scenarios_only")


async def test_looking_around_leaves_the_bench_alone() -> None:
    async with scenarios() as stage:
        await stage.press("down", "down", "k", "2", "down")
        await stage.scan(5)
        await stage.press("escape")
        await stage.scan(1)
        assert "scan 26 " in stage.line("▶ RUN")


async def test_the_one_that_was_chosen_is_chosen_again() -> None:
    async with scenarios() as stage:
        await stage.choose("hopes")
        await stage.press("escape", "S")
        assert "▸   Two wrong hopes" in stage.text


@pytest.mark.parametrize("keys", [":scenarios\r", "S", "7S", "4S"])
async def test_it_is_opened_by_key_and_by_prompt_and_hears_keys_of_the_same_batch(keys: str) -> None:
    async with looking(WIDE) as looker:
        for key in typed(f"{keys}/frame\r\ryn"):
            looker.app.post_message(key)
        await looker.settle()
        load, step = looker.lines
        assert load == f"scenario load {HERE / 'scenarios' / 'frame.toml'} sim"
        assert step == "scenario step"


async def test_the_palette_has_it_and_what_can_be_done_there() -> None:
    async with scenarios() as stage:
        there = {command.title for command in stage.app.get_system_commands(stage.app.screen)}
        assert {"Next step", "Run to the end", "Load on real sockets", "Leave the scenarios"} <= there
        await stage.press("escape")
        back = {command.title for command in stage.app.get_system_commands(stage.app.screen)}
        assert "Scenarios" in back and "Next step" not in back


async def test_a_click_chooses_and_a_second_one_loads() -> None:
    async with scenarios() as stage:
        y = next(n for n, line in enumerate(stage.text.splitlines()) if "Two wrong hopes" in line)
        await stage.pilot.click(offset=(10, y))
        await follow(stage.app, stage.pilot)
        assert "2 wrong-hope.toml" in stage.text
        await stage.pilot.click(offset=(10, y))
        await follow(stage.app, stage.pilot)
        assert "wrong-hope.toml · sim · step 1 of 5" in stage.text


@pytest.mark.parametrize("size", [(60, 20), (40, 12), (20, 6), (400, 100)])
async def test_no_size_breaks_the_play(size: tuple[int, int]) -> None:
    async with scenarios(size) as stage:
        await stage.choose("hopes")
        await stage.press("r")
        await stage.scan(20)
        for key in "1234":
            await stage.press(key)
        await stage.pilot.resize_terminal(*WIDE)
        await follow(stage.app, stage.pilot)
        assert "✗ FAILED: 2 of 5 steps" in stage.text


@pytest.mark.parametrize(("size", "name"), [(WIDE, "scenarios-140x45"), (SMALL, "scenarios-80x24")])
async def test_a_play_stands_on_the_screen_as_drawn(size: tuple[int, int], name: str, tmp_path: Path) -> None:
    async with scenarios(size) as stage:
        await stage.choose("frame")
        await stage.press("enter", "n", "n")
        await stage.scan(20)
        await stage.press("n", "n")
        await stage.scan(20)
        await stage.press("n", "n")
        await stage.scan(20)
        await stage.press("n")
        same_screen(stage.app, name, tmp_path)


@pytest.mark.parametrize(
    ("size", "name"), [(WIDE, "scenario-failed-140x45"), (SMALL, "scenario-failed-80x24")]
)
async def test_a_failure_stands_on_the_screen_as_drawn(
    size: tuple[int, int], name: str, tmp_path: Path
) -> None:
    async with scenarios(size) as stage:
        await stage.press("end", "r")
        await stage.scan(30)
        same_screen(stage.app, name, tmp_path)
