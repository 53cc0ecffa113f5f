"""A receive job that every call refuses: its error shows with each call, or once while nothing changes."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs

TOLD: Final = Cause(Why.WAITING, "the error has been told; EN_R is 1, and LEN and DATA are as they were")


class ToldOnce:
    """What one instance has told; `quiet` is the condition that it falls back to."""

    def __init__(self, is_once: bool, quiet: Condition) -> None:
        self._is_once = is_once
        self._quiet = Outcome(quiet, TOLD)
        self._told: tuple[Condition, Inputs] | None = None

    def shown(self, outcome: Outcome, inputs: Inputs) -> Outcome:
        """Return what shows of an answer to EN_R = 1."""
        if not self._is_once:
            return outcome
        now = (outcome.condition, inputs) if outcome.error else None
        is_old, self._told = now is not None and now == self._told, now
        if is_old:
            return self._quiet
        return Outcome(outcome.condition, outcome.cause) if outcome.error else outcome

    def forget(self) -> None:
        """EN_R is 0, or the connection has changed: the next error is a new one."""
        self._told = None
