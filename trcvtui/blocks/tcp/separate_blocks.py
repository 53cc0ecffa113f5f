"""TCON, TDISCON, T_RESET, TSEND, TRCV: a connection, block by block (manual 7.15.5 to 7.15.9)."""

from __future__ import annotations

from collections import deque

from msgspec.structs import replace

from trcvtui.blocks.block import ConnectBinding, JobBlock, ScriptedBlock
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Lamp, Outcome, cause_of_fault
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.compact_blocks import EN_R_IS_0
from trcvtui.blocks.tcp.connection_control import ConnectionControl, Phase, disconnect, reset, set_up_failed
from trcvtui.blocks.tcp.no_connection import CONNECTED, NO_LINK, KnownIncarnation, loss_walk, not_connected
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.blocks.tcp.send_job import SendJob
from trcvtui.net.connection.connection import ConnectionLoss, State


class Tcon(ScriptedBlock):
    """One TCON instance. Once triggered, a TCON reconnects after each loss until a disconnect (7.15.5)."""

    def __init__(self, bound: ConnectBinding) -> None:
        super().__init__()
        self._bound = bound
        self._connection = bound.connection
        self._control = ConnectionControl(bound.env, bound.connection, bound.make_claim())
        self._triggered = False
        self._has_done = False  # DONE has shown for this trigger

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, 7002, then 7004; the first 7004 has DONE."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._was_disconnected():
            self._control.detach()
            self._control = ConnectionControl(self._bound.env, self._connection, self._bound.make_claim())
            self._triggered = False  # the next edge of REQ connects
        if rose and not self._triggered:
            self._triggered, self._has_done = True, False
        if not self._triggered:
            return _REQ_NOT_RISEN
        outcome = self._control.call(cont=True, com_rst=False)
        if outcome is None:
            return self._answer_connected()
        if outcome.condition is Condition.CONNECTED and not self._has_done:
            self._has_done = True
            return replace(outcome, lamp=Lamp.DONE)
        return outcome

    def _was_disconnected(self) -> bool:
        begun = self._control.phase in (Phase.CONNECTING, Phase.CONNECTED)
        return self._triggered and begun and self._connection.state is State.CLOSED

    def _answer_connected(self) -> Outcome:
        loss = self._connection.find_loss(self._control.incarnation) or self._connection.check_loss()
        if loss is None:
            return _CONNECTION_UP
        outcomes = loss_walk(loss, self._bound.env.rules, self.job, failed=None)
        return self._control.start_reconnecting(outcomes, "the connection is gone")

    def detach(self, reason: str) -> None:
        self._control.detach()


_REQ_NOT_RISEN = Outcome(
    Condition.NO_JOB, Cause(CauseKind.WAITING, "REQ has not risen", pin="REQ"), stable=True
)
_CONNECTION_UP = Outcome(Condition.CONNECTED, Cause(CauseKind.PARTNER, "the connection is up"), stable=True)


class Tdiscon(ScriptedBlock):
    def __init__(self, bound: ConnectBinding) -> None:
        super().__init__()
        self._connection = bound.connection

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call with 7003, or 7007 and DONE. A connection without a partner closes as well."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._script:
            return self._script.popleft()
        if not rose or self._connection.state is State.CLOSED:
            return IDLE
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        cause = Cause(CauseKind.INPUT, "REQ rose", pin="REQ", value=1)
        return queue_with_lamps(disconnect(self._connection, cause), self._script)


def queue_with_lamps(outcomes: list[Outcome], script: deque[Outcome]) -> Outcome:
    """Return the first outcome and queue the others in `script`; the last has DONE, earlier ones BUSY."""
    if len(outcomes) == 1:
        return outcomes[0]  # a failed call shows nothing else
    lamps = [Lamp.BUSY] * (len(outcomes) - 1) + [Lamp.DONE]
    script.extend(replace(outcome, lamp=lamp) for outcome, lamp in zip(outcomes, lamps, strict=True))
    return script.popleft()


# The manual's list has no other word for "called, nothing to do".
IDLE = Outcome(Condition.NOT_CALLED, Cause(CauseKind.WAITING, "REQ has not risen", pin="REQ"), stable=True)


class TReset(ScriptedBlock):
    """One T_RESET instance. T_RESET, or another block, rebuilds the connection after the reset (7.15.7)."""

    def __init__(self, bound: ConnectBinding) -> None:
        super().__init__()
        self._env = bound.env
        self._connection = bound.connection
        self._rebuilds = False  # from its own reset until a connection is up

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 8000, 7003, 7007 with DONE, 7002, then the connection's state: 7002, 7004."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._script:
            return self._script.popleft()
        if not rose or not self._connection.is_up:  # nothing to reset: no effect
            return self._show_connection()
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        cause = Cause(CauseKind.INPUT, "REQ rose", pin="REQ", value=1)
        shown = queue_with_lamps(reset(self._connection, cause, self._env.rules.course.reset), self._script)
        self._script.append(_REBUILDING)
        self._rebuilds = True
        return shown

    def _show_connection(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            self._rebuilds = False
            return IDLE
        failed = self._connection.step(self._env.scan, self._env.now) if self._rebuilds else None
        if failed is not None:
            return set_up_failed(self._connection, failed, self._env.rules.course)
        if not self._connection.is_up:
            return _REBUILDING if self._rebuilds else _NO_LINK
        self._rebuilds = False
        return _CONNECTION_UP


_REBUILDING = Outcome(Condition.ESTABLISHING, Cause(CauseKind.WAITING, "the connection is being built anew"))
_NO_LINK = Outcome(Condition.ESTABLISHING, Cause(CauseKind.WAITING, "there is no connection"), stable=True)


class Tsend(JobBlock):
    def __init__(self, bound: ConnectBinding) -> None:
        self.job = SendJob(bound)
        self._connection = bound.connection
        self._link = KnownIncarnation(bound.connection)
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7004, 7005, 7009; an edge without a connection is 80A1."""
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        loss = self._link.find_loss()
        if loss is not None:
            return self._handle_loss(loss, req_rose)
        shown = self._link.next_outcome()
        if shown is not None and not req_rose:  # an edge has to show its own code
            return shown
        self._link.adopt_new(self.job.claim)
        if self._link.has_incarnation():
            return self._send(inputs, req_rose)
        return (
            not_connected("REQ", "REQ rose without a connection", self._connection) if req_rose else NO_LINK
        )

    def _send(self, inputs: Inputs, req_rose: bool) -> Outcome:
        got = self.job.call(inputs, req_rose)
        return got if isinstance(got, Outcome) else self._handle_loss(got, req_rose)

    def _handle_loss(self, loss: ConnectionLoss, req_rose: bool) -> Outcome:
        return self._link.end_incarnation(self.job.end_by_loss(loss, asked=req_rose))


class Trcv(JobBlock):
    def __init__(self, bound: ConnectBinding) -> None:
        self.job = ReceiveJob(bound)
        self._connection = bound.connection
        self._link = KnownIncarnation(bound.connection)
        self._complaint: Outcome | None = None

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7004, 7006, 7008; EN_R without a connection is 80A1 in each scan."""
        if not inputs.en_r:
            self.job.abandon("EN_R fell")
            self.job.release_direction()
        loss = self._link.find_loss(self.job.claim)
        if loss is not None:
            return self._handle_loss(loss)
        shown = self._link.next_outcome()
        if shown is not None:
            return shown
        if self._link.adopt_new(self.job.claim):
            return CONNECTED  # one 7004 before the first job
        if self._link.has_incarnation():
            return self._receive(inputs)
        if not inputs.en_r:
            return NO_LINK
        return self._not_connected_outcome()

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether the block's next call would receive; plc/instance.py finds this method by name."""
        return self.job.would_read(inputs, waits)

    def _not_connected_outcome(self) -> Outcome:
        """Return the outcome 80A1. Return the same object until its cause changes."""
        now = not_connected("EN_R", "EN_R is 1 without a connection", self._connection)
        if self._complaint is None or self._complaint.cause != now.cause:
            self._complaint = replace(now, stable=True)
        return self._complaint

    def _receive(self, inputs: Inputs) -> Outcome:
        got = self.job.call(inputs) if inputs.en_r else self.job.check_loss() or EN_R_IS_0
        return got if isinstance(got, Outcome) else self._handle_loss(got)

    def _handle_loss(self, loss: ConnectionLoss) -> Outcome:
        return self._link.end_incarnation(self.job.end_by_loss(loss))
