"""How a screen drives the bench: the engine in its own process, or the bench in this one."""

from __future__ import annotations

import multiprocessing
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Protocol

from trcvtui.plc.project import Project
from trcvtui.rig.assembly import Bench
from trcvtui.rig.console import Console
from trcvtui.rig.picture import EngineTiming, Picture, PictureRequest
from trcvtui.rig.routine import read_routines
from trcvtui.rig.scenario import start_steps

LAST_WORDS_S: Final = 2.0


class EngineStopped(Exception):
    """The engine process has ended; its last words say why."""


class Driver(Protocol):
    """What a screen may do with a bench."""

    def submit(self, line: str) -> int:
        """Send one bench command line; return the number under which its answer comes."""
        ...

    def request(self, request: PictureRequest) -> None:
        """Ask for a picture; at most one request is outstanding."""
        ...

    def picture(self) -> Picture | None:
        """Return the newest picture that has arrived since the last call."""
        ...

    def close(self) -> None:
        """End the bench."""
        ...


class EngineDriver:
    """The bench in a process of its own; start it before the screen library is imported."""

    def __init__(self, path: Path, kernel: str, overrides: Sequence[str] = ()) -> None:
        # Spawned, not forked: the same on every system, and nothing of this process leaks into the engine.
        from trcvtui.rig.engine import engine_main

        context = multiprocessing.get_context("spawn")
        self._channel, theirs = context.Pipe()
        self._process = context.Process(
            target=engine_main, args=(theirs, path, kernel, tuple(overrides)), daemon=True
        )
        self._process.start()
        theirs.close()
        self._number = 0
        self._outstanding = False

    @property
    def pid(self) -> int | None:
        """Return the number of the engine's process."""
        return self._process.pid

    def submit(self, line: str) -> int:
        """Send one bench command line."""
        self._number += 1
        self._send((self._number, line))
        return self._number

    def request(self, request: PictureRequest) -> None:
        """Ask for a picture, unless one is on its way."""
        if not self._outstanding:
            self._outstanding = True
            self._send(request)

    def wait(self, seconds: float) -> None:
        """Wait until a picture has arrived, at most so long."""
        self._channel.poll(seconds)

    def picture(self) -> Picture | None:
        """Return the newest picture that has arrived."""
        newest = None
        while self._channel.poll():
            newest = self._receive()
            self._outstanding = False
        return newest

    def _receive(self) -> Picture:
        try:
            message = self._channel.recv()
        except (EOFError, OSError):
            raise EngineStopped("the engine has ended without a word") from None
        if isinstance(message, Picture):
            return message
        raise EngineStopped(str(message))

    def _send(self, message: object) -> None:
        try:
            self._channel.send(message)
        except OSError:
            self._raise_last_words()

    def _raise_last_words(self) -> None:
        while not self._channel.closed and self._channel.poll(LAST_WORDS_S):
            self._receive()
        raise EngineStopped("the engine has ended without a word")

    def close(self) -> None:
        """Close the channel, which ends the engine, and wait for it."""
        self._channel.close()
        self._process.join(LAST_WORDS_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join()


class LocalDriver:
    """The bench in this process, for simulation and tests; `scan` lets scans pass."""

    def __init__(self, bench: Bench) -> None:
        self.console = Console(bench)
        self._number = 0
        self._picture: Picture | None = None

    def submit(self, line: str) -> int:
        """Carry out one bench command line."""
        self._number += 1
        self.console.take(self._number, line)
        return self._number

    def scan(self, scans: int = 1) -> None:
        """Let scans pass, as far as they are not held."""
        for _ in range(scans):
            if self.console.may_scan():
                self.console.bench.step()

    def request(self, request: PictureRequest) -> None:
        """Take a picture now."""
        self._picture = self.console.picture(request, EngineTiming(mode="in process"), request.most_lines)

    def picture(self) -> Picture | None:
        """Return the picture taken since the last call."""
        picture, self._picture = self._picture, None
        return picture

    def close(self) -> None:
        """End the bench."""
        self.console.bench.close()


def start_engine(project: Project, kernel: str) -> EngineDriver:
    """Start the engine for a project; raise UserError for a mistake in its bench commands."""
    start_steps(project)
    read_routines(project)
    return EngineDriver(project.path, kernel)
