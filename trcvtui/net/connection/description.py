"""Connection descriptions such as TCON_IP_v4 and TCON_IP_RFC, and TADDR_Param, as bytes (STEP 7 help).

Rule: the bytes are the description. Values are read from the bytes, and any bytes can be read.
All numbers are big-endian. The layouts of the structures are in `system_types.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from msgspec import Struct

from trcvtui.system_types import ADDRESSES as ADDRESSES
from trcvtui.system_types import CONNECTIONS as CONNECTIONS
from trcvtui.system_types import LONGEST_NAME as LONGEST_NAME
from trcvtui.system_types import LONGEST_SELECTOR as LONGEST_SELECTOR
from trcvtui.system_types import DescriptionField as DescriptionField
from trcvtui.system_types import FieldType as FieldType
from trcvtui.system_types import Structure as Structure

CONFIGURED_TYPE: Final = 254  # ConnectionType

FieldValue = int | bool | str | bytes


class Description(Struct, frozen=True):
    """A structure and the bytes of one description, perhaps too few or too many for the structure."""

    structure: Structure
    data: bytes

    def value(self, name: str) -> FieldValue:
        """Return the value of a field; missing bytes count as 0."""
        field = self.structure.field(name)
        assert field is not None, name
        raw = self.data[field.offset : field.offset + field.size]
        return _decode_field(field, raw + bytes(field.size - len(raw)))

    def number(self, name: str) -> int:
        """Return a number; 0 if the structure has no such field."""
        return int(self.value(name)) if self.structure.field(name) is not None else 0

    def text(self, name: str) -> str:
        """Return an address or a name, or "" if the structure has no such field."""
        return str(self.value(name)) if self.structure.field(name) is not None else ""

    def byte_field(self, name: str) -> bytes:
        """Return bytes or a selector, or b"" if the structure has no such field."""
        found = self.value(name) if self.structure.field(name) is not None else b""
        assert isinstance(found, bytes)
        return found

    def values(self) -> dict[str, FieldValue]:
        return {field.name: self.value(field.name) for field in self.structure.fields}


def _decode_field(field: DescriptionField, raw: bytes) -> FieldValue:
    match field.type:
        case FieldType.NUMBER:
            return int.from_bytes(raw, "big")
        case FieldType.TRUTH:
            return bool(raw[0] & 1)
        case FieldType.ADDRESS:
            return ".".join(map(str, raw))
        case FieldType.SELECTOR:
            return raw[2 : 2 + int.from_bytes(raw[:2], "big")]
        case FieldType.NAME:  # a STRING: longest length, length, characters
            return raw[2 : 2 + raw[1]].decode("latin-1")
        case FieldType.BYTES:
            return raw


def pack(structure: Structure, values: Mapping[str, FieldValue]) -> bytes:
    """Return the bytes of a structure; a field without a value is 0. Each value must fit its field."""
    data = bytearray(structure.size)
    for field in structure.fields:
        raw = _encode_field(field, values[field.name]) if field.name in values else b""
        data[field.offset : field.offset + len(raw)] = raw
        if field.type is FieldType.NAME:
            data[field.offset] = LONGEST_NAME  # its longest length is not 0 without a value, too
    return bytes(data)


def _encode_field(field: DescriptionField, value: FieldValue) -> bytes:
    match field.type, value:
        case FieldType.ADDRESS, str():
            return bytes(map(int, value.split(".")))
        case FieldType.SELECTOR, bytes():
            return len(value).to_bytes(2, "big") + value
        case FieldType.NAME, str():
            return bytes([LONGEST_NAME, len(value)]) + value.encode("latin-1")
        case FieldType.BYTES, bytes():
            return value
        case FieldType.NUMBER | FieldType.TRUTH, int():
            return int(value).to_bytes(field.size, "big")
    raise TypeError(f"{field.name} holds no {type(value).__name__}")


def find_structure(data: bytes) -> Structure | None:
    """Return the structure of a connection description by its size, None if no structure has it."""
    size, configured = len(data), CONNECTIONS["TCON_Configured"]
    # A TCON_Configured may be shorter: then its type must name it, the size is not enough.
    if size == configured.size - configured.spare and data[4] == CONFIGURED_TYPE:
        return configured
    return next((one for one in CONNECTIONS.values() if one.size == size), None)


# -- shown byte for byte -----------------------------------------------------------------------------------


class DescriptionRow(NamedTuple):
    """One line of the view. `remark` is a comment on the bytes."""

    offset: int
    field: str
    data: bytes
    value: str
    remark: str = ""


def rows(description: Description, remarks: Mapping[str, str]) -> tuple[DescriptionRow, ...]:
    """Return the description field by field, with the bytes between and after the fields.

    `remarks` has a remark by the name of each field. The name "" stands for the whole description.
    """
    found: list[DescriptionRow] = []
    at = 0
    for field in description.structure.fields:
        found += _gap_rows(description.data, at, field.offset)
        raw = description.data[field.offset : field.offset + field.size]
        value = _format(field, description.value(field.name)) if len(raw) == field.size else "(not there)"
        found.append(DescriptionRow(field.offset, field.name, raw, value, remarks.get(field.name, "")))
        at = field.offset + field.size
    found += _gap_rows(description.data, at, max(len(description.data), at))
    if remarks.get(""):
        found.append(DescriptionRow(len(description.data), "", b"", "", remarks[""]))
    return tuple(found)


def selector_hex(data: bytes) -> str:
    return data.hex(" ").upper()


def format_selector(data: bytes) -> str:
    """Return a T-selector in hex: `E0 02`. Put its text first if it has one: `TCP-1 (54 43 50 2D 31)`."""
    is_text = len(data) > 1 and all(0x20 < byte < 0x7F for byte in data)
    return f"{data.decode('ascii')} ({selector_hex(data)})" if is_text else selector_hex(data)


def _gap_rows(data: bytes, begin: int, end: int) -> list[DescriptionRow]:
    return [DescriptionRow(begin, "", data[begin:end], "")] if data[begin:end] else []


def _format(field: DescriptionField, value: FieldValue) -> str:
    match value:
        case bool():
            return "TRUE" if value else "FALSE"
        case bytes() if field.type is FieldType.SELECTOR or "tsap_id" in field.name:
            return format_selector(value)
        case bytes():
            text = value.decode("latin-1")
            return text if text.isascii() and text.isprintable() and text else value.hex(" ").upper()
        case int() if field.size == 1 or field.name in ("InterfaceId", "ID", "id"):
            return f"{value} (16#{value:X})"
        case str():
            return "".join(one if one.isprintable() else "·" for one in value)
        case _:
            return str(value)
