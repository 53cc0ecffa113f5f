"""TRCV_C and TSEND_C, which build the connection that they use (manual 7.15.1, 7.15.2)."""

from __future__ import annotations

from msgspec.structs import replace

from trcvtui.blocks.block import ConnectBinding, JobBlock
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Lamp, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.connection_control import BY_EN_R, BY_REQ, ConnectionControl, ConnectionDemand, Phase
from trcvtui.blocks.tcp.job_checks import RepeatedFaultFilter
from trcvtui.blocks.tcp.no_connection import StandingRequest, not_connected
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.blocks.tcp.send_job import NO_REQ, SendJob
from trcvtui.net.connection.connection import ConnectionLoss


class TrcvC(JobBlock):
    def __init__(self, bound: ConnectBinding) -> None:
        self.job = ReceiveJob(bound)
        self._connection = bound.connection
        has_addr, claim = bound.address is not None, bound.make_claim()
        self._inputs: Inputs | None = None
        self._begins = False  # JOB_BEGINS has shown: the job starts in this scan
        self._course = bound.env.rules.course
        self._fault_filter = RepeatedFaultFilter(self._course.faults_once, Condition.CONNECTED)
        self._cont = ConnectionDemand(BY_EN_R if self._course.request_connects else None)
        self._control = ConnectionControl(bound.env, bound.connection, claim, has_addr, self._cont)
        self._request = StandingRequest(bound.env.rules.not_connected)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in this order: inputs, connection, loss, data."""
        # The usual scan, in short: inputs and connection are as before, the job alone works.
        if inputs is self._inputs and self._control.is_steady() and not self._cont.is_due:
            return self._receive(inputs) if self._should_receive(inputs) else self._answer_idle(None)
        self._inputs = inputs
        self._request.update(inputs, cont_rose=inputs.cont and not self._control.cont)
        was_connected = self._control.phase is Phase.CONNECTED
        cont = self._cont.update(inputs.cont, self._has_request(inputs), self._control.is_closing)
        outcome = self._control.call(cont, inputs.com_rst, asks=inputs.en_r)
        if was_connected and self._control.phase is not Phase.CONNECTED:
            self._cont.latch_cont(inputs.cont)  # for the connection after the reset
        if outcome is not None:
            return self._answer_not_connected(inputs, outcome)
        return self._answer_connected(inputs)

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether the block's next call would receive; plc/instance.py finds this method by name."""
        return (inputs.cont or self._course.request_connects) and self.job.would_read(inputs, waits)

    def _should_receive(self, inputs: Inputs) -> bool:
        """Return whether the job may work: EN_R is 1, or a begun job may continue without EN_R."""
        return inputs.en_r or self.job.outlives_en_r(self._begins)

    def _has_request(self, inputs: Inputs) -> bool:
        waits = self._begins or self._control.phase is not Phase.CONNECTED
        return self._should_receive(inputs) and (self.job.running or waits)

    def detach(self, reason: str) -> None:
        self._control.detach()
        super().detach(reason)

    def _answer_not_connected(self, inputs: Inputs, outcome: Outcome) -> Outcome:
        self.job.abandon(outcome.cause.name)
        self._fault_filter.forget()
        condition = outcome.condition
        self._begins = condition is Condition.JOB_BEGINS and self.job.reserve(inputs)
        if condition is Condition.JOB_BEGINS:
            return self._control.first_scan_outcome(outcome, self._begins)
        if condition is Condition.CONNECTED:
            self._request.forget_edge()
        elif condition is Condition.ESTABLISHING and self._control.waits > 1 and self._request.use_edge():
            # 80A1 in the place of a 7002, never of the first (7.15.1); before any connection it is expected.
            shown = not_connected("EN_R", "EN_R is 1 without a connection", self._connection)
            return replace(shown, cause=replace(shown.cause, is_expected=not self._connection.incarnation))
        return outcome

    # -- connected ------------------------------------------------------------------------------------

    def _answer_connected(self, inputs: Inputs) -> Outcome:
        loss = self._connection.find_loss(self._control.incarnation, self.job.claim)
        if not self._should_receive(inputs):
            self.job.abandon("EN_R fell")
            return self._answer_idle(loss)
        if loss is not None:
            return self._handle_loss(loss)
        self._request.forget_edge()
        return self._receive(inputs)

    def _receive(self, inputs: Inputs) -> Outcome:
        self._begins = False
        got = self.job.call(inputs)
        if not isinstance(got, Outcome):
            return self._handle_loss(got)
        if got.condition is Condition.RECEIVED:
            self._cont.note_job_done()  # cont_mode manual: CONT = 0 ends the connection after data
        return self._fault_filter.filter_outcome(got, inputs) if self._course.faults_once else got

    def _answer_idle(self, loss: ConnectionLoss | None) -> Outcome:
        self.job.release_direction()
        self._fault_filter.forget()
        loss = loss or self.job.check_loss()
        return EN_R_IS_0 if loss is None else self._handle_loss(loss)

    def _handle_loss(self, loss: ConnectionLoss) -> Outcome:
        assert self._inputs is not None
        self._cont.latch_cont(self._inputs.cont)  # for the next connection
        return self._control.start_reconnecting(self.job.end_by_loss(loss), "the connection is gone")


EN_R_IS_0 = Outcome(
    Condition.CONNECTED, Cause(CauseKind.INPUT, "EN_R is 0", pin="EN_R", value=0), stable=True
)


class TsendC(JobBlock):
    def __init__(self, bound: ConnectBinding) -> None:
        self.job = SendJob(bound)
        self._connection = bound.connection
        has_addr, claim = bound.address is not None, bound.make_claim()
        self._course = bound.env.rules.course
        self._cont = ConnectionDemand(BY_REQ if self._course.request_connects else None)
        self._control = ConnectionControl(bound.env, bound.connection, claim, has_addr, self._cont)
        self._inputs: Inputs | None = None
        self._req = False
        self._shown = NO_REQ, NO_REQ  # the last outcome, without BUSY and with it
        self._edge = False  # an edge without a connection that has neither shown 80A1 nor sent

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in this order: inputs, connection, loss, data."""
        # The usual scan, in short: inputs and connection are as before, the job alone works.
        if inputs is self._inputs and self._control.is_steady() and not self._edge and not self._cont.is_due:
            return self._send(inputs, req_rose=False)
        self._inputs = inputs
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        if not self._course.request_connects:
            return self._answer(inputs, req_rose)
        if req_rose and not self._has_request():  # an edge before DONE or ERROR does not count
            self._edge = True
            self._cont.latch_cont(inputs.cont)
            self._cont.note_job_done()
        return self._with_busy(self._answer(inputs, req_rose=False))

    def _answer(self, inputs: Inputs, req_rose: bool) -> Outcome:
        cont = self._cont.update(inputs.cont, self._has_request(), self._control.is_closing)
        if cont and not self._control.cont and self._course.waiting_req_sends:
            # REQ = 1 sends on each connection that CONT builds, even after a DONE (FAQ, figure 2).
            self._edge |= inputs.req and not self._course.request_connects
        asks = self._edge or req_rose
        waits = self._course.waiting_req_sends and (inputs.req or self._course.request_connects) and asks
        job_error = self._course.reset_ends_send if self.job.running else None
        outcome = self._control.call(cont, inputs.com_rst, asks=waits, job_error=job_error)
        if outcome is not None:
            return self._answer_not_connected(inputs, outcome, req_rose)
        loss = self._connection.find_loss(self._control.incarnation)
        if self._course.waiting_req_sends:
            req_rose, self._edge = req_rose or self._edge, False
        return self._send(inputs, req_rose) if loss is None else self._handle_loss(loss, req_rose)

    def _has_request(self) -> bool:
        return self._edge or self.job.running

    def _with_busy(self, outcome: Outcome) -> Outcome:
        if not self._has_request() or outcome.busy or outcome.done or outcome.error:
            return outcome
        if self._shown[0] is not outcome:
            self._shown = outcome, replace(outcome, lamp=Lamp.BUSY)
        return self._shown[1]

    def detach(self, reason: str) -> None:
        self._control.detach()
        super().detach(reason)

    # -- 80A1: asked for data, not connected -------------------------------------

    def _answer_not_connected(self, inputs: Inputs, outcome: Outcome, req_rose: bool) -> Outcome:
        self.job.abandon(outcome.cause.name)
        if outcome.condition is Condition.JOB_BEGINS:
            outcome = self._control.first_scan_outcome(outcome, self.job.reserve(inputs))
        if self._course.waiting_req_sends:
            return self._keep_request(inputs, outcome, req_rose)
        self._edge = (self._edge or req_rose) and inputs.cont
        if not self._edge or not self._may_show_not_connected(outcome):
            return outcome
        self._edge = False
        self._control.hold_back(outcome)
        return not_connected("REQ", "REQ rose without a connection", self._connection)

    def _keep_request(self, inputs: Inputs, outcome: Outcome, req_rose: bool) -> Outcome:
        """Remember an edge of REQ until the connection is up. REQ must stay 1 unless `request_connects`."""
        if self._course.request_connects:
            self._edge = self._edge and not outcome.error
        else:
            self._edge = (self._edge or req_rose) and inputs.req
        if outcome.condition is Condition.RESET_IN_JOB:
            self._cont.keep_connection()  # COM_RST has ended the job, and the connection is rebuilt
        return outcome

    def _may_show_not_connected(self, outcome: Outcome) -> bool:
        """Return whether 80A1 may replace this code: a 7002 after the first 7002, or the first 7004.

        Each early edge of REQ shows 80A1 (7.15.2), so the first 7004 may come one scan later.
        """
        if outcome.condition is Condition.ESTABLISHING:
            return self._control.waits > 1
        return outcome.condition is Condition.CONNECTED

    # -- connected ------------------------------------------------------------------------------------

    def _send(self, inputs: Inputs, req_rose: bool) -> Outcome:
        got = self.job.call(inputs, req_rose)
        return got if isinstance(got, Outcome) else self._handle_loss(got, req_rose)

    def _handle_loss(self, loss: ConnectionLoss, req_rose: bool) -> Outcome:
        was_asked = req_rose or self.job.running
        shown = self.job.end_by_loss(loss, asked=req_rose)
        outcome = self._control.start_reconnecting(shown, "the connection is gone")
        if self._course.request_connects:
            self._edge = was_asked and not outcome.error  # BUSY until the error that ends it
        else:
            # A close by our side shows no ERROR: the edge still has to show its 80A1.
            self._edge = req_rose and not shown and not self._course.waiting_req_sends
        return outcome
