"""The send job: what TSEND does between a rising edge of REQ and DONE.

Rule 1: at the edge, at most LEN bytes of DATA are copied. An edge of REQ while the job runs has
no effect (7.15.2).
Rule 2: the job checks for a loss before each send and before DONE, so no DONE comes after a FIN.
Rule 3: the scan of the REQ edge shows "sending" even if the stack took everything. DONE means that the
local stack has every byte, not that the partner has every byte.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.block import ConnectBinding
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import FULL, NEXT_REQ, Cause, CauseKind, Outcome, cause_of_fault, send_full_cause
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.job_checks import JobRequest, acquire, find_misfit, find_rival, reserve, target_error
from trcvtui.blocks.tcp.jobs import OutgoingJob
from trcvtui.blocks.tcp.no_connection import loss_walk
from trcvtui.blocks.tcp.receive_job import OUTCOMES_KEPT
from trcvtui.net.connection.connection import ConnectionLoss
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import Fault, WouldBlock

# For a datagram without a route; every other failed call is "send failed".
UNREACHABLE_ERRORS: Final = dict.fromkeys(("ENETUNREACH", "EHOSTUNREACH"), Condition.UNREACHABLE)
NO_REQ: Final = Outcome(
    Condition.CONNECTED, Cause(CauseKind.WAITING, "REQ has not risen", pin="REQ"), stable=True
)
_NEXT_REQ: Final = replace(NO_REQ, cause=NEXT_REQ)


class SendJob(OutgoingJob):
    def __init__(self, bound: ConnectBinding, needs_datagrams: bool = False) -> None:
        super().__init__(bound, bound.connection, bound.connection.sending)
        self._must_stay = bound.env.rules.area.must_stay
        self._needs_len = needs_datagrams and bound.env.rules.area.datagram_needs_len
        self._unfit = find_misfit(bound, needs_datagrams)
        self._address = bound.address
        self._limit = bound.env.rules.max_datagram if bound.connection.config.is_datagram else None
        self._unsent = memoryview(b"")
        self._refusal = FULL  # the answer of the stack that took no byte

    # -- one scan, connected ------------------------------------------------------------------------

    def call(self, inputs: Inputs, rose: bool) -> Outcome | ConnectionLoss:
        """Continue the job, begin one at the edge of REQ, or wait for an edge."""
        if self.running:  # rule 1: an edge is not seen
            return self.advance()
        if rose:
            return self.begin(inputs)
        return self.connection.check_loss() or (_NEXT_REQ if self.number else NO_REQ)

    def begin(self, inputs: Inputs) -> Outcome | ConnectionLoss:
        """Start a job in the scan of the edge and send at once."""
        loss = self.connection.check_before_sending()  # rule 2
        if loss is not None:
            return loss
        if (wrong := self._find_target_error()) is not None:
            return wrong
        request = self._make_request(inputs.len)
        refused = acquire(self._env, self.data, request, self._direction, self.claim, self._connect)
        if refused is not None:
            self.release_direction()  # the lock lasts from the edge to DONE or ERROR: this is an ERROR
            return refused
        assert self.data is not None
        self._latched = inputs.len, self.data.shape
        self._start(bytes(self.data.content[: inputs.len or self.data.size]))
        ended = self._send_rest()
        if ended is not None:
            return ended
        if not self.have:
            # 80A8 only before the first byte (7.15.2): to end the job later would cut the stream.
            self._end(done=False, reason="the send buffer is full")
            return self._send_full_outcome()
        return _sending_outcome(self.have, self.need)  # rule 3

    def _make_request(self, length: int) -> JobRequest:
        least = self.data.text_lens.sent if self.data is not None else 0
        rival = find_rival(self._env, self.connection, self.claim)
        return JobRequest(length, most=self._limit, least=least, rival=rival, needs_len=self._needs_len)

    def reserve(self, inputs: Inputs) -> bool:
        """Reserve the send side for the next call's job. Return False if the job would be refused."""
        request = self._make_request(inputs.len)
        return self._find_target_error() is None and reserve(
            self._env, self.data, request, self._direction, self.claim
        )

    def advance(self) -> Outcome | ConnectionLoss:
        """Send the remaining bytes; end the job once the stack has taken them all."""
        if self._must_stay and (changed := self._end_if_changed()) is not None:
            return changed
        ended: Outcome | ConnectionLoss | None = self.connection.check_before_sending()  # rule 2
        if ended is None and self._unsent:
            ended = self._send_rest()
        if ended is not None:
            return ended
        if self._unsent:
            return _sending_outcome(self.have, self.need)
        self._end(done=True, reason="complete")
        return _sent_outcome(self.need)

    def _start(self, payload: bytes) -> None:
        super()._start(payload)
        self._unsent = memoryview(payload)

    def _find_target_error(self) -> Outcome | None:
        is_datagram = self.connection.config.is_datagram
        return self._unfit or (target_error(self._address) if is_datagram and self._address else None)

    def _send_rest(self) -> Outcome | ConnectionLoss | None:
        got = self._send()
        if isinstance(got, WouldBlock) or (isinstance(got, Fault) and got.error == "EAGAIN"):
            self._refusal = got if isinstance(got, Fault) else FULL
            return None
        if isinstance(got, Fault):
            self._end(done=False, reason="the datagram was not taken")
            failed = UNREACHABLE_ERRORS.get(got.error, Condition.SEND_FAILED)
            return Outcome(failed, cause_of_fault(got, self._peer_text()))
        if isinstance(got, int):
            self.have += got
            self._unsent = self._unsent[got:]
            self.last_bytes_at = self._env.now
            return None
        return got

    def _send_full_outcome(self) -> Outcome:
        blames = not self._refusal.injected and not self.connection.config.is_datagram
        name = "the stack takes no byte: the partner does not read" if blames else "the stack takes no byte"
        cause = send_full_cause(self._refusal, name, self.need, self._peer_text())
        return Outcome(Condition.SEND_BUFFER_FULL, cause)

    def _peer_text(self) -> str:
        if self._address is not None and isinstance(self.connection, UdpEndpoint):
            return self.connection.describe_target(self._address)
        return str(self.connection.peer or "")

    def _send(self) -> int | WouldBlock | Fault | ConnectionLoss:
        if self._address is not None and isinstance(self.connection, UdpEndpoint):
            return self.connection.send_to(self._unsent, self._address, self._instance)
        return self.connection.send(self._unsent, self._instance)

    def end_by_loss(self, loss: ConnectionLoss, asked: bool) -> list[Outcome]:
        """End the job. Return the outcomes of the loss, one a scan. If `asked`, REQ rose in this scan."""
        failed = Condition.SEND_FAILED if self.running or asked else None
        outcomes = loss_walk(loss, self._env.rules, self, failed)
        self.abandon(loss.reason)
        return outcomes

    def _end(self, done: bool, reason: str) -> None:
        self._unsent = memoryview(b"")
        super()._end(done, reason)


@lru_cache(OUTCOMES_KEPT)
def _sending_outcome(have: int, need: int) -> Outcome:
    name = "DONE comes in the next scan" if have == need else "bytes are left"
    return Outcome(Condition.SENDING, Cause(CauseKind.BYTES, name, have=have, need=need))


@lru_cache(OUTCOMES_KEPT)
def _sent_outcome(size: int) -> Outcome:
    cause = Cause(CauseKind.BYTES, "the local stack has every byte", have=size, need=size)
    return Outcome(Condition.SENT, cause)
