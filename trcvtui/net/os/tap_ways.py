"""Ways to what a tap shows: its children ask for one each time they begin, and get it."""

from __future__ import annotations

import os
import socket
import struct
from contextlib import suppress
from typing import Final

ASK_CHANNEL, ASK_COUNT = b"+", b"?"  # for a way; how many connections are open
SCREEN, RECORDER, ORDERS = b"s", b"r", b"o"  # whose way it is, said to the process that serves observers
MOST_ANSWER_BYTES: Final = 64  # bytes
BLOCK: Final = struct.Struct("<4xI")  # with how many bytes a block of pcapng says it has


class ChannelServer:
    """The tap's end. `fd` is readable when a way is asked for, and when nobody is there who could ask."""

    def __init__(self) -> None:
        self._asks, self.theirs = socket.socketpair()
        self.fd = self._asks.fileno()

    def read_question(self) -> bytes:
        """Wait for the other end; return what it asks, b"" when it has ended."""
        with suppress(OSError):
            return self._asks.recv(1)
        return b""

    def answer_count(self, text: str) -> None:
        """Tell how many connections are open."""
        with suppress(OSError):
            self._asks.sendall(f"{text}\n".encode())

    def hand_over_channel(self) -> socket.socket | None:
        """Hand a way over; return its other end. None, and no way for the other: no descriptor is left."""
        try:
            ours, theirs = socket.socketpair()
        except OSError:
            with suppress(OSError):
                self._asks.sendall(ASK_CHANNEL)
            return None
        with theirs, suppress(OSError):
            socket.send_fds(self._asks, [ASK_CHANNEL], [theirs.fileno()])
        return ours

    def close(self) -> None:
        self._asks.close()


class ObserverServerPipes:
    """The tap's ends of what the process that serves observers has: events for orders, and ways."""

    def __init__(self) -> None:
        self.events, self._theirs = socket.socketpair()
        self._ways, self._their_ways = socket.socketpair()
        self.fds = self._theirs.fileno(), self._their_ways.fileno()  # the other ends

    def close_far_ends(self) -> None:
        self._theirs.close()
        self._their_ways.close()

    def hand_over_observer(self, kind: bytes, way: socket.socket) -> None:
        """Let an observer of that kind be served."""
        with way, suppress(OSError):
            socket.send_fds(self._ways, [kind], [way.fileno()])

    def close(self) -> None:
        self._ways.close()


def _ask_tap(fd: int, what: bytes) -> tuple[bytes, list[int]]:
    """Return what the tap at `fd` answers, and the descriptor that it hands over."""
    with suppress(OSError), socket.socket(fileno=fd) as asks:
        try:
            asks.sendall(what)
            return socket.recv_fds(asks, MOST_ANSWER_BYTES, 1)[:2]
        finally:
            asks.detach()
    return b"", []


def ask_open_count(fd: int) -> str:
    """Return how many connections of a tap are open, "" for none."""
    return _ask_tap(fd, ASK_COUNT)[0].decode().strip()


class TapChannel:
    """The way of a tap to one of its children: whole blocks of pcapng come on `fd`, orders go back.

    When the process that serves it has ended there is another one, which begins with a new section.
    """

    def __init__(self, asks: int) -> None:
        self._asks, self._part = asks, b""
        self.fd = os.open(os.devnull, os.O_RDONLY)  # at its end: then a way is asked for

    def feed(self, data: bytes) -> bytes | None:
        """Return the whole blocks that were read, None for none yet, b"" where there is no tap any more."""
        if not data:
            self._part = b""
            ways = _ask_tap(self._asks, ASK_CHANNEL)[1]
            for way in ways:
                os.dup2(way, self.fd)
                os.close(way)
            return None if ways else b""
        data, at = self._part + data, 0
        while at + BLOCK.size <= len(data) and (end := at + BLOCK.unpack_from(data, at)[0]) <= len(data):
            at = end
        self._part = data[at:]
        return data[:at] or None

    def send(self, line: bytes) -> None:
        with suppress(OSError):  # the tap has ended: soon it is said
            os.write(self.fd, line)
