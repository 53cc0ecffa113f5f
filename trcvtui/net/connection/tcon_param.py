"""A connection said in a TCON_Param, the only structure of instructions before 3.0 (siemens.md 1.11, 3.3)."""

from __future__ import annotations

from typing import Final

from trcvtui.net.connection.description import CONNECTIONS, Description, Value, pack
from trcvtui.net.connection.description_check import ANY_ADDRESS, TSAP_SIZES, Meaning, Protocol

STRUCTURE: Final = CONNECTIONS["TCON_Param"]
_TYPES: Final = {Protocol.TCP: 17, Protocol.ISO: 18, Protocol.UDP: 19}


def as_param(says: Meaning, has_interface: bool) -> Description | None:
    """Return the TCON_Param that says the same; None: it has no place for that.

    `has_interface`: the description names an interface, which is the first one here.
    """
    if says.protocol not in _TYPES or says.remote_name:
        return None
    local, remote = _ends(says)
    if max(len(local), len(remote)) >= TSAP_SIZES.stop:
        return None
    address = bytes(map(int, says.remote_address.split("."))) if says.remote_address != ANY_ADDRESS else b""
    values: dict[str, Value] = {
        "block_length": STRUCTURE.size,
        "id": says.identity,
        "connection_type": _TYPES[says.protocol],
        "active_est": says.is_active,
        "local_device_id": int(has_interface),
        "local_tsap_id_len": len(local),
        "rem_staddr_len": len(address),
        "rem_tsap_id_len": len(remote),
        "local_tsap_id": local,
        "rem_staddr": address,
        "rem_tsap_id": remote,
    }
    return Description(STRUCTURE, pack(STRUCTURE, values))


def _ends(says: Meaning) -> tuple[bytes, bytes]:
    """Return what stands for the local and for the remote end: T-selectors, or ports."""
    if says.protocol is Protocol.ISO:
        return says.local_tsap, says.remote_tsap
    local, remote = says.local_port.to_bytes(2, "big"), says.remote_port.to_bytes(2, "big")
    if says.is_active:
        return local if says.local_port else b"", remote
    return local, remote if says.remote_port and says.protocol is Protocol.TCP else b""
