"""URECV_C: create a UDP socket and receive one datagram a job (manual 7.15.15)."""

from __future__ import annotations

from functools import lru_cache

from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import JobEnded, JobStarted
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.job_checks import Wish, changed, refuse
from trcvtui.blocks.tcp.not_connected import StandingRequest
from trcvtui.blocks.udp.udp_control import UdpBinding, UdpPart
from trcvtui.net.results import Datagram, Endpoint, Fault


class UrecvC:
    """One URECV_C instance."""

    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramIn(bound)
        self._part = UdpPart(bound.env, bound.port)
        self._request = StandingRequest(bound.env.rules.not_connected)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, then 7006 and 7008 for each datagram as long as EN_R is 1."""
        self._request.see(inputs, cont_rose=inputs.cont and not self._part.cont)
        outcome = self._part.call(inputs.cont)
        if outcome is not None:
            return self._while_not_ready(outcome)
        self._request.answered()
        if inputs.en_r:
            return self.job.call(inputs.len)
        self.job.abandon("EN_R fell")
        self.job.let_go()
        return READY

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the socket stays as it is."""
        self.job.leave(reason)

    # -- 80A1: asked for data, no socket (design 6, row 3, with 0001 in the place of 7002) -----------

    def _while_not_ready(self, outcome: Outcome) -> Outcome:
        self.job.abandon(outcome.cause.name)
        if outcome.condition is Condition.CREATED:
            self._request.answered()
        elif outcome.condition is Condition.CREATING and self._part.waits > 1 and self._request.is_told():
            return _TOO_EARLY
        return outcome


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
        wish = Wish(length, most=self._env.rules.max_datagram)
        refused = refuse(self._env, self._data, wish, self._port.receiving, self.claim, self._config)
        if refused is not None:
            return refused
        assert self._data is not None
        self._asked = length, self._data.shape
        self._start(length or self._data.size)
        return self._collect() or self._receiving()

    def _changed(self, length: int) -> Outcome | None:
        """End the job when LEN or DATA is another than at its start."""
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
        """Take one datagram into the job's own buffer; return what failed."""
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
        """Write the datagram to DATA and its source to ADDR; what a smaller DATA cannot hold is dropped."""
        size, data = self.have, self._data
        assert data is not None
        data.write(0, memoryview(self._buffer)[:size].toreadonly())
        self._address.take(source)
        kept = min(size, data.size)
        self._drop(kept, size - kept, "DATA resized")
        self._end(done=True, reason="complete", size=kept)
        cause = Cause(Why.BYTES, "a datagram is here", have=size, need=self.need, peer=str(source))
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

    def leave(self, reason: str) -> None:
        """Be gone; the lock of a job may stay behind (rules) until the socket is closed (row 15)."""
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


READY = Outcome(Condition.CREATED, Cause(Why.INPUT, "EN_R is 0", pin="EN_R", value=0), lasts=True)
_TOO_EARLY = Outcome(
    Condition.NOT_CONNECTED,
    Cause(Why.INPUT, "EN_R is 1 before the socket is there", pin="EN_R", value=1),
)


@lru_cache(1024)
def _receiving(have: int, need: int, is_here: bool) -> Outcome:
    name = "the datagram is here and shows in the next scan" if is_here else "nothing received yet"
    cause = Cause(Why.BYTES, name, have=have, need=need)
    return Outcome(Condition.RECEIVING, cause, lasts=not is_here)
