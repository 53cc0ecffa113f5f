"""The folder of a session that is raced: it is gone when the screen is, also when the terminal goes first."""

from __future__ import annotations

import signal
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import current_thread, main_thread
from types import FrameType
from typing import Final

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
