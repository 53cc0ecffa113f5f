"""The bytes of one peer: what comes in is read, what is due goes out and is told to the journal."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Final

from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import WOULD_BLOCK, Fault, WouldBlock
from trcvtui.plc.ledger import Event, PeerSent
from trcvtui.rig.commands.inbox import Inbox
from trcvtui.rig.commands.words import PeerSend
from trcvtui.rig.peers.outbox import Outbox
from trcvtui.rig.peers.replies import Replies

READ_BYTES: Final = 65536
MOST_READS: Final = 64  # a flood costs bounded work between two scans


class Fin(Enum):
    """The partner's FIN."""

    FIN = "FIN"


FIN: Final = Fin.FIN


class PeerTraffic:
    """What one peer sends and receives, over all of its connections; counters in bytes."""

    def __init__(self, name: str, kernel: Kernel, journal: Callable[[Event], None]) -> None:
        self.inbox = Inbox()
        self.replies = Replies()
        self.messages = self.bytes_sent = 0
        self._name = name
        self._kernel = kernel
        self._journal = journal
        self._outbox = Outbox()
        self._buffer = memoryview(bytearray(READ_BYTES))
        self._ends = ("", "")
        self._offset = 0  # in the sent stream of this connection

    def begin(self, local: str, remote: str) -> None:
        """Begin with a new connection between these ends."""
        self._ends, self._offset = (local, remote), 0
        self.inbox.begin()
        self.replies.begin()

    def read(self, handle: Handle, now: int, may_answer: bool) -> Fault | Fin | None:
        """Read what has arrived; return how the connection has ended, None while it stands."""
        for _ in range(MOST_READS):
            got = self._kernel.recv(handle, self._buffer)
            if isinstance(got, WouldBlock):
                return None
            if isinstance(got, Fault):
                return got
            assert isinstance(got, int)
            if got == 0:
                return FIN
            self.inbox.take(self._buffer[:got])
            if self.replies:
                self._answer(bytes(self._buffer[:got]), now, self._outbox.room if may_answer else 0)
        return None

    def _answer(self, arrived: bytes, now: int, room: int) -> None:
        for send, number in self.replies.take(arrived, now, room):
            self._outbox.put(send, now, number)

    def put(self, send: PeerSend, now: int, number: int = 0, pause_ns: int = 0) -> None:
        """Take one send command, behind those that are not finished."""
        self._outbox.put(send, now, number, pause_ns)

    def send_due(self, handle: Handle, now: int) -> Fault | None:
        """Send what is due as far as the stack takes it; return the Fault that ends the connection."""
        while (chunk := self._outbox.due(now)) is not None:
            got = self._kernel.send(handle, chunk)
            if got is WOULD_BLOCK:
                return None
            if isinstance(got, Fault):
                return got
            assert isinstance(got, int)
            self._sent(got, now)
        return None

    def _sent(self, count: int, now: int) -> None:
        size = self._outbox.message_begins
        if size:
            self.messages += 1
            self._journal(PeerSent(self._name, self.messages, *self._ends, self._offset, size))
        self._offset += count
        self.bytes_sent += count
        self._outbox.taken(count, now)

    @property
    def unsent(self) -> int:
        """Return how many bytes are still to come, those of all repetitions included."""
        return self._outbox.unsent

    def drop_unsent(self) -> int:
        """Forget what is still to come; return how many bytes that were."""
        return self._outbox.clear()
