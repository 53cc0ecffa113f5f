"""The bytes of a CONNECT's description as readable text: the screen shows the text beside the DB."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.net.connection.config import AddrParam
from trcvtui.net.connection.config import ConnectConfig as ConnectConfig
from trcvtui.net.connection.description import Description, DescriptionField, FieldType, FieldValue, rows
from trcvtui.net.connection.description import DescriptionRow as DescriptionRow
from trcvtui.net.connection.description_check import Flaw, Transport, field_name, read_spec
from trcvtui.net.layer import Credentials, tls_credentials_of
from trcvtui.project.descriptions import UNSAFE
from trcvtui.system_types import UNVERIFIED_NOTE
from trcvtui.udt.literals import quote_text

# Rule: the pasted text has exactly these bytes. Bytes that are no whole structure are shown as bytes.

INDENT: Final = "    "
REMARK: Final = "  // "


class FieldLine(NamedTuple):
    """One field with its value, `ID := 1`, and a comment on it."""

    text: str
    remark: str = ""


def connect_declaration(config: ConnectConfig, indent: str = "") -> str:
    """Return the declaration of a CONNECT with a description; its first line is not indented."""
    assert config.description is not None
    flaw = config.flaw
    if not _is_whole(config.description) or (flaw is not None and flaw.flaw is Flaw.NO_DESCRIPTION):
        why = flaw.text if flaw is not None else "no whole structure"
        return _bytes_declaration(config.name, config.description.data, why)
    remarks = {flaw.field: f"a CPU refuses this: {flaw.text}"} if flaw is not None else {}
    if isinstance(config.remote_port, str):
        remarks.setdefault(
            field_name(config.description, "RemotePort"), f"where {config.remote_port} listens"
        )
    values = initial_values(config.description, remarks)
    return declaration(config.name, config.description.structure.name, values, indent, remarks.get("", ""))


def addr_declaration(addr: AddrParam, indent: str = "") -> str:
    """Return the declaration of an ADDR as a structure, or as bytes if the structure is not complete."""
    description = addr.effective_description
    if not _is_whole(description):
        what = f"{len(description.data)} bytes, {description.structure.name} has {description.structure.size}"
        return _bytes_declaration(addr.name, description.data, what)
    port = next(field.name for field in description.structure.fields if field.name in PORT_FIELDS)
    remarks = {port: f"where {addr.remote_port} listens"} if isinstance(addr.remote_port, str) else {}
    values = initial_values(description, remarks, _ADDRESS_ARRAY_FORM)
    return declaration(addr.name, description.structure.name, values, indent)


PORT_FIELDS: Final = ("rem_port_nr", "RemotePort")
_ADDRESS_ARRAY_FORM: Final = "[{}]"  # an ARRAY; that of a description is an IP_V4
_IP_V4_FORM: Final = "(ADDR := [{}])"


def declaration(
    name: str, type_name: str, fields: Sequence[FieldLine], indent: str = "", remark: str = ""
) -> str:
    head = f"{name} : {type_name} := ({REMARK + remark if remark else ''}"
    lines = []
    for number, field in enumerate(fields, 1):
        comma = "," if number < len(fields) else ""
        remark_text = REMARK + field.remark if field.remark else ""
        lines.append(f"{indent}{INDENT}{field.text}{comma}{remark_text}")
    return "\n".join([head, *lines, f"{indent});"])


def initial_values(
    description: Description, remarks: Mapping[str, str], address: str = _IP_V4_FORM
) -> tuple[FieldLine, ...]:
    """Return each field with its initial value in a DB; `remarks` are by field name."""
    return tuple(
        FieldLine(f"{field.name} := {_literal(field, description, address)}", remarks.get(field.name, ""))
        for field in description.structure.fields
    )


def _is_whole(description: Description) -> bool:
    structure, size = description.structure, len(description.data)
    return structure.size - structure.spare <= size <= structure.size


def _bytes_declaration(name: str, data: bytes, why: str) -> str:
    if not data:
        return f"// {name} holds no byte: {why}"
    lines = ",\n".join(_hex_rows(data))
    return f"{name} : ARRAY[0..{len(data) - 1}] OF BYTE := [{REMARK}a CPU refuses this: {why}\n{lines}\n];"


def _hex_rows(data: bytes) -> Iterator[str]:
    for at in range(0, len(data), 8):
        yield INDENT + ", ".join(f"16#{byte:02X}" for byte in data[at : at + 8])


def _literal(field: DescriptionField, description: Description, address: str) -> str:
    value: FieldValue = description.value(field.name)
    match field.type, value:
        case FieldType.TRUTH, _:
            return str(value).upper()
        case FieldType.ADDRESS, str():
            return address.format(", ".join(value.split(".")))
        case FieldType.SELECTOR, bytes():
            size = int.from_bytes(description.data[field.offset : field.offset + 2], "big")
            return f"(TSelLength := {size}, TSel := {_to_array(value)})"  # also a length that does not fit
        case FieldType.NAME, str():
            return quote_text(value)
        case FieldType.BYTES, bytes():
            return _to_array(value)
        case _:
            return str(value)


def _to_array(data: bytes) -> str:
    return "[" + ", ".join(f"16#{byte:02X}" for byte in data) + "]"


TLS_TEXT: Final = "TLS"
TLS_UNCHECKED_TEXT: Final = "TLS NOT CHECKED"
UNVERIFIED_WARNING: Final = f'the certificate of the partner is not checked: verify = "{UNSAFE}"'
NO_CLIENT_CHECK_TEXT: Final = "not asked for: any client may connect"
MOST_FILES: Final = 3


class Security(NamedTuple):
    """How secure a CONNECT is. If `is_unsafe`, the CONNECT accepts any certificate, and `text` says so."""

    text: str
    is_unsafe: bool


def security_of(config: ConnectConfig | None) -> Security | None:
    tls = None if config is None else tls_credentials_of(config.session)
    if tls is None:
        return None
    unsafe = tls.is_unverified
    return Security(TLS_UNCHECKED_TEXT if unsafe else TLS_TEXT, unsafe)


def certificate_remarks(config: ConnectConfig) -> dict[str, str]:
    """Return, by the name of each field that refers to certificates, a remark with their files."""
    session = tls_credentials_of(config.session)
    if session is None:
        return {}
    own, partners = ("Client", "Server") if config.active else ("Server", "Client")
    trusted = _describe_trust(session)
    if not config.active and not session.asks_client:
        trusted = NO_CLIENT_CHECK_TEXT
    shown = f"shows {_short_path(session.certificate)}" if session.certificate else "shows none"
    return {f"TLS{own}CertRef": shown, f"TLS{partners}CertRef": trusted}


def _describe_trust(session: Credentials) -> str:
    if session.is_unverified:
        return "! NOT CHECKED: any certificate is accepted"
    return f"trusts {_short_paths(session.authorities)}" if session.authorities else "trusts none"


def _short_paths(paths: Iterable[str]) -> str:
    shown = [_short_path(path) for path in paths]
    rest = len(shown) - MOST_FILES
    return ", ".join(shown[:MOST_FILES]) + (f" and {rest} more" if rest > 0 else "")


def _short_path(path: str) -> str:
    return "/".join(Path(path).parts[-2:])


TYPE_FIELDS: Final = ("ConnectionType", "connection_type")
INTERFACE_FIELDS: Final = ("InterfaceId", "local_device_id")


class DescriptionView(NamedTuple):
    """One description. `says` is its meaning in one line. `flaw` is what a CPU would find wrong.

    `warning` is about a check that the project has switched off.
    """

    structure: str
    says: str
    rows: tuple[DescriptionRow, ...]
    flaw: str
    warning: str = ""


def description_view(config: ConnectConfig, listens: str = "") -> DescriptionView | None:
    """Return the view of a CONNECT, or None if the CONNECT has no description.

    `listens` is the address and port where the CONNECT listens now, or "".
    """
    description = config.description
    if description is None:
        return None
    flaw = config.flaw
    remarks = _bench_remarks(config) | certificate_remarks(config)
    if flaw is not None:
        remarks[flaw.field] = f"! {flaw.text}"
    security = security_of(config)
    return DescriptionView(
        structure=description.structure.name,
        says=_describe(config, listens)
        + ("" if description.structure.is_verified else f"; {UNVERIFIED_NOTE}"),
        rows=rows(description, remarks),
        flaw=flaw.text if flaw is not None else "",
        warning=UNVERIFIED_WARNING if security is not None and security.is_unsafe else "",
    )


def _describe(config: ConnectConfig, listens: str) -> str:
    assert config.description is not None
    if config.flaw is not None and config.flaw.flaw is Flaw.NO_DESCRIPTION:
        return "no connection description"
    protocol = read_spec(config.description).protocol
    if protocol in (Transport.UNKNOWN, Transport.CONFIGURED):
        return str(protocol)
    security = security_of(config)
    spoken = f"{protocol}, {security.text}" if security is not None else str(protocol)
    if config.active:
        return f"{spoken}, active to {config.remote_address}:{config.remote_port}"
    return f"{spoken}, passive on {_own_end(config, listens)}"


def _own_end(config: ConnectConfig, listens: str) -> str:
    if config.local.port:
        return str(config.local)
    return f"{listens}, a free port" if listens else f"{config.local.address}, a free port"


def _bench_remarks(config: ConnectConfig) -> dict[str, str]:
    assert config.description is not None
    says = read_spec(config.description)
    found = dict.fromkeys(TYPE_FIELDS, str(says.protocol))
    where = "where routing says" if config.any_local else config.local.address
    found |= dict.fromkeys(INTERFACE_FIELDS, f"on the bench: {where}")
    if isinstance(config.remote_port, str):
        found[field_name(config.description, "RemotePort")] = f"on the bench: {config.remote_port}"
    if says.protocol is not Transport.ISO and not config.active and config.local.port != says.local_port:
        found[field_name(config.description, "LocalPort")] = (
            f"on the bench: {config.local.port or 'a free port'}"
        )
    if says.remote_name and config.remote_address != says.remote_address:
        found["RemoteQDN"] = f"on the bench: {config.remote_address}"
    if says.protocol is Transport.ISO:
        port = config.remote_port if config.active else config.local.port or "a free one"
        found[field_name(config.description, "ActiveEstablished")] = f"port: {port}"
    return found
