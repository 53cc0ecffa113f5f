"""TRCV_C: build a connection and receive on it (manual 7.15.1)."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.connection_part import ConnectionPart, cause_of
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.receive_job import ReceiveJob
from trcvtui.blocks.rules import NotConnected
from trcvtui.net.connection import Connection, ConnectionLoss, LossKind


@dataclass(frozen=True, slots=True)
class TrcvCInputs:
    """The inputs of one call; `len` in bytes, 0 = size of DATA."""

    en_r: bool = False
    cont: bool = False
    len: int = 0
    adhoc: bool = False
    com_rst: bool = False


class TrcvC:
    """One TRCV_C instance."""

    def __init__(
        self, env: Environment, connection: Connection, data: DataArea | None, instance: str
    ) -> None:
        self.data = data
        self.connection = connection
        self.job = ReceiveJob(env, connection, instance)
        self._env = env
        self._part = ConnectionPart(env, connection)
        self._inputs: TrcvCInputs | None = None
        self._en_r = False
        self._armed = False

    def call(self, inputs: TrcvCInputs) -> Outcome:
        """Answer one call, in the order of design 6, row 24: inputs, connection, loss, data."""
        if inputs is self._inputs and self._part.stands():  # the usual scan, in short
            return self._receive(inputs) if inputs.en_r else self._idle(None)
        self._inputs = inputs
        cont_rose = inputs.cont and not self._part.cont
        self._arm(inputs, cont_rose)
        outcome = self._part.call(inputs.cont, inputs.com_rst)
        if outcome is not None:
            return self._while_not_receiving(inputs, outcome)
        return self._connected(inputs)

    # -- 80A1: asked for data, not connected (design 6, row 3) -------------------------------------

    def _arm(self, inputs: TrcvCInputs, cont_rose: bool) -> None:
        en_r_rose = inputs.en_r and not self._en_r
        self._en_r = inputs.en_r
        if not (inputs.en_r and inputs.cont):
            self._armed = False
        elif en_r_rose or cont_rose:
            self._armed = True

    def _while_not_receiving(self, inputs: TrcvCInputs, outcome: Outcome) -> Outcome:
        self.job.abandon(outcome.cause.name)
        if outcome.condition is Condition.CONNECTED:
            self._armed = False
        elif outcome.condition is Condition.ESTABLISHING and self._part.waits > 1:  # from the second 7002 on
            return self._complain(inputs, outcome)
        return outcome

    def _complain(self, inputs: TrcvCInputs, waiting: Outcome) -> Outcome:
        rule = self._env.rules.not_connected
        if rule is NotConnected.NEVER or not inputs.en_r:
            return waiting
        if rule is NotConnected.PULSE and not self._armed:
            return waiting
        self._armed = False
        cause = Cause(
            Why.INPUT, "EN_R is 1 without a connection", pin="EN_R", value=1, peer=waiting.cause.peer
        )
        return Outcome(Condition.NOT_CONNECTED, cause)

    # -- connected ------------------------------------------------------------------------------------

    def _connected(self, inputs: TrcvCInputs) -> Outcome:
        loss = self.connection.lost(self._part.incarnation)
        if not inputs.en_r:
            self.job.abandon("EN_R fell")
            self.job.let_go()
            return self._idle(loss)
        return self._receive(inputs) if loss is None else self._lost(loss)

    def _receive(self, inputs: TrcvCInputs) -> Outcome:
        job = self.job
        if not job.running:
            return self._start(inputs)
        if not job.complete:
            loss = job.collect()
            if loss is not None:
                return self._lost(loss)
            if not job.complete:
                return job.receiving()
        assert self.data is not None
        return job.deliver(self.data)

    def _start(self, inputs: TrcvCInputs) -> Outcome:
        refused = self.job.refuse(self.data, inputs.len)
        if refused is not None:
            loss = self.job.check_loss()
            return refused if loss is None else self._lost(loss)
        assert self.data is not None
        self.job.start(self.data, inputs.len, inputs.adhoc)
        loss = self.job.collect()
        return self.job.receiving() if loss is None else self._lost(loss)

    def _idle(self, loss: ConnectionLoss | None) -> Outcome:
        loss = loss or self.job.check_loss()
        return _READY if loss is None else self._lost(loss)

    # -- the connection is gone (design 6, rows 7 to 10, 22, 23) ------------------------------------

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        shown = self._shown(loss)
        self.job.abandon("connection lost")
        return self._part.lost(shown, "the connection is gone")

    def _shown(self, loss: ConnectionLoss) -> list[Outcome]:
        """Return what a loss shows, one scan each; nothing without a job, but 80AB and a failed release."""
        cause = _cause(loss, self.job)
        shown = []
        if loss.kind is LossKind.LINK_DEAD:
            shown.append(Outcome(Condition.LINK_DEAD, cause))
        elif self.job.running and loss.kind is not LossKind.OURS:
            shown = self._shown_by_job(loss, cause)
        if loss.release_fault is not None:
            shown[-1:] = [Outcome(Condition.POLL_DEL_FAILED, cause_of(loss.release_fault, loss.peer))]
        return shown

    def _shown_by_job(self, loss: ConnectionLoss, cause: Cause) -> list[Outcome]:
        rules = self._env.rules
        if loss.kind is LossKind.RESET_BY_PARTNER and not rules.reset_counts_as_close:
            return [Outcome(Condition.RECEIVE_FAILED, cause)]
        if loss.kind is LossKind.FAILED:
            return [Outcome(Condition.RECEIVE_FAILED, cause)]
        shown = [Outcome(Condition.PARTNER_CLOSED, cause)]
        if self.job.have and not self.job.adhoc and rules.short_frame_shown:
            shown.insert(0, Outcome(Condition.SHORT_FRAME, cause))
        return shown


_READY = Outcome(Condition.CONNECTED, Cause(Why.INPUT, "EN_R is 0", pin="EN_R", value=0), lasts=True)

_FIN_CALL = {LossKind.CLOSED_BY_PARTNER: "recv"}  # it answered 0 bytes: no errno

_LOSS_NAMES = {
    LossKind.CLOSED_BY_PARTNER: "the partner closed",
    LossKind.RESET_BY_PARTNER: "the partner reset",
    LossKind.LINK_DEAD: "the link is dead",
    LossKind.FAILED: "the connection failed",
    LossKind.OURS: "closed on our side",
}


def _cause(loss: ConnectionLoss, job: ReceiveJob) -> Cause:
    fault = loss.fault
    return Cause(
        Why.OTHER_BLOCK if loss.kind is LossKind.OURS else Why.PARTNER if fault is None else Why.KERNEL,
        _LOSS_NAMES[loss.kind],
        call=fault.call if fault else _FIN_CALL.get(loss.kind, ""),
        error=fault.error if fault else "",
        injected=fault.injected if fault else False,
        peer=loss.peer,
        have=job.have if job.running else None,
        need=job.need if job.running else None,
    )
