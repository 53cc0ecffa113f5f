"""The receive job: what TRCV does between EN_R and DONE.

Rule 1: LEN, ADHOC and the size of DATA are latched when a job starts; a job reads at most its own length.
Rule 2: DATA changes only at DONE; until then the bytes are the job's.
Rule 3: at least one scan of "receiving" stands before each DONE (design 6, row 5).
"""

from __future__ import annotations

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.connection_part import cause_of
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment, JobEnded, JobStarted
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.answers import WouldBlock
from trcvtui.net.connection import Connection, ConnectionLoss

# (some bytes are there, the job is complete) -> what the block is doing
_RECEIVING = {
    (False, False): "nothing received yet",
    (True, False): "bytes are missing",
    (True, True): "the frame is complete and shows in the next scan",
}


class ReceiveJob:
    """One instance's receive jobs, one after the other."""

    def __init__(self, env: Environment, connection: Connection, instance: str) -> None:
        self.number = 0
        self.running = False
        self.have = 0
        self.need = 0
        self.adhoc = False
        self.last_receive: int | None = None
        self._env = env
        self._connection = connection
        self._instance = instance
        self._owner = object()
        self._buffer = bytearray()
        self._view = memoryview(self._buffer)
        self._first_offset = 0
        self._waiting: Outcome | None = None

    # -- may a job start? ---------------------------------------------------------------------------

    def refuse(self, data: DataArea | None, length: int) -> Outcome | None:
        """Return why no job can start, in the manual's order: 80A4, 80A5, 80C3, then a buffer."""
        if data is None or data.size == 0:
            return Outcome(
                Condition.DATA_EMPTY, Cause(Why.PARAMETER, "DATA has no byte", pin="DATA", value=0)
            )
        if length > data.size or (length or data.size) > self._env.rules.max_len:
            return self._wrong_length(data, length)
        if self._connection.receiver not in (None, self._owner):
            cause = Cause(Why.OWNER, "another instance receives on this CONNECT")
            return Outcome(Condition.CONNECT_IN_USE, cause)
        self._connection.receiver = self._owner
        fault = self._env.resources.buffers.acquire(self._connection.config.name)
        return Outcome(Condition.NO_BUFFER, cause_of(fault)) if fault is not None else None

    def _wrong_length(self, data: DataArea, length: int) -> Outcome:
        limit = min(data.size, self._env.rules.max_len)
        name = "LEN is larger than DATA" if length > data.size else "longer than one job can be"
        cause = Cause(Why.PARAMETER, name, pin="LEN", value=length, have=length or data.size, need=limit)
        return Outcome(Condition.LENGTH_WRONG, cause)

    # -- one job --------------------------------------------------------------------------------------

    def start(self, data: DataArea, length: int, adhoc: bool) -> None:
        """Begin a job of `length` bytes (0: the size of DATA); its buffer is taken already."""
        self.number += 1
        self.running, self.adhoc = True, adhoc
        self.need, self.have = length or data.size, 0
        self._waiting = None
        if len(self._buffer) != self.need:
            self._buffer = bytearray(self.need)
        self._view = memoryview(self._buffer)
        self._first_offset = self._connection.bytes_received
        self._env.write(
            JobStarted(
                self._instance,
                self.number,
                self._connection.config.name,
                self._connection.incarnation,
                self._first_offset,
                self.need,
                adhoc,
            )
        )

    def collect(self) -> ConnectionLoss | None:
        """Read what is there into the job's own buffer; return the loss that stands behind the last byte."""
        got = self._connection.receive(self._view[self.have :])
        if isinstance(got, ConnectionLoss):
            return got
        if not isinstance(got, WouldBlock):
            self.have += got
            self.last_receive = self._env.now
            self._waiting = None
        return None

    def check_loss(self) -> ConnectionLoss | None:
        """Look for a loss while no job runs."""
        return self._connection.check_loss(self._owner)

    @property
    def complete(self) -> bool:
        """Return whether the job has what it wants: every byte (static), any byte (ad-hoc)."""
        return self.have == self.need or (self.adhoc and self.have > 0)

    def receiving(self) -> Outcome:
        """Return the outcome of a job that waits; the same object while nothing changes."""
        if self._waiting is None:
            name = _RECEIVING[self.have > 0, self.complete]
            cause = Cause(Why.BYTES, name, have=self.have, need=self.need)
            self._waiting = Outcome(Condition.RECEIVING, cause)
        return self._waiting

    def deliver(self, data: DataArea) -> Outcome:
        """Write the job's bytes to DATA and end it."""
        size = self.have
        self._view.release()
        if size == data.size == len(self._buffer):
            self._buffer = data.swap(self._buffer)
        else:
            data.write(0, memoryview(self._buffer)[:size].toreadonly())
        self._end(done=True, reason="complete")
        cause = Cause(Why.BYTES, "the frame is complete", have=size, need=self.need)
        return Outcome(Condition.RECEIVED, cause, rcvd_len=size)

    def abandon(self, reason: str) -> None:
        """End a running job without DONE; what it had collected is dropped and noted."""
        if self.running:
            self._connection.drop(self._first_offset, self.have, reason)
            self._end(done=False, reason=reason)

    def let_go(self) -> None:
        """Give the CONNECT's receive side back (EN_R fell)."""
        if self._connection.receiver is self._owner:
            self._connection.receiver = None

    def partial(self) -> bytes:
        """Return a copy of the bytes collected so far."""
        return bytes(self._buffer[: self.have]) if self.running else b""

    def _end(self, done: bool, reason: str) -> None:
        self._env.resources.buffers.release()
        self.running = False
        incarnation, name = self._connection.incarnation, self._connection.config.name
        self._env.write(
            JobEnded(
                self._instance, self.number, name, incarnation, self._first_offset, self.have, done, reason
            )
        )
        self.have = 0
