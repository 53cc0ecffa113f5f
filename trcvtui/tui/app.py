"""The screen on a bench: pictures in, bench commands out. No logic of its own."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar, Final

from textual import events
from textual.app import App, SystemCommand
from textual.screen import Screen

from trcvtui.plc.project import Project
from trcvtui.rig.driver import Driver, EngineStopped
from trcvtui.tui.keystrokes import obey
from trcvtui.tui.scene import Scene
from trcvtui.tui.screens.main import MainScreen
from trcvtui.tui.theme import DARK, LIGHT

FRAME_S: Final = 1 / 20
HANG_UP_S: Final = 1.0
HANG_UP: Final = 129  # as a shell reports SIGHUP
ENGINE_ENDED: Final = 1


class BenchApp(App[None]):
    """Twenty times a second: take the newest picture, show it, ask for the next."""

    TITLE = "trcvtui"
    CSS_PATH = Path(__file__).with_name("styles.tcss")
    ENABLE_COMMAND_PALETTE: ClassVar[bool] = True

    def __init__(self, driver: Driver, project: Project) -> None:
        super().__init__()
        self._engine = driver
        self.scene = Scene(project)
        self.main = MainScreen(self.scene, self.submit)
        self.last_words = ""
        self._early_keys: list[events.Key] | None = []
        self.register_theme(DARK)
        self.register_theme(LIGHT)
        # Without its watcher: every rule would be read twice before the first frame.
        self.set_reactive(BenchApp.theme, DARK.name)
        self.stylesheet.set_variables(self.get_css_variables())

    def on_mount(self) -> None:
        """Put the bench on the screen, then let the pictures flow."""
        # Not as the default screen: an input field in that one fails at start (Textual issue 6444).
        self.push_screen(self.main)
        self._frame()
        self.set_interval(FRAME_S, self._frame)
        if not self.is_headless:
            self.set_interval(HANG_UP_S, self._leave_a_dead_terminal)
        self.call_after_refresh(self._after_the_first_frame)

    # -- keys ---------------------------------------------------------------------------------------

    async def on_event(self, event: events.Event) -> None:
        """Obey a key at once; those typed before everything is there are kept for the moment it is."""
        if isinstance(event, events.Key) and not event.is_forwarded:
            if self._early_keys is not None:
                self._early_keys.append(event)
                return
            if self.screen is self.main and await obey(self, event):
                return
        await super().on_event(event)

    async def _after_the_first_frame(self) -> None:
        await self.main.prepare()
        while self._early_keys:
            await self._obey_early(self._early_keys.pop(0))
        self._early_keys = None
        _quiet_collector()

    async def _obey_early(self, event: events.Key) -> None:
        if self.screen is not self.main or not await obey(self, event):
            await super().on_event(event)

    # -- pictures and lines -------------------------------------------------------------------------

    def _frame(self) -> None:
        if self.last_words:
            return
        try:
            picture = self._engine.picture()
            if picture is not None:
                self.scene.take(picture)
                if self.main.is_mounted:
                    self.main.show()
            self._engine.request(self.scene.request())
        except EngineStopped as stopped:
            self._end(str(stopped))

    def _leave_a_dead_terminal(self) -> None:
        """End when the terminal is gone: below `make` no SIGHUP comes, and reading it would spin for ever."""
        if not os.isatty(sys.__stdin__.fileno() if sys.__stdin__ else -1):
            self._engine.close()
            os._exit(HANG_UP)  # there is nothing left to restore, and nobody to tell

    def submit(self, line: str) -> None:
        """Send one bench command line to the engine, while there is one."""
        if self.last_words:
            return
        try:
            self.main.prompt.sent(line, self._engine.submit(line))
        except EngineStopped as stopped:
            self._end(str(stopped))

    def _end(self, words: str) -> None:
        self.last_words = words
        self.main.end(words.strip().splitlines()[-1] if words.strip() else "the engine has ended")

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """Yield everything that can be done, by name."""
        from trcvtui.tui.palette import Reach, commands  # read when first asked for

        yield from commands(Reach(self.scene, self.main, self.submit))
        yield SystemCommand("Theme", "another look", self.action_change_theme)
        yield SystemCommand("Screenshot", "save the screen as an SVG file", self.deliver_screenshot)
        yield SystemCommand("Quit", "end the bench · key q", self.action_quit)


def _quiet_collector() -> None:
    # What lives now lives to the end: a full collection would cost frames for nothing (performance.md 2).
    gc.enable()
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)


def run_app(driver: Driver, project: Project) -> int:
    """Open the screen on a bench; return 0, or 1 when the engine ended by itself."""
    gc.disable()  # until the first frame stands: what is made on the way to it stays
    app = BenchApp(driver, project)
    app.run()
    if app.last_words:
        sys.stderr.write(f"{app.last_words.rstrip()}\n")
        return ENGINE_ENDED
    return app.return_code or 0
