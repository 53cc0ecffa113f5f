"""The receive job: what TRCV does between EN_R and DONE.

Rule 1: LEN, ADHOC and the size of DATA are latched when a job starts; a job reads at most its own length.
Rule 2: DATA changes only at DONE; until then the bytes are the job's.
Rule 3: at least one scan of "receiving" stands before each DONE (design 6, row 5).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.connection_part import cause_of
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment, JobEnded, JobStarted
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.answers import WOULD_BLOCK
from trcvtui.net.connection import Connection, ConnectionLoss

OUTCOMES_KEPT: Final = 1024  # distinct (have, need) whose outcome is made only once

# (some bytes are there, the job is complete) -> what the block is doing
_RECEIVING: Final = {
    (False, False): "nothing received yet",
    (True, False): "bytes are missing",
    (True, True): "the frame is complete and shows in the next scan",
}


class ReceiveJob:
    """One instance's receive jobs, one after the other."""

    def __init__(self, env: Environment, connection: Connection, instance: str) -> None:
        self.number = 0
        self.running = False
        self.complete = False  # every byte is there (static), any byte is there (ad-hoc)
        self.have = 0
        self.need = 0
        self.adhoc = False
        self.last_receive: int | None = None
        self._env = env
        self._buffers = env.resources.buffers
        self._connection = connection
        self._connect = connection.config.name
        self._instance = instance
        self._owner = object()
        self._buffer = bytearray()
        self._view = memoryview(self._buffer)
        self._incarnation = 0  # of the connection that the running job receives on
        self._first_offset = 0

    # -- may a job start? ---------------------------------------------------------------------------

    def refuse(self, data: DataArea | None, length: int) -> Outcome | None:
        """Return why no job can start, in the manual's order: 80A4, 80A5, 80C3, then a buffer."""
        if data is None or data.size == 0:
            return Outcome(
                Condition.DATA_EMPTY, Cause(Why.PARAMETER, "DATA has no byte", pin="DATA", value=0)
            )
        if length > data.size or (length or data.size) > self._env.rules.max_len:
            return self._wrong_length(data, length)
        if self._connection.receiver is not self._owner:
            if self._connection.receiver is not None:
                cause = Cause(Why.OWNER, "another instance receives on this CONNECT")
                return Outcome(Condition.CONNECT_IN_USE, cause)
            self._connection.receiver = self._owner
        fault = self._buffers.acquire(self._connect)
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
        self.running, self.complete, self.adhoc = True, False, adhoc
        need = self.need = length or data.size
        if len(self._buffer) != need:
            self._buffer = bytearray(need)
        self._view = memoryview(self._buffer)
        incarnation = self._incarnation = self._connection.incarnation
        offset = self._first_offset = self._connection.bytes_received
        self._env.write(
            JobStarted(self._instance, self.number, self._connect, incarnation, offset, need, adhoc)
        )

    def collect(self) -> ConnectionLoss | None:
        """Read what is there into the job's own buffer; return the loss that stands behind the last byte."""
        have = self.have
        got = self._connection.receive(self._view[have:] if have else self._view)
        if isinstance(got, int):
            have = self.have = have + got
            self.complete = self.adhoc or have == self.need
            self.last_receive = self._env.now
            return None
        return None if got is WOULD_BLOCK else got

    def check_loss(self) -> ConnectionLoss | None:
        """Look for a loss while no job runs."""
        return self._connection.check_loss(self._owner)

    def receiving(self) -> Outcome:
        """Return the outcome of a job that waits; the same object while nothing changes."""
        return _receiving(self.have, self.need, self.complete)

    def deliver(self, data: DataArea) -> Outcome:
        """Write the job's bytes to DATA and end it."""
        size = self.have
        self._view.release()
        if size == data.size == len(self._buffer):
            self._buffer = data.swap(self._buffer)
        else:
            data.write(0, memoryview(self._buffer)[:size].toreadonly())
        self._end(done=True, reason="complete")
        return _received(size, self.need)

    def abandon(self, reason: str) -> None:
        """End a running job without DONE; what it had collected is dropped and noted."""
        if self.running:
            self._connection.drop(self._first_offset, self.have, reason, self._incarnation)
            self._end(done=False, reason=reason)

    def let_go(self) -> None:
        """Give the CONNECT's receive side back (EN_R fell)."""
        if self._connection.receiver is self._owner:
            self._connection.receiver = None

    def partial(self) -> bytes:
        """Return a copy of the bytes collected so far."""
        return bytes(self._buffer[: self.have]) if self.running else b""

    def _end(self, done: bool, reason: str) -> None:
        self._buffers.release()
        self.running = self.complete = False
        size, self.have = self.have, 0
        incarnation, offset = self._incarnation, self._first_offset
        self._env.write(
            JobEnded(self._instance, self.number, self._connect, incarnation, offset, size, done, reason)
        )


@lru_cache(OUTCOMES_KEPT)
def _receiving(have: int, need: int, complete: bool) -> Outcome:
    cause = Cause(Why.BYTES, _RECEIVING[have > 0, complete], have=have, need=need)
    return Outcome(Condition.RECEIVING, cause, lasts=not complete)


@lru_cache(OUTCOMES_KEPT)
def _received(size: int, need: int) -> Outcome:
    cause = Cause(Why.BYTES, "the frame is complete", have=size, need=need)
    return Outcome(Condition.RECEIVED, cause, rcvd_len=size)
