"""The jobs of blocks on a UDP_CONFIG: one datagram out, one datagram in."""

from __future__ import annotations

from functools import lru_cache

from msgspec import Struct

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment, JobEnded, JobStarted, SendEnded, SendStarted
from trcvtui.blocks.outcome import FULL, Cause, Outcome, Why, cause_of, full_cause
from trcvtui.blocks.table import BlockRow
from trcvtui.blocks.tcp.job_checks import JobRequest, changed, refuse
from trcvtui.net.connection.config import RemoteAddress
from trcvtui.net.connection.resources import Claim
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import Datagram, Endpoint, Fault


class UdpBinding(Struct, frozen=True):
    """CONFIG, ADDR and DATA of one instance. `data` None: the pin is open; `priority` is that of its task."""

    env: Environment
    port: UdpEndpoint
    address: RemoteAddress
    data: DataArea | None
    instance: str
    priority: int = 1

    def claim(self) -> Claim:
        """Return this instance's claim on one direction of its UDP_CONFIG."""
        return Claim(self.instance, None if self.env.rules.lock_across_tasks else self.priority)

    def class_of(self, row: BlockRow) -> str:
        return row.on_config


class DatagramOut:
    """One instance's send jobs: each is one datagram, copied from DATA at the edge."""

    adhoc = False

    def __init__(self, bound: UdpBinding) -> None:
        self.number = 0
        self.running = False
        self.have = 0
        self.need = 0
        self.last_bytes: int | None = None
        self.claim = bound.claim()
        self._env = bound.env
        self._shape: tuple[str, int] | None = None  # of DATA when the job began
        self._data = bound.data
        self._address = bound.address
        self._port = bound.port
        self._config = bound.port.config.name
        self._instance = bound.instance
        self._incarnation = self._first_offset = 0
        self._peer = ""  # whom the datagram went to

    def begin(self, length: int) -> Outcome:
        """Send in the scan of the edge; the stack takes the datagram whole or not at all."""
        rules = self._env.rules
        request = JobRequest(length, most=rules.max_datagram, needs_len=rules.area.datagram_needs_len)
        refused = refuse(self._env, self._data, request, self._port.sending, self.claim, self._config)
        if refused is not None:
            self._port.sending.give_back(self.claim)  # the lock lasts from the edge to DONE or ERROR
            return refused
        assert self._data is not None
        self._shape = self._data.shape
        payload = bytes(self._data.content[: length or self._data.size])
        self._start(len(payload))
        got = self._port.send_to(memoryview(payload), self._address, self._instance)
        if isinstance(got, int):
            self.have, self.last_bytes, self._peer = got, self._env.now, str(self._port.peer)
            return _sending(got, self._peer)
        self._end(done=False, reason="the datagram was not taken")
        peer = self._port.where(self._address)
        if isinstance(got, Fault) and got.error != "EAGAIN":
            return Outcome(Condition.SEND_FAILED, cause_of(got, peer))
        fault = got if isinstance(got, Fault) else FULL
        cause = full_cause(fault, "the stack has no room for the datagram", self.need, peer)
        return Outcome(Condition.SEND_BUFFER_FULL, cause)

    def go_on(self) -> Outcome:
        """Show in the next scan that the datagram went."""
        data = self._data
        if self._env.rules.area.must_stay and data is not None and data.shape != self._shape:
            outcome = changed("DATA")
            self.abandon(outcome.cause.name)
            return outcome
        self._end(done=True, reason="complete")
        return _sent(self.need, self._peer)

    def _start(self, need: int) -> None:
        self.number += 1
        self.running, self.have, self.need = True, 0, need
        incarnation, offset = self._port.incarnation, self._port.bytes_sent
        self._incarnation, self._first_offset = incarnation, offset
        self._env.write(SendStarted(self._instance, self.number, self._config, incarnation, offset, need))

    def abandon(self, reason: str) -> None:
        """End a running job without DONE."""
        if self.running:
            self._end(done=False, reason=reason)

    def detach(self, reason: str) -> None:
        """Detach the instance; the lock of a job may stay (rules) until the socket is closed."""
        self.claim.is_orphan = self.running and self._env.rules.lock_outlives
        self.abandon(reason)
        if not self.claim.is_orphan:
            self._port.sending.give_back(self.claim)  # also of a job that was to begin next

    def partial(self) -> bytes:
        """Return nothing: a send job collects no bytes."""
        return b""

    def _end(self, done: bool, reason: str) -> None:
        self.running = False
        self._env.resources.buffers.release()
        if not self.claim.is_orphan:
            self._port.sending.give_back(self.claim)
        place = self._config, self._incarnation, self._first_offset
        self._env.write(SendEnded(self._instance, self.number, *place, self.have, done, reason))


@lru_cache(64)
def _sending(size: int, peer: str) -> Outcome:
    cause = Cause(Why.BYTES, "the stack has the datagram", have=size, need=size, peer=peer)
    return Outcome(Condition.SENDING, cause)


@lru_cache(64)
def _sent(size: int, peer: str) -> Outcome:
    cause = Cause(Why.BYTES, "the datagram is with the local stack", have=size, need=size, peer=peer)
    return Outcome(Condition.SENT, cause)


class DatagramIn:
    """One instance's receive jobs. LEN and the size of DATA are latched when a job starts."""

    adhoc = False

    def __init__(self, bound: UdpBinding) -> None:
        self.number = 0
        self.running = False
        self.have = 0
        self.need = 0
        self.last_bytes: int | None = None
        self.claim = bound.claim()
        self._env = bound.env
        self._asked: tuple[int, tuple[str, int]] | None = None  # LEN and DATA of the job that runs
        self._data = bound.data
        self._address = bound.address
        self._port = bound.port
        self._config = bound.port.config.name
        self._instance = bound.instance
        self._buffer = bytearray()
        self._source: Endpoint | None = None  # of the datagram that is here and shows in the next scan
        self._incarnation = self._first_offset = 0

    def call(self, length: int) -> Outcome:
        """Start, go on or end: one datagram a scan at most, and one scan of "receiving" before each DONE."""
        if not self.running:
            return self._begin(length)
        if self._env.rules.area.must_stay and (ended := self._changed(length)) is not None:
            return ended
        if self._source is None:
            failed = self._collect()
            if failed is not None or self._source is None:
                return failed or self._receiving()
        return self._deliver(self._source)

    def _begin(self, length: int) -> Outcome:
        request = JobRequest(length, most=self._env.rules.max_datagram)
        refused = refuse(self._env, self._data, request, self._port.receiving, self.claim, self._config)
        if refused is not None:
            return refused
        assert self._data is not None
        self._asked = length, self._data.shape
        self._start(length or self._data.size)
        return self._collect() or self._receiving()

    def _changed(self, length: int) -> Outcome | None:
        assert self._asked is not None and self._data is not None
        if self._asked == (length, self._data.shape):
            return None
        outcome = changed("DATA" if self._asked[0] == length else "LEN")
        self.abandon(outcome.cause.name)
        return outcome

    def _start(self, need: int) -> None:
        self.number += 1
        self.running, self.have, self.need, self._source = True, 0, need, None
        if len(self._buffer) != need:
            self._buffer = bytearray(need)
        incarnation, offset = self._port.incarnation, self._port.bytes_received
        self._incarnation, self._first_offset = incarnation, offset
        self._env.write(
            JobStarted(self._instance, self.number, self._config, incarnation, offset, need, False)
        )

    def _collect(self) -> Outcome | None:
        self._first_offset = self._port.bytes_received
        got = self._port.receive_from(memoryview(self._buffer), self._instance)
        if isinstance(got, Fault):
            self._end(done=False, reason="receiving failed", size=0)
            return Outcome(Condition.RECEIVE_FAILED, cause_of(got))
        if not isinstance(got, Datagram):
            return None
        self.last_bytes = self._env.now
        if got.is_cut and not self._env.rules.large_datagram_cut:
            return self._too_large(got)
        self.have, self._source = got.size, got.source
        self._drop(got.size, got.whole - got.size, "larger than LEN or DATA")
        return None

    def _too_large(self, got: Datagram) -> Outcome:
        self._drop(0, got.whole, "larger than LEN or DATA")
        self._end(done=False, reason="the datagram is too large", size=0)
        cause = Cause(
            Why.BYTES, "the datagram is larger than LEN or DATA", have=got.whole, need=self.need,
            peer=str(got.source),
        )  # fmt: skip
        return Outcome(self._env.rules.datagram_too_long, cause)

    def _receiving(self) -> Outcome:
        return _receiving(self.have, self.need, self._source is not None)

    def _deliver(self, source: Endpoint) -> Outcome:
        size, data = self.have, self._data
        assert data is not None
        data.write(0, memoryview(self._buffer)[:size].toreadonly())
        self._address.take(source)
        kept = min(size, data.size)
        self._drop(kept, size - kept, "DATA resized")
        self._end(done=True, reason="complete", size=kept)
        cause = Cause(Why.FRAME, "a datagram is here", have=size, need=self.need, peer=str(source))
        return Outcome(Condition.RECEIVED, cause, rcvd_len=size)

    def _drop(self, begin: int, size: int, reason: str) -> None:
        self._port.drop(self._first_offset + begin, size, reason, self._incarnation)

    def abandon(self, reason: str) -> None:
        """End a running job without DONE; a datagram that is already here is dropped and noted."""
        if self.running:
            self._drop(0, self.have, reason)
            self._end(done=False, reason=reason, size=self.have)

    def let_go(self) -> None:
        """Give the receive side back (EN_R fell)."""
        self._port.receiving.give_back(self.claim)

    def detach(self, reason: str) -> None:
        """Detach the instance; the lock of a job may stay (rules) until the socket is closed."""
        self.claim.is_orphan = self.running and self._env.rules.lock_outlives
        if not self.claim.is_orphan:
            self.let_go()
        self.abandon(reason)

    def partial(self) -> bytes:
        """Return a copy of the datagram that shows in the next scan."""
        return bytes(self._buffer[: self.have]) if self.running else b""

    def _end(self, done: bool, reason: str, size: int) -> None:
        self.running = False
        self.have, self._source = 0, None
        self._env.resources.buffers.release()
        place = self._config, self._incarnation, self._first_offset
        self._env.write(JobEnded(self._instance, self.number, *place, size, done, reason))


@lru_cache(1024)
def _receiving(have: int, need: int, is_here: bool) -> Outcome:
    name = "the datagram is here and shows in the next scan" if is_here else "nothing received yet"
    cause = Cause(Why.BYTES, name, have=have, need=need)
    return Outcome(Condition.RECEIVING, cause, stable=not is_here)
