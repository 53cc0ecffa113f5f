"""The dialect race on the screen: one scenario or the session through several dialects, scan beside scan."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual.pilot import Pilot

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import BOTH, SMALL, WIDE, follow, same_screen, screen_text
from trcvtui.engine.controller import fresh_bench
from trcvtui.engine.engine import LocalDriver
from trcvtui.scenario import scenario as scenario_files
from trcvtui.scenario.scenario import load_bench
from trcvtui.tui.app import BenchApp
from trcvtui.tui.race.screen import RaceScreen

STEPS = """
set TRCV_C_1 CONT=1 EN_R=1
run 4
peer P1 connect
run 3
peer P1 send hex 01 02 03 04 05 06 07 08
run 3
expect TRCV_C_1 STATUS=7006
"""
MOST_LOOKS = 10_000  # a hundred seconds: a busy machine is slow


class Stage:
    """The screen on a simulated bench; nothing moves but by `scan`."""

    def __init__(self, driver: LocalDriver, app: BenchApp, pilot: Pilot[None]) -> None:
        self.driver, self.app, self.pilot = driver, app, pilot

    async def press(self, *keys: str) -> None:
        """Press keys and let the screen follow."""
        await self.pilot.press(*keys)
        await follow(self.app, self.pilot)

    async def do(self, *lines: str, scans: int) -> None:
        """Send bench commands, let scans pass, and let the screen see them."""
        for line in lines:
            self.driver.submit(line)
        self.driver.scan(scans)
        await follow(self.app, self.pilot)

    async def raced(self) -> None:
        """Wait until the race is over and shown."""
        for _ in range(MOST_LOOKS):
            await follow(self.app, self.pilot)
            run = self.race.run
            if run is not None and run.is_over:
                break
            await self.pilot.pause(0.01)
        await follow(self.app, self.pilot)
        assert "racing" not in self.text, self.text

    @property
    def race(self) -> RaceScreen:
        """Return the race screen."""
        assert self.app.race is not None
        return self.app.race

    @property
    def text(self) -> str:
        """Return what stands on the screen."""
        return screen_text(self.app)

    @property
    def words(self) -> str:
        """Return it as words, without frames."""
        return " ".join(self.text.replace("│", " ").replace("┃", " ").split())

    @property
    def table(self) -> list[str]:
        """Return the rows of the table, each as words."""
        region = self.race.table.region
        lines = [line[region.x : region.right] for line in self.text.splitlines()[region.y : region.bottom]]
        return [" ".join(line.split()) for line in lines if line.strip()]


@asynccontextmanager
async def opened(size: tuple[int, int] = WIDE) -> AsyncIterator[Stage]:
    """Open the screen on a bench whose peer is the active one."""
    project = load_bench(CONFIGS / "passive.toml")
    driver = LocalDriver(fresh_bench(project, "sim"))
    app = BenchApp(driver, project)
    try:
        async with app.run_test(size=size) as pilot:
            stage = Stage(driver, app, pilot)
            await follow(app, pilot)
            yield stage
    finally:
        driver.close()


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with one scenario in it, the only one that the screen finds."""
    folder = tmp_path / "configs" / "scenarios"
    folder.mkdir(parents=True)
    project = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
    text = f'{project}\n[scenario]\nname = "story"\nsteps = """{STEPS}"""\n'
    (folder / "story.toml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(
        scenario_files, "find_files", lambda home: scenario_files.Found((folder / "story.toml",), False)
    )
    return folder / "story.toml"


@asynccontextmanager
async def race_of_the_scenario(size: tuple[int, int] = WIDE) -> AsyncIterator[Stage]:
    """Open the scenarios and race the one that is there."""
    async with opened(size) as stage:
        await stage.press("S")
        await stage.press("D")
        await stage.raced()
        yield stage


# -- scan beside scan ----------------------------------------------------------------------------------------


async def test_a_scenario_stands_there_scan_by_scan_in_its_dialect_and_another(shelf: Path) -> None:
    async with race_of_the_scenario(SMALL) as stage:
        assert "story · 10 scans of T#10ms · 1 expect left out" in stage.words
        assert "TRCV_C_1 (TRCV_C) · first differ in scan 1: 0001 vs 7001" in stage.words
        assert stage.table == [
            "1 ≠ 0001 B□ D□ E□ 7001 B□ D□ E□",
            "2 ≠ 7001 B□ D□ E□ 7002 B□ D□ E□",
            "3 7002 B□ D□ E□ 7002 B□ D□ E□",
            "4 ≠ 80A1 B□ D□ E■ 7002 B□ D□ E□",
            "5 ≠ 7004 B□ D□ E□ 0001 B■ D□ E□",
            "6-7 7006 B■ D□ E□ 7006 B■ D□ E□",
            "8 ≠ 7008 B□ D■ E□ 8 B 0000 B□ D■ E□ 8 B",
            "9-10 7006 B■ D□ E□ 7006 B■ D□ E□",
        ]


@BOTH
async def test_n_jumps_to_the_next_difference_and_tells_it_in_full(
    shelf: Path, size: tuple[int, int]
) -> None:
    async with race_of_the_scenario(size) as stage:
        await stage.press("n", "n", "n")
        assert "scan 5 · 1 scan from 0.04" in stage.words and "≠ STATUS, BUSY" in stage.words
        assert "s7-1500 0001" in stage.words and "The connection is up" in stage.words
        await stage.press("n", "n")
        assert "scan 8" in stage.words and "no difference further down" in stage.words
        await stage.press("N", "N", "N", "N", "N")
        assert "no difference further up" in stage.words


async def test_a_digit_takes_a_dialect_into_the_race_and_out_of_it(shelf: Path) -> None:
    async with race_of_the_scenario() as stage:
        assert "1 ■ baosky 2 ■ s7-1500 3 □ s7-1200 4 □ s7-1200-legacy" in stage.words
        await stage.press("4")
        await stage.raced()
        assert "4 ■ s7-1200-legacy" in stage.words
        assert stage.table[4] == "5 ≠ 7004 B□ D□ E□ 0001 B■ D□ E□ 0001 B■ D□ E□"
        await stage.press("1")
        await stage.raced()
        await stage.press("2")
        assert "a race needs two dialects" in stage.words and "2 ■ s7-1500" in stage.words


async def test_equal_scans_can_be_left_out(shelf: Path) -> None:
    async with race_of_the_scenario() as stage:
        await stage.press("o")
        assert all("≠" in line for line in stage.table) and len(stage.table) == 5


async def test_what_differs_is_marked_by_its_style_too(shelf: Path) -> None:
    async with race_of_the_scenario() as stage:
        (line,) = (row for row in [stage.race.table.row_at(7 - 1)])
        assert dict(line.parts)["0000"] == "done changed" and dict(line.parts)["7008"] == "done"


async def test_the_race_is_left_to_the_scenarios_again(shelf: Path) -> None:
    async with race_of_the_scenario() as stage:
        await stage.press("escape")
        assert stage.app.race is None and stage.app.screen is stage.app.scenarios


async def test_the_palette_and_the_help_are_those_of_the_race(shelf: Path) -> None:
    async with race_of_the_scenario() as stage:
        names = [command.title for command in stage.app.get_system_commands(stage.app.screen)]
        assert "Next difference" in names and "s7-1200 into the race" in names
        await stage.press("question_mark")
        assert "Here: Race" in stage.text


# -- the session ---------------------------------------------------------------------------------------------


@BOTH
async def test_d_races_the_session_since_the_mark(size: tuple[int, int]) -> None:
    async with opened(size) as stage:
        await stage.do("set TRCV_C_1 CONT=1 EN_R=1", scans=4)
        await stage.do("peer P1 connect", "mark", scans=3)
        await stage.do("peer P1 send hex 01 02 03 04 05 06 07 08", scans=3)
        scans = stage.driver.console.bench.runtime.scans
        await stage.press("D")
        await stage.raced()
        assert f"{scans} scans of T#10ms · shown since the mark after scan 4" in stage.words
        assert [line.split()[0] for line in stage.table] == ["5", "6-7", "8", "9-10"]
        assert "first differ in scan 5: 7004 vs 0001" in stage.words
        assert stage.driver.console.bench.runtime.scans == scans, "the bench is left alone"


async def test_r_races_the_session_as_far_as_it_is_now() -> None:
    async with opened() as stage:
        await stage.do("set TRCV_C_1 CONT=1", scans=3)
        await stage.press("D")
        await stage.raced()
        folder = stage.race._folder
        await stage.do("set TRCV_C_1 CONT=0", scans=2)
        await stage.press("r")
        await stage.raced()
        assert "5 scans of T#10ms" in stage.words
        await stage.press("escape")
        await follow(stage.app, stage.pilot)
        assert folder is not None and not folder.file.parent.exists(), "nothing is left after"


async def test_a_session_that_cannot_be_written_says_why() -> None:
    async with opened() as stage:
        await stage.do("save project", scans=1)
        stage.app._read_only = True
        await stage.press("D")
        assert stage.app.race is None and "read-only" in stage.words


# -- what cannot be raced ------------------------------------------------------------------------------------


async def test_a_dialect_that_cannot_take_the_connects_says_so_and_the_race_before_stays(
    shelf: Path,
) -> None:
    source = CONFIGS / "scenarios" / "siemens" / "iso-active.toml"
    async with opened() as stage:
        stage.app.open_race(source)
        await stage.raced()
        assert "2 ■ s7-1500 3 ■ s7-1200" in stage.words, "Baosky has no ISO-on-TCP: the next one is taken"
        before = stage.table
        await stage.press("1")
        await stage.raced()
        assert "✗ baosky: connect" in stage.words and "expected plain TCP by address" in stage.words
        assert "1 □ baosky" in stage.words and stage.table == before


# -- as drawn ------------------------------------------------------------------------------------------------


@BOTH
async def test_it_stands_as_drawn(shelf: Path, size: tuple[int, int], tmp_path: Path) -> None:
    async with race_of_the_scenario(size) as stage:
        await stage.press("4")
        await stage.raced()
        await stage.press("n", "n", "n")
        same_screen(stage.app, f"race-{size[0]}x{size[1]}", tmp_path)
