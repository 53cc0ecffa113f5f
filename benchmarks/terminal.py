"""A program in a terminal of its own: what it writes is read at once, keys can be typed, texts waited for."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final, Self

TRCVTUI: Final = Path(sys.executable).with_name("trcvtui")
ROWS: Final = 50
COLUMNS: Final = 200
# CSI with its parameters, OSC up to its end, and the short sequences
ESCAPE: Final = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\)|[@-Z\\-_])")
LAST_BYTES: Final = 1 << 20


class Terminal:
    """One program behind a pseudo terminal of 200 x 50; its own clock begins when it is started."""

    def __init__(self, command: Sequence[str], env: Mapping[str, str] | None = None) -> None:
        self._screen, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
        self._written = b""
        self._began = time.perf_counter()
        self._process = subprocess.Popen(
            command,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
            env={**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor", **(env or {})},
        )
        os.close(theirs)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self.end()

    def read_for(self, seconds: float) -> None:
        """Read what the program writes for so long, or until it ends."""
        end = time.perf_counter() + seconds
        while (left := end - time.perf_counter()) > 0 and self._read(left):
            pass

    def read_until(self, process: subprocess.Popen[bytes]) -> None:
        """Read what the program writes until another process has ended."""
        while process.poll() is None:
            self._read(0.05)

    def wait_for(self, texts: Sequence[str], limit_s: float = 20.0) -> float:
        """Return how many seconds after its start it had written all texts; TimeoutError after the limit."""
        wanted, end = [text.encode() for text in texts], time.perf_counter() + limit_s
        while time.perf_counter() < end and self._read(0.5):
            seen = self.written()
            wanted = [text for text in wanted if text not in seen]
            if not wanted:
                return time.perf_counter() - self._began
        raise TimeoutError(f"not seen: {wanted}; last words: {self.written()[-400:]!r}")

    def _read(self, most_s: float) -> bool:
        """Read once; False when the program has closed its end."""
        if not select.select([self._screen], [], [], most_s)[0]:
            return True
        try:
            news = os.read(self._screen, 1 << 16)
        except OSError:  # EIO: nobody writes any more
            return False
        self._written = (self._written + news)[-LAST_BYTES:]
        return bool(news)

    def written(self) -> bytes:
        """Return the newest of what the program has written, without its escape sequences."""
        return ESCAPE.sub(b"", self._written)

    def forget(self) -> None:
        """Let only what is written from now on count."""
        self._written = b""

    @property
    def process(self) -> int:
        """Return the number of the program's process."""
        return self._process.pid

    def used_s(self) -> float:
        """Return how many seconds of processor time the program has used, without its children (Linux)."""
        return used_s(self.process)

    def type(self, keys: str) -> None:
        """Send keys as a person would type them."""
        os.write(self._screen, keys.encode())

    def end(self, keys: str = "", limit_s: float = 5.0) -> None:
        """Type the keys that leave the program and wait for its end; kill it when it stays."""
        if self._process.poll() is None and keys:
            self.type(keys)
            end = time.perf_counter() + limit_s
            while self._process.poll() is None and time.perf_counter() < end:
                self._read(0.02)
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        if self._screen >= 0:
            os.close(self._screen)
            self._screen = -1


def used_s(process: int) -> float:
    """Return how many seconds of processor time a process has used, without its children (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
