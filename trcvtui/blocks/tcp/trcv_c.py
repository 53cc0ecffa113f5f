"""TRCV_C: build a connection and receive on it (manual 7.15.1)."""

from __future__ import annotations

from trcvtui.blocks.block import Binding
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.connection_control import ConnectionPart, Phase
from trcvtui.blocks.tcp.fault_repeat import ToldOnce
from trcvtui.blocks.tcp.not_connected import StandingRequest, not_connected
from trcvtui.blocks.tcp.one_shot_cont import BY_EN_R, ContLevel
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.net.connection.connection import ConnectionLoss


class TrcvC:
    """One TRCV_C instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = ReceiveJob(bound)
        self._connection = bound.connection
        has_addr = bound.address is not None
        self._inputs: Inputs | None = None
        self._begins = False  # the job has had its first scan, and starts in this one
        self._course = bound.env.rules.course
        self._told = ToldOnce(self._course.faults_once, Condition.CONNECTED)
        self._cont = ContLevel(BY_EN_R if self._course.request_connects else None)
        self._part = ConnectionPart(bound.env, bound.connection, bound.claim(), has_addr, self._cont)
        self._request = StandingRequest(bound.env.rules.not_connected)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in the order of design 6, row 24: inputs, connection, loss, data."""
        # The usual scan, in short.
        if inputs is self._inputs and self._part.stands() and not self._cont.is_due:
            return self._receive(inputs) if self._goes_on(inputs) else self._idle(None)
        self._inputs = inputs
        self._request.see(inputs, cont_rose=inputs.cont and not self._part.cont)
        stood = self._part.phase is Phase.CONNECTED
        cont = self._cont.level(inputs.cont, self._is_asked(inputs), self._part.is_closing)
        outcome = self._part.call(cont, inputs.com_rst, asks=inputs.en_r)
        if stood and self._part.phase is not Phase.CONNECTED:
            self._cont.count(inputs.cont)  # a reset begins it anew
        if outcome is not None:
            return self._while_not_receiving(inputs, outcome)
        return self._connected(inputs)

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether this instance receives on the connection when its turn comes; see `Reader`."""
        return (inputs.cont or self._course.request_connects) and self.job.would_read(inputs, waits)

    def _goes_on(self, inputs: Inputs) -> bool:
        """Return whether the job has this scan: EN_R is 1, or a job that has begun outlives it."""
        return inputs.en_r or self.job.outlives_en_r(self._begins)

    def _is_asked(self, inputs: Inputs) -> bool:
        """Return whether a job runs, or EN_R waits for a connection."""
        waits = self._begins or self._part.phase is not Phase.CONNECTED
        return self._goes_on(inputs) and (self.job.running or waits)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self._part.leave()
        self.job.leave(reason)

    def _while_not_receiving(self, inputs: Inputs, outcome: Outcome) -> Outcome:
        self.job.abandon(outcome.cause.name)
        self._told.forget()
        self._begins = outcome.condition is Condition.JOB_BEGINS and self.job.reserve(inputs)
        if outcome.condition is Condition.JOB_BEGINS:
            return self._part.first_scan(outcome, self._begins)
        if outcome.condition is Condition.CONNECTED:
            self._request.answered()
        elif outcome.condition is Condition.ESTABLISHING and self._part.waits > 1 and self._request.is_told():
            return not_connected("EN_R", "EN_R is 1 without a connection", self._connection)  # row 3
        return outcome

    # -- connected ------------------------------------------------------------------------------------

    def _connected(self, inputs: Inputs) -> Outcome:
        loss = self._connection.lost(self._part.incarnation, self.job.claim)
        if not self._goes_on(inputs):
            self.job.abandon("EN_R fell")
            return self._idle(loss)
        if loss is not None:
            return self._lost(loss)
        self._request.answered()
        return self._receive(inputs)

    def _receive(self, inputs: Inputs) -> Outcome:
        self._begins = False
        got = self.job.call(inputs)
        if not isinstance(got, Outcome):
            return self._lost(got)
        if got.condition is Condition.RECEIVED:
            self._cont.served()
        return self._told.shown(got, inputs) if self._course.faults_once else got

    def _idle(self, loss: ConnectionLoss | None) -> Outcome:
        self.job.let_go()
        self._told.forget()
        loss = loss or self.job.check_loss()
        return READY if loss is None else self._lost(loss)

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        assert self._inputs is not None
        self._cont.count(self._inputs.cont)  # the connection is begun anew
        return self._part.lost(self.job.shown(loss), "the connection is gone")


READY = Outcome(Condition.CONNECTED, Cause(Why.INPUT, "EN_R is 0", pin="EN_R", value=0), lasts=True)
