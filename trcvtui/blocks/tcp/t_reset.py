"""T_RESET: reset a connection that stands (manual 7.15.7)."""

from __future__ import annotations

from collections import deque

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp import disconnect_reset as closing
from trcvtui.blocks.tcp.connection_control import set_up_failed
from trcvtui.blocks.tcp.tdiscon import IDLE, lit
from trcvtui.net.connection.connection import State


class TReset:
    """One T_RESET instance. What it has reset it builds anew, together with whoever else wants it."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._env = bound.env
        self._connection = bound.connection
        self._req = False
        self._rebuilds = False  # from a reset of its own until a connection stands
        self._script: deque[Outcome] = deque()

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 8000, 7003, 7007 with DONE, 7002, then how the connection stands: 7002, 7004."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._script:
            return self._script.popleft()
        if not rose or not self._connection.is_up:
            return self._view()
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of(fault))
        cause = Cause(Why.INPUT, "REQ rose", pin="REQ", value=1)
        shown = lit(closing.reset(self._connection, cause, self._env.rules.course.reset), self._script)
        self._script.append(_REBUILDING)
        self._rebuilds = True
        return shown

    def _view(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            self._rebuilds = False
            return IDLE
        failed = self._connection.step(self._env.scan, self._env.now) if self._rebuilds else None
        if failed is not None:
            return set_up_failed(self._connection, failed, self._env.rules.course)
        if not self._connection.is_up:
            return _REBUILDING if self._rebuilds else _DOWN
        self._rebuilds = False
        return _UP

    def stop(self, reason: str) -> None:
        """Forget what was still to be shown."""
        self._script.clear()

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""


_UP = Outcome(Condition.CONNECTED, Cause(Why.PARTNER, "a connection stands"), lasts=True)
_REBUILDING = Outcome(Condition.ESTABLISHING, Cause(Why.WAITING, "the connection is being built anew"))
_DOWN = Outcome(Condition.ESTABLISHING, Cause(Why.WAITING, "no connection stands"), lasts=True)
