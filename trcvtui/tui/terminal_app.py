"""The base of every screen: theme, keys in their order, signals, a dead terminal, garbage collection."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar, Final

from textual import events
from textual.app import App
from textual.command import Provider

from trcvtui.tui.settings import ScreenSettings
from trcvtui.tui.widgets.theme import COMPONENT_CLASSES, OWN_THEMES, THEMES, readable_colours
from trcvtui.tui.widgets.typed_lines import EntryField, dispatch_key

TERMINAL_CHECK_S: Final = 1.0
REST_INTERVAL_S: Final = 2.0  # so long without a key: collect the middle generation
LONG_REST_COUNT: Final = 15  # after so many such intervals: collect everything made since the start
YOUNG_OBJECTS: Final = 2_000  # objects made before the collector visits them: 1 to 2 ms
ENDING_SIGNAL_NAMES: Final = ("SIGTERM", "SIGHUP", "SIGQUIT")
ENDING_SIGNALS: Final = [getattr(signal, name) for name in ENDING_SIGNAL_NAMES if hasattr(signal, name)]
QUIT_ACTIONS: Final = frozenset(("app.quit", "quit"))
HANG_UP_EXIT: Final = 129  # as a shell reports SIGHUP


def _ordered_commands() -> type[Provider]:
    from trcvtui.tui.palette import OrderedCommands  # read when first asked for

    return OrderedCommands


class TerminalApp(App[None]):
    """A subclass calls `set_up_terminal` when it is mounted, and `finish_start` after its first frame."""

    TITLE = "trcvtui"
    CSS_PATH = Path(__file__).with_name("styles.tcss")
    COMPONENT_CLASSES: ClassVar[set[str]] = COMPONENT_CLASSES
    ENABLE_COMMAND_PALETTE: ClassVar[bool] = True
    COMMANDS: ClassVar[set[type[Provider] | Callable[[], type[Provider]]]] = {_ordered_commands}
    only_looks = False  # read-only: it changes nothing and starts no program

    def __init__(self, settings: ScreenSettings) -> None:
        super().__init__(ansi_color=True if "NO_COLOR" in os.environ else None)
        self._look = THEMES[settings.theme]
        self.key_names, self.problems = settings.names, settings.problems
        self.set_keymap(dict(settings.keymap))
        self._keys = self._rests = self._keys_seen = 0
        self._kept_keys: list[events.Key | events.Paste] = []
        self._keeps_keys, self._is_up = True, False  # keys wait for what they act on; the start is over
        self._ended_by = 0  # a signal that came before the start was over
        for theme in OWN_THEMES.values():
            self.register_theme(theme)
        if not self._look.ansi:
            # Without the watcher: it would read every rule twice before the first frame.
            self.set_reactive(TerminalApp.theme, self._look.name)
            self.stylesheet.set_variables(self.get_css_variables())

    # -- for subclasses -----------------------------------------------------------------------------

    async def mount_fields(self) -> None:
        """Make widgets that the first frame does not need, such as input fields."""

    def show_start_message(self) -> None:
        """After the start, show the message that the user must see about this screen."""

    def end_children(self, is_dead: bool) -> None:
        """End the child processes of this screen. If `is_dead`, this process itself ends right after."""

    def get_css_variables(self) -> dict[str, str]:
        """Return the colours of the theme; colours that are hard to see are replaced."""
        colours = super().get_css_variables()  # its `theme_variables`, too
        colours.update(readable_colours(self.current_theme, colours))
        return colours

    # -- from the start to the end ------------------------------------------------------------------

    def on_load(self) -> None:
        if not self.is_headless:  # before Textual changes the terminal's mode
            self._add_signal_handlers()

    def set_up_terminal(self) -> None:
        if self._look.ansi:
            self.theme = self._look.name  # with the watcher: native colours need it
        if not self.is_headless and not self.is_web:
            self.set_interval(TERMINAL_CHECK_S, self._exit_if_hung_up)

    async def finish_start(self) -> None:
        await self.mount_fields()
        await self.process_kept_keys()
        self._is_up = True
        if self._ended_by:
            self._end_by_signal(self._ended_by)
        self.show_start_message()
        limit_garbage_collector()
        self.set_interval(REST_INTERVAL_S, self._collect_garbage)

    def _add_signal_handlers(self) -> None:
        """Let ENDING_SIGNALS end the screen as `q` does, so that the terminal's state is restored."""
        loop = asyncio.get_running_loop()
        for number in ENDING_SIGNALS:
            if signal.getsignal(number) is signal.SIG_IGN:  # started by nohup
                continue
            with suppress(NotImplementedError, ValueError):  # not on every system, only in the main thread
                loop.add_signal_handler(number, self._end_by_signal, number)

    def _end_by_signal(self, number: int) -> None:
        if not self._is_up:  # `finish_start` ends it
            self._ended_by = number
            return
        if not self.is_web:
            self._exit_if_hung_up()
        self.end_children(False)
        self.exit(return_code=128 + number)  # as a shell reports a signal

    def _exit_if_hung_up(self) -> None:
        """End if the terminal is gone. Under `make` no SIGHUP comes, and reading would loop for ever."""
        if not os.isatty(sys.__stdin__.fileno() if sys.__stdin__ else -1):
            self.end_children(True)
            os._exit(HANG_UP_EXIT)  # no terminal to restore

    # -- keys ---------------------------------------------------------------------------------------

    async def on_event(self, event: events.Event) -> None:
        """Handle a key before the next key is read. While the screen is not ready, store the keys."""
        if isinstance(event, events.Key | events.Paste) and not event.is_forwarded:
            self._keys += 1
            if (self._keeps_keys or self._kept_keys) and not self._is_quit_key(event):
                self._kept_keys.append(_normalize_enter(event))
                return
            if await dispatch_key(self, event):
                return
        await super().on_event(event)

    def _is_quit_key(self, event: events.Key | events.Paste) -> bool:
        if not self._is_up or isinstance(event, events.Paste):
            return False
        if event.is_printable and (self._kept_keys or isinstance(self.focused, EntryField)):
            return False
        bound = self.screen.active_bindings.get(event.key)
        return bound is not None and bound.binding.action in QUIT_ACTIONS

    async def process_kept_keys(self) -> None:
        """Handle the stored keys in their order, until one of them makes the others wait again."""
        self._keeps_keys = False
        while self._kept_keys and not self._keeps_keys:
            if not await dispatch_key(self, self._kept_keys[0]):
                await super().on_event(self._kept_keys[0])
            del self._kept_keys[0]  # only now: while it is handled, new keys queue behind it

    def copy_to_clipboard(self, text: str) -> None:
        """Copy a text to the terminal (OSC 52) and to a clipboard program."""
        super().copy_to_clipboard(text)
        if not self.only_looks:
            from trcvtui.tui.clipboard_and_files import copy_by_program  # read when first asked for

            self.run_worker(asyncio.to_thread(copy_by_program, text))

    # -- the collector ------------------------------------------------------------------------------

    def _collect_garbage(self) -> None:
        """Collect garbage while no key comes, if `gc.get_count` shows new objects."""
        self._rests = self._rests + 1 if self._keys == self._keys_seen else 0
        self._keys_seen = self._keys
        _, older, oldest = gc.get_count()
        if self._rests >= LONG_REST_COUNT and oldest:
            gc.collect()
        elif self._rests and older:
            gc.collect(1)


def _normalize_enter(event: events.Key | events.Paste) -> events.Key | events.Paste:
    # Before raw mode the terminal driver turns the CR of enter into LF, which is ctrl+j.
    return events.Key("enter", "\r") if isinstance(event, events.Key) and event.key == "ctrl+j" else event


def limit_garbage_collector() -> None:
    """Let the collector visit only young objects, a few at a time. Older ones wait until typing pauses.

    A collection of 50,000 young objects took 37 to 181 ms.
    """
    gc.enable()
    gc.collect()
    gc.freeze()  # objects of the start live to the end
    gc.set_threshold(YOUNG_OBJECTS, 1_000_000, 1_000_000)
