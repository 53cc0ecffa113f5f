"""Connection descriptions and TADDR_Param as declarations in SCL, and what a CPU would refuse beside them.

Rule: what is pasted is what is here. Bytes that fill no structure stay bytes; nothing is rounded to fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description import Description, Field, FieldType, Value
from trcvtui.net.connection.description_check import Flaw, field_name
from trcvtui.net.connection.udp_config import AddrParam

INDENT: Final = "    "
REMARK: Final = "  // "


class Initial(NamedTuple):
    """One field with its value, `ID := 1`, and what is to say of it."""

    text: str
    remark: str = ""


def declaration(config: ConnectConfig, indent: str = "") -> str:
    """Return a CONNECT that is a description as its declaration; the first line is not indented."""
    assert config.description is not None
    flaw = config.flaw
    if not _is_whole(config.description) or (flaw is not None and flaw.flaw is Flaw.NO_DESCRIPTION):
        why = flaw.text if flaw is not None else "no whole structure"
        return _as_bytes(config.name, config.description.data, why)
    remarks = {flaw.field: f"a CPU refuses this: {flaw.text}"} if flaw is not None else {}
    if isinstance(config.remote_port, str):
        remarks.setdefault(
            field_name(config.description, "RemotePort"), f"where {config.remote_port} listens"
        )
    values = initial_values(config.description, remarks)
    return record(config.name, config.description.structure.name, values, indent, remarks.get("", ""))


def declaration_of_addr(addr: AddrParam, indent: str = "") -> str:
    """Return an ADDR as its declaration: TADDR_Param, or the bytes that it is instead."""
    description = addr.written
    if not _is_whole(description):
        what = f"{len(description.data)} bytes, {description.structure.name} has {description.structure.size}"
        return _as_bytes(addr.name, description.data, what)
    port = next(field.name for field in description.structure.fields if field.name in PORTS)
    remarks = {port: f"where {addr.remote_port} listens"} if isinstance(addr.remote_port, str) else {}
    values = initial_values(description, remarks, _ADDRESS_IN_ADDR)
    return record(addr.name, description.structure.name, values, indent)


PORTS: Final = ("rem_port_nr", "RemotePort")
_ADDRESS_IN_ADDR: Final = "[{}]"  # an ARRAY; that of a description is an IP_V4
_IP_V4: Final = "(ADDR := [{}])"


def record(name: str, type_name: str, fields: Sequence[Initial], indent: str = "", remark: str = "") -> str:
    """Return the declaration of a structure."""
    head = f"{name} : {type_name} := ({REMARK + remark if remark else ''}"
    lines = []
    for number, field in enumerate(fields, 1):
        comma = "," if number < len(fields) else ""
        said = REMARK + field.remark if field.remark else ""
        lines.append(f"{indent}{INDENT}{field.text}{comma}{said}")
    return "\n".join([head, *lines, f"{indent});"])


def initial_values(
    description: Description, remarks: Mapping[str, str], address: str = _IP_V4
) -> tuple[Initial, ...]:
    """Return the fields as the initial values of a DB; `remarks` are by field name."""

    def one(field: Field) -> Initial:
        value = _literal(field, description, address)
        return Initial(f"{field.name} := {value}", remarks.get(field.name, ""))

    return tuple([one(field) for field in description.structure.fields])


def _is_whole(description: Description) -> bool:
    structure, size = description.structure, len(description.data)
    return structure.size - structure.spare <= size <= structure.size


def _as_bytes(name: str, data: bytes, why: str) -> str:
    """Return what is no structure as it is."""
    if not data:
        return f"// {name} holds no byte: {why}"
    lines = ",\n".join(_rows(data))
    return f"{name} : ARRAY[0..{len(data) - 1}] OF BYTE := [{REMARK}a CPU refuses this: {why}\n{lines}\n];"


def _rows(data: bytes) -> Iterator[str]:
    for at in range(0, len(data), 8):
        yield INDENT + ", ".join(f"16#{byte:02X}" for byte in data[at : at + 8])


def _literal(field: Field, description: Description, address: str) -> str:
    value: Value = description.value(field.name)
    match field.type, value:
        case FieldType.TRUTH, _:
            return str(value).upper()
        case FieldType.ADDRESS, str():
            return address.format(", ".join(value.split(".")))
        case FieldType.SELECTOR, bytes():
            size = int.from_bytes(description.data[field.offset : field.offset + 2], "big")
            return f"(TSelLength := {size}, TSel := {_array(value)})"  # also a length that does not fit
        case FieldType.NAME, str():
            return "'" + "".join(_character(one) for one in value) + "'"
        case FieldType.BYTES, bytes():
            return _array(value)
        case _:
            return str(value)


def _array(data: bytes) -> str:
    return "[" + ", ".join(f"16#{byte:02X}" for byte in data) + "]"


def _character(one: str) -> str:
    """Return a character as a STRING literal has it."""
    return one if one.isprintable() and one not in "'$" else f"${ord(one):02X}"
