"""From a TRCV_C into a ComBuffer: what the program does behind each call, chunk by chunk.

Rule: what it knows of its connection outlives the TRCV_C: one that is created anew goes on with it.
Rule: a ComBuffer that has no room for a whole DATA holds the TRCV_C: it is called with EN_R = 0, so that the
bytes stay with the network, which slows the sender (row 15). Never in a job that has bytes: they would drop.
"""

from __future__ import annotations

from trcvtui.blocks.block import Job
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.serial.com_buffer import ComBuffer
from trcvtui.net.connection.connection import Connection, State


class StreamFeed:
    """One TRCV_C in front of one ComBuffer. Without `holds` bytes that have no room are dropped.

    With `follows_en_r` a part of a frame ends when EN_R falls.
    """

    def __init__(
        self,
        connection: Connection,
        data: DataArea | None,
        buffer: ComBuffer,
        *,
        holds: bool,
        follows_en_r: bool,
    ) -> None:
        self.is_held = False
        self._follows_en_r = follows_en_r
        self._was_asked = False
        self._connection = connection
        self._data = data
        self._buffer = buffer
        self._holds = holds
        self._incarnation: int | None = None  # of the connection whose bytes were the last

    @property
    def keeps_awake(self) -> bool:
        """Return whether the next call may differ though the block says nothing."""
        return self.is_held

    def before(self, job: Job) -> bool:
        """Decide whether the next call is held; return whether its inputs change by it."""
        return self.hold(job.have)

    def overrides(self) -> dict[str, int]:
        """Return the inputs that the program writes."""
        return {"en_r": False} if self.is_held else {}

    def after(self, outcome: Outcome, asked: bool) -> None:
        """Take what a call has brought."""
        self.called(outcome.done, outcome.rcvd_len, asked)

    def hold(self, job_has: int) -> bool:
        """Decide, before a call, whether it is held; return whether that is new."""
        before, room = self.is_held, self._data.size if self._data is not None else 0
        is_full = self._holds and self._buffer.count > 0 and self._buffer.free < room
        self.is_held = is_full and (before or not job_has)
        if self.is_held != before:
            self._buffer.hold(self.is_held)
        return self.is_held != before

    def called(self, done: bool, size: int, asked: bool) -> None:
        """Take the bytes of a DONE; see whether the connection that they came over is still the same."""
        connection = self._connection
        if self._follows_en_r and self._was_asked and not asked:
            self._buffer.end("EN_R fell")
        self._was_asked = asked
        if done and size and self._data is not None:
            if self._incarnation not in (None, connection.incarnation):
                self._close()
            if self._incarnation is None:
                self._buffer.empty("of an earlier connection")
            self._incarnation = connection.incarnation
            self._buffer.put(bytes(memoryview(self._data.content)[:size]))
        self.watch()

    def follow(self, earlier: StreamFeed) -> None:
        """Go on where a deleted TRCV_C of the same name has left the ComBuffer."""
        if earlier._connection is self._connection:
            self._incarnation, self._was_asked = earlier._incarnation, earlier._was_asked
        else:
            earlier.leave()

    def left(self) -> None:
        """The TRCV_C is deleted: nobody holds the line any more."""
        if self.is_held:
            self.is_held = False
            self._buffer.hold(False)

    def watch(self) -> None:
        """See whether the connection that the last bytes came over is still the same."""
        if self._incarnation is not None and not self._is_same(self._connection):
            self._close()

    def leave(self) -> None:
        """Turn to another connection: what came over this one has ended."""
        if self._incarnation is not None:
            self._close()

    def stop(self) -> None:
        """PLC STOP: the connection is closed, nobody has read the rest."""
        self._incarnation, self.is_held = None, False

    def _is_same(self, connection: Connection) -> bool:
        return connection.state is State.CONNECTED and connection.incarnation == self._incarnation

    def _close(self) -> None:
        self._incarnation = None
        self._buffer.end("connection closed")
