"""The screen on a block with a framer: bytes are fed, scans are let pass, and what stands there is read."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from rich.style import Style

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import SMALL, follow
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project

LINE, STREAM = "twincat-line.toml", "twincat-stream.toml"
STX_CR_LF = ("prefix RD hex 02", "suffix RD hex 0D 0A", "set RD Timeout=50")


class LineBench(Stage):
    async def until(self, needle: str, most: int = 50) -> None:
        for _ in range(most):
            if needle in self.words:
                return
            await follow(self.app, self.pilot)
        raise AssertionError(f"{needle!r} did not come:\n{self.text}")

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
    async with on_stage(LineBench, load_project(CONFIGS / project), size) as shown:
        await shown.do(*lines)
        shown.app.view_model.selected = select
        shown.app.main.reset_for_selected()
        await shown.press()
        yield shown
