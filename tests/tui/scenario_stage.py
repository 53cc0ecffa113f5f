"""The scenarios on the screen over a simulated bench, for the tests of that screen."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from tests.tui.looking import WIDE
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project

HERE = Path(__file__).parent


class ScenarioStage(Stage):
    async def choose(self, name: str) -> None:
        await self.press("slash", *name, "enter")


@asynccontextmanager
async def scenarios(size: tuple[int, int] = WIDE) -> AsyncIterator[ScenarioStage]:
    async with on_stage(ScenarioStage, load_project(Path("eight.toml")), size) as stage:
        await stage.press("t")
        await stage.scan(20)
        await stage.press("S")
        screen = stage.app.scenarios
        while screen is not None and not screen._model.is_read:  # which a timer does, a few files at a time
            screen._read_next_files()
        await stage.press()
        yield stage
