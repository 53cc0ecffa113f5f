"""The receive job: what TRCV does between EN_R and DONE.

Rule 1: a job latches LEN and the size of DATA when it starts, and reads at most its own length. ADHOC acts
on the running job (7.15.1, ADHOC mode: "sets the current reception function"), or is latched as well if the
vendor's rules say so.
Rule 2: until DONE the bytes stay in the job's buffer, so DATA changes only at DONE.
Rule 3: at least one scan of "receiving" shows before each DONE.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from trcvtui.blocks.block import ConnectBinding
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import ModeChanged
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.job_checks import JobRequest, acquire, can_start, find_misfit, find_rival, reserve
from trcvtui.blocks.tcp.jobs import IncomingJob
from trcvtui.blocks.tcp.no_connection import loss_walk
from trcvtui.net.connection.connection import ConnectionLoss, LossKind
from trcvtui.net.results import Datagram, Endpoint, WouldBlock

OUTCOMES_KEPT: Final = 1024  # distinct (have, need) whose outcome is made only once

# What the block is doing, in words. A complete frame may have no bytes: an empty datagram, an empty TSDU.
NO_BYTE_TEXT: Final = "nothing received yet"
SOME_BYTES_TEXT: Final = "bytes are missing"
COMPLETE_TEXT: Final = "the frame is complete and shows in the next scan"


class ReceiveJob(IncomingJob):
    def __init__(self, bound: ConnectBinding, needs_datagrams: bool = False) -> None:
        super().__init__(bound, bound.connection)
        self.complete = False  # every byte is there (static), any byte is there (ad-hoc)
        self.whole = 0  # size of the message, with the bytes that DATA has no room for
        self._area = bound.env.rules.area
        self._is_message_oriented = bound.connection.config.is_message_oriented
        self._unfit = find_misfit(bound, needs_datagrams, receives=True)
        self._address = bound.address if bound.connection.config.is_datagram else None
        self._limit = bound.env.rules.max_datagram if self._address is not None else None
        self._source: Endpoint | None = None  # of the message that has come
        self.view = memoryview(self.buffer)
        self.span_offset = self.next_offset = 0  # in the received stream
        self._spans: list[tuple[int, int]] = []  # earlier ones of this job: offset and size

    # -- one scan with EN_R = 1, connected ----------------------------------------------------------

    def call(self, inputs: Inputs) -> Outcome | ConnectionLoss:
        """Start, continue or end a job: at most one frame a scan."""
        if not self.running:
            return self._begin(inputs.len, inputs.adhoc)
        if self._area.must_stay and (changed := self._end_if_changed(inputs.len)) is not None:
            return changed
        if inputs.adhoc != self.adhoc and self._env.rules.adhoc_at_once:
            self._switch_adhoc(inputs.adhoc)  # rule 1
        if not self.complete:
            loss = self._collect()
            if loss is not None:
                return loss
            if not self.complete:
                return self.receiving_outcome()
        return self._deliver()

    def _begin(self, length: int, adhoc: bool) -> Outcome | ConnectionLoss:
        request, receiving = self._make_request(length, adhoc), self.connection.receiving
        refused = self._unfit or acquire(self._env, self.data, request, receiving, self.claim, self._connect)
        self.claim.is_refused = refused is not None
        if refused is not None:
            # 80A7: a whole frame waits for its buffer, also when the partner has gone.
            has_to_wait = refused.condition is Condition.NO_BUFFER and self._whole_frame_waits(request)
            return refused if has_to_wait else self.check_loss() or refused
        assert self.data is not None
        self._latched = length, self.data.shape
        self._start(request.length or self.data.size, request.adhoc)
        return self._collect() or self.receiving_outcome()  # rule 3, even if all bytes are here

    def _whole_frame_waits(self, request: JobRequest) -> bool:
        size = self.data.size if self.data is not None else 0
        least = 1 if request.adhoc or self._is_message_oriented else request.length or size
        return self.connection.unread() >= least

    def _make_request(self, length: int, adhoc: bool) -> JobRequest:
        if length in self._area.adhoc_lens:
            length, adhoc = 0, True
        least = self.data.text_lens.received if self.data is not None else 0
        rival = find_rival(self._env, self.connection, self.claim)
        return JobRequest(length, adhoc=adhoc, most=self._limit, least=least, rival=rival)

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether EN_R asks for a job that can start, now or once another reader frees the lock.

        Without `waits`, also return False if the block with the lock could start no job in its last call.
        """
        if not inputs.en_r or self._unfit is not None:
            return False
        request = self._make_request(inputs.len, inputs.adhoc)
        return can_start(self._env, self.data, request) and not self.connection.receiving.is_barred(
            self.claim, waits
        )

    def reserve(self, inputs: Inputs) -> bool:
        """Reserve the receive side for the next call's job. Return False if the job would be refused."""
        request, receiving = self._make_request(inputs.len, inputs.adhoc), self.connection.receiving
        taken = self._unfit is None and reserve(self._env, self.data, request, receiving, self.claim)
        self.claim.is_refused = not taken
        return taken

    def outlives_en_r(self, reserved: bool = False) -> bool:
        """Return whether a job continues while EN_R is 0. If `reserved`, the job begins in this call."""
        has_data = self.have > 0 or self.complete
        return (self.running or reserved) and self._env.rules.course.outlives_en_r(has_data)

    def _start(self, need: int, adhoc: bool = False) -> None:
        super()._start(need, adhoc)
        self.complete, self.adhoc = False, adhoc
        self.view = memoryview(self.buffer)
        self.span_offset = self.next_offset = self.first_offset
        self._spans.clear()

    def _switch_adhoc(self, adhoc: bool) -> None:
        self.adhoc = adhoc
        self._env.write(ModeChanged(self._instance, self.number, adhoc))
        if self._is_message_oriented:
            return
        if adhoc and 0 < self.have < self.need and self.connection.unread():  # a loss shows after the frame
            self._collect()
        self.complete = self.claim.has_frame = self.have > 0 if adhoc else self.have == self.need

    def _collect(self) -> ConnectionLoss | None:
        """Read into the job's own buffer (rule 2). Return the loss that follows the last byte."""
        if self._is_message_oriented:
            return self._collect_message()
        have = self.have
        got = self.connection.receive(self.view[have:] if have else self.view, self._instance)
        if isinstance(got, int):
            offset = self.connection.bytes_received - got
            if offset != self.next_offset:  # tasks of different priority take turns on one stream
                self._begin_span(offset)
            self.next_offset = offset + got
            have = self.have = have + got
            self.complete = self.claim.has_frame = self.adhoc or have == self.need
            self.last_bytes_at = self._env.now
            return None
        return None if isinstance(got, WouldBlock) else got

    def _collect_message(self) -> ConnectionLoss | None:
        got = self.connection.receive_message(self.view, self._instance)
        if not isinstance(got, Datagram):
            return None if isinstance(got, WouldBlock) else got
        self.first_offset = self.span_offset = self.connection.bytes_received - got.size
        self.next_offset = self.connection.bytes_received
        self.have, self.whole, self._source = got.size, got.whole, got.source
        self.complete = self.claim.has_frame = True
        self.last_bytes_at = self._env.now
        return None

    def _begin_span(self, offset: int) -> None:
        """Note that a job of another priority has read bytes, and that this job continues at `offset`."""
        if self.have:
            self._spans.append((self.span_offset, self.next_offset - self.span_offset))
        else:
            self.first_offset = offset
        self.span_offset = offset

    def check_loss(self) -> ConnectionLoss | None:
        return self.connection.check_loss(self.claim)

    def end_by_loss(self, loss: ConnectionLoss) -> list[Outcome]:
        """End the job; return the outcomes that the loss shows, one a scan."""
        failed = Condition.RECEIVE_FAILED if self.running else None
        is_short = bool(self.have and not self.adhoc)
        outcomes = loss_walk(loss, self._env.rules, self, failed, short_frame=is_short)
        still_asked = self._env.rules.course.still_asked
        # 80C4 follows only a job that the loss has ended, not a close by our side.
        if self.running and still_asked and loss.kind not in (LossKind.OURS, LossKind.REFUSED):
            outcomes.append(Outcome(still_asked, outcomes[-1].cause))
        self.abandon(loss.reason)
        return outcomes

    def receiving_outcome(self) -> Outcome:
        """Return the outcome of a waiting job; the same object while nothing changes."""
        part = self._env.rules.receiving_part if self.have else Condition.RECEIVING
        return _receiving_outcome(self.have, self.need, self.complete, part)

    def _deliver(self) -> Outcome:
        """Write the job's bytes to DATA and end the job; bytes beyond a smaller DATA are dropped."""
        size, data = self.have, self.data
        assert data is not None
        if self.whole > size:
            return self._refuse_too_long()
        self.view.release()
        if size == data.size == len(self.buffer):
            self.buffer = data.swap(self.buffer)  # no copy where all of DATA is new
        else:
            data.write(0, memoryview(self.buffer)[:size].toreadonly())
        if self._address is not None and self._source is not None:
            self._address.set_end(self._source)
        kept = min(size, data.size)
        if kept < size:
            self._drop_collected(kept, "DATA resized")
        self._end(done=True, reason="complete", size=kept)
        return _received_outcome(size, self.need)

    def _refuse_too_long(self) -> Outcome:
        cause = Cause(
            CauseKind.BYTES, "the message is longer than LEN or DATA", have=self.whole, need=self.need
        )
        self.abandon("the message is too long")
        return Outcome(Condition.MESSAGE_TOO_LONG, cause)

    def abandon(self, reason: str) -> None:
        """End a running job without DONE; its collected bytes are dropped and noted."""
        if self.running:
            self._drop_collected(0, reason)
            self._end(done=False, reason=reason, size=self.have)

    def _drop_collected(self, kept: int, reason: str) -> None:
        for offset, size in (*self._spans, (self.span_offset, self.next_offset - self.span_offset)):
            skipped = min(kept, size)
            kept -= skipped
            self.connection.note_dropped(offset + skipped, size - skipped, reason, self._incarnation)

    def _end(self, done: bool, reason: str, size: int) -> None:
        self.complete = self.claim.has_frame = False
        self.whole = 0
        super()._end(done, reason, size)


@lru_cache(OUTCOMES_KEPT)
def _receiving_outcome(have: int, need: int, complete: bool, condition: Condition) -> Outcome:
    name = COMPLETE_TEXT if complete else SOME_BYTES_TEXT if have else NO_BYTE_TEXT
    cause = Cause(CauseKind.FRAME if complete else CauseKind.BYTES, name, have=have, need=need)
    return Outcome(condition, cause, stable=not complete)


@lru_cache(OUTCOMES_KEPT)
def _received_outcome(size: int, need: int) -> Outcome:
    cause = Cause(CauseKind.FRAME, "the frame is complete", have=size, need=need)
    return Outcome(Condition.RECEIVED, cause, rcvd_len=size)
