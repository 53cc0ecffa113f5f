"""TSEND_C: build a connection and send on it (manual 7.15.2)."""

from __future__ import annotations

from dataclasses import replace

from trcvtui.blocks.block import Binding
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Lamp, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.connection_control import ConnectionPart
from trcvtui.blocks.tcp.not_connected import not_connected
from trcvtui.blocks.tcp.one_shot_cont import BY_REQ, ContLevel
from trcvtui.blocks.tcp.send_job import SendJob
from trcvtui.net.connection.connection import ConnectionLoss


class TsendC:
    """One TSEND_C instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = SendJob(bound)
        self._connection = bound.connection
        has_addr = bound.address is not None
        self._course = bound.env.rules.course
        self._cont = ContLevel(BY_REQ if self._course.request_connects else None)
        self._part = ConnectionPart(bound.env, bound.connection, bound.claim(), has_addr, self._cont)
        self._inputs: Inputs | None = None
        self._req = False
        self._shown = READY, READY  # without BUSY, and with it
        self._asked = False  # an edge that came without a connection, not yet told or served

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in the order of design 6, row 24: inputs, connection, loss, data."""
        # The usual scan, in short.
        if inputs is self._inputs and self._part.stands() and not self._asked and not self._cont.is_due:
            return self._send(inputs, req_rose=False)
        self._inputs = inputs
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        if not self._course.request_connects:
            return self._answer(inputs, req_rose)
        if req_rose and not self._is_asked():  # an edge until DONE or ERROR is none
            self._asked = True
            self._cont.count(inputs.cont)
            self._cont.served()
        return self._busy(self._answer(inputs, req_rose=False))

    def _answer(self, inputs: Inputs, req_rose: bool) -> Outcome:
        cont = self._cont.level(inputs.cont, self._is_asked(), self._part.is_closing)
        if cont and not self._part.cont and self._course.waiting_req_sends:
            # A new connection: also a REQ that has had its DONE on the old one, unless REQ itself connects.
            self._asked |= inputs.req and not self._course.request_connects
        asks = self._asked or req_rose
        waits = self._course.waiting_req_sends and (inputs.req or self._course.request_connects) and asks
        outcome = self._part.call(cont, inputs.com_rst, asks=waits, job_error=self._reset_error())
        if outcome is not None:
            return self._while_not_sending(inputs, outcome, req_rose)
        loss = self._connection.lost(self._part.incarnation)
        if self._course.waiting_req_sends:
            req_rose, self._asked = req_rose or self._asked, False
        return self._send(inputs, req_rose) if loss is None else self._lost(loss, req_rose)

    def _is_asked(self) -> bool:
        """Return whether an edge has not had its DONE or ERROR."""
        return self._asked or self.job.running

    def _busy(self, outcome: Outcome) -> Outcome:
        """Return the outcome with BUSY from the edge to DONE or ERROR; the same object for the same one."""
        if not self._is_asked() or outcome.busy or outcome.done or outcome.error:
            return outcome
        if self._shown[0] is not outcome:
            self._shown = outcome, replace(outcome, lamp=Lamp.BUSY)
        return self._shown[1]

    def _reset_error(self) -> Condition | None:
        return self._course.reset_ends_send if self.job.running else None

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self._part.leave()
        self.job.leave(reason)

    # -- 80A1: asked for data, not connected (design 6, row 4) -------------------------------------

    def _while_not_sending(self, inputs: Inputs, outcome: Outcome, req_rose: bool) -> Outcome:
        self.job.abandon(outcome.cause.name)
        if outcome.condition is Condition.JOB_BEGINS:
            outcome = self._part.first_scan(outcome, self.job.reserve(inputs))
        if self._course.waiting_req_sends:
            return self._keep_asking(inputs, outcome, req_rose)
        self._asked = (self._asked or req_rose) and inputs.cont
        if not self._asked or not self._may_complain(outcome):
            return outcome
        self._asked = False
        self._part.hold_back(outcome)
        return not_connected("REQ", "REQ rose without a connection", self._connection)

    def _keep_asking(self, inputs: Inputs, outcome: Outcome, req_rose: bool) -> Outcome:
        """Remember a REQ that stays 1: it sends when the connection is up; one that falls before is lost.

        An edge that connects by itself is kept, whatever REQ does behind it.
        """
        if self._course.request_connects:
            self._asked = self._asked and not outcome.error
        else:
            self._asked = (self._asked or req_rose) and inputs.req
        if outcome.condition is Condition.RESET_IN_JOB:
            self._cont.goes_on()
        return outcome

    def _may_complain(self, outcome: Outcome) -> bool:
        """Return whether 80A1 may take this scan: the second 7002 and later, or the first 7004.

        An edge is never lost without a word, so the 7004 waits for it by one scan.
        """
        if outcome.condition is Condition.ESTABLISHING:
            return self._part.waits > 1
        return outcome.condition is Condition.CONNECTED

    # -- connected ------------------------------------------------------------------------------------

    def _send(self, inputs: Inputs, req_rose: bool) -> Outcome:
        if self.job.running:
            got = self.job.go_on()
        elif req_rose:
            got = self.job.begin(inputs)
        else:
            got = self.job.check_loss() or READY
        return got if isinstance(got, Outcome) else self._lost(got, req_rose)

    def _lost(self, loss: ConnectionLoss, req_rose: bool) -> Outcome:
        was_asked = req_rose or self.job.running
        shown = self.job.shown(loss, asked=req_rose)
        outcome = self._part.lost(shown, "the connection is gone")
        if self._course.request_connects:
            self._asked = was_asked and not outcome.error  # BUSY until the error that ends it
        else:
            # Closed on our side shows no error that would tell the edge.
            self._asked = req_rose and not shown and not self._course.waiting_req_sends
        return outcome


READY = Outcome(Condition.CONNECTED, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), lasts=True)
