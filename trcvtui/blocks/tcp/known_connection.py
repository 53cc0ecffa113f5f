"""What TSEND and TRCV see of a connection that other blocks build (manual 7.15.8, 7.15.9)."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.connection.connection import Connection, ConnectionLoss
from trcvtui.net.connection.resources import Claim


class LinkView:
    """One block's sight of the connection: which incarnation it knows, and what a loss still has to show."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._incarnation = 0
        self._script: deque[Outcome] = deque()

    def next_shown(self) -> Outcome | None:
        """Return what an earlier loss shows in this scan."""
        return self._script.popleft() if self._script else None

    def lost(self, claim: Claim | None = None) -> ConnectionLoss | None:
        """Return how the incarnation that this block knows has ended, None while it stands."""
        return self._connection.lost(self._incarnation, claim) if self._incarnation else None

    def is_new(self, claim: Claim) -> bool:
        """Return whether a connection stands that this block has not seen before, and know it from now on."""
        if self._incarnation == self._connection.incarnation or not self._connection.stands_for(claim):
            return False
        self._incarnation = self._connection.incarnation
        return True

    def is_known(self) -> bool:
        """Return whether the block has a connection to work on."""
        return self._incarnation != 0

    def end(self, shown: list[Outcome]) -> Outcome:
        """Forget the incarnation; return what its loss shows first."""
        self._incarnation = 0
        self._script = deque(shown)
        return self._script.popleft() if self._script else _GONE


CONNECTED = Outcome(Condition.CONNECTED, Cause(Why.PARTNER, "a connection stands"))
_GONE = Outcome(Condition.NO_JOB, Cause(Why.WAITING, "no connection, and this block builds none"))
NO_LINK = replace(_GONE, lasts=True)  # unlike the scan of the loss: with EN_R = 1 that is followed by 80A1
