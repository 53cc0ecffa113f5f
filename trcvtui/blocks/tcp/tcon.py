"""TCON: build a connection and keep it (manual 7.15.5)."""

from __future__ import annotations

from dataclasses import replace

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Lamp, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.connection_control import ConnectionPart, Phase
from trcvtui.blocks.tcp.loss_status import shown
from trcvtui.net.connection.connection import State


class Tcon:
    """One TCON instance. Once triggered it connects again after each loss, until somebody disconnects."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._bound = bound
        self._connection = bound.connection
        self._part = ConnectionPart(bound.env, bound.connection, bound.claim())
        self._req = False
        self._triggered = False
        self._is_told = False  # DONE has shown for this trigger

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 0001, 7001, 7002, then 7004, with DONE for the first."""
        rose = inputs.req and not self._req
        self._req = inputs.req
        if self._was_disconnected():
            self._part.leave()
            self._part = ConnectionPart(self._bound.env, self._connection, self._bound.claim())
            self._triggered = False
        if rose and not self._triggered:
            self._triggered, self._is_told = True, False
        if not self._triggered:
            return _IDLE
        outcome = self._part.call(cont=True, com_rst=False)
        if outcome is None:
            return self._connected()
        if outcome.condition is Condition.CONNECTED and not self._is_told:
            self._is_told = True
            return replace(outcome, lamp=Lamp.DONE)
        return outcome

    def _was_disconnected(self) -> bool:
        begun = self._part.phase in (Phase.CONNECTING, Phase.CONNECTED)
        return self._triggered and begun and self._connection.state is State.CLOSED

    def _connected(self) -> Outcome:
        loss = self._connection.lost(self._part.incarnation) or self._connection.check_loss()
        if loss is None:
            return _UP
        outcomes = shown(loss, self._bound.env.rules, self.job, failed=None)
        return self._part.lost(outcomes, "the connection is gone")

    def stop(self, reason: str) -> None:
        """Do nothing: no job runs here."""

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self._part.leave()


_IDLE = Outcome(Condition.NO_JOB, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), lasts=True)
_UP = Outcome(Condition.CONNECTED, Cause(Why.PARTNER, "the connection stands"), lasts=True)
