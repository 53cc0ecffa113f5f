"""Ways for the events of a tap: its screen asks for one each time its engine starts, and gets it."""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import Final

from trcvtui.net.os.forwarder import Forwarder

ASKED, COUNTS = b"+", b"?"  # for a way; how many connections are open
MOST_ANSWER: Final = 64  # bytes


class EventPipes:
    """The tap's end. `fd` is readable when a way is asked for, and when nobody is there who could ask."""

    def __init__(self) -> None:
        self._asks, self.theirs = Forwarder.pair()
        self.fd = self._asks.fileno()

    def take_question(self) -> bytes:
        """Wait for the other end; return what it asks, b"" when it has ended."""
        with suppress(OSError):
            return self._asks.recv(1)
        return b""

    def answer(self, text: str) -> None:
        """Tell how many connections are open."""
        with suppress(OSError):
            self._asks.sendall(f"{text}\n".encode())

    def hand_over(self) -> socket.socket | None:
        """Hand a way over; return our end of it. None, and no way for the other: no descriptor is left."""
        try:
            ours, theirs = Forwarder.pair()
        except OSError:
            with suppress(OSError):
                self._asks.sendall(ASKED)
            return None
        with theirs, suppress(OSError):
            socket.send_fds(self._asks, [ASKED], [theirs.fileno()])
        return ours


def _ask(fd: int, what: bytes) -> tuple[bytes, list[int]]:
    """Return what the tap at `fd` answers, and the descriptor that it hands over."""
    with suppress(OSError), socket.socket(fileno=fd) as asks:
        try:
            asks.sendall(what)
            return socket.recv_fds(asks, MOST_ANSWER, 1)[:2]
        finally:
            asks.detach()
    return b"", []


def ask_what_is_open(fd: int) -> str:
    """Return how many connections of a tap are open, "" for none."""
    return _ask(fd, COUNTS)[0].decode().strip()


def ask_for_way(fd: int) -> int:
    """Return the descriptor on which a tap tells its events, handed over `fd`.

    It is at its end already where there is no tap any more.
    """
    for way in _ask(fd, ASKED)[1]:
        return way
    ours, theirs = socket.socketpair()
    theirs.close()
    return ours.detach()
