"""What a peer still has to send: chunks, each due at its time, and what the stack did not take yet."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from trcvtui.net.answers import Fault, WouldBlock
from trcvtui.net.kernel import Handle, Kernel
from trcvtui.rig.bench_words import PeerSend

CHUNKS_A_STEP: Final = 4096  # bounded work between two scans


def chunks_of(payload: bytes, split: tuple[int, ...]) -> tuple[bytes, ...]:
    """Return the payload cut into chunks of these sizes and the rest."""
    cut, begin = [], 0
    for size in split:
        cut.append(payload[begin : begin + size])
        begin += size
    cut.append(payload[begin:])
    return tuple(chunk for chunk in cut if chunk)


@dataclass(slots=True)
class _Message:
    """One message on its way: what is left of it, and when the next chunk is due (ns)."""

    number: int
    chunks: deque[memoryview]
    gap_ns: int
    due: int


class Sending:
    """The messages of one connection, in the order in which they were given."""

    def __init__(self) -> None:
        self.begun = 0  # how many messages were begun on this connection
        self._messages: deque[_Message] = deque()
        self._repeating: deque[tuple[PeerSend, int, int]] = deque()  # command, times left, due

    def add(self, command: PeerSend, now: int) -> None:
        """Take a message; `repeat` more of it follow every `every_ns` (0: at once)."""
        if command.every_ns == 0:
            for _ in range(command.repeat):
                self._queue(command, now)
        else:
            self._repeating.append((command, command.repeat, now))
            self.begin_due(now)

    def begin_due(self, now: int) -> None:
        """Queue the repetitions that are due."""
        for _ in range(len(self._repeating)):
            command, left, due = self._repeating.popleft()
            while left and due <= now:
                self._queue(command, now)
                left, due = left - 1, due + command.every_ns
            if left:
                self._repeating.append((command, left, due))

    def _queue(self, command: PeerSend, now: int) -> None:
        chunks = deque(memoryview(chunk) for chunk in chunks_of(command.payload, command.split))
        if chunks:
            self.begun += 1
            self._messages.append(_Message(self.begun, chunks, command.gap_ns, now))

    def push(self, kernel: Kernel, handle: Handle, now: int) -> tuple[list[tuple[int, int]], Fault | None]:
        """Give the stack what is due and what it takes.

        Return (message number, bytes taken) for each chunk, and the fault that ended it.
        """
        taken: list[tuple[int, int]] = []
        for _ in range(CHUNKS_A_STEP):
            if not self._messages or self._messages[0].due > now:
                break
            message = self._messages[0]
            got = kernel.send(handle, message.chunks[0])
            if isinstance(got, Fault):
                return taken, got
            if isinstance(got, WouldBlock):
                break
            taken.append((message.number, got))
            self._advance(message, got, now)
        return taken, None

    def _advance(self, message: _Message, taken: int, now: int) -> None:
        chunk = message.chunks.popleft()
        if taken < len(chunk):
            message.chunks.appendleft(chunk[taken:])
            return
        message.due = now + message.gap_ns
        if not message.chunks:
            self._messages.popleft()

    def clear(self) -> None:
        """Forget everything: the connection is gone."""
        self._messages.clear()
        self._repeating.clear()
        self.begun = 0

    def is_due(self, now: int) -> bool:
        """Return whether something could be given to the stack now."""
        return bool(self._messages) and self._messages[0].due <= now

    @property
    def pending(self) -> int:
        """Return how many bytes wait, repetitions that are not due left out."""
        return sum(len(chunk) for message in self._messages for chunk in message.chunks)
