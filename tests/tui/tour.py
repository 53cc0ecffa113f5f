"""A tour of the screen: a bench with a story on the simulated network, and a walk past every pane.

`python -m tests.tui.tour FOLDER` draws every stop as SVG, at every size, dark and light: to be looked at.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final, NamedTuple

import pytest
from textual import events
from textual.app import App
from textual.pilot import Pilot
from textual.widgets import Input

from tests.local_driver import LocalDriver
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.settings import load_settings

Size = tuple[int, int]
Story = Sequence[tuple[int, str]]  # scans to let pass first, a line
HERE: Final = Path(__file__).parent
SIZES: Final[tuple[Size, ...]] = ((80, 24), (120, 40), (200, 60))
THEMES: Final = ("dark", "light")
FRAMES_TO_FOLLOW: Final = 3
MOST_LOOKS: Final = 20
KEYS: Final = {
    "colon": ("colon", ":"),
    "slash": ("slash", "/"),
    " ": ("space", " "),
    "_": ("underscore", "_"),
}
REPLY: Final = "contains hex 05 send hex 06 {n:2:big}"
# What happened before the first look.
STORY: Final = (
    (0, "set TRCV_C_1 CONT=1 EN_R=1"),
    (0, "set TRCV_C_2 CONT=1"),
    (5, "peer P1 connect"),
    (0, f"peer P1 reply on {REPLY}"),
    (6, "peer P1 send udt Telegram {id=41, state=1, alarm=TRUE, speed=1234.5, tag='grün'}"),
    (20, "fault buffer ENOBUFS on C1"),
    (0, "set TRCV_C_1 EN_R=0"),
    (2, "set TRCV_C_1 EN_R=1"),
    (9, "peer P1 send udt Telegram {id=42, state=1, speed=1236.0, tag='[b]x[/b]'}"),
    (12, "peer P1 send hex 2B 00 00 00 01 00 00 00 00 80 9A 44 08 05 68 65 6C split=5 gap=T#20ms"),
    (40, "expect TRCV_C_1 STATUS=7006"),
)


class Stop(NamedTuple):
    """One thing to look at: keys that lead there, what of the screen is kept ("": all), keys back."""

    name: str
    keys: tuple[str, ...]
    pane: str = ""
    back: tuple[str, ...] = ()


STOPS: Final = (
    Stop("bench", ()),
    Stop("instances", ("1",), "#instances"),
    Stop("block", ("2", "down"), "#block"),
    Stop("status", ("3",), "#status"),
    Stop("history", ("4", "down", "down", "down", "down"), "#history"),
    Stop("why", ("3",), "#status", ("escape",)),
    Stop("received", ("5", *["right"] * 8), "#received"),
    Stop("stream", ("5", "H", "left_square_bracket", "right", "d"), "#received", ("H",)),
    Stop("members", ("6", "down", "down", "down"), "#udt"),
    Stop("peer", ("7", "i", *"01020Aff0506", "escape", "x", "space", "right", "right", "space"), "#peer"),
    Stop("timing", ("8", "down", "down", "down", "N", "m", "N", "m"), "#timing", ("escape",)),
    Stop("frozen", ("2", "F"), "", ("F",)),
    Stop("refused", ("colon", *"set TRCV_C_1 LEN=x", "enter"), "#prompt"),
    Stop("prompt", ("colon", *"set TRCV_C_1 AD"), "#prompt", ("escape",)),
    Stop("help", ("2", "question_mark"), "#help", ("escape",)),
    Stop("yank", ("5", "y"), "#yank", ("escape",)),
    Stop("palette", ("ctrl+p", *"mark"), "CommandList", ("escape",)),
    Stop("scenarios", ("S", "slash", *"frame", "enter"), "", ()),
    Stop("played", ("enter", "n", "n", "n", "n", "n"), "", ("q",)),
)


class Seen(NamedTuple):
    """What stood on a part of the screen: its lines, for each character its style; and the whole as SVG."""

    name: str
    lines: tuple[str, ...]
    styles: tuple[tuple[str, ...], ...]
    svg: Callable[[], str]  # while the tour stands there


class Tour:
    def __init__(self, app: BenchApp, driver: LocalDriver, pilot: Pilot[None]) -> None:
        self.app, self._driver, self._pilot = app, driver, pilot

    async def stops(self, stops: Sequence[Stop] = STOPS) -> AsyncIterator[Seen]:
        for stop in stops:
            await self._press(*stop.keys)
            if stop.name == "palette":
                await self.app.workers.wait_for_complete()  # of the search
                await self._follow(FRAMES_TO_FOLLOW)
            yield await self._look(stop)
            await self._press(*stop.back)

    async def _press(self, *keys: str) -> None:
        for name in keys:
            key, character = KEYS.get(name, (name, name if len(name) == 1 else None))
            self.app.post_message(events.Key(key, character))
            await self._follow(2)  # what the key has asked for comes with the second picture
        await self._follow(FRAMES_TO_FOLLOW)

    async def _follow(self, frames: int) -> None:
        for _ in range(frames):
            await self._pilot._wait_for_screen()
            if self.app.scenarios is not None:
                await self._pilot.pause()  # a pane that opens has to find its size before it scrolls
                self._driver.scan(20)
            self.app._refresh_picture()
        await self._pilot._wait_for_screen()
        self.app.screen._on_timer_update()

    async def _look(self, stop: Stop) -> Seen:
        self._calm_cursors()
        now = seen(self.app, stop)
        for _ in range(MOST_LOOKS):
            await self._pilot.pause()
            before, now = now, seen(self.app, stop)
            if (before.lines, before.styles) == (now.lines, now.styles):
                return now
        raise AssertionError(f"{stop.name} does not come to rest")

    def _calm_cursors(self) -> None:
        for field in self.app.screen.query(Input):
            field.cursor_blink = False


def seen(app: App[None], stop: Stop) -> Seen:
    region = app.screen.query_one(stop.pane).region if stop.pane else app.screen.region
    lines, styles = [], []
    for strip in app.screen._compositor.render_strips()[region.y : region.bottom]:
        cut = strip.crop(region.x, region.right)
        lines.append(cut.text)
        styles.append(tuple(str(segment.style) for segment in cut for _ in segment.text))
    return Seen(stop.name, tuple(lines), tuple(styles), app.export_screenshot)


@asynccontextmanager
async def tour(size: Size, theme: str, story: Story = STORY) -> AsyncIterator[Tour]:
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.setattr("trcvtui.tui.app.FRAME_S", 3600.0)  # no picture but those that the tour takes
    project = load_project(Path("bench.toml"))  # as the user who stands beside it opens it
    driver = LocalDriver(fresh_bench(project, "sim"))
    for scans, line in story:
        driver.scan(scans)
        driver.submit(line)
    app = BenchApp(driver, project, load_settings((*BenchApp.BINDINGS, *MainScreen.BINDINGS), theme))
    async with app.run_test(size=size) as pilot:
        walk = Tour(app, driver, pilot)
        await walk._follow(FRAMES_TO_FOLLOW)
        yield walk
    driver.close()
    monkeypatch.undo()


async def _draw(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for width, height in SIZES:
        for theme in THEMES:
            async with tour((width, height), theme) as walk:
                async for stop in walk.stops():
                    (folder / f"{stop.name}-{theme}-{width}x{height}.svg").write_text(
                        stop.svg(), encoding="utf-8"
                    )


if __name__ == "__main__":
    target = Path(sys.argv[1]).absolute()
    os.chdir(HERE)
    asyncio.run(_draw(target))
