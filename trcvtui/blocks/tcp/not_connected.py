"""80A1, "asked for data, not connected": when it shows (design 6, rows 3 and 4).

The request is remembered where another code has to show, and told in the first scan that is free for it.
"""

from __future__ import annotations

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.rules import NotConnected
from trcvtui.net.connection.connection import Connection


def not_connected(pin: str, name: str, connection: Connection) -> Outcome:
    """Return the outcome of a request without a connection."""
    remote = str(connection.set_up.remote or "")
    return Outcome(Condition.NOT_CONNECTED, Cause(Why.INPUT, name, pin=pin, value=1, peer=remote))


class StandingRequest:
    """EN_R of a block that makes its own connection: an edge of EN_R or CONT arms it, one scan tells it."""

    def __init__(self, rule: NotConnected) -> None:
        self._rule = rule
        self._en_r = False
        self._armed = False

    def see(self, inputs: Inputs, cont_rose: bool) -> None:
        """Take the inputs of this call."""
        en_r_rose = inputs.en_r and not self._en_r
        self._en_r = inputs.en_r
        if not (inputs.en_r and inputs.cont):
            self._armed = False
        elif en_r_rose or cont_rose:
            self._armed = True

    def answered(self) -> None:
        """Forget the edge: a connection is there, and a loss or reset that comes later is no edge."""
        self._armed = False

    def is_told(self) -> bool:
        """Return whether this scan, which is free for it, tells the request; PULSE tells each edge once."""
        told = self._en_r and (
            self._rule is NotConnected.HOLD or (self._rule is NotConnected.PULSE and self._armed)
        )
        if told:
            self._armed = False
        return told
