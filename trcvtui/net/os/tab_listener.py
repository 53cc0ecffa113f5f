"""The socket where the tabs of a bench in a browser connect: a Unix socket in a folder of this user alone."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

from trcvtui.net.os.observers import is_trusted, listen_at


class TabListener:
    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="trcvtui-")) / "bench"  # mode 0700
        atexit.register(shutil.rmtree, self.path.parent, ignore_errors=True)
        self._listens = listen_at(self.path)
        self._listens.setblocking(False)

    def accept(self) -> int | None:
        """Return the descriptor of a new tab, or None if there is none or it is another user's."""
        try:
            tab, _ = self._listens.accept()
        except OSError:
            return None
        with tab:
            return tab.detach() if is_trusted(tab) else None

    def close(self) -> None:
        self._listens.close()
        shutil.rmtree(self.path.parent, ignore_errors=True)
