"""From a ComBuffer into a TSEND_C: what the program does before each call, one DATA full of bytes at a time.

Rule: bytes wait as long as there is no connection; with the end of one those that it should have carried go.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import Job
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.serial.com_buffer import ComBuffer
from trcvtui.net.connection.connection import Connection, State

READY: Final = (Condition.CONNECTED, Condition.SENT)  # what the last call showed, where REQ may rise


class StreamDrain:
    """One ComBuffer in front of one TSEND_C; `per_call`: the most bytes of one REQ, 0: what DATA holds."""

    keeps_awake = True  # bytes come without a word

    def __init__(
        self, connection: Connection, data: DataArea | None, buffer: ComBuffer, per_call: int
    ) -> None:
        self._connection = connection
        self._data = data
        self._buffer = buffer
        self._per_call = per_call
        self._incarnation: int | None = None  # of the connection that the bytes are for
        self._size = 0  # of what REQ sends in this call
        self._ready = False

    def before(self, job: Job) -> bool:
        """Put the next bytes into DATA where a call may send them; return whether the inputs change by it."""
        was_asked, self._size = bool(self._size), 0
        self.watch()
        if self._ready and self._data is not None and self._incarnation is not None and not job.running:
            room = min(self._data.size, self._per_call or self._data.size)
            payload = self._buffer.take(room)
            if payload:
                self._data.write(0, payload)
                self._size = len(payload)
        return was_asked or bool(self._size)

    def overrides(self) -> dict[str, int]:
        """Return the inputs that the program writes."""
        return {"req": True, "len": self._size} if self._size else {}

    def after(self, outcome: Outcome, asked: bool) -> None:
        """See whether the next call may send; a REQ of somebody else must have fallen before."""
        self._ready = outcome.condition in READY and not asked

    def follow(self, earlier: StreamDrain) -> None:
        """Go on where a deleted TSEND_C of the same name has left the ComBuffer."""
        if earlier._connection is self._connection:
            self._incarnation = earlier._incarnation
        else:
            earlier.leave()

    def left(self) -> None:
        """The TSEND_C is deleted; what waits may still go over its connection."""

    def leave(self) -> None:
        """Turn to another connection: what waited for this one goes with it."""
        if self._incarnation is not None:
            self._buffer.empty("connection closed")
            self._incarnation = None

    def stop(self) -> None:
        """PLC STOP: the connection is closed."""
        self._incarnation, self._size, self._ready = None, 0, False

    def watch(self) -> None:
        """Empty the ComBuffer when the connection that its bytes were for is gone."""
        connection = self._connection
        is_up = connection.state is State.CONNECTED
        if not is_up or connection.incarnation != self._incarnation:
            self.leave()
        if is_up:
            self._incarnation = connection.incarnation
