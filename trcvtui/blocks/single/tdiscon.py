"""TDISCON as a single instruction: close a connection and its endpoint (siemens.md 1.10, 2.6)."""

from __future__ import annotations

from collections import deque
from typing import Final

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import IDLE, NO_ENDPOINT, REQ_ROSE
from trcvtui.blocks.tcp import disconnect_reset as closing
from trcvtui.net.connection.connection import State

STILL_BUILT: Final = Cause(Why.OTHER_BLOCK, "the connection is still being built")


class Tdiscon:
    """One TDISCON instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._connection = bound.connection
        self._req = False
        self._script: deque[Outcome] = deque()

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with DONE; nothing to close is 80A3, not built yet 80C4."""
        rose, self._req = inputs.req and not self._req, inputs.req
        if self._script:
            shown = self._script.popleft()
            self._connection.set_up.is_closing = bool(self._script)
            return shown
        return self._begin() if rose else IDLE

    def stop(self, reason: str) -> None:
        """Forget what was still to be shown."""
        self._script.clear()
        self._connection.set_up.is_closing = False

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self.stop(reason)

    def _begin(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            return Outcome(Condition.ENDPOINT_GONE, NO_ENDPOINT)
        set_up = self._connection.set_up
        if not set_up.has_been_up:  # its TCON ends with this, a _C block goes on
            set_up.is_withdrawn = True
            return Outcome(Condition.NOT_NOW, STILL_BUILT)
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        ended = closing.disconnect(self._connection, REQ_ROSE)
        if ended[0].error:
            return ended[0]
        set_up.is_closing = True
        self._script.extend([Outcome(Condition.RUNNING, REQ_ROSE), Outcome(Condition.FINISHED, REQ_ROSE)])
        return Outcome(Condition.STARTED, REQ_ROSE)
