"""TCON as a single instruction: one attempt for each edge, then the endpoint stays (siemens.md 1.10, 2.3)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import IDLE, REQ_ROSE
from trcvtui.blocks.tcp.connection_control import established, set_up_failed
from trcvtui.blocks.tcp.job_checks import in_use, rival_of
from trcvtui.blocks.tcp.loss_status import loss_cause
from trcvtui.net.connection.connection import LossKind, State
from trcvtui.net.connection.set_up import SetUpStage, StepFault

IS_THERE: Final = Cause(Why.INPUT, "REQ rose, and the connection is there", pin="REQ", value=1)
STILL_CLOSED: Final = Cause(Why.OTHER_BLOCK, "TDISCON is still closing the connection")


class Tcon:
    """One TCON instance. What it has once established it builds again after each loss (siemens.md 4.4)."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._env = bound.env
        self._connection = bound.connection
        self._claim = bound.claim()
        self._req = False
        self._is_building = False
        self._incarnation = 0  # the newest one that it has seen
        self._keeps = False  # established by this instance: the endpoint is there until TDISCON or T_RESET

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with DONE; an attempt that fails ends the job."""
        rose, self._req = inputs.req and not self._req, inputs.req
        if self._connection.state is State.CLOSED:
            self._keeps = False
        if self._is_building:
            return self._go_on()
        if rose:
            return self._begin()
        if self._keeps:
            return self._look_after()
        return IDLE

    def stop(self, reason: str) -> None:
        """Forget the attempt."""
        self._is_building = self._keeps = False

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self._connection.keeping.give_back(self._claim)

    def _begin(self) -> Outcome:
        rival = rival_of(self._env, self._connection, self._claim)
        if rival is not None:
            return Outcome(Condition.CONNECT_IN_USE, in_use(rival, self._claim))
        if self._connection.set_up.is_closing:
            return Outcome(Condition.NOT_NOW, STILL_CLOSED)
        if self._connection.state is not State.CLOSED:
            return self._refused()
        fault = self._connection.open()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        self._is_building = True
        self._connection.keeping.hold(self._claim)
        return Outcome(Condition.STARTED, REQ_ROSE)

    def _refused(self) -> Outcome:
        """Return why there can be no endpoint, while a _C block asks for it in vain, or that it is there."""
        failed = self._connection.set_up.judge_description()
        if failed is not None:
            return set_up_failed(self._connection, failed, self._env.rules.course)
        return Outcome(Condition.ENDPOINT_THERE, IS_THERE)

    def _go_on(self) -> Outcome:
        if self._connection.set_up.is_withdrawn or self._connection.state is State.CLOSED:  # TDISCON, CONT
            self._end()
            self._connection.disconnect()
            return Outcome(Condition.RESET_IN_JOB, Cause(Why.OTHER_BLOCK, "closed before it was established"))
        failed = self._connection.step(self._env.scan, self._env.now)
        if failed is not None and self._is_silent(failed):
            return _BUILDING
        if failed is not None:
            self._end()
            shown = set_up_failed(self._connection, failed, self._env.rules.course)
            self._connection.disconnect()
            return shown
        if not self._connection.is_up:
            return _BUILDING
        self._end()
        self._keeps, self._incarnation = True, self._connection.incarnation
        return Outcome(Condition.FINISHED, established(self._connection))

    def _end(self) -> None:
        self._is_building = False
        self._connection.keeping.give_back(self._claim)

    def _is_silent(self, failed: StepFault) -> bool:
        return self._env.rules.course.silent_connect and failed.stage is SetUpStage.CONNECT

    def _look_after(self) -> Outcome:
        """Build a lost connection again; a partner who refuses us has let this attempt fail."""
        loss = self._connection.lost(self._incarnation) or self._connection.check_loss()
        course = self._env.rules.course
        if loss is not None and loss.fault and loss.kind is LossKind.REFUSED and not course.silent_connect:
            self._keeps = False
            self._connection.disconnect()
            return Outcome(course.of_set_up(SetUpStage.CONNECT, loss.fault.error), loss_cause(loss, self.job))
        if self._connection.is_up:
            self._incarnation = self._connection.incarnation
        else:
            self._connection.step(self._env.scan, self._env.now)
        return _KEEPING


_BUILDING = Outcome(Condition.RUNNING, Cause(Why.WAITING, "no partner yet"))
_KEEPING = Outcome(Condition.NO_JOB, Cause(Why.WAITING, "established; REQ has not risen", pin="REQ"))
