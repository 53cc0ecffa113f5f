"""What a peer still has to send, and when: messages cut into chunks, with pauses and repetitions.

Rule: times are planned from the first chunk on, so that pauses do not add up to a drift. Several sends wait
for each other; their messages never mix.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from trcvtui.rig.commands.counters_and_checksums import filled
from trcvtui.rig.commands.payload import chunks
from trcvtui.rig.commands.words import PeerSend

MOST_WAITING: Final = 256  # answers of a peer whose partner asks and does not read


class _Sending:
    """One `send` in progress: which message of its repetitions, which chunk, what is left of it."""

    def __init__(self, send: PeerSend, now: int, number: int, pause_ns: int) -> None:
        self.send = send
        self._pause_ns = pause_ns
        self._number = number  # of the running message, for what is filled in
        self._gaps = send.gaps_ns or (send.gap_ns,)
        self.left = send.repeat  # messages to come, the running one included
        self.due = self.began = now + pause_ns
        self._pieces = self._filled()
        self._piece = 0
        self.rest = self._pieces[0]
        self.is_fresh = True  # nothing of the running message has gone yet

    def comes_next(self, now: int) -> None:
        """Plan from now on: what went before it is over."""
        self.due = self.began = max(self.due, now + self._pause_ns)

    def taken(self, count: int, now: int) -> None:
        """Count bytes that the stack took, and plan what comes next."""
        self.is_fresh = False
        self.rest = self.rest[count:]
        if len(self.rest):
            self.due = now  # a full stack broke the plan: go on from here
            return
        self._piece += 1
        if self._piece < len(self._pieces):
            self.due += self._gaps[min(self._piece, len(self._gaps)) - 1]
            self.rest = self._pieces[self._piece]
        else:
            self._next_message()

    def _next_message(self) -> None:
        self.left -= 1
        pause_over = self.due + self.send.gap_ns
        self.due = max(self.began + self.send.every_ns, self.due) if self.send.every_ns else pause_over
        self.began = self.due
        if self.send.fills and self.left:
            self._number += 1
            self._pieces = self._filled()
        self._piece, self.rest, self.is_fresh = 0, self._pieces[0], True

    def _filled(self) -> tuple[memoryview, ...]:
        return chunks(filled(self.send.payload, self.send.fills, self._number), self.send.split)

    @property
    def unsent(self) -> int:
        """Return how many bytes are to come, those of all repetitions included."""
        running = len(self.rest) + sum(map(len, self._pieces[self._piece + 1 :]))
        return running + (self.left - 1) * len(self.send.payload)


class Outbox:
    """All that waits to be sent, in the order in which it was given."""

    def __init__(self) -> None:
        self._sendings: deque[_Sending] = deque()

    def put(self, send: PeerSend, now: int, number: int = 0, pause_ns: int = 0) -> None:
        """Take one send command; its first chunk is due now, behind what waits already.

        `number` is that of its first message, for what is filled in; `pause_ns` comes before it.
        """
        self._sendings.append(_Sending(send, now, number, pause_ns))

    @property
    def room(self) -> int:
        """Return how many more answers may wait."""
        return max(0, MOST_WAITING - len(self._sendings))

    def due(self, now: int) -> memoryview | None:
        """Return what is to be sent now, None while nothing is due."""
        if not self._sendings or self._sendings[0].due > now:
            return None
        return self._sendings[0].rest

    @property
    def message_begins(self) -> int:
        """Return the size of the message that the due bytes begin, 0 when they go on with one."""
        first = self._sendings[0]
        return len(first.send.payload) if first.is_fresh else 0

    def taken(self, count: int, now: int) -> None:
        """Count bytes of the due chunk as sent."""
        first = self._sendings[0]
        first.taken(count, now)
        if not first.left:
            self._sendings.popleft()
            if self._sendings:
                self._sendings[0].comes_next(now)

    def clear(self) -> int:
        """Drop everything; return how many bytes will not be sent."""
        unsent = self.unsent
        self._sendings.clear()
        return unsent

    @property
    def unsent(self) -> int:
        """Return how many bytes wait, those of all repetitions included."""
        return sum(sending.unsent for sending in self._sendings)
