"""USEND_C: create a UDP socket and send a datagram on each rising edge of REQ (manual 7.15.14)."""

from __future__ import annotations

from functools import lru_cache

from trcvtui.blocks.cause import FULL, Cause, Why, cause_of, full_cause
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import SendEnded, SendStarted
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.job_checks import Wish, changed, refuse
from trcvtui.blocks.udp.udp_control import UdpBinding, UdpPart
from trcvtui.net.results import Fault


class UsendC:
    """One USEND_C instance."""

    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramOut(bound)
        self._part = UdpPart(bound.env, bound.port)
        self._req = False
        self._asked = False  # an edge that came before the socket, not yet told

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, then 7005 and 7009 for each edge."""
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        outcome = self._part.call(inputs.cont)
        if outcome is not None:
            return self._while_not_ready(inputs, outcome, req_rose)
        if self.job.running:
            return self.job.go_on()
        return self.job.begin(inputs.len) if req_rose else READY

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the socket stays as it is."""
        self.job.leave(reason)

    def _while_not_ready(self, inputs: Inputs, outcome: Outcome, req_rose: bool) -> Outcome:
        """Tell an edge that came too early in the second 0001, or instead of the first 7001 (row 4)."""
        self.job.abandon(outcome.cause.name)
        self._asked = (self._asked or req_rose) and inputs.cont
        in_time = outcome.condition is Condition.CREATING and self._part.waits > 1
        if not self._asked or not (in_time or outcome.condition is Condition.CREATED):
            return outcome
        self._asked = False
        self._part.hold_back(outcome)
        return Outcome(
            Condition.NOT_CONNECTED,
            Cause(Why.INPUT, "REQ rose before the socket was there", pin="REQ", value=1),
        )


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
        wish = Wish(length, most=rules.max_datagram, needs_len=rules.area.datagram_needs_len)
        refused = refuse(self._env, self._data, wish, self._port.sending, self.claim, self._config)
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

    def leave(self, reason: str) -> None:
        """Be gone; the lock of a job may stay behind (rules) until the socket is closed."""
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


READY = Outcome(Condition.CREATED, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), lasts=True)


@lru_cache(64)
def _sending(size: int, peer: str) -> Outcome:
    cause = Cause(Why.BYTES, "the stack has the datagram", have=size, need=size, peer=peer)
    return Outcome(Condition.SENDING, cause)


@lru_cache(64)
def _sent(size: int, peer: str) -> Outcome:
    cause = Cause(Why.BYTES, "the datagram is with the local stack", have=size, need=size, peer=peer)
    return Outcome(Condition.SENT, cause)
