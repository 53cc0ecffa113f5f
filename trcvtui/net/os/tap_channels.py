"""Channels for the events of a tap: sockets that the tap gives to its child processes when they ask."""

from __future__ import annotations

import os
import socket
import struct
from contextlib import suppress
from typing import Final

ASK_CHANNEL, ASK_COUNT = b"+", b"?"  # for a channel; for the number of open connections
SCREEN, RECORDER, ORDERS = b"s", b"r", b"o"  # the kind of a channel, sent with its socket to the server
MOST_ANSWER_BYTES: Final = 64  # bytes
BLOCK: Final = struct.Struct("<4xI")  # the head of a pcapng block: its type, its whole length in bytes


class ChannelServer:
    """The tap's end. `fd` is readable when a child asks, and when no child process is left."""

    def __init__(self) -> None:
        self._asks, self.theirs = socket.socketpair()
        self.fd = self._asks.fileno()

    def read_question(self) -> bytes:
        """Wait for a question of the child processes; return the question, or b"" when all have ended."""
        with suppress(OSError):
            return self._asks.recv(1)
        return b""

    def answer_count(self, text: str) -> None:
        with suppress(OSError):
            self._asks.sendall(f"{text}\n".encode())

    def hand_over_channel(self) -> socket.socket | None:
        """Give a child one end of a new channel; return the tap's end, or None if no descriptor is left."""
        try:
            ours, theirs = socket.socketpair()
        except OSError:
            with suppress(OSError):
                self._asks.sendall(ASK_CHANNEL)  # an answer without a descriptor: the child must not wait
            return None
        with theirs, suppress(OSError):
            socket.send_fds(self._asks, [ASK_CHANNEL], [theirs.fileno()])
        return ours

    def close(self) -> None:
        self._asks.close()


class ObserverServerPipes:
    """The tap's ends of two sockets to the observer server: one for events and orders, one for channels."""

    def __init__(self) -> None:
        self.events, self._theirs = socket.socketpair()
        self._channels, self._their_channels = socket.socketpair()
        self.fds = self._theirs.fileno(), self._their_channels.fileno()  # the other ends

    def close_far_ends(self) -> None:
        self._theirs.close()
        self._their_channels.close()

    def hand_over_observer(self, kind: bytes, channel: socket.socket) -> None:
        with channel, suppress(OSError):
            socket.send_fds(self._channels, [kind], [channel.fileno()])

    def close(self) -> None:
        self._channels.close()


def _ask_tap(fd: int, what: bytes) -> tuple[bytes, list[int]]:
    """Return the answer of the tap at `fd`, and the descriptor that it hands over."""
    with suppress(OSError), socket.socket(fileno=fd) as asks:
        try:
            asks.sendall(what)
            return socket.recv_fds(asks, MOST_ANSWER_BYTES, 1)[:2]
        finally:
            asks.detach()  # `fd` is the caller's
    return b"", []


def ask_open_count(fd: int) -> str:
    """Return how many connections of a tap are open, "" for none."""
    return _ask_tap(fd, ASK_COUNT)[0].decode().strip()


class TapChannel:
    """A child process's end of a channel. Whole blocks of pcapng come on `fd`, and orders go back.

    If the process that serves the channel ends, another process takes over and begins a new section.
    """

    def __init__(self, asks: int) -> None:
        self._asks, self._part = asks, b""
        self.fd = os.open(os.devnull, os.O_RDONLY)  # it is at its end, and `feed` then asks for a channel

    def feed(self, data: bytes) -> bytes | None:
        """Return the blocks that `data` completes, None if there is none, or b"" if the tap has ended."""
        if not data:
            self._part = b""  # half a block of a server that has ended
            channels = _ask_tap(self._asks, ASK_CHANNEL)[1]
            for channel in channels:
                os.dup2(channel, self.fd)  # the reader's poll set keeps its descriptor
                os.close(channel)
            return None if channels else b""
        data, at = self._part + data, 0
        while at + BLOCK.size <= len(data) and (end := at + BLOCK.unpack_from(data, at)[0]) <= len(data):
            at = end
        self._part = data[at:]
        return data[:at] or None

    def send(self, line: bytes) -> None:
        with suppress(OSError):  # the tap has ended: the next read reports it
            os.write(self.fd, line)
