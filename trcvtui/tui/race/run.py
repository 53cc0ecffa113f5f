"""A race that runs aside while the screen goes on: of a scenario file, through dialects of one's choice."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread, current_thread, main_thread
from types import FrameType
from typing import Final

from trcvtui.errors import UserError
from trcvtui.rig.scenario.race import DIALECT_NAMES, InstanceRace, Race, ScanRow, race_file
from trcvtui.rig.scenario.recorded_session import marked_scan
from trcvtui.rig.scenario.scenario import load_scenario

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
        """Leave no file behind."""
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
