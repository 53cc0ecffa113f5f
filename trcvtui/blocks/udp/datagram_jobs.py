"""The jobs of blocks on a UDP_CONFIG: one datagram out, one datagram in."""

from __future__ import annotations

from functools import lru_cache

from trcvtui.blocks.block import JobBinding
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import FULL, Cause, CauseKind, Outcome, cause_of_fault, send_full_cause
from trcvtui.blocks.table import BlockRow
from trcvtui.blocks.tcp.job_checks import JobRequest, acquire
from trcvtui.blocks.tcp.jobs import IncomingJob, OutgoingJob
from trcvtui.net.connection.config import RemoteAddress
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import Datagram, Endpoint, Fault


class UdpBinding(JobBinding, frozen=True):
    """CONFIG, ADDR and DATA of one instance."""

    port: UdpEndpoint
    address: RemoteAddress

    def class_of(self, row: BlockRow) -> str:
        return row.on_config


class DatagramSendJob(OutgoingJob):
    """One instance's send jobs: each is one datagram, copied from DATA at the edge."""

    def __init__(self, bound: UdpBinding) -> None:
        super().__init__(bound, bound.port, bound.port.sending)
        self._address = bound.address
        self._port = bound.port
        self._peer = ""  # where the datagram went

    def begin(self, length: int) -> Outcome:
        """Send in the scan of the edge; the stack takes the datagram whole or not at all."""
        rules = self._env.rules
        request = JobRequest(length, most=rules.max_datagram, needs_len=rules.area.datagram_needs_len)
        refused = acquire(self._env, self.data, request, self._direction, self.claim, self._connect)
        if refused is not None:
            self.release_direction()  # the lock lasts from the edge to DONE or ERROR
            return refused
        assert self.data is not None
        self._latched = length, self.data.shape
        payload = bytes(self.data.content[: length or self.data.size])
        self._start(payload)
        got = self._port.send_to(memoryview(payload), self._address, self._instance)
        if isinstance(got, int):
            self.have, self.last_bytes_at, self._peer = got, self._env.now, str(self._port.peer)
            return _sending_outcome(got, self._peer)
        self._end(done=False, reason="the datagram was not taken")
        peer = self._port.describe_target(self._address)
        if isinstance(got, Fault) and got.error != "EAGAIN":  # a planned EAGAIN means full, too
            return Outcome(Condition.SEND_FAILED, cause_of_fault(got, peer))
        fault = got if isinstance(got, Fault) else FULL
        cause = send_full_cause(fault, "the stack has no room for the datagram", self.need, peer)
        return Outcome(Condition.SEND_BUFFER_FULL, cause)

    def advance(self) -> Outcome:
        """End the job: DONE shows one scan after the send."""
        if self._env.rules.area.must_stay and (ended := self._end_if_changed()) is not None:
            return ended
        self._end(done=True, reason="complete")
        return _sent_outcome(self.need, self._peer)


@lru_cache(64)
def _sending_outcome(size: int, peer: str) -> Outcome:
    cause = Cause(CauseKind.BYTES, "the stack has the datagram", have=size, need=size, peer=peer)
    return Outcome(Condition.SENDING, cause)


@lru_cache(64)
def _sent_outcome(size: int, peer: str) -> Outcome:
    cause = Cause(CauseKind.BYTES, "the local stack has the datagram", have=size, need=size, peer=peer)
    return Outcome(Condition.SENT, cause)


class DatagramReceiveJob(IncomingJob):
    """One instance's receive jobs. LEN and the size of DATA are latched when a job starts."""

    def __init__(self, bound: UdpBinding) -> None:
        super().__init__(bound, bound.port)
        self._address = bound.address
        self._port = bound.port
        self._source: Endpoint | None = None  # of the datagram that is here and shows in the next scan

    def call(self, length: int) -> Outcome:
        """Start, continue or end a job: at most one datagram a scan, "receiving" before each DONE."""
        if not self.running:
            return self._begin(length)
        if self._env.rules.area.must_stay and (ended := self._end_if_changed(length)) is not None:
            return ended
        if self._source is None:
            failed = self._collect()
            if failed is not None or self._source is None:
                return failed or self._receiving_outcome()
        return self._deliver(self._source)

    def _begin(self, length: int) -> Outcome:
        request = JobRequest(length, most=self._env.rules.max_datagram)
        refused = acquire(self._env, self.data, request, self._direction, self.claim, self._connect)
        if refused is not None:
            return refused
        assert self.data is not None
        self._latched = length, self.data.shape
        self._start(length or self.data.size)
        return self._collect() or self._receiving_outcome()

    def _collect(self) -> Outcome | None:
        self.first_offset = self._port.bytes_received
        got = self._port.receive_from(memoryview(self.buffer), self._instance)
        if isinstance(got, Fault):
            self._end(done=False, reason="receiving failed", size=0)
            return Outcome(Condition.RECEIVE_FAILED, cause_of_fault(got))
        if not isinstance(got, Datagram):
            return None
        self.last_bytes_at = self._env.now
        if got.is_cut and not self._env.rules.large_datagram_cut:  # switch large_datagram
            return self._refuse_too_large(got)
        self.have, self._source = got.size, got.source
        self._note_dropped(got.size, got.whole - got.size, "larger than LEN or DATA")
        return None

    def _refuse_too_large(self, got: Datagram) -> Outcome:
        self._note_dropped(0, got.whole, "larger than LEN or DATA")
        self._end(done=False, reason="the datagram is too large", size=0)
        cause = Cause(
            CauseKind.BYTES, "the datagram is larger than LEN or DATA", have=got.whole, need=self.need,
            peer=str(got.source),
        )  # fmt: skip
        return Outcome(self._env.rules.datagram_too_long, cause)

    def _receiving_outcome(self) -> Outcome:
        return _receiving_outcome(self.have, self.need, self._source is not None)

    def _deliver(self, source: Endpoint) -> Outcome:
        size, data = self.have, self.data
        assert data is not None
        data.write(0, memoryview(self.buffer)[:size].toreadonly())
        self._address.set_end(source)
        kept = min(size, data.size)
        self._note_dropped(kept, size - kept, "DATA resized")
        self._end(done=True, reason="complete", size=kept)
        cause = Cause(CauseKind.FRAME, "a datagram is here", have=size, need=self.need, peer=str(source))
        return Outcome(Condition.RECEIVED, cause, rcvd_len=size)

    def _note_dropped(self, begin: int, size: int, reason: str) -> None:
        self._port.note_dropped(self.first_offset + begin, size, reason, self._incarnation)

    def abandon(self, reason: str) -> None:
        """End a running job without DONE; a datagram that is already here is dropped and noted."""
        if self.running:
            self._note_dropped(0, self.have, reason)
            self._end(done=False, reason=reason, size=self.have)

    def _end(self, done: bool, reason: str, size: int) -> None:
        self._source = None
        super()._end(done, reason, size)


@lru_cache(1024)
def _receiving_outcome(have: int, need: int, is_here: bool) -> Outcome:
    name = "the datagram is here and shows in the next scan" if is_here else "nothing received yet"
    cause = Cause(CauseKind.BYTES, name, have=have, need=need)
    return Outcome(Condition.RECEIVING, cause, stable=not is_here)
