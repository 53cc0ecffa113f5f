"""Packets that another program pipes to us, read as they come. While none come, `report_wait` is called."""

from __future__ import annotations

import os
import queue
import select
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final

READ_BYTES: Final = 256 << 10  # bytes of one read
PIPE_BYTES: Final = 1 << 20  # in the pipe, if the system allows so much
FEW_BYTES: Final = 32 << 10  # after fewer bytes it pauses: packets read one by one cost several times as much
REST_S: Final = 0.005
TICK_S: Final = 0.01  # between two calls of `waits`
SLOW_TICK_S: Final = 0.05  # after so many ticks
FAST_TICKS: Final = 200
STOP_WAIT_S: Final = 0.5  # after `stop`, for the other program to end
_F_SETPIPE_SZ: Final = 1031  # F_SETPIPE_SZ of Linux
_MOST_CHUNKS: Final = 4  # read ahead by a thread


class PacketPipe:
    """Packets from a descriptor. `report_wait` gets how long (ns) the running `read` has found nothing."""

    def __init__(
        self,
        fd: int,
        report_wait: Callable[[int], object],
        cut_whole: Callable[[bytes], bytes | None] = bytes,
    ) -> None:
        self._next, self._waits, self._whole = _chunk_reader(fd), report_wait, cut_whole
        self._few = False
        self.empty_at = time.monotonic_ns()  # when it was last seen empty
        self._stops_at: float | None = None

    def stop_when_empty(self) -> None:
        """End the pipe as soon as it is empty, but at the earliest after STOP_WAIT_S."""
        self._stops_at = time.monotonic() + STOP_WAIT_S

    @property
    def is_stopping(self) -> bool:
        return self._stops_at is not None

    @property
    def since_empty_ns(self) -> int:
        """Return how many ns ago the pipe was last seen empty."""
        return time.monotonic_ns() - self.empty_at

    def read(self, _most: int) -> bytes:
        """Return the next bytes, b"" at the end."""
        ticks = since = 0
        if self._few:
            time.sleep(REST_S)
        while True:
            data = self._next(0.0 if not ticks else TICK_S if ticks < FAST_TICKS else SLOW_TICK_S)
            if data is not None and (data := self._whole(data)) is not None:
                self._few = len(data) < FEW_BYTES
                if self._few:
                    self.empty_at = time.monotonic_ns()
                return data
            self.empty_at = time.monotonic_ns()
            if self._stops_at is not None and time.monotonic() > self._stops_at:
                return b""
            since = since or self.empty_at
            self._waits(self.empty_at - since)
            ticks += 1


def _chunk_reader(fd: int) -> Callable[[float], bytes | None]:
    """Return a function that returns the next bytes, or None if none come within the given seconds."""
    if hasattr(select, "poll"):
        with suppress(ImportError, OSError):
            import fcntl

            fcntl.fcntl(fd, _F_SETPIPE_SZ, PIPE_BYTES)
        poller = select.poll()
        poller.register(fd, select.POLLIN)
        return lambda seconds: _read_or_end(fd) if poller.poll(seconds * 1000) else None
    chunks = queue.Queue[bytes](_MOST_CHUNKS)

    def fill() -> None:  # a pipe of Windows cannot be polled
        data = b"."
        while data:
            try:
                data = os.read(fd, READ_BYTES)
            except OSError:
                data = b""
            chunks.put(data)

    def wait(seconds: float) -> bytes | None:
        with suppress(queue.Empty):
            return chunks.get(timeout=seconds) if seconds else chunks.get_nowait()
        return None

    threading.Thread(target=fill, daemon=True).start()
    return wait


def _read_or_end(fd: int) -> bytes:
    with suppress(ConnectionResetError):  # the other end has closed with an order of ours unread: an end, too
        return os.read(fd, READ_BYTES)
    return b""


def detach_stdin(with_keyboard: bool) -> int:
    """Return a new descriptor of the piped stdin. If `with_keyboard`, stdin becomes the terminal."""
    fd = os.dup(0)
    if with_keyboard:
        keyboard = os.open("CONIN$" if os.name == "nt" else "/dev/tty", os.O_RDWR)
        os.dup2(keyboard, 0)
        os.close(keyboard)
    if os.name == "nt":
        import msvcrt

        msvcrt.setmode(fd, os.O_BINARY)  # type: ignore[attr-defined]
    return fd
