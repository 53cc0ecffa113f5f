"""What the jobs of one direction have in common, on a CONNECT and on a UDP_CONFIG."""

from __future__ import annotations

from trcvtui.blocks.block import JobBinding
from trcvtui.blocks.environment import ReceiveEnded, ReceiveStarted, SendEnded, SendStarted
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.tcp.job_checks import changed_outcome
from trcvtui.net.connection.connection import Connection
from trcvtui.net.connection.resources import DirectionClaims


class JobRunner:
    adhoc = False

    def __init__(self, bound: JobBinding, connection: Connection, direction: DirectionClaims) -> None:
        self.number = 0
        self.running = False
        self.have = 0
        self.need = 0
        self.last_bytes_at: int | None = None
        self.claim = bound.make_claim()
        self.data = bound.data
        self.connection = connection
        self._direction = direction
        self._env = bound.env
        self._connect = connection.config.name
        self._instance = bound.instance
        self._latched: tuple[int, tuple[str, int]] | None = None  # LEN and DATA of the job that runs
        self._incarnation = 0  # of the connection that the running job works on
        self.first_offset = 0  # in the stream

    def _begin_job(self, need: int, offset: int) -> tuple[str, int, str, int, int]:
        """Begin the next job; return the first fields of its ledger event."""
        self.number += 1
        self.running, self.have, self.need = True, 0, need
        self._incarnation, self.first_offset = self.connection.incarnation, offset
        return self._event_head()

    def _event_head(self) -> tuple[str, int, str, int, int]:
        return self._instance, self.number, self._connect, self._incarnation, self.first_offset

    def _end_if_changed(self, length: int | None = None) -> Outcome | None:
        """End the job if the type or size of DATA has changed, or if a given LEN has another value."""
        assert self._latched is not None and self.data is not None
        same_len = length in (None, self._latched[0])
        if same_len and self._latched[1] == self.data.shape:
            return None
        outcome = changed_outcome("DATA" if same_len else "LEN")
        self.abandon(outcome.cause.name)
        return outcome

    def release_direction(self) -> None:
        self._direction.give_back(self.claim)

    def abandon(self, reason: str) -> None: ...

    def detach(self, reason: str) -> None:
        """Detach the instance. If the rules say so, a job's lock stays until disconnect, reset or close."""
        self.claim.is_orphan = self.running and self._env.rules.lock_outlives  # 7.15.1, note
        if not self.claim.is_orphan:
            self.release_direction()  # also of a job that was to begin next
        self.abandon(reason)


class OutgoingJob(JobRunner):
    """A job that sends a copy of DATA."""

    def _start(self, payload: bytes) -> None:
        head = self._begin_job(len(payload), self.connection.bytes_sent)
        self._env.write(SendStarted(*head, self.need))

    def abandon(self, reason: str) -> None:
        """End a running job without DONE; what the stack has not taken is dropped, never sent later."""
        if self.running:
            self._end(done=False, reason=reason)

    def received_part(self) -> bytes:
        return b""

    def _end(self, done: bool, reason: str) -> None:
        self.running = False
        self._env.resources.buffers.release()
        if not self.claim.is_orphan:  # an orphan locks until disconnect or reset
            self.release_direction()
        self._env.write(SendEnded(*self._event_head(), self.have, done, reason))


class IncomingJob(JobRunner):
    """A job that collects bytes in a buffer of its own."""

    def __init__(self, bound: JobBinding, connection: Connection) -> None:
        super().__init__(bound, connection, connection.receiving)
        self.buffer = bytearray()

    def _start(self, need: int, adhoc: bool = False) -> None:
        head = self._begin_job(need, self.connection.bytes_received)
        if len(self.buffer) != need:  # else the buffer of the last job serves again
            self.buffer = bytearray(need)
        self._env.write(ReceiveStarted(*head, need, adhoc))

    def received_part(self) -> bytes:
        return bytes(self.buffer[: self.have]) if self.running else b""

    def _end(self, done: bool, reason: str, size: int) -> None:
        self.running = False
        self.have = 0
        self._env.resources.buffers.release()
        self._env.write(ReceiveEnded(*self._event_head(), size, done, reason))
