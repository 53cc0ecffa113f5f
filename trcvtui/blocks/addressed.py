"""ADDR: which blocks fit a connection of datagrams, and whether a datagram has somebody to go to (2.7)."""

from __future__ import annotations

from trcvtui.blocks.block import Binding
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.connect_config import ANY_ADDRESS
from trcvtui.net.datagram_connection import DatagramConnection
from trcvtui.net.udp_config import RemoteAddress


def unfit(bound: Binding, needs_datagrams: bool) -> Outcome | None:
    """Return why this block can never work on this connection; `needs_datagrams`: it is TUSEND or TURCV."""
    is_udp = isinstance(bound.connection, DatagramConnection)
    if is_udp and bound.address is None:
        return _wrong(Condition.OTHER_TRANSPORT, "the connection is UDP, and this block has no ADDR")
    if needs_datagrams and not is_udp:
        return _wrong(Condition.OTHER_TRANSPORT, "the connection is not UDP", "CONNECT")
    return None


def no_target(address: RemoteAddress) -> Outcome | None:
    """Return why no datagram can go to this ADDR."""
    if address.address == ANY_ADDRESS:
        return _wrong(Condition.REMOTE_WRONG, "ADDR names no address")
    if address.port == 0:
        return _wrong(Condition.NEEDS_ADDR, "ADDR names no port")
    return None


def _wrong(condition: Condition, name: str, pin: str = "ADDR") -> Outcome:
    return Outcome(condition, Cause(Why.PARAMETER, name, pin=pin))
