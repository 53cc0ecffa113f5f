"""The disconnect job and the reset job: what TDISCON and T_RESET do, for every block that closes.

Each answers what it shows, one outcome a scan; a call that failed is the only one shown.
"""

from __future__ import annotations

from collections.abc import Iterable

from trcvtui.blocks.cause import Cause, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.connection.connection import Connection
from trcvtui.net.results import Fault


def disconnect(connection: Connection, cause: Cause) -> list[Outcome]:
    """Close the connection and the listener: closing, closed by us."""
    peer = str(connection.peer or "")
    fault = connection.disconnect()
    if fault is not None:
        return [Outcome(_unless_poll_del(fault, Condition.DISCONNECT_FAILED), cause_of(fault, peer))]
    return [Outcome(Condition.CLOSING, cause), Outcome(Condition.CLOSED, cause)]


def reset(connection: Connection, cause: Cause, shown: Iterable[Condition]) -> list[Outcome]:
    """Abort the connection with RST and show these; the listener stays."""
    peer = str(connection.peer or "")
    fault = connection.reset()
    if fault is not None:
        return [Outcome(_unless_poll_del(fault, Condition.RESET_FAILED), cause_of(fault, peer))]
    return [Outcome(condition, cause) for condition in shown]


def _unless_poll_del(fault: Fault, otherwise: Condition) -> Condition:
    return Condition.POLL_DEL_FAILED if fault.call == "poll_del" else otherwise
