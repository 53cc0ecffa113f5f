"""What a screen may do with its engine, how that ends, and the messages on the channel between them.

Rule: importing this costs next to nothing, because nothing else happens before the engine is started.
"""

from __future__ import annotations

import os
import struct
import sys
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest

LENGTH: Final = struct.Struct("!i")  # before each message, as multiprocessing writes it
READ_BYTES: Final = 1 << 18


class EngineStopped(Exception):
    """The engine process has ended; its last words say why, the last line of them in short.

    `ends_screen`: nothing can be shown any more, not even that. `is_internal`: an error of this program, or
    a signal, has ended it; `folder`: where its recording is, None: there is none.
    """

    ends_screen = is_internal = False
    folder: Path | None = None


class Driver(Protocol):
    """What a screen may do with a bench."""

    def submit(self, line: str) -> int:
        """Send one bench command line; return the number under which its answer comes."""
        ...

    def request(self, request: UpdateRequest) -> None:
        """Ask for a picture; at most one request is outstanding."""
        ...

    def picture(self) -> BenchUpdate | None:
        """Return the newest picture that has arrived since the last call."""
        ...

    def cuts(self) -> str:
        """Return what is cut when the screen quits, in words; "" for nothing."""
        ...

    def restart(self) -> None: ...

    def close(self) -> None: ...


class MessageReader:
    """What has come over a channel. A message is taken when the whole of it is there; nobody waits for more.

    The engine writes a picture in the gaps of several scans: a screen that waited would stand still.
    """

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._bytes = bytearray()
        self._has_ended = False

    def next(self) -> bytes | None:
        """Return the next whole message, None while there is none; raise EOFError after the last one."""
        if sys.platform == "win32":
            return self._channel.recv_bytes() if self._channel.poll() else None
        self._look()
        if len(self._bytes) >= LENGTH.size:
            end = LENGTH.size + LENGTH.unpack_from(self._bytes)[0]
            if len(self._bytes) >= end:
                message = bytes(memoryview(self._bytes)[LENGTH.size : end])
                del self._bytes[:end]
                return message
        if self._has_ended:
            raise EOFError
        return None

    def _look(self) -> None:
        descriptor = self._channel.fileno()
        os.set_blocking(descriptor, False)
        try:
            while not self._has_ended:
                read = os.read(descriptor, READ_BYTES)
                self._bytes += read
                self._has_ended = not read
        except OSError as why:  # a reset: the other end had not read all; what it said before that is here
            self._has_ended = not isinstance(why, BlockingIOError)
        finally:
            os.set_blocking(descriptor, True)
