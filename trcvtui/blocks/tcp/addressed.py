"""ADDR: which blocks fit a connection of datagrams, and whether a datagram has somebody to go to (2.7)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import Binding
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.net.connection.config import RemoteAddress
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import ANY_ADDRESS

TARGETS: Final = ("TADDR_Param",)
SOURCES: Final = ("TADDR_Param", "TADDR_RCV_IP")


def unfit(bound: Binding, needs_datagrams: bool, receives: bool = False) -> Outcome | None:
    """Return why this block can never work on this connection; `needs_datagrams`: it is TUSEND or TURCV."""
    is_udp = isinstance(bound.connection, UdpEndpoint)
    if is_udp and bound.address is None:
        return _wrong(Condition.OTHER_TRANSPORT, "the connection is UDP, and this block has no ADDR")
    if is_udp and receives and bound.address is not None:
        return wrong_structure(bound.address)
    if needs_datagrams and not is_udp:
        return _wrong(Condition.OTHER_TRANSPORT, "the connection is not UDP", "CONNECT")
    return None


def no_target(address: RemoteAddress) -> Outcome | None:
    """Return why no datagram can go to this ADDR."""
    wrong = wrong_structure(address, TARGETS)
    if wrong is not None:
        return wrong
    if address.address == ANY_ADDRESS:
        return _wrong(Condition.REMOTE_WRONG, "ADDR names no address")
    if address.port == 0:
        return _wrong(Condition.NEEDS_ADDR, "ADDR names no port")
    return None


def wrong_structure(address: RemoteAddress, taken: tuple[str, ...] = SOURCES) -> Outcome | None:
    """Return why what stands at ADDR is of no use, whatever it says."""
    written = address.description
    if written is None:
        return None
    name, size = written.structure.name, len(written.data)
    if name not in taken:
        return _wrong(Condition.NO_DESCRIPTION, f"ADDR is a {name}, and {taken[0]} is expected")
    if size != written.structure.size:
        text = f"ADDR has {size} bytes, and {name} has {written.structure.size}"
        return _wrong(Condition.PARAMETER_WRONG, text)
    return None


def _wrong(condition: Condition, name: str, pin: str = "ADDR") -> Outcome:
    return Outcome(condition, Cause(Why.PARAMETER, name, pin=pin))
