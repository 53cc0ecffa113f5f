"""T_RESET as a single instruction: drop a connection and build it again (siemens.md 1.10, 2.6)."""

from __future__ import annotations

from collections import deque

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import IDLE, NO_ENDPOINT, REQ_ROSE
from trcvtui.blocks.tcp import disconnect_reset as closing
from trcvtui.net.connection.connection import State


class TReset:
    """One T_RESET instance. The endpoint stays; whoever keeps the connection builds it again."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._course = bound.env.rules.course
        self._connection = bound.connection
        self._req = False
        self._script: deque[Outcome] = deque()

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with DONE; nothing established is 0001 with DONE."""
        rose, self._req = inputs.req and not self._req, inputs.req
        if self._script:
            return self._script.popleft()
        return self._begin() if rose else IDLE

    def stop(self, reason: str) -> None:
        """Forget what was still to be shown."""
        self._script.clear()

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""

    def _begin(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            return Outcome(Condition.ENDPOINT_GONE, NO_ENDPOINT)
        if not self._connection.is_up:
            return Outcome(Condition.NOTHING_TO_RESET, REQ_ROSE)
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        ended = closing.reset(self._connection, REQ_ROSE, (Condition.STARTED,))
        if not ended[0].error:
            running, finished = Outcome(Condition.RUNNING, REQ_ROSE), Outcome(Condition.FINISHED, REQ_ROSE)
            self._script.extend([running, finished])
        return ended[0]
