"""The screen on a block with a framer: bytes are fed, scans are let pass, and what stands there is read."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from rich.style import Style
from textual.pilot import Pilot

from tests.local_driver import LocalDriver
from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import SMALL, follow, screen_text
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.tui.app import BenchApp

LINE, STREAM = "twincat-line.toml", "twincat-stream.toml"
STX_CR_LF = ("prefix RD hex 02", "suffix RD hex 0D 0A", "set RD Timeout=50")


class LineBench:
    def __init__(self, driver: LocalDriver, app: BenchApp, pilot: Pilot[None]) -> None:
        self.driver, self.app, self.pilot = driver, app, pilot

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await follow(self.app, self.pilot)

    async def do(self, *lines: str, scans: int = 1) -> None:
        for line in lines:
            self.driver.submit(line)
        self.driver.scan(scans)
        await follow(self.app, self.pilot)

    async def until(self, needle: str, most: int = 50) -> None:
        for _ in range(most):
            if needle in self.words:
                return
            await follow(self.app, self.pilot)
        raise AssertionError(f"{needle!r} did not come:\n{self.text}")

    @property
    def text(self) -> str:
        return screen_text(self.app)

    @property
    def words(self) -> str:
        return " ".join(re.sub("[│┃▄▅▆▇▁▂▃]", " ", self.text).split())

    def line(self, needle: str) -> str:
        found = [line for line in self.text.splitlines() if needle in line]
        assert found, f"{needle!r} is not there:\n{self.text}"
        return found[0]

    def style_at(self, needle: str, offset: int = 0) -> Style:
        for strip in self.app.screen._compositor.render_strips():
            place = strip.text.find(needle)
            if place >= 0:
                cells = strip.crop(place + offset, place + offset + 1)
                style = next(iter(cells)).style
                assert style is not None
                return style
        raise AssertionError(f"{needle!r} is not there:\n{self.text}")


@asynccontextmanager
async def on_a_line(
    size: tuple[int, int] = SMALL, project: str = LINE, lines: tuple[str, ...] = STX_CR_LF, select: str = "RD"
) -> AsyncIterator[LineBench]:
    declared = load_project(CONFIGS / project)
    driver = LocalDriver(fresh_bench(declared, "sim"))
    app = BenchApp(driver, declared)
    try:
        async with app.run_test(size=size) as pilot:
            shown = LineBench(driver, app, pilot)
            await shown.do(*lines)
            app.view_model.selected = select
            app.main.follow_selected()
            await follow(app, pilot)
            yield shown
    finally:
        driver.close()
