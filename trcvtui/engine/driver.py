"""Drives the bench from a screen, which sends lines and gets pictures. The engine is a separate process.

Rule: the import of this module takes almost no time, as the engine starts before all other imports.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from multiprocessing.connection import Client
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trcvtui.errors import UserError, mistake
from trcvtui.picture.protocol import EngineStopped

if TYPE_CHECKING:
    from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
    from trcvtui.project.project import Project
    from trcvtui.recording.files import RecordTarget

EXIT_WAIT_S: Final = 2.0
HELLO_TIMEOUT_S: Final = 30.0  # for an engine to let a tab in


class ProcessDriver:
    """A process that runs `main` and sends pictures. Make it before you import the screen library."""

    _record: RecordTarget | None = None
    is_shared = False

    def __init__(self, main: Callable[..., None], *asked: Any) -> None:
        self._main, self._asked = main, asked
        self._number = 0
        self._start()

    def _start(self) -> None:
        # Spawned, not forked: the same on every system, and nothing of this process leaks into the engine.
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        self._process = context.Process(target=self._main, args=(theirs, *self._arguments()), daemon=True)
        self._process.start()
        theirs.close()
        self._open_channel(ours)

    def _open_channel(self, channel: Channel) -> None:
        from trcvtui.picture.update_pipe import UpdateReader  # after the engine has started

        self._channel = channel
        self._arriving = UpdateReader(self._channel)
        self._outstanding = False
        self._project: Project | None = None

    def _arguments(self) -> tuple[Any, ...]:
        return self._asked

    def describe_quit_cuts(self) -> str:
        return ""

    def restart(self) -> None:
        ProcessDriver.close(self)  # not our own: a door stays open
        self._record = None  # the recording is of the run that has ended
        self._start()

    @property
    def pid(self) -> int | None:
        return self._process.pid

    def wait_for_project(self) -> Project:
        """Return the project once the engine has read it. Raise UserError for mistakes in the project."""
        while not self.has_begun():
            self._channel.poll(None)
        assert self._project is not None
        return self._project

    def has_begun(self) -> bool:
        """Return whether the engine has sent the project. Raise UserError for mistakes in the project."""
        if self._project is None and (message := self._next_message()) is not None:
            if isinstance(message, UserError):
                raise message
            self._project = self._check_message(message)
        return self._project is not None

    def submit(self, line: str) -> int:
        self._number += 1
        self._send((self._number, line.encode(errors="surrogatepass")))
        return self._number

    def request(self, request: UpdateRequest) -> None:
        if not self._outstanding:
            self._outstanding = True
            self._send(request)

    def wait_for_message(self, seconds: float) -> None:
        self._channel.poll(seconds)

    def poll_picture(self) -> BenchUpdate | None:
        newest = None
        while (message := self._next_message()) is not None:
            newest = self._accept_message(self._check_message(message)) or newest
        return newest

    def _accept_message(self, message: Any) -> BenchUpdate | None:
        """Return the message if it is a picture. The first message is the project: return None for it."""
        if self._project is None:
            self._project = message
            return None
        self._outstanding = False
        picture: BenchUpdate = message
        return picture

    def _next_message(self) -> Any:
        """Return the next message, None if no whole message has come yet."""
        try:
            return self._arriving.next()
        except (EOFError, OSError):
            raise self._make_stopped_error() from None

    def _make_stopped_error(self, trace: str = "") -> EngineStopped:
        if not trace:
            self._process.join(EXIT_WAIT_S)
            code = self._process.exitcode
            name = {number.value: number.name for number in signal.Signals}.get(-(code or 0))
            trace = f"the engine process was ended by {name or f'exit code {code}'}"
        stopped = EngineStopped(trace)
        stopped.is_internal = True
        if self._record is not None:
            target = self._record.target
            stopped.folder = (target if target.is_dir() else target.parent).absolute()
        return stopped

    def _check_message(self, message: Any) -> Any:
        """Return the message; raise EngineStopped if the message says why the engine has ended."""
        match message:
            case UserError():
                raise EngineStopped(message.lines()[0])
            case str():
                raise self._make_stopped_error(message)
        return message

    def _send(self, message: tuple[int, bytes] | UpdateRequest) -> None:
        from msgspec.msgpack import encode

        try:
            self._channel.send_bytes(encode(message))
        except OSError:
            while not self._channel.closed and self._channel.poll(EXIT_WAIT_S):  # the reason may still come
                self.poll_picture()
            raise self._make_stopped_error() from None

    def close(self) -> None:
        self._channel.close()
        self._process.join(EXIT_WAIT_S)
        if self._process.is_alive():
            self._process.kill()  # a stopped process gets no other signal
            self._process.join()


class EngineDriver(ProcessDriver):
    """The bench, in an engine process of its own."""

    def __init__(
        self,
        path: Path,
        kernel: str,
        netns: bool = False,
        read_only: bool = False,
        record: RecordTarget | None = None,
        is_shared: bool = False,
    ) -> None:
        from trcvtui.engine.engine import engine_main

        self._door, self.door = None, Path()
        if is_shared:
            from trcvtui.net.os.tab_listener import TabListener

            self._door = TabListener()
            self.door = self._door.path
        self._record = record
        super().__init__(engine_main, path, kernel, netns, read_only)

    def _arguments(self) -> tuple[Any, ...]:
        return *self._asked, self._record, self._door

    def close(self) -> None:
        super().close()
        if self._door is not None:
            self._door.close()


class AttachedDriver(ProcessDriver):
    """Connects one tab of `trcvtui serve` to the bench. `serve` has started the engine."""

    is_shared = True

    def __init__(self, door: Path) -> None:
        self._door, self._number, self._parent = door, 0, os.getppid()
        self._start()

    def _start(self) -> None:
        try:
            self._open_channel(Client(str(self._door)))
            if not self._channel.poll(HELLO_TIMEOUT_S):
                raise TimeoutError
        except OSError:
            raise mistake("--attach", str(self._door), "the engine of `trcvtui serve`") from None

    def _make_stopped_error(self, trace: str = "") -> EngineStopped:
        stopped = EngineStopped(trace or "the engine of `trcvtui serve` has ended")
        stopped.ends_screen = os.getppid() != self._parent  # `serve` was killed
        return stopped

    def close(self) -> None:
        self._channel.close()
