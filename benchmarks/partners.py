"""The partners of the 32 busy connections, a process of their own: each sends numbered frames without end.

TRCV_C and TSEND_C of a connection share DATA, so that what comes back is the last frame that the PLC has
received: its number tells how many DONE there have been, and a frame that is not of one piece is seen.
On each line of stdin the process tells how far everybody is, as JSON.
"""

from __future__ import annotations

import json
import selectors
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

FRAME: Final = 4096
NUMBER: Final = struct.Struct("<Q")
BOTH: Final = selectors.EVENT_READ | selectors.EVENT_WRITE


@dataclass(frozen=True, slots=True)
class Progress:
    """How far one connection is: frames the PLC has received and sent, and those that came back wrong."""

    received: int
    sent: int
    wrong: int


class Partners:
    """The process, and what it tells."""

    def __init__(self, process: subprocess.Popen[str], ports: Sequence[int]) -> None:
        self._process = process
        self.ports = ports

    def progress(self) -> list[Progress]:
        """Ask how far everybody is who is connected, in the order of the ports."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print("?", file=self._process.stdin, flush=True)
        return [Progress(*figures) for figures in json.loads(self._process.stdout.readline())]


@contextmanager
def partners(count: int) -> Iterator[Partners]:
    """Let so many partners listen meanwhile."""
    command = [sys.executable, str(Path(__file__)), str(count)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            assert process.stdout is not None
            yield Partners(process, json.loads(process.stdout.readline()))
        finally:
            process.kill()


# -- the process ------------------------------------------------------------------------------------------


class Conversation:
    """One connection: frames out as fast as they are taken, frames in as they come."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._sock = sock
        self._next = 0
        self._unsent = memoryview(b"")
        self._have = bytearray()
        self._last = self._frames = self._wrong = 0

    def go_on(self, events: int) -> None:
        """Send and receive what goes now."""
        if events & selectors.EVENT_WRITE:
            if not self._unsent:
                self._next += 1
                self._unsent = memoryview(NUMBER.pack(self._next) * (FRAME // NUMBER.size))
            self._unsent = self._unsent[self._sock.send(self._unsent) :]
        if events & selectors.EVENT_READ:
            self._have += self._sock.recv(FRAME)
            if len(self._have) >= FRAME:
                self._take(bytes(self._have[:FRAME]))
                del self._have[:FRAME]

    def _take(self, frame: bytes) -> None:
        (number,) = NUMBER.unpack_from(frame)
        if number < self._last or frame != frame[: NUMBER.size] * (FRAME // NUMBER.size):
            self._wrong += 1
        self._last = max(self._last, number)
        self._frames += 1

    def progress(self) -> tuple[int, int, int]:
        """Return the figures of `Progress`."""
        return self._last, self._frames, self._wrong


def main(count: int) -> None:
    """Listen, say where, converse until stdin ends or the PLC goes."""
    listeners = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [listener.getsockname()[1] for listener in listeners]
    print(json.dumps(ports), flush=True)
    with suppress(OSError):  # the PLC is gone
        _converse(listeners, ports)


def _converse(listeners: Sequence[socket.socket], ports: Sequence[int]) -> None:
    conversations: dict[int, Conversation] = {}
    with selectors.DefaultSelector() as selector:
        selector.register(sys.stdin, selectors.EVENT_READ)
        for listener in listeners:
            selector.register(listener, selectors.EVENT_READ, listener)
        while True:
            for key, events in selector.select():
                if isinstance(key.data, Conversation):
                    key.data.go_on(events)
                elif key.data is not None:
                    sock = key.data.accept()[0]
                    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    talk = conversations[sock.getsockname()[1]] = Conversation(sock)
                    selector.register(sock, BOTH, talk)
                elif sys.stdin.readline():
                    told = [conversations[port].progress() for port in ports if port in conversations]
                    print(json.dumps(told), flush=True)
                else:
                    return


if __name__ == "__main__":
    main(int(sys.argv[1]))
