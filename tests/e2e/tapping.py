"""`trcvtui tap` as a process of its own, and plain sockets at both its ends."""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

RESET = (1).to_bytes(4, sys.byteorder) + bytes(4)  # SO_LINGER: close sends RST
PATIENCE = 60.0  # seconds, of a socket: a busy machine is slow


class Tap:
    """A tap to a place; `port` is where it listens. It gets so many descriptors, 0: as many as we do."""

    def __init__(self, to: str, *words: str, listen: str = "127.0.0.1:0", descriptors: int = 0) -> None:
        pipe = subprocess.PIPE
        places = (listen, to) if to else ()
        command = [sys.executable, "-m", "trcvtui", "tap", *places, *words]
        if descriptors:
            limit = (
                f"import os, sys; from resource import *; setrlimit(RLIMIT_NOFILE, ({descriptors},) * 2); "
            )
            command = [sys.executable, "-c", f"{limit}os.execv(sys.argv[1], sys.argv[1:])", *command]
        # Unbuffered: `communicate` does not see what `readline` has read ahead.
        self.process = subprocess.Popen(command, bufsize=0, stdin=pipe, stdout=pipe, stderr=pipe)
        assert self.process.stderr is not None
        self.said = self.process.stderr.readline().decode()
        ends = self.said.partition(": ")[2].partition(" to ")[0]
        self.port = 0 if ends.startswith("serial:") else int(ends.rpartition(":")[2])

    @classmethod
    def of_project(cls, project: Path, *words: str) -> Tap:
        return cls("", "--project", str(project), *words)

    def __enter__(self) -> Tap:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()

    def order(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def end(self, number: int = signal.SIGTERM) -> tuple[int, str, str]:
        """End it; return its exit code, and what it wrote to stdout and to stderr after its first line."""
        self.process.send_signal(number)
        out, errors = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, (out or b"").decode(), errors.decode()


def listening(family: int = socket.AF_INET) -> tuple[socket.socket, int]:
    door = socket.create_server(("::1" if family == socket.AF_INET6 else "127.0.0.1", 0), family=family)
    door.settimeout(PATIENCE)
    return door, door.getsockname()[1]


def calling(port: int, source: str = "127.0.0.1") -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), PATIENCE, (source, 0))


def joined(door: socket.socket, port: int, source: str = "127.0.0.1") -> tuple[socket.socket, socket.socket]:
    """Return the end that calls a port, and the end that `door` accepts for it."""
    near = calling(port, source)
    far = door.accept()[0]
    far.settimeout(PATIENCE)
    return near, far


@contextlib.contextmanager
def tapped(*words: str, source: str = "127.0.0.1") -> Iterator[tuple[Tap, socket.socket, socket.socket]]:
    """Yield a tap, the end that calls it, and the end that it leads to."""
    door, port = listening()
    with door, Tap(str(port), *words) as tap:
        near, far = joined(door, tap.port, source)
        with near, far:
            yield tap, near, far


def exactly(sock: socket.socket, size: int) -> bytes:
    """Return so many bytes, fewer at the end."""
    got = bytearray()
    while len(got) < size and (part := sock.recv(size - len(got))):
        got += part
    return bytes(got)


def end_of(sock: socket.socket) -> tuple[int, str]:
    size = 0
    try:
        while part := sock.recv(1 << 16):
            size += len(part)
    except ConnectionError:
        return size, "RST"
    return size, "FIN"


def reset(sock: socket.socket) -> None:
    with contextlib.suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
    sock.close()
