"""The scenarios on the screen over a simulated bench, for the tests of that screen."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from textual.pilot import Pilot

from tests.local_driver import LocalDriver
from tests.tui.looking import WIDE, follow, screen_text
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.tui.app import BenchApp

HERE = Path(__file__).parent


class Stage:
    def __init__(self, driver: LocalDriver, app: BenchApp, pilot: Pilot[None]) -> None:
        self.driver, self.app, self.pilot = driver, app, pilot

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await follow(self.app, self.pilot)

    async def scan(self, scans: int = 1) -> None:
        self.driver.scan(scans)
        await follow(self.app, self.pilot)

    async def choose(self, name: str) -> None:
        await self.press("slash", *name, "enter")

    @property
    def text(self) -> str:
        return screen_text(self.app)

    @property
    def words(self) -> str:
        return " ".join(self.text.replace("│", " ").split())

    def line(self, needle: str) -> str:
        found = [line for line in self.text.splitlines() if needle in line]
        assert found, f"{needle!r} is not there:\n{self.text}"
        return found[0]


@asynccontextmanager
async def scenarios(size: tuple[int, int] = WIDE) -> AsyncIterator[Stage]:
    project = load_project(Path("eight.toml"))
    driver = LocalDriver(fresh_bench(project, "sim"))
    app = BenchApp(driver, project)
    try:
        async with app.run_test(size=size) as pilot:
            stage = Stage(driver, app, pilot)
            await stage.press("t")
            await stage.scan(20)
            await stage.press("S")
            yield stage
    finally:
        driver.close()
