"""The observers of a tap: a Unix socket, mode 0600, at which each of them reads blocks of what passes.

Rule: an observer that does not read makes its own way full, and no other one wait.
"""

from __future__ import annotations

import os
import select
import socket
import stat
import struct
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

from trcvtui.errors import mistake
from trcvtui.files import reason_of
from trcvtui.net.os.tap_ways import ask_for_way
from trcvtui.net.tap import TapEvent, events_of

CREDENTIALS: Final = struct.Struct("iII")  # of SO_PEERCRED: process, user, group
MOST_NAME: Final = 107  # bytes of `sun_path`
MOST_OBSERVERS: Final = 8
READ: Final = 1 << 16  # bytes of orders that are read at once
LAST_S: Final = 1.0  # for observers to read what is left
TRY_S: Final = 1.0  # for a tap to take a connection, and to tell something
LOOK_S: Final = 5.0  # between two looks at whether the socket is still there
MOST_LINE: Final = 4 << 20  # bytes of an order


def _checked(path: Path) -> str:
    with suppress(OSError):  # without a folder there is no socket either
        folder = os.lstat(path.parent)
        is_ours = stat.S_ISDIR(folder.st_mode) and folder.st_uid == os.geteuid()
        if not is_ours or folder.st_mode & 0o077:
            found = f"mode {folder.st_mode & 0o777:o}" if is_ours else "a link, or another user's folder"
            raise mistake(str(path.parent), found, "a folder of yours, mode 700: set XDG_RUNTIME_DIR")
    if len(os.fsencode(path)) > MOST_NAME:
        raise mistake(str(path), f"a name of {len(os.fsencode(path))} bytes", f"{MOST_NAME} at most")
    return str(path)


def is_trusted(peer: socket.socket) -> bool:
    """Return whether we or root are at the other end; where the system does not tell, the folder is all."""
    asked = getattr(socket, "SO_PEERCRED", None)
    if asked is None:
        return True
    _, user, _ = CREDENTIALS.unpack(peer.getsockopt(socket.SOL_SOCKET, asked, CREDENTIALS.size))
    return user in (0, os.geteuid())


def connected(path: Path, expected: str) -> int:
    """Return the descriptor of a connection to the tap that listens there; raise UserError without one."""
    name, made = _checked(path), socket.socket(socket.AF_UNIX)
    made.settimeout(TRY_S)
    found = "no tap"
    try:
        made.connect(name)
        found = "a tap of another user"
        if not is_trusted(made):
            raise PermissionError
        found = "a tap that tells nothing"  # the system connects us to a process that hangs, too
        if not made.recv(1, socket.MSG_PEEK):
            raise ConnectionResetError
        made.setblocking(True)
    except OSError:
        made.close()
        raise mistake(str(path), found, expected) from None
    return made.detach()


def listening(path: Path) -> socket.socket:
    """Listen there, in place of a program that is dead; raise UserError where one lives, or nothing goes."""
    made = socket.socket(socket.AF_UNIX)
    try:
        with socket.socket(socket.AF_UNIX) as rival, suppress(FileNotFoundError, ConnectionRefusedError):
            rival.settimeout(TRY_S)
            rival.connect(_checked(path))
            raise mistake(str(path), "a tap that listens there already", "one tap of a project")
        with suppress(FileNotFoundError):
            if not stat.S_ISSOCK(os.lstat(path).st_mode):
                raise mistake(str(path), "a file", "nothing, or the socket of a tap")
            os.unlink(path)
        before = os.umask(0o177)
        try:
            made.bind(str(path))
        finally:
            os.umask(before)
        made.listen(MOST_OBSERVERS)
    except OSError as failed:
        made.close()
        raise mistake(str(path), reason_of(failed), "a place for a socket") from None
    except BaseException:
        made.close()
        raise
    return made


class Capture(Protocol):
    """What an observer reads: a head, and blocks of events."""

    def head(self) -> bytes: ...

    def blocks(self, events: Iterable[TapEvent]) -> bytes: ...


class ObserverServer:
    """Serves observers, each with a `capture` of its own; the tap hands over ways of events on `asks`."""

    def __init__(
        self,
        path: Path,
        asks: int,
        may_order: bool,
        capture: Callable[[], Capture],
        say: Callable[[str], None],
    ) -> None:
        """Listen; raise UserError where that cannot be."""
        self._path, self._asks, self._may_order = path, asks, may_order
        self._capture, self._say = capture, say
        self._door = listening(path)
        self._inode = os.stat(path).st_ino
        self._served: list[threading.Thread] = []

    def run_until(self, end: int) -> None:
        """Serve until the end of a descriptor, or of the socket's file; let observers read what is left."""
        threading.Thread(target=self._accept, daemon=True).start()
        while self._is_there() and not select.select([end], [], [], LOOK_S)[0]:
            pass
        if self._is_there():  # otherwise it is another one's
            os.unlink(self._path)
        until = time.monotonic() + LAST_S
        for each in tuple(self._served):
            each.join(max(0.0, until - time.monotonic()))

    def _is_there(self) -> bool:
        try:
            return os.stat(self._path).st_ino == self._inode
        except OSError:
            return False

    def _accept(self) -> None:
        while True:
            observer, _ = self._door.accept()
            self._served = [each for each in self._served if each.is_alive()]
            if len(self._served) >= MOST_OBSERVERS or not is_trusted(observer):
                observer.close()
                continue
            way = ask_for_way(self._asks)
            self._served.append(threading.Thread(target=self._serve, args=(observer, way), daemon=True))
            self._served[-1].start()

    def _serve(self, observer: socket.socket, way: int) -> None:
        hears = threading.Thread(target=self._hear, args=(observer, way), daemon=True)
        hears.start()
        capture = self._capture()
        with suppress(OSError):
            observer.sendall(capture.head())
            for events in events_of(lambda most: os.read(way, most)):
                observer.sendall(capture.blocks(events))
        with suppress(OSError):
            observer.shutdown(socket.SHUT_RDWR)  # this ends `_hear`, too
        hears.join()
        observer.close()
        os.close(way)

    def _hear(self, observer: socket.socket, way: int) -> None:
        """Hand on whole lines of orders; at the end of the observer end its way."""
        is_refused, size = False, 0  # bytes since the last end of a line
        with socket.socket(fileno=os.dup(way)) as tap:
            with suppress(OSError):
                while (said := observer.recv(READ)) and size < MOST_LINE:
                    size = len(said) - 1 - said.rfind(b"\n") if b"\n" in said else size + len(said)
                    if self._may_order:
                        tap.sendall(said)
                    elif not is_refused:
                        is_refused = True
                        self._say("an observer gives orders: it needs `trcvtui tap --allow-orders`")
            with suppress(OSError):
                tap.shutdown(socket.SHUT_RDWR)  # also where it died with bytes unread
