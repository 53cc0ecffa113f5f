"""Dialect race: one scenario, or the session since the mark, through several dialects, scan beside scan.

Rule: the same pins, peers and bytes go through each of them, on simulated networks of their own, aside.
"""

from __future__ import annotations

import signal
from asyncio import sleep
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread, current_thread, main_thread
from types import FrameType
from typing import ClassVar, Final

from textual.binding import Binding
from textual.containers import Vertical
from textual.widget import Widget

from trcvtui.errors import UserError
from trcvtui.scenario.race import DIALECT_NAMES, InstanceRace, Race, ScanRow, race_file
from trcvtui.scenario.recorded_session import marked_scan
from trcvtui.scenario.scenario import load_scenario
from trcvtui.tui import messages
from trcvtui.tui.formatting import plain
from trcvtui.tui.race.table import (
    NAMES,
    RaceColumns,
    RaceHead,
    RaceScan,
    RaceTable,
    instance_title,
    race_parts,
)
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import pane_title
from trcvtui.tui.widgets.screens import Command, SideScreen

SESSION_FILE: Final = "session.toml"
HANG_UP: Final = getattr(signal, "SIGHUP", None)  # not on every system


class RaceFolder:
    """A folder for one file."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="trcvtui-race-")
        self.file = Path(self._folder.name) / SESSION_FILE
        # Where a hang-up is ignored (nohup) the program goes on, and so does its folder.
        self._listens = (
            HANG_UP is not None
            and current_thread() is main_thread()
            and signal.getsignal(HANG_UP) != signal.SIG_IGN
        )
        if self._listens:
            assert HANG_UP is not None
            self._before = signal.signal(HANG_UP, self._hung_up)

    def _hung_up(self, number: int, frame: FrameType | None) -> None:
        self.close()
        signal.raise_signal(number)  # to whom it went before

    def close(self) -> None:
        """Leave no file."""
        self._folder.cleanup()
        if self._listens:
            self._listens = False
            assert HANG_UP is not None
            signal.signal(HANG_UP, self._before)


class RaceRun:
    """One race: under way until `is_over`, then there is a `race` or a `problem`.

    Without names it runs in the file's own dialect and the first other one that can take its CONNECTs.
    `hidden`: so many scans had passed when a session was marked; they are raced and not shown.
    """

    def __init__(self, path: Path, names: Sequence[str] = ()) -> None:
        self.path = path
        self.names = tuple(names)
        self.race: Race | None = None
        self.problem = ""
        self.hidden = 0
        self._thread = Thread(target=self._run, daemon=True)  # the program may end before the race does
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """Return whether it has come to its end."""
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            scenario = load_scenario(self.path)
            self.hidden = marked_scan(scenario.about)
            self.race = self._raced(scenario.project.dialect.name)
        except UserError as wrong:
            self.problem = wrong.lines()[0]

    def _raced(self, own: str) -> Race:
        if self.names:
            return race_file(self.path, self.names)
        first: UserError | None = None
        for other in DIALECT_NAMES:
            if other != own:
                try:
                    return race_file(self.path, [own, other])
                except UserError as wrong:
                    first = first or wrong
        assert first is not None, "there are several dialects"
        raise first


def since(raced: InstanceRace, hidden: int) -> InstanceRace:
    """Return an instance without its first scans."""
    rows = tuple(_without_hidden(row, hidden) for row in raced.rows if row.scan + row.scans - 1 > hidden)
    return replace(raced, rows=rows) if hidden else raced


def _without_hidden(row: ScanRow, hidden: int) -> ScanRow:
    missing = max(0, hidden + 1 - row.scan)
    return replace(row, scan=row.scan + missing, scans=row.scans - missing) if missing else row


LOOK_S: Final = 1 / 30
KEYS: Final = (
    ("n N", "difference"), ("1-4", "dialects"), ("← →", "instance"), ("o", "only differing"),
    ("r", "again"), ("y", "yank"), ("?", "help"), ("esc", "leave"),
)  # fmt: skip
ACTIONS: Final = {
    "n N": "difference(1)", "← →": "instance(1)", "o": "only", "r": "again", "y": "yank", "?": "help",
    "esc": "leave",
}  # fmt: skip


class RaceScreen(SideScreen[None]):
    """Head with the dialects, table of scans, the chosen scan in full."""

    BINDINGS: ClassVar = [
        *[Binding(str(digit), f"dialect({digit})", show=False) for digit in range(1, len(NAMES) + 1)],
        Binding("n", "difference(1)", show=False),
        Binding("N", "difference(-1)", show=False),
        Binding("right", "instance(1)", show=False),
        Binding("left", "instance(-1)", show=False),
        Binding("o", "only", show=False),
        Binding("r", "again", show=False),
        Binding("y", "yank", show=False),
        Binding("escape,q,D", "leave", show=False),
    ]
    CSS_PATH = "race.tcss"

    def __init__(self, view_model: ViewModel, say: Callable[[str], int | None], path: Path | None) -> None:
        super().__init__(view_model, say, KEYS, ACTIONS)
        self._path = path
        self._folder: RaceFolder | None = None  # of a session's file
        self.run: RaceRun | None = None
        self._chosen: tuple[str, ...] = ()  # the dialects, as far as they are known
        self._taken: RaceRun | None = None  # what the table shows
        self._instance = ""
        self._said = ("", "")
        self.head = RaceHead()
        self.columns = RaceColumns()
        self.table = RaceTable()
        self.scan = RaceScan()
        self._frame = Vertical(id="race-frame")

    def compose(self) -> Iterator[Widget]:
        """Compose header, head, table, the chosen scan, keys."""
        yield self.header
        yield self.head
        with self._frame:
            yield self.columns
            yield self.table
        yield self.scan
        yield self.outcome
        yield self.key_line

    def on_mount(self) -> None:
        """Begin the race; a session is written down first."""
        self.set_focus(self.table)
        if self._path is not None:
            self._begin()
        else:
            self._folder = RaceFolder()
            self._path = self._folder.file
            self._write_session()
        self.show()

    def on_unmount(self) -> None:
        """Leave no file."""
        self.forget()

    def forget(self) -> None:
        """Remove the session's file: the screen, or the whole program, ends."""
        if self._folder is not None:
            self._folder.close()

    def _write_session(self) -> None:
        self._asked.clear()
        if not self.send(f"save scenario {self._path}"):
            self._tell("this screen may not write down the session", "error")

    def _begin(self) -> None:
        assert self._path is not None
        self.run = RaceRun(self._path, self._chosen)
        self._tell("racing …", "busy")
        self.run_worker(self._follow(self.run), exclusive=True)

    async def _follow(self, run: RaceRun) -> None:
        while not run.is_over:
            await sleep(LOOK_S)
        self.show()

    # -- what is shown ------------------------------------------------------------------------------

    def show(self) -> None:
        """Take what is over, and repaint what changed."""
        self._hear_answer()
        if self.run is not None and self.run.is_over and self.run is not self._taken:
            self._take(self.run)
        self.header.show()
        what = self._what()
        self.head.draw(what, self._chosen)
        self.show_keys()

    def _hear_answer(self) -> None:
        for answer in self.answers():
            if answer.error:
                self._tell(answer.error, "error")
            else:
                self._begin()

    def _what(self) -> list[tuple[str, str]]:
        race = self._taken.race if self._taken is not None else None
        if race is None or self._taken is None:
            return [("race      ", "dim"), (plain(self._path.stem) if self._path else "", "strong")]
        return race_parts(race, self._taken.hidden)

    def _take(self, run: RaceRun) -> None:
        if run.race is None:
            self.run = self._taken if self._taken is not None and self._taken.race is not None else None
            if self.run is not None and self.run.race is not None:
                self._chosen = self.run.race.dialects
            self._tell(f"✗ {run.problem}", "error")
            return
        self._taken, self._chosen = run, run.race.dialects
        self._tell("")
        self._draw()

    @property
    def instances(self) -> tuple[InstanceRace, ...]:
        """Return the instances of the race that is shown."""
        if self._taken is None or self._taken.race is None:
            return ()
        return tuple(since(each, self._taken.hidden) for each in self._taken.race.instances)

    def _draw(self) -> None:
        instances = self.instances
        place = next((n for n, each in enumerate(instances) if each.instance == self._instance), 0)
        raced = instances[place] if instances else None
        race = self._taken.race if self._taken is not None else None
        self.columns.raced = raced
        self.columns.refresh()
        self.table.take(raced, race)
        title = instance_title(raced, place, len(instances)) if raced is not None else "no instance"
        self._frame.border_title = pane_title(None, title)
        self._draw_scan()

    def _draw_scan(self) -> None:
        race = self._taken.race if self._taken is not None else None
        self.scan.take(self.table.chosen, self.table.raced, race.interval_ns if race is not None else 0)

    def _tell(self, words: str, style: str = "dim") -> None:
        self.outcome.display = bool(words)
        self.outcome.say(words, style)

    def on_race_row_selected(self) -> None:
        """Show the chosen scan in full."""
        self._tell("")
        self._draw_scan()

    def on_dialect_toggled(self, message: messages.DialectToggled) -> None:
        """Toggle a dialect by mouse."""
        self.action_dialect(message.digit)

    # -- actions ------------------------------------------------------------------------------------

    def action_dialect(self, digit: int) -> None:
        """Let a dialect take part, or no longer; the race runs anew."""
        name = NAMES[digit - 1]
        if not self._chosen or self._asked:
            return
        chosen = tuple(each for each in NAMES if (each in self._chosen) != (each == name))
        if len(chosen) < 2:
            self._tell("a race needs two dialects: add another one first", "warn")
            return
        self._chosen = chosen
        self._begin()
        self.show()

    def action_difference(self, step: int) -> None:
        """Go to the next scan in which they differ, or the one before."""
        if not self.table.difference(step):
            way = "further down" if step > 0 else "further up"
            self._tell(f"no difference {way}", "dim")

    def action_instance(self, step: int) -> None:
        """Look at another instance."""
        instances = self.instances
        if instances:
            names = [each.instance for each in instances]
            here = names.index(self._instance) if self._instance in names else 0
            self._instance = names[(here + step) % len(names)]
            self._draw()

    def action_only(self) -> None:
        """Show only the scans in which they differ, or all."""
        self.table.only_differing = not self.table.only_differing
        self._draw()
        self._tell("only the scans that differ; o: all" if self.table.only_differing else "")

    def action_again(self) -> None:
        """Race anew: the file, or the session as far as it is now."""
        if self._folder is not None:
            self._write_session()
        else:
            self._begin()
        self.show()

    def action_yank(self) -> None:
        """Take the whole race as text."""
        from trcvtui.scenario.race import race_text  # read when first asked for
        from trcvtui.tui.clipboard_and_files import take
        from trcvtui.tui.copy_formats import Format

        if self._taken is not None and self._taken.race is not None:
            text = race_text(self._taken.race) + "\n"
            form = Format("r", "the race", lambda of: text)
            self.run_worker(take(self.app, form, text, self._tell, partial(self._tell, style="error")))

    def action_leave(self) -> None:
        """Go back to where the race was asked for."""
        self.dismiss(None)

    def palette_rows(self) -> Iterator[Command]:
        """Yield what can be done here, for the palette."""
        yield "Next difference", "key n", "difference(1)"
        yield "Difference before", "key N", "difference(-1)"
        for digit, name in enumerate(NAMES, 1):
            way = "out of the race" if name in self._chosen else "into the race"
            yield f"{name} {way}", f"key {digit}", f"dialect({digit})"
        yield "Next instance", "key →", "instance(1)"
        yield "Only the scans that differ, or all", "key o", "only"
        yield "Race again", "the file or session as it is now · key r", "again"
        yield "Yank the race as text", "key y", "yank"
        yield "Help", "key ?", "help"
        yield "Leave the race", "key esc", "leave"
