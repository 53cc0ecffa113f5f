"""Open the screen on pictures, press keys, read what stands on it."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.app import App
from textual.keys import _character_to_key
from textual.pilot import Pilot

from tests.tui.fakes import FakeDriver, bench_project, picture
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.settings import load_settings

WIDE, SMALL = (140, 45), (80, 24)
BOTH = pytest.mark.parametrize("size", [WIDE, SMALL], ids=["140x45", "80x24"])
SNAPSHOTS = Path(__file__).parent / "snapshots"
FRAMES_TO_FOLLOW = 3  # a command goes out, its scan passes, its picture comes back
UPDATE = "UPDATE_SNAPSHOTS"  # UPDATE_SNAPSHOTS=1 writes the pictures anew: look at them before you commit


async def follow(app: BenchApp, pilot: Pilot[None]) -> None:
    for _ in range(FRAMES_TO_FOLLOW):
        await pilot.pause()
        app._refresh_picture()
    await pilot.pause()


class Looker:
    def __init__(self, app: BenchApp, driver: FakeDriver, pilot: Pilot[None]) -> None:
        self.app = app
        self.driver = driver
        self.pilot = pilot

    async def press(self, *keys: str) -> None:
        for key in keys:
            await self.pilot.press(key)
        await self.settle()

    async def type(self, text: str) -> None:
        await self.at_once(text)

    async def at_once(self, text: str) -> None:
        for key in typed(text):
            self.app.post_message(key)
        await self.settle()

    async def show(self, *pictures: BenchUpdate) -> None:
        self.driver.waiting.extend(pictures)
        while self.driver.waiting:
            self.app._refresh_picture()
            await self.pilot.pause()
        await self.settle()

    async def settle(self) -> None:
        await self.pilot.pause()
        self.app._refresh_picture()
        await self.pilot.pause()

    @property
    def lines(self) -> list[str]:
        return self.driver.lines

    @property
    def text(self) -> str:
        return screen_text(self.app)

    def line(self, needle: str, pane: str = "") -> str:
        text = self.pane(pane) if pane else self.text
        found = [line for line in text.splitlines() if needle in line]
        assert found, f"{needle!r} is not there:\n{text}"
        return found[0]

    def pane(self, id: str) -> str:
        region = self.app.main.query_one(f"#{id}").region
        lines = self.text.splitlines()[region.y : region.bottom]
        return "\n".join(line[region.x : region.right].strip(" │┃") for line in lines)

    def words(self, id: str) -> str:
        return " ".join(self.pane(id).split())


def typed(text: str) -> list[events.Key]:
    """Return the keys that give a text; carriage return, tab and escape are keys too."""
    names = {"\r": "enter", "\t": "tab", "\x1b": "escape"}
    return [events.Key(names.get(character) or _character_to_key(character), character) for character in text]


def screen_text(app: App[None]) -> str:
    strips = app.screen._compositor.render_strips()
    return "\n".join(strip.text.rstrip() for strip in strips) + "\n"


@asynccontextmanager
async def looking(
    size: tuple[int, int] = WIDE, *pictures: BenchUpdate, theme: str | None = None
) -> AsyncIterator[Looker]:
    driver = FakeDriver()
    settings = load_settings((*BenchApp.BINDINGS, *MainScreen.BINDINGS), theme)
    app = BenchApp(driver, bench_project(), settings)
    async with app.run_test(size=size) as pilot:
        looker = Looker(app, driver, pilot)
        await looker.show(*(pictures or (picture(),)))
        yield looker


def same_as_snapshot(looker: Looker, name: str, kept: Path) -> None:
    same_screen(looker.app, name, kept)


def same_screen(app: App[None], name: str, kept: Path) -> None:
    path, found = SNAPSHOTS / f"{name}.txt", screen_text(app)
    if os.environ.get(UPDATE):
        path.parent.mkdir(exist_ok=True)
        path.write_text(found, encoding="utf-8")
    expected = path.read_text(encoding="utf-8") if path.exists() else ""
    if found != expected:
        svg = kept / f"{name}.svg"
        svg.write_text(app.export_screenshot(), encoding="utf-8")
        assert found == expected, f"the screen changed; it is kept in {svg}; {UPDATE}=1 accepts it"
