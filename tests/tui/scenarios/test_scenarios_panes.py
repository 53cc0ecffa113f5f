"""What plays is seen as on the bench: STATUS, history, timing, all panes; y alone ends a live bench."""

from __future__ import annotations

import pytest

from tests.tui.looking import BOTH, SMALL, WIDE, Looker, looking
from tests.tui.scenario_stage import HERE, ScenarioStage, scenarios

pytestmark = pytest.mark.usefixtures("own_scenarios_only")
LOAD = f"scenario load {HERE / 'scenarios' / 'frame.toml'} sim"


async def some_steps(stage: ScenarioStage) -> None:
    await stage.choose("frame")
    await stage.press("enter")
    await stage.scan(2)
    for _ in range(4):
        await stage.press("n")
        await stage.scan(20)


async def test_on_a_small_screen_they_are_tabs() -> None:
    async with scenarios(SMALL) as stage:
        await some_steps(stage)
        assert "5 STATUS   6 History   7 Timing" in stage.text
        await stage.press("5")
        assert "why " in stage.text and "check " in stage.text
        await stage.press("6")
        assert "the partner is connected" in stage.text
        await stage.press("7")
        assert "▸STATUS" in stage.text
        await stage.press("1")
        assert "1 Scenarios ·" in stage.text


@BOTH
async def test_v_takes_the_scenario_to_the_panes_and_s_brings_it_back(size: tuple[int, int]) -> None:
    async with scenarios(size) as stage:
        await some_steps(stage)
        step = next(word for word in stage.text.split("step ")[1:]).split(" of ")[0]
        await stage.press("v")
        assert "1 Instances" in stage.text and "3 STATUS" in stage.text
        assert f"step {step} of" in stage.line("scenario"), "the header says what stands here"
        await stage.press("S")
        assert f"step {step} of" in stage.text, "where it was"
        await stage.press("n")
        await stage.scan(20)
        assert f"step {int(step) + 1} of" in stage.text, "and it goes on"
        await stage.press("escape")
        await stage.scan(3)
        assert "scenario" not in stage.text.splitlines()[0], "left for good: the project is back"


async def test_without_a_scenario_v_says_what_is_missing() -> None:
    async with scenarios(WIDE) as stage:
        await stage.press("v")
        assert "no scenario is loaded: enter loads the chosen one" in stage.text


@pytest.mark.parametrize(("key", "lines"), [("enter", [LOAD]), ("n", [LOAD]), ("r", [LOAD, "scenario run"])])
async def test_a_live_bench_is_not_ended_before_y(key: str, lines: list[str]) -> None:
    async with looking(WIDE) as looker:
        await filtered(looker)
        await looker.press(key)
        assert looker.lines == []
        assert "a scenario ends the live bench and its connections: y loads it, esc goes back" in looker.text
        await looker.press("y")
        assert looker.lines == lines


async def test_escape_keeps_the_live_bench() -> None:
    async with looking(WIDE) as looker:
        await filtered(looker)
        await looker.press("enter", "escape")
        assert looker.lines == []
        assert "1 Instances" in looker.text
        await looker.press("S", "y")
        assert looker.lines == [], "nothing is asked any more"


async def filtered(looker: Looker) -> None:
    await looker.type("S/frame\r")
