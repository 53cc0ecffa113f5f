"""A real terminal for tests: the program in tmux, keys in, screen text out."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

TRCVTUI = Path(sys.executable).with_name("trcvtui")
_NUMBERS = itertools.count(1)
PATIENCE_S = 90  # a busy machine is slow, not wrong
LOOK_S = 0.1  # between two looks the program gets the processor: each is a process of tmux


def need(tool: str) -> str:
    """Return the path of a system program; skip visibly, with its name, where it is absent."""
    found = shutil.which(tool)
    if found is None:
        pytest.skip(f"{tool} is not installed")
    return found


class Terminal:
    """One tmux session of its own server."""

    def __init__(self, columns: int, rows: int, command: str) -> None:
        # A name of its own for each: a server that is going away must not meet the next one.
        self._tmux = [need("tmux"), "-L", f"trcvtui-{os.getpid()}-{next(_NUMBERS)}", "-f", "/dev/null"]
        self._call("new-session", "-d", "-x", str(columns), "-y", str(rows), command)

    def _call(self, *words: str) -> str:
        # The runner's own idea of a terminal size must not reach the program under test.
        env = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "LINES", "TMUX")}
        done = subprocess.run([*self._tmux, *words], capture_output=True, text=True, check=True, env=env)
        return done.stdout

    def screen(self) -> str:
        """Return the text on the screen now."""
        return self._call("capture-pane", "-p")

    @property
    def modes(self) -> str:
        asked = "alternate #{alternate_on}, mouse #{mouse_any_flag}"
        return self._call("display-message", "-p", asked).strip()

    def keys(self, *keys: str) -> None:
        self._call("send-keys", *keys)

    def type(self, text: str) -> None:
        self._call("send-keys", "-l", text)

    def wait(self, seen: str | Callable[[str], bool]) -> str:
        """Look until the screen shows it; return the screen."""
        shows = seen if callable(seen) else lambda screen: seen in screen
        screen = ""
        limit = time.monotonic() + PATIENCE_S
        while time.monotonic() < limit:
            screen = self.screen()
            if shows(screen):
                return screen
            time.sleep(LOOK_S)
        raise AssertionError(f"never seen: {seen}\n{screen}")

    def close(self) -> None:
        subprocess.run([*self._tmux, "kill-server"], capture_output=True, check=False)
