"""TCON, TDISCON, T_RESET, TSEND, TRCV: a connection, block by block (manual 7.15.5 to 7.15.9)."""

from __future__ import annotations

from collections import deque

from msgspec.structs import replace

from trcvtui.blocks.block import Binding, JobBlock, ScriptBlock
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, Lamp, Outcome, Why, cause_of
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.compact_blocks import EN_R_IS_0
from trcvtui.blocks.tcp.connection_control import (
    ConnectionControl,
    Phase,
    set_up_failed,
    show_disconnect,
    show_reset,
)
from trcvtui.blocks.tcp.no_connection import CONNECTED, NO_LINK, KnownConnection, not_connected, show_loss
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.blocks.tcp.send_job import SendJob
from trcvtui.net.connection.connection import ConnectionLoss, State


class Tcon(ScriptBlock):
    """One TCON instance. Once triggered it connects again after each loss, until somebody disconnects."""

    def __init__(self, bound: Binding) -> None:
        super().__init__()
        self._bound = bound
        self._connection = bound.connection
        self._part = ConnectionControl(bound.env, bound.connection, bound.claim())
        self._triggered = False
        self._is_told = False  # DONE has told of this trigger

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, 7002, then 7004, with DONE for the first."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._was_disconnected():
            self._part.detach()
            self._part = ConnectionControl(self._bound.env, self._connection, self._bound.claim())
            self._triggered = False
        if rose and not self._triggered:
            self._triggered, self._is_told = True, False
        if not self._triggered:
            return _NOTHING_ASKED
        outcome = self._part.call(cont=True, com_rst=False)
        if outcome is None:
            return self._connected()
        if outcome.condition is Condition.CONNECTED and not self._is_told:
            self._is_told = True
            return replace(outcome, lamp=Lamp.DONE)
        return outcome

    def _was_disconnected(self) -> bool:
        begun = self._part.phase in (Phase.CONNECTING, Phase.CONNECTED)
        return self._triggered and begun and self._connection.state is State.CLOSED

    def _connected(self) -> Outcome:
        loss = self._connection.find_loss(self._part.incarnation) or self._connection.check_loss()
        if loss is None:
            return _UP
        outcomes = show_loss(loss, self._bound.env.rules, self.job, failed=None)
        return self._part.lost(outcomes, "the connection is gone")

    def detach(self, reason: str) -> None:
        self._part.detach()


_NOTHING_ASKED = Outcome(Condition.NO_JOB, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), stable=True)
_UP = Outcome(Condition.CONNECTED, Cause(Why.PARTNER, "the connection stands"), stable=True)


class Tdiscon(ScriptBlock):
    def __init__(self, bound: Binding) -> None:
        super().__init__()
        self._connection = bound.connection

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7003, 7007 with DONE. Also what only waits for its partner is freed."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._script:
            return self._script.popleft()
        if not rose or self._connection.state is State.CLOSED:
            return IDLE
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        cause = Cause(Why.INPUT, "REQ rose", pin="REQ", value=1)
        return lit(show_disconnect(self._connection, cause), self._script)


def lit(outcomes: list[Outcome], script: deque[Outcome]) -> Outcome:
    """Return the first outcome and put the others into the script: BUSY with all, DONE with the last."""
    if len(outcomes) == 1:
        return outcomes[0]  # a failure
    lamps = [Lamp.BUSY] * (len(outcomes) - 1) + [Lamp.DONE]
    script.extend(replace(outcome, lamp=lamp) for outcome, lamp in zip(outcomes, lamps, strict=True))
    return script.popleft()


# The manual's list has no other word for "called, nothing to do".
IDLE = Outcome(Condition.NOT_CALLED, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), stable=True)


class TReset(ScriptBlock):
    """One T_RESET instance. What it has reset it builds anew, together with other blocks that want it."""

    def __init__(self, bound: Binding) -> None:
        super().__init__()
        self._env = bound.env
        self._connection = bound.connection
        self._rebuilds = False  # from a reset of its own until a connection stands

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 8000, 7003, 7007 with DONE, 7002, then how the connection stands: 7002, 7004."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._script:
            return self._script.popleft()
        if not rose or not self._connection.is_up:
            return self._view()
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        cause = Cause(Why.INPUT, "REQ rose", pin="REQ", value=1)
        shown = lit(show_reset(self._connection, cause, self._env.rules.course.reset), self._script)
        self._script.append(_REBUILDING)
        self._rebuilds = True
        return shown

    def _view(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            self._rebuilds = False
            return IDLE
        failed = self._connection.step(self._env.scan, self._env.now) if self._rebuilds else None
        if failed is not None:
            return set_up_failed(self._connection, failed, self._env.rules.course)
        if not self._connection.is_up:
            return _REBUILDING if self._rebuilds else _DOWN
        self._rebuilds = False
        return _UP


_REBUILDING = Outcome(Condition.ESTABLISHING, Cause(Why.WAITING, "the connection is being built anew"))
_DOWN = Outcome(Condition.ESTABLISHING, Cause(Why.WAITING, "no connection stands"), stable=True)


class Tsend(JobBlock):
    def __init__(self, bound: Binding) -> None:
        self.job = SendJob(bound)
        self._connection = bound.connection
        self._link = KnownConnection(bound.connection)
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7004, 7005, 7009; an edge without a connection is 80A1."""
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        loss = self._link.lost()
        if loss is not None:
            return self._lost(loss, req_rose)
        shown = self._link.next_shown()
        if shown is not None and not req_rose:
            return shown
        self._link.is_new(self.job.claim)
        if self._link.is_known():
            return self._send(inputs, req_rose)
        return (
            not_connected("REQ", "REQ rose without a connection", self._connection) if req_rose else NO_LINK
        )

    def _send(self, inputs: Inputs, req_rose: bool) -> Outcome:
        got = self.job.call(inputs, req_rose)
        return got if isinstance(got, Outcome) else self._lost(got, req_rose)

    def _lost(self, loss: ConnectionLoss, req_rose: bool) -> Outcome:
        return self._link.end(self.job.show_loss(loss, asked=req_rose))


class Trcv(JobBlock):
    def __init__(self, bound: Binding) -> None:
        self.job = ReceiveJob(bound)
        self._connection = bound.connection
        self._link = KnownConnection(bound.connection)
        self._complaint: Outcome | None = None

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7004, 7006, 7008; EN_R without a connection is 80A1 in each scan."""
        if not inputs.en_r:
            self.job.abandon("EN_R fell")
            self.job.let_go()
        loss = self._link.lost(self.job.claim)
        if loss is not None:
            return self._lost(loss)
        show_loss = self._link.next_shown()
        if show_loss is not None:
            return show_loss
        if self._link.is_new(self.job.claim):
            return CONNECTED
        if self._link.is_known():
            return self._receive(inputs)
        if not inputs.en_r:
            return NO_LINK
        return self._not_connected()

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether this instance receives on the connection when its turn comes; asked by name."""
        return self.job.would_read(inputs, waits)

    def _not_connected(self) -> Outcome:
        """Return 80A1: the same object as long as the same partner is missing."""
        now = not_connected("EN_R", "EN_R is 1 without a connection", self._connection)
        if self._complaint is None or self._complaint.cause != now.cause:
            self._complaint = replace(now, stable=True)
        return self._complaint

    def _receive(self, inputs: Inputs) -> Outcome:
        got = self.job.call(inputs) if inputs.en_r else self.job.check_loss() or EN_R_IS_0
        return got if isinstance(got, Outcome) else self._lost(got)

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        return self._link.end(self.job.show_loss(loss))
