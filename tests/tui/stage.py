"""The screen on a project in the simulation; nothing moves but by `do` and `scan`."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TypeVar

from textual.pilot import Pilot

from tests.local_driver import LocalDriver
from tests.tui.looking import WIDE, follow, screen_text
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.project import Project
from trcvtui.tui.app import BenchApp


class Stage:
    def __init__(self, driver: LocalDriver, app: BenchApp, pilot: Pilot[None]) -> None:
        self.driver, self.app, self.pilot = driver, app, pilot

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await follow(self.app, self.pilot)

    async def scan(self, scans: int = 1) -> None:
        await self.do(scans=scans)

    async def do(self, *lines: str, scans: int = 1) -> None:
        for line in lines:
            self.driver.submit(line)
        self.driver.scan(scans)
        await follow(self.app, self.pilot)

    async def select(self, name: str) -> None:
        self.app.view_model.selected = name
        self.app.main.reset_for_selected()
        await self.press("2")

    @property
    def text(self) -> str:
        return screen_text(self.app)

    @property
    def words(self) -> str:
        """Return what stands on the screen without frames and scrollbars, its lines put together."""
        return " ".join(re.sub("[│┃▁-▇]", " ", self.text).split())

    def line(self, needle: str) -> str:
        found = [line for line in self.text.splitlines() if needle in line]
        assert found, f"{needle!r} is not there:\n{self.text}"
        return found[0]


OneStage = TypeVar("OneStage", bound=Stage)


@asynccontextmanager
async def on_stage(
    kind: type[OneStage], project: Project, size: tuple[int, int] = WIDE
) -> AsyncIterator[OneStage]:
    driver = LocalDriver(fresh_bench(project, "sim"))
    app = BenchApp(driver, project)
    try:
        async with app.run_test(size=size) as pilot:
            yield kind(driver, app, pilot)
    finally:
        driver.close()
