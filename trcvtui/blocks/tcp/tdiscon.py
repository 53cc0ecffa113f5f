"""TDISCON: close a connection and its listener (manual 7.15.6)."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Lamp, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp import disconnect_reset as closing
from trcvtui.net.connection.connection import State


class Tdiscon:
    """One TDISCON instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._connection = bound.connection
        self._req = False
        self._script: deque[Outcome] = deque()

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7003, 7007 with DONE. Also what only waits for its partner is freed."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._script:
            return self._script.popleft()
        if not rose or self._connection.state is State.CLOSED:
            return IDLE
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        cause = Cause(Why.INPUT, "REQ rose", pin="REQ", value=1)
        return lit(closing.disconnect(self._connection, cause), self._script)

    def stop(self, reason: str) -> None:
        """Forget what was still to be shown."""
        self._script.clear()

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""


def lit(outcomes: list[Outcome], script: deque[Outcome]) -> Outcome:
    """Return the first outcome and put the others into the script: BUSY with all, DONE with the last."""
    if len(outcomes) == 1:
        return outcomes[0]  # a failure
    lamps = [Lamp.BUSY] * (len(outcomes) - 1) + [Lamp.DONE]
    script.extend(replace(outcome, lamp=lamp) for outcome, lamp in zip(outcomes, lamps, strict=True))
    return script.popleft()


# The manual's list has no other word for "called, nothing to do" (baosky.md section 5).
IDLE = Outcome(Condition.NOT_CALLED, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), lasts=True)
