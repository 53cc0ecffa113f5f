"""USEND_C and URECV_C, which create the UDP socket that they use (manual 7.15.14, 7.15.15)."""

from __future__ import annotations

from collections import deque

from msgspec.structs import replace

from trcvtui.blocks.block import JobBlock
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import NEXT_REQ, Cause, CauseKind, Outcome, cause_of_fault
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.rules import PLAIN_SET_UP_CONDITIONS
from trcvtui.blocks.tcp.no_connection import StandingRequest
from trcvtui.blocks.udp.datagram_jobs import DatagramReceiveJob, DatagramSendJob, UdpBinding
from trcvtui.net.connection.udp import UdpEndpoint


class UdpControl:
    """Shows the phases of a socket on STATUS. `call` returns None when the job decides what shows."""

    def __init__(self, env: Environment, port: UdpEndpoint) -> None:
        self.cont = False
        self.waits = 0  # scans of "creating" since creating began
        self._env = env
        self._port = port
        self._incarnation = 0  # of the socket that this block works on, 0: of none
        self._held_back: Outcome | None = None
        self._script: deque[Outcome] = deque()
        self._is_late = False  # CONT rose while a close still showed

    def call(self, cont: bool) -> Outcome | None:
        """Return the outcome of this scan, or None if the socket is there and the job decides."""
        rose, fell = cont and not self.cont, self.cont and not cont
        self.cont = cont
        if fell and not self._is_late:
            return self._close()
        if self._script:  # a close that has begun ends first
            self._is_late = cont
            return self._script.popleft()
        if cont and (rose or self._is_late):
            return self._start()
        self._is_late = False
        return self._answer_while_wanted() if cont else NO_JOB

    def _start(self) -> Outcome:
        self._is_late = False
        if self._port.is_open:  # joins: 7001 without 0001
            return self._become_ready("another block has created the socket")
        self.waits = 1
        return Outcome(Condition.CREATING, Cause(CauseKind.INPUT, "CONT rose", pin="CONT", value=1))

    def _answer_while_wanted(self) -> Outcome | None:
        if self._incarnation and self._has_socket():
            held, self._held_back = self._held_back, None
            return held
        if self._incarnation:
            self._incarnation, self._held_back, self.waits = 0, None, 1  # no ERROR: it is made anew
            return _CLOSED_BY_ANOTHER
        failed = self._port.step(self._env.scan, self._env.now)
        if failed is not None:
            return Outcome(PLAIN_SET_UP_CONDITIONS[failed.stage, ""], cause_of_fault(failed.fault))
        if self._port.is_open:
            return self._become_ready("the socket is there")
        self.waits += 1
        return _WAITING

    def _has_socket(self) -> bool:
        return self._port.is_open and self._port.incarnation == self._incarnation

    def _become_ready(self, reason: str) -> Outcome:
        self._incarnation = self._port.incarnation
        return Outcome(Condition.CREATED, Cause(CauseKind.SEQUENCE, reason, detail=f"at {self._port.local}"))

    def hold_back(self, outcome: Outcome) -> None:
        """Show the first "created" one scan later: another code takes this scan."""
        if outcome.condition is Condition.CREATED:
            self._held_back = outcome

    def _close(self) -> Outcome:
        was_there = self._incarnation != 0 and self._has_socket()
        self._incarnation, self._held_back = 0, None
        self._script.clear()
        fault = self._port.close()
        if fault is not None:
            failed = Condition.POLL_DEL_FAILED if fault.call == "poll_del" else Condition.DISCONNECT_FAILED
            return Outcome(failed, cause_of_fault(fault))
        cause = Cause(CauseKind.INPUT, "CONT fell", pin="CONT", value=0)
        if was_there:  # without a socket 7003 alone
            self._script.append(Outcome(Condition.CLOSED, cause))
        return Outcome(Condition.CLOSING, cause)


NO_JOB = Outcome(Condition.NO_JOB, Cause(CauseKind.INPUT, "CONT is 0", pin="CONT", value=0), stable=True)
_WAITING = Outcome(Condition.CREATING, Cause(CauseKind.WAITING, "before the next attempt"))
_CLOSED_BY_ANOTHER = Outcome(
    Condition.CREATING, Cause(CauseKind.OTHER_BLOCK, "another block has closed the socket; it is made anew")
)


class UsendC(JobBlock):
    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramSendJob(bound)
        self._control = UdpControl(bound.env, bound.port)
        self._req = False
        self._edge = False  # an edge before the socket has not shown 80A1 yet

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, then 7005 and 7009 for each edge."""
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        outcome = self._control.call(inputs.cont)
        if outcome is not None:
            return self._answer_not_ready(inputs, outcome, req_rose)
        if self.job.running:
            return self.job.advance()
        return self.job.begin(inputs.len) if req_rose else _NEXT_REQ if self.job.number else NO_REQ

    def _answer_not_ready(self, inputs: Inputs, outcome: Outcome, req_rose: bool) -> Outcome:
        """Show 80A1 for an early edge of REQ, instead of the first 7001 or any 0001 after the first."""
        self.job.abandon(outcome.cause.name)
        self._edge = (self._edge or req_rose) and inputs.cont
        in_time = outcome.condition is Condition.CREATING and self._control.waits > 1
        if not self._edge or not (in_time or outcome.condition is Condition.CREATED):
            return outcome
        self._edge = False
        self._control.hold_back(outcome)
        return Outcome(
            Condition.NOT_CONNECTED,
            Cause(CauseKind.INPUT, "REQ rose before the socket was there", pin="REQ", value=1),
        )


NO_REQ = Outcome(Condition.CREATED, Cause(CauseKind.WAITING, "REQ has not risen", pin="REQ"), stable=True)
_NEXT_REQ = replace(NO_REQ, cause=NEXT_REQ)


class UrecvC(JobBlock):
    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramReceiveJob(bound)
        self._control = UdpControl(bound.env, bound.port)
        self._request = StandingRequest(bound.env.rules.not_connected)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, then 7006 and 7008 for each datagram as long as EN_R is 1."""
        self._request.update(inputs, cont_rose=inputs.cont and not self._control.cont)
        outcome = self._control.call(inputs.cont)
        if outcome is not None:
            return self._answer_not_ready(outcome)
        self._request.forget_edge()
        if inputs.en_r:
            return self.job.call(inputs.len)
        self.job.abandon("EN_R fell")
        self.job.release_direction()
        return EN_R_IS_0

    # -- 80A1: asked for data, no socket (0001 in the place of 7002) -----------------------------

    def _answer_not_ready(self, outcome: Outcome) -> Outcome:
        self.job.abandon(outcome.cause.name)
        if outcome.condition is Condition.CREATED:
            self._request.forget_edge()
        elif outcome.condition is Condition.CREATING and self._control.waits > 1 and self._request.use_edge():
            return _TOO_EARLY
        return outcome


EN_R_IS_0 = Outcome(Condition.CREATED, Cause(CauseKind.INPUT, "EN_R is 0", pin="EN_R", value=0), stable=True)
_TOO_EARLY = Outcome(
    Condition.NOT_CONNECTED,
    Cause(CauseKind.INPUT, "EN_R is 1 before the socket is there", pin="EN_R", value=1),
)
