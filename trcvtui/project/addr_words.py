"""How a project file of a dialect with descriptions says ADDR: a TADDR_Param by its fields, or as bytes.

Rule: refused is only what cannot be typed; a structure or length that no block takes is the block's to show.
"""

from __future__ import annotations

from typing import Final

from trcvtui.net.connection.config import ANY_ADDRESS
from trcvtui.net.connection.description import ADDRESSES, CONNECTIONS, Description, Structure, Value, pack
from trcvtui.net.connection.udp_config import TADDR_PARAM, AddrParam
from trcvtui.project.iso_words import DB_BYTES
from trcvtui.project.names import expected_name
from trcvtui.project.parts import NAME, UDP_PORT_OR_NAME, UINT, read_addr
from trcvtui.project.tables import ADDRESS, TEXT, Table, shown

STRUCTURES: Final = CONNECTIONS | ADDRESSES
_FIELDS: Final = ("rem_ip_addr", "rem_port_nr", "reserved")
_PLAIN: Final = ("RemoteAddress", "RemotePort")


def read_described_addr(table: Table) -> AddrParam | None:
    """Return one ADDR; RemoteAddress and RemotePort alone are a TADDR_Param, too."""
    if not any(table.has(key) for key in ("type", "bytes", *_FIELDS)):
        return read_addr(table)
    name = table.must("name", NAME)
    type_name = table.read("type", TEXT)
    if type_name is not None and type_name not in STRUCTURES:
        table.wrong("type", shown(type_name), expected_name(type_name, ADDRESSES, "structure"))
        table.know(*table.rest())
        return None
    raw = table.read("bytes", DB_BYTES)
    if table.has("bytes"):
        found = None if raw is None else _of_bytes(raw, type_name)
    else:
        found = _of_fields(table, STRUCTURES[type_name or TADDR_PARAM.name])
    port = table.read("RemotePort", UDP_PORT_OR_NAME) if table.has("bytes") else None
    table.finish()
    if name is None or found is None:
        return None
    description, said = found
    return _addr(name, description, port if port is not None else said)


def _of_bytes(raw: bytes, type_name: str | None) -> tuple[Description, int | str | None]:
    by_size = next((one for one in ADDRESSES.values() if one.size == len(raw)), TADDR_PARAM)
    return Description(STRUCTURES[type_name] if type_name else by_size, raw), None


def _of_fields(table: Table, structure: Structure) -> tuple[Description, int | str | None]:
    if structure != TADDR_PARAM:
        return Description(structure, bytes(structure.size)), None
    address = table.get("rem_ip_addr", ADDRESS, ANY_ADDRESS)
    port = table.get("rem_port_nr", UDP_PORT_OR_NAME, 0)
    number = port if isinstance(port, int) else 0
    values: dict[str, Value] = {
        "rem_ip_addr": address,
        "rem_port_nr": number,
        "reserved": table.get("reserved", UINT, 0),
    }
    return Description(structure, pack(structure, values)), port


def _addr(name: str, description: Description, port: int | str | None) -> AddrParam:
    """Return an ADDR with what its bytes say; a TADDR_RCV_IP is for a receiver to write."""
    is_param = description.structure == TADDR_PARAM
    address = description.text("rem_ip_addr") if is_param else ANY_ADDRESS
    if port is None:
        port = description.number("rem_port_nr")
    return AddrParam(name, address, port, description)
