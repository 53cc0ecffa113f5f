"""Ways for the events of a tap: its screen asks for one each time its engine starts, and gets it."""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import Final

from trcvtui.net.os.forwarder import Forwarder

ASKED: Final = b"+"


class EventPipes:
    """The tap's end. `fd` is readable when a way is asked for, and when nobody is there who could ask."""

    def __init__(self) -> None:
        self._asks, self.theirs = Forwarder.pair()
        self.fd = self._asks.fileno()

    def is_asked(self) -> bool:
        """Wait for the other end; return whether it asks, and has not ended."""
        try:
            return self._asks.recv(1) == ASKED
        except OSError:
            return False

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


def ask_for_way(fd: int) -> int:
    """Return the descriptor on which a tap tells its events, handed over `fd`.

    It is at its end already where there is no tap any more.
    """
    with suppress(OSError), socket.socket(fileno=fd) as asks:
        try:
            asks.sendall(ASKED)
            for way in socket.recv_fds(asks, 1, 1)[1]:
                return way
        finally:
            asks.detach()
    ours, theirs = socket.socketpair()
    theirs.close()
    return ours.detach()
