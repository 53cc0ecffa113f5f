"""TSEND, TRCV, TUSEND, TURCV as single instructions (STEP 7 help)."""

from __future__ import annotations

from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.block import ConnectBinding, JobBlock
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.connect import IDLE, end_job, no_socket_outcome, with_condition
from trcvtui.blocks.tcp.job_checks import RepeatedFaultFilter, find_structure_error, target_error
from trcvtui.blocks.tcp.no_connection import KnownIncarnation, not_connected
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.blocks.tcp.send_job import SendJob
from trcvtui.blocks.udp.datagram_jobs import DatagramReceiveJob, DatagramSendJob, UdpBinding
from trcvtui.net.connection.connection import ConnectionLoss, State


class SingleTsend(JobBlock):
    needs_datagrams = False

    def __init__(self, bound: ConnectBinding) -> None:
        self.job = SendJob(bound, self.needs_datagrams)
        self._course = bound.env.rules.course
        self._connection = bound.connection
        self._link = KnownIncarnation(bound.connection)
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with DONE; an edge without a connection is 80A1."""
        rose, self._req = inputs.req and not self._req, inputs.req
        loss = self._link.find_loss()
        if loss is not None and self.job.running:
            return self._handle_loss(loss)
        if loss is not None:
            self._link.end_incarnation([])  # no job, no error
        self._link.adopt_new(self.job.claim)
        if self.job.running:
            return self._as_outcome(self.job.advance(), Condition.RUNNING)
        if not rose:
            return IDLE
        if not self._link.has_incarnation():
            return not_connected("REQ", "REQ rose without a connection", self._connection)
        return self._as_outcome(self.job.begin(inputs), Condition.STARTED)

    def _as_outcome(self, got: Outcome | ConnectionLoss, sending: Condition) -> Outcome:
        if isinstance(got, ConnectionLoss):
            return self._handle_loss(got)
        return with_condition(sending, got) if got.condition is Condition.SENDING else got

    def _handle_loss(self, loss: ConnectionLoss) -> Outcome:
        self._link.end_incarnation([])
        return end_job(loss, self.job, self._course, Condition.SEND_FAILED)


class TusendOnConnect(SingleTsend):
    needs_datagrams = True


class SingleTrcv(JobBlock):
    needs_datagrams = False

    def __init__(self, bound: ConnectBinding) -> None:
        self.job = ReceiveJob(bound, self.needs_datagrams)
        self._course = bound.env.rules.course
        self._connection = bound.connection
        self._link = KnownIncarnation(bound.connection)
        self._complaint: Outcome | None = None
        self._fault_filter = RepeatedFaultFilter(self._course.faults_once, Condition.NO_JOB)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with NDR; without a connection 80A1 or 80C4."""
        loss = self._link.find_loss(self.job.claim)
        if loss is not None and self.job.running:
            return self._handle_loss(loss)
        if loss is not None:
            self._link.end_incarnation([])  # no job, no error
        self._link.adopt_new(self.job.claim)
        if not inputs.en_r and not self.job.outlives_en_r():  # switch en_r_falls
            self.job.abandon("EN_R fell")
            self.job.release_direction()
            self._fault_filter.forget()
            return _EN_R_IS_0
        shown = self._receive(inputs) if self._link.has_incarnation() else self._no_link_outcome()
        return self._fault_filter.filter_outcome(shown, inputs)

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether the block's next call would receive; plc/instance.py finds this method by name."""
        return self.job.would_read(inputs, waits)

    def _receive(self, inputs: Inputs) -> Outcome:
        was_running = self.job.running
        got = self.job.call(inputs)
        if isinstance(got, ConnectionLoss):
            return self._handle_loss(got)
        if got.condition not in (Condition.RECEIVING, Condition.RECEIVING_PART):
            return got
        return with_condition(Condition.RUNNING if was_running else Condition.STARTED, got)

    def _handle_loss(self, loss: ConnectionLoss) -> Outcome:
        self._link.end_incarnation([])
        return end_job(loss, self.job, self._course, Condition.RECEIVE_FAILED)

    def _no_link_outcome(self) -> Outcome:
        """Return 80A1, or 80C4 while the connection is rebuilt."""
        now = not_connected("EN_R", "EN_R is 1 without a connection", self._connection)
        if self._connection.state is not State.CLOSED and self._course.still_asked:
            now = replace(now, condition=self._course.still_asked)
        known = self._complaint
        if known is None or (known.cause, known.condition) != (now.cause, now.condition):
            self._complaint = known = replace(now, stable=True)
        return known


class TurcvOnConnect(SingleTrcv):
    needs_datagrams = True


_EN_R_IS_0: Final = Outcome(
    Condition.NO_JOB, Cause(CauseKind.INPUT, "EN_R is 0", pin="EN_R", value=0), stable=True
)


# A UDP_CONFIG is like a connection that the CPU has established: its socket opens with the first call.


class Tusend(JobBlock):
    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramSendJob(bound)
        self._env = bound.env
        self._port = bound.port
        self._address = bound.address
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 0000 with DONE; an edge without a socket is 80A1."""
        rose, self._req = inputs.req and not self._req, inputs.req
        self._port.step(self._env.scan, self._env.now)
        if self.job.running:
            return self.job.advance()
        if not rose:
            return IDLE if self._port.is_open else _NO_SOCKET
        return self._begin(inputs.len)

    def _begin(self, length: int) -> Outcome:
        if not self._port.is_open:
            return no_socket_outcome(self._port, "REQ", "REQ rose without a socket")
        began = target_error(self._address) or self.job.begin(length)
        return with_condition(Condition.STARTED, began) if began.condition is Condition.SENDING else began


_NO_SOCKET = Outcome(Condition.NO_JOB, Cause(CauseKind.WAITING, "REQ has not risen", pin="REQ"))


class Turcv(JobBlock):
    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramReceiveJob(bound)
        self._env = bound.env
        self._port = bound.port
        self._unfit = find_structure_error(bound.address)
        self._course = bound.env.rules.course

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with NDR; without a socket 80A1."""
        self._port.step(self._env.scan, self._env.now)
        if not inputs.en_r and not (self.job.running and self._course.outlives_en_r(self.job.have > 0)):
            self.job.abandon("EN_R fell")
            self.job.release_direction()
            return _EN_R_IS_0_UNSTABLE
        if not self._port.is_open:
            return no_socket_outcome(self._port, "EN_R", "EN_R is 1 without a socket")
        was_running = self.job.running
        got = self._unfit or self.job.call(inputs.len)
        if got.condition is not Condition.RECEIVING:
            return got
        return with_condition(Condition.RUNNING if was_running else Condition.STARTED, got)


_EN_R_IS_0_UNSTABLE: Final = Outcome(
    Condition.NO_JOB, Cause(CauseKind.INPUT, "EN_R is 0", pin="EN_R", value=0)
)
