"""The door of a bench in a browser: a Unix socket in a folder of this user alone, by which tabs come in."""

from __future__ import annotations

import os
import shutil
import socket
import tempfile
from pathlib import Path

from trcvtui.errors import mistake
from trcvtui.files import reason_of
from trcvtui.net.os.observers import is_trusted, listening


class TabDoor:
    """It is `serve`'s, which hands it to each of its engines."""

    def __init__(self) -> None:
        """Listen; raise UserError where the system has no such sockets, or no room."""
        if not hasattr(socket, "AF_UNIX"):
            raise mistake("trcvtui serve", "a system without Unix sockets", "Linux, macOS or a BSD")
        self.path = Path(tempfile.mkdtemp(prefix="trcvtui-")) / "bench"  # mode 0700
        try:
            self._listens = listening(self.path)
        except BaseException:
            self.remove()
            raise
        self._listens.setblocking(False)

    def fileno(self) -> int:
        return self._listens.fileno()

    def accept(self) -> int | None:
        """Return the descriptor of a tab that has come; None: there is none, or one of another user."""
        try:
            tab, _ = self._listens.accept()
        except OSError:
            return None
        if not is_trusted(tab):
            tab.close()
            return None
        return tab.detach()

    def turn_away(self) -> None:
        """Close those that have come: there is no engine."""
        while (tab := self.accept()) is not None:
            os.close(tab)

    def remove(self) -> None:
        shutil.rmtree(self.path.parent, ignore_errors=True)


def enter(path: Path) -> int:
    """Return the descriptor of a connection to the engine of `serve`; raise UserError without one."""
    with socket.socket(socket.AF_UNIX) as made:
        try:
            made.connect(str(path))
        except OSError as failed:
            raise mistake(str(path), reason_of(failed), "a bench that `trcvtui serve` shows") from None
        return made.detach()
