"""CONT as the connection sees it: the pin itself, or what one manual makes of it and of a request.

By that manual a request (an edge of REQ, EN_R = 1) or CONT = 1 builds a connection, which then stays. It ends
at once when CONT falls while no job waits or runs, else behind the job; and behind a job that had CONT = 0
when it counted: at the edge of REQ, for TRCV_C when the connection was begun.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome


@dataclass(frozen=True, slots=True)
class Told:
    """Why a connection is begun, why it ends, and that there is none."""

    asked: Cause
    ended: Cause
    idle: Outcome


def _idle(name: str, pin: str) -> Outcome:
    return Outcome(Condition.NO_JOB, Cause(Why.INPUT, name, pin=pin, value=0), lasts=True)


CONT_ROSE: Final = Cause(Why.INPUT, "CONT rose", pin="CONT", value=1)
CONT_FELL: Final = Cause(Why.INPUT, "CONT fell", pin="CONT", value=0)
CONT_IS_0: Final = _idle("CONT is 0", "CONT")
BY_REQ: Final = Told(
    asked=Cause(Why.INPUT, "REQ rose without a connection", pin="REQ", value=1),
    ended=Cause(Why.INPUT, "CONT was 0 when REQ rose", pin="CONT", value=0),
    idle=_idle("CONT is 0 and REQ has not risen", "REQ"),
)
BY_EN_R: Final = Told(
    asked=Cause(Why.INPUT, "EN_R is 1 without a connection", pin="EN_R", value=1),
    ended=Cause(Why.INPUT, "CONT was 0 when the connection was begun", pin="CONT", value=0),
    idle=_idle("CONT and EN_R are 0", "EN_R"),
)


class ContLevel:
    """CONT of one instance. `told` None: the connection is wanted as long as the pin is 1."""

    def __init__(self, told: Told | None) -> None:
        self.begins, self.ends_by = CONT_ROSE, CONT_FELL
        self.idle = told.idle if told else CONT_IS_0
        self.is_due = False  # the connection ends as soon as no job needs it
        self._told = told
        self._is_single = False  # it serves one job
        self._cont = self._is_wanted = False

    def level(self, cont: bool, asks: bool, is_closing: bool) -> bool:
        """Return whether the connection is wanted.

        `asks`: a request waits for it, or a job runs on it; `is_closing`: what a close shows is not over.
        """
        if self._told is None:
            return cont
        fell, self._cont = self._cont and not cont, cont
        if fell and self._is_wanted:
            self.is_due, self.ends_by = True, CONT_FELL
        if self.is_due and not asks:
            self.is_due = self._is_wanted = False
        elif (cont or asks) and not is_closing and not self._is_wanted:
            self._is_wanted = True
            self.begins = self._told.asked if asks else CONT_ROSE
            self.count(cont)
        return self._is_wanted

    def count(self, cont: bool) -> None:
        """Take CONT as it is now for the job that comes."""
        self._is_single = not cont

    def served(self) -> None:
        """Say that the job has what it came for."""
        if self._told is not None and self._is_single and not self.is_due:
            self.is_due, self.ends_by = True, self._told.ended

    def goes_on(self) -> None:
        """Keep the connection: it is built anew, and the job that was to end it is gone."""
        self.is_due = self._is_single = False
