"""TRCV_C: build a connection and receive on it (manual 7.15.1)."""

from __future__ import annotations

from trcvtui.blocks.block import Binding
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.connection_part import ConnectionPart
from trcvtui.blocks.cont_level import ContLevel
from trcvtui.blocks.inputs import Inputs
from trcvtui.blocks.not_connected import StandingRequest, not_connected
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.receive_job import ReceiveJob
from trcvtui.net.connection_loss import ConnectionLoss


class TrcvC:
    """One TRCV_C instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = ReceiveJob(bound)
        self._connection = bound.connection
        self._part = ConnectionPart(bound.env, bound.connection, bound.address is not None)
        self._inputs: Inputs | None = None
        self._course = bound.env.rules.course
        self._cont = ContLevel(self._course.one_shot)
        self._request = StandingRequest(bound.env.rules.not_connected)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in the order of design 6, row 24: inputs, connection, loss, data."""
        # The usual scan, in short.
        if inputs is self._inputs and self._part.stands() and not self._course.one_shot:
            return self._receive(inputs) if self._goes_on(inputs) else self._idle(None)
        self._inputs = inputs
        self._request.see(inputs, cont_rose=inputs.cont and not self._part.cont)
        cont = self._cont.level(inputs.cont, inputs.en_r, self.job.running)
        outcome = self._part.call(cont, inputs.com_rst, asks=inputs.en_r)
        if outcome is not None:
            return self._while_not_receiving(outcome)
        return self._connected(inputs)

    def _goes_on(self, inputs: Inputs) -> bool:
        """Return whether the job has this scan: EN_R is 1, or a job that runs outlives it."""
        return inputs.en_r or (self.job.running and self._course.en_r_keeps_job)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self.job.leave(reason)

    def _while_not_receiving(self, outcome: Outcome) -> Outcome:
        self.job.abandon(outcome.cause.name)
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
            self.job.let_go()
            return self._idle(loss)
        if loss is not None:
            return self._lost(loss)
        self._request.answered()
        return self._receive(inputs)

    def _receive(self, inputs: Inputs) -> Outcome:
        got = self.job.call(inputs)
        return got if isinstance(got, Outcome) else self._lost(got)

    def _idle(self, loss: ConnectionLoss | None) -> Outcome:
        loss = loss or self.job.check_loss()
        return READY if loss is None else self._lost(loss)

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        return self._part.lost(self.job.shown(loss), "the connection is gone")


READY = Outcome(Condition.CONNECTED, Cause(Why.INPUT, "EN_R is 0", pin="EN_R", value=0), lasts=True)
