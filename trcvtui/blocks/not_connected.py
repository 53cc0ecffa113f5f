"""80A1, "asked for data, not connected": when it shows (design 6, rows 3 and 4).

The request is remembered where another code has to show, and told in the first scan that is free for it.
"""

from __future__ import annotations

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.connection import Connection


def not_connected(pin: str, name: str, connection: Connection) -> Outcome:
    """Return the outcome of a request without a connection."""
    remote = str(connection.set_up.remote or "")
    return Outcome(Condition.NOT_CONNECTED, Cause(Why.INPUT, name, pin=pin, value=1, peer=remote))
