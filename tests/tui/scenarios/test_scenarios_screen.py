"""The scenarios on the screen: which there are, what they say, and one of them played step by step."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual.pilot import Pilot

from tests.tui.fakes import FakeDriver, picture
from tests.tui.looking import BOTH, SMALL, WIDE, follow, screen_text
from tests.tui.scenario_stage import HERE, scenarios
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui.app import BenchApp

pytestmark = pytest.mark.usefixtures("own_scenarios_only")


# -- the list and the text -----------------------------------------------------------------------------


@BOTH
async def test_a_broken_file_says_its_first_problem_and_is_not_loaded(size: tuple[int, int]) -> None:
    async with scenarios(size) as stage:
        await stage.choose("broken")
        await stage.press("enter")
        words = stage.words
        assert "✗ scenarios/broken.toml: step 1 (set NOBODY CONT=1): found 'NOBODY'" in words
        assert stage.driver.console.player is None
        await stage.press("escape")
        assert stage.driver.console.bench.runtime.scans == 20, "the bench is the one that it was"


async def test_n_pressed_fast_takes_a_step_for_every_key() -> None:
    async with scenarios() as stage:
        await stage.choose("frame")
        await stage.press("enter", *"nnnn")
        await stage.scan(500)
        player = stage.driver.console.player
        assert player is not None
        assert player.snapshot().current == 4


async def test_a_filter_acts_while_it_is_typed_and_escape_drops_it() -> None:
    async with scenarios() as stage:
        await stage.press("slash", *"hopes")
        assert "A frame in two parts" not in stage.text
        assert "Two wrong hopes" in stage.text
        await stage.press("escape")
        assert "A frame in two parts" in stage.text
        await stage.press("slash", *"nonsense", "enter")
        assert "no scenario with these words" in stage.text
        await stage.press("enter", "n", "r", "down")
        assert stage.driver.console.player is None


async def test_text_of_a_file_is_neither_markup_nor_an_escape(tmp_path: Path) -> None:
    (tmp_path / "eight.toml").write_text((HERE / "eight.toml").read_text(encoding="utf-8"), encoding="utf-8")
    told = 'project = "eight.toml"\n[scenario]\nname = "[red]\\u001b[31m"\nabout = "[b]\\u0007"\n'
    (tmp_path / "[x].toml").write_text(
        told + 'steps = """\n# [red]\\u001b[1m[/]\nrun 1\n"""\n', encoding="utf-8"
    )
    app = BenchApp(FakeDriver(picture()), load_project(tmp_path / "eight.toml"))
    async with app.run_test(size=WIDE) as pilot:
        await follow(app, pilot)
        await pilot.press("S", "slash", *"[x]", "enter")
        await follow(app, pilot)
        text = screen_text(app)
    for words in (r"[red]\x1b[31m", r"[b]\x07", r"# [red]\x1b[1m[/]", "2 [x].toml"):
        assert words in text
    assert "\x1b" not in text and "\x07" not in text


# -- playing -------------------------------------------------------------------------------------------


@BOTH
async def test_a_scenario_is_played_step_by_step(size: tuple[int, int]) -> None:
    async with scenarios(size) as stage:
        await stage.choose("frame")
        await stage.press("enter")
        assert "frame.toml · sim · step 1 of 11" in stage.text
        assert "‖ HOLD" in stage.text
        assert "▸ set TRCV_C_1 CONT=1 EN_R=1" in stage.text
        await stage.press("n")
        assert "• set TRCV_C_1 CONT=1 EN_R=1" in stage.text
        assert "▸ wait TRCV_C_1 STATUS=7002" in stage.text
        await stage.press("space")
        await stage.scan(2)
        assert "▶ wait TRCV_C_1 STATUS=7002" in stage.text
        assert "▶ wait TRCV_C_1 STATUS=7002: 2 scans so far" in stage.text
        await stage.scan(5)
        assert "✓ wait TRCV_C_1 STATUS=7002" in stage.text
        assert "scan 3 " in stage.line("‖ HOLD"), "the scans of a step, and no more"
        assert "7002 listening" in stage.line("▸ TRCV_C_1")
        assert "EN_R ■  CONT ■" in stage.text
        assert "  0001 7001 7002 " in stage.text


@BOTH
async def test_a_run_to_the_end_says_that_all_has_held(size: tuple[int, int]) -> None:
    async with scenarios(size) as stage:
        await stage.choose("frame")
        await stage.press("r")
        await stage.scan(20)
        assert "✓ passed: all 11 steps" in stage.text
        assert "7006{4} 7008" in stage.text
        await stage.press("1")
        assert "▸ ✓ A frame in two parts" in stage.text


async def test_enter_begins_anew() -> None:
    async with scenarios() as stage:
        await stage.choose("frame")
        await stage.press("r")
        await stage.scan(20)
        await stage.press("n")
        assert "✗ the scenario is over; loading it again begins anew" in stage.text
        await stage.press("enter")
        assert "step 1 of 11" in stage.text
        assert "scan 0 " in stage.line("‖ HOLD")


async def test_a_file_is_played_as_it_is_on_the_disk_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("eight.toml", "scenarios/frame.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text((HERE / name).read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    async with scenarios() as stage:
        file = tmp_path / "scenarios" / "frame.toml"
        file.write_text(file.read_text(encoding="utf-8").replace("run 3", "run 4"), encoding="utf-8")
        await stage.press("enter")
        assert "run 4" in stage.text


async def test_another_scenario_has_instances_of_its_own() -> None:
    async with scenarios() as stage:
        await stage.choose("frame")
        await stage.press("r")
        await stage.scan(20)
        await stage.press("1", "slash", *["backspace"] * 5, *"hopes", "enter", "n")
        assert "wrong-hope.toml · sim · step 1 of 5" in stage.text
        assert "no scan yet" in stage.text
        assert "D◆" not in stage.text, "no pulse of the one before"


# -- real sockets, and what the engine says --------------------------------------------------------------


async def test_k_chooses_real_sockets_for_the_next_one() -> None:
    async with looking_at_scenarios() as (app, driver, pilot):
        await pilot.press("k", "enter")
        await follow(app, pilot)
        assert driver.lines == [], "the first one is broken"
        await pilot.press("slash", *"frame", "enter", "enter", "y", "n", "y", "k", "enter", "y")
        await follow(app, pilot)
        assert driver.lines == [
            "scenario load scenarios/frame.toml live",
            "scenario step",
            "scenario load scenarios/frame.toml sim",
        ]


async def test_what_the_engine_refuses_is_said_whole() -> None:
    error = "scenarios/frame.toml: peer P1: local: found Address already in use, expected a free end"
    async with looking_at_scenarios(SMALL) as (app, driver, pilot):
        await pilot.press("slash", *"frame", "enter", "enter", "y")
        driver.waiting.append(picture(answers=[LineAnswer(1, driver.lines[-1], error)]))
        await follow(app, pilot)
        assert f"✗ {error}" in " ".join(screen_text(app).split())
        sent = len(driver.lines)
        await pilot.press("n", "y")
        await follow(app, pilot)
        assert driver.lines[-1].startswith("scenario load"), "it is not loaded, so the next step loads it"
        assert len(driver.lines) == sent + 1


async def test_an_engine_that_ends_is_told_on_the_bench() -> None:
    async with looking_at_scenarios() as (app, driver, pilot):
        driver.stopped = "Traceback\n  ...\nAssertionError: two receivers"
        await follow(app, pilot)
        assert "ENGINE ENDED" in screen_text(app)
        assert "1 Instances" in screen_text(app)


@asynccontextmanager
async def looking_at_scenarios(
    size: tuple[int, int] = WIDE,
) -> AsyncIterator[tuple[BenchApp, FakeDriver, Pilot[None]]]:
    driver = FakeDriver(picture())
    app = BenchApp(driver, load_project(Path("eight.toml")))
    async with app.run_test(size=size) as pilot:
        await follow(app, pilot)
        await pilot.press("f2")
        await follow(app, pilot)
        yield app, driver, pilot
