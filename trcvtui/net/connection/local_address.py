"""Whether LocalAddress is a usable address of this PLC: the address list decides, not errno (8081)."""

from __future__ import annotations

from trcvtui.net.connection.config import ANY_ADDRESS
from trcvtui.net.connection.ipv4 import is_group, is_loopback
from trcvtui.net.kernel import LocalAddress


def wrong_local_address(address: str, own: tuple[LocalAddress, ...], strict: bool) -> str:
    """Return why the address cannot be used, or "" when it can; strict refuses loopback too.

    An empty `own` is a list that the system could not give: then bind decides.
    """
    if address == ANY_ADDRESS:
        return "0.0.0.0 names no port of the PLC"
    if is_group(address):
        return f"{address} is a multicast or broadcast address"
    mine = next((a for a in own if a.address == address), None)
    everybody = next((a for a in own if a.broadcast == address), None)
    if everybody is not None and mine is None:
        return f"{address} is the broadcast address of {everybody.interface}"
    if is_loopback(address):
        return f"{address} is loopback, no Ethernet port" if strict else ""
    if not own:
        return ""
    if mine is None:
        return f"{address} is no address of this machine"
    return "" if mine.ethernet else f"{address} is on {mine.interface}, which is no Ethernet port"
