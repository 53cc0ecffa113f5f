"""The meaning of a connection description, and the first flaw that a CPU would report (STEP 7 help, TCON).

Rule: each check is a row of the table `_CHECKS`. The first check that fails, in this order, is reported.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Final, NamedTuple

from msgspec import Struct

from trcvtui.net.connection.description import (
    CONFIGURED_TYPE,
    CONNECTIONS,
    LONGEST_SELECTOR,
    Description,
    FieldValue,
    pack,
)
from trcvtui.net.results import ANY_ADDRESS, is_group, is_loopback

MOST_ID: Final = 4095
UDP_TYPE: Final = 19
CHECKS_NAME_BIT: Final = 1  # bit 0 of ExtTLSCapabilities
RESERVED_PORTS: Final = frozenset({20, 21, 80, 102, 135, 161, 162, 443, 34962, 34963, 34964})  # of a CPU
FIRST_DYNAMIC_PORT: Final = 49152  # RFC 6335 6
TCON_PARAM_SIZE: Final = 64
TSAP_FIRST_BYTES: Final = b"\xe0\xe1"  # the first byte of a T-selector for programs; E1 on an S7-1200 alone
TSAP_SIZES: Final = range(2, 17)  # of TCON_Param


class Transport(StrEnum):
    TCP = "TCP"
    ISO = "ISO-on-TCP"
    UDP = "UDP"
    CONFIGURED = "configured"
    UNKNOWN = "unknown"


class Flaw(StrEnum):
    NO_DESCRIPTION = "no description"
    STRUCTURE = "structure not taken"
    LENGTH = "wrong length"
    ID = "wrong ID"
    INTERFACE = "wrong interface"
    NO_LOCAL_ADDRESS = "interface without address"
    TYPE = "wrong type"
    NEEDS_ADDR = "UDP without ADDR"
    UDP_ACTIVE = "active UDP"
    TSAP = "wrong TSAP"
    PARAMETER = "wrong parameter"
    PORT_RESERVED = "reserved port"
    REMOTE = "wrong remote"
    NAME_EMPTY = "name empty"
    NAME_NOT_FULL = "name not fully qualified"
    NO_RESOLVER = "no resolver"
    NAME_UNKNOWN = "name unknown"
    SERVER_BARE = "server without certificate"
    SECURE_DATAGRAMS = "secure datagrams"
    CLIENT_ASKS = "client asks for a client certificate"
    SERVER_CHECKS = "server checks a name"
    CERTIFICATE = "certificate unknown"


class DescriptionFlaw(NamedTuple):
    """One flaw. `text` says what was found and expected. The `field` "" means the whole description."""

    flaw: Flaw
    field: str
    text: str


FlawAnswer = tuple[Flaw, str, str]  # the result of a check, with the fields of a DescriptionFlaw


class LinkSpec(Struct, frozen=True):
    """The meaning of a description, the same for all structures."""

    protocol: Transport
    identity: int
    is_active: bool = False
    remote_address: str = ANY_ADDRESS
    remote_name: str = ""
    remote_port: int = 0
    local_port: int = 0
    remote_tsap: bytes = b""
    local_tsap: bytes = b""


# Structure -> the numbers of ConnectionType that it may have (80B6).
_CONNECTION_TYPES: Final = {
    "TCON_IP_v4": {11: Transport.TCP, 17: Transport.TCP, 19: Transport.UDP},
    "TCON_IP_V4_SEC": {11: Transport.TCP, 17: Transport.TCP},
    "TCON_IP_RFC": {12: Transport.ISO, 18: Transport.ISO},
    "TCON_QDN": {13: Transport.TCP},
    "TCON_QDN_SEC": {13: Transport.TCP},
    "TCON_Param": {17: Transport.TCP, 18: Transport.ISO, 19: Transport.UDP},
    "TCON_Configured": {CONFIGURED_TYPE: Transport.CONFIGURED},
}


# The field's name in the newer structures -> its name in TCON_Param.
_PARAM_FIELD_NAMES: Final = {
    "ActiveEstablished": "active_est",
    "RemoteAddress": "rem_staddr",
    "RemotePort": "rem_tsap_id",
    "LocalPort": "local_tsap_id",
}


def field_name(description: Description, name: str) -> str:
    """Return the name that a field of TCON_IP_v4 has in this structure."""
    return _PARAM_FIELD_NAMES.get(name, name) if description.structure.name == "TCON_Param" else name


def connection_types_of(structure: str) -> tuple[int, ...]:
    """Return the numbers that ConnectionType may have, the usual number first."""
    return tuple(_CONNECTION_TYPES[structure])


def speaks_iso(structure: str) -> bool:
    """Return whether the structure can describe a connection of ISO-on-TCP."""
    return Transport.ISO in _CONNECTION_TYPES[structure].values()


def read_spec(description: Description) -> LinkSpec:
    """Return the meaning of a description, without a check for flaws."""
    if description.structure.name == "TCON_Param":
        return _read_param_meaning(description)
    types = _CONNECTION_TYPES[description.structure.name]
    return LinkSpec(
        protocol=types.get(description.number("ConnectionType"), Transport.UNKNOWN),
        identity=description.number("ID"),
        is_active=bool(description.number("ActiveEstablished")),
        remote_address=description.text("RemoteAddress") or ANY_ADDRESS,
        remote_name=description.text("RemoteQDN"),
        remote_port=description.number("RemotePort"),
        local_port=description.number("LocalPort"),
        remote_tsap=description.byte_field("RemoteTSelector"),
        local_tsap=description.byte_field("LocalTSelector"),
    )


def _read_param_meaning(description: Description) -> LinkSpec:
    protocol = _CONNECTION_TYPES["TCON_Param"].get(description.number("connection_type"), Transport.UNKNOWN)
    local = description.byte_field("local_tsap_id")[: description.number("local_tsap_id_len")]
    remote = description.byte_field("rem_tsap_id")[: description.number("rem_tsap_id_len")]
    known = description.number("rem_staddr_len") > 0
    is_iso = protocol is Transport.ISO
    return LinkSpec(
        protocol=protocol,
        identity=description.number("id"),
        is_active=bool(description.number("active_est")),
        remote_address=".".join(map(str, description.byte_field("rem_staddr")[:4])) if known else ANY_ADDRESS,
        remote_port=0 if is_iso else int.from_bytes(remote[:2], "big"),
        local_port=0 if is_iso else int.from_bytes(local[:2], "big"),
        remote_tsap=remote if is_iso else b"",
        local_tsap=local if is_iso else b"",
    )


class DescribedConnect(Struct, frozen=True):
    """A description, and the other facts in the project file about its CONNECT.

    `own_address` is the address of InterfaceId. With `takes_free_port`, LocalPort 0 is no flaw. With
    `remote_is_known`, `@NAME` in the file names the partner's port. The instructions accept the
    `structures`, or all structures if this is (). With `narrow_tsaps`, the CPU is an S7-1200.
    """

    description: Description
    meaning: LinkSpec
    own_address: str
    takes_free_port: bool = False
    remote_is_known: bool = False
    structures: tuple[str, ...] = ()
    narrow_tsaps: bool = False


def find_flaw(connect: DescribedConnect) -> DescriptionFlaw | None:
    """Return the first flaw, None if a CPU would try to connect."""
    found = next((found for check in _CHECKS if (found := check(connect)) is not None), None)
    return DescriptionFlaw(found[0], field_name(connect.description, found[1]), found[2]) if found else None


# -- the checks --------------------------------------------------------------------------------------------


def _check_structure(connect: DescribedConnect) -> FlawAnswer | None:
    name = connect.description.structure.name
    if not connect.structures or name in connect.structures:
        return None
    return Flaw.STRUCTURE, "", f"{name}: these instructions take {', '.join(connect.structures)} only"


def _check_size(connect: DescribedConnect) -> FlawAnswer | None:
    structure, size = connect.description.structure, len(connect.description.data)
    if structure.size - structure.spare <= size <= structure.size:
        return None
    return Flaw.LENGTH, "", f"{size} bytes, but {structure.name} has {structure.size}"


def _check_identity(connect: DescribedConnect) -> FlawAnswer | None:
    if 1 <= connect.meaning.identity <= MOST_ID:
        return None
    name = "id" if connect.description.structure.field("id") else "ID"
    return Flaw.ID, name, f"{name} is {connect.meaning.identity}, expected 1 to {MOST_ID}"


def _refuse_configured(connect: DescribedConnect) -> FlawAnswer | None:
    if connect.meaning.protocol is not Transport.CONFIGURED:
        return None
    return Flaw.ID, "ID", f"no configured connection has the ID {connect.meaning.identity}"


def _check_interface(connect: DescribedConnect) -> FlawAnswer | None:
    # A description with a name may leave the choice of the interface to the CPU: 0.
    names_own = connect.meaning.remote_name or connect.description.structure.name.startswith("TCON_QDN")
    field = "local_device_id" if connect.description.structure.field("local_device_id") else "InterfaceId"
    if connect.description.number(field) == 0 and not names_own:
        return Flaw.INTERFACE, field, f"{field} is 0, expected a port's hardware identifier, such as 64"
    if connect.own_address == ANY_ADDRESS:
        return Flaw.NO_LOCAL_ADDRESS, field, "LocalAddress is 0.0.0.0: the interface has no address"
    return None


def _check_type(connect: DescribedConnect) -> FlawAnswer | None:
    if connect.meaning.protocol is not Transport.UNKNOWN:
        return None
    structure = connect.description.structure
    field = "connection_type" if structure.field("connection_type") else "ConnectionType"
    taken = ", ".join(f"16#{one:02X}" for one in connection_types_of(structure.name))
    number = connect.description.number(field)
    return Flaw.TYPE, field, f"{field} is 16#{number:02X}, but {structure.name} takes {taken}"


def _check_udp_active(connect: DescribedConnect) -> FlawAnswer | None:
    if connect.meaning.protocol is not Transport.UDP or not connect.meaning.is_active:
        return None
    return Flaw.UDP_ACTIVE, "ActiveEstablished", "UDP cannot be active"


def _check_udp_port(connect: DescribedConnect) -> FlawAnswer | None:
    if connect.meaning.protocol is not Transport.UDP:
        return None
    if not connect.meaning.local_port and not connect.takes_free_port:
        return Flaw.PARAMETER, "LocalPort", "LocalPort is 0, but UDP needs a port"
    return None


def _check_tsap(connect: DescribedConnect) -> FlawAnswer | None:
    if connect.meaning.protocol is not Transport.ISO:
        return None
    return _check_common_tsap(connect) or (
        check_strict_tsap(connect.meaning.local_tsap) if connect.narrow_tsaps else None
    )


def _check_common_tsap(connect: DescribedConnect) -> FlawAnswer | None:
    local = connect.meaning.local_tsap
    if connect.description.structure.name == "TCON_Param":
        return _check_param_tsap(connect)
    for field in ("LocalTSelector", "RemoteTSelector"):
        size = _selector_length(connect.description, field)
        if size > LONGEST_SELECTOR:
            return Flaw.PARAMETER, field, f"TSelLength is {size}, expected at most {LONGEST_SELECTOR}"
    if not local:
        return Flaw.TSAP, "LocalTSelector", "the local T-selector is empty"
    if len(local) < TSAP_SIZES.start and not connect.meaning.is_active:
        return Flaw.TSAP, "LocalTSelector", "the local T-selector has 1 byte; a passive end needs 2 or more"
    if len(local) == 2 and local[0] not in _allowed_first_bytes(connect):
        return Flaw.TSAP, "LocalTSelector", f"a selector of 2 bytes begins with E0, not {local[0]:02X}"
    if local.startswith(b"SIMATIC-"):
        return Flaw.TSAP, "LocalTSelector", "SIMATIC- is reserved for the system"
    return None


def _allowed_first_bytes(connect: DescribedConnect) -> bytes:
    return TSAP_FIRST_BYTES if connect.narrow_tsaps else TSAP_FIRST_BYTES[:1]


def check_strict_tsap(local: bytes) -> DescriptionFlaw | None:
    """Return a flaw of the local T-selector that only an S7-1200 reports (S7-1200 System Manual)."""
    text = ""
    if len(local) >= 2 and local[0] in TSAP_FIRST_BYTES and local[1] > 1:
        text = f"after {local[0]:02X} comes 00 or 01, not {local[1]:02X}"
    elif any(not 0x20 <= byte < 0x7F for byte in local[2:]):
        text = f"from the third byte on it has to be ASCII, not {local[2:].hex(' ')}"
    return DescriptionFlaw(Flaw.TSAP, "LocalTSelector", text) if text else None


def _selector_length(description: Description, name: str) -> int:
    field = description.structure.field(name)
    assert field is not None
    return int.from_bytes(description.data[field.offset : field.offset + 2], "big")


def _check_param_tsap(connect: DescribedConnect) -> FlawAnswer | None:
    local = connect.meaning.local_tsap
    if not connect.meaning.is_active and (
        len(local) < TSAP_SIZES.start or local[0] not in _allowed_first_bytes(connect)
    ):
        return Flaw.TSAP, "local_tsap_id", f"{local.hex(' ')}, expected two bytes or more that begin with E0"
    return None


def _check_param_lengths(connect: DescribedConnect) -> FlawAnswer | None:
    # S7-1200 System Manual, TCON_Param
    if connect.description.structure.name != "TCON_Param":
        return None
    number, spec = connect.description.number, connect.meaning
    for field, taken in _allowed_param_lengths(spec):
        if number(field) not in taken:
            wanted = " or ".join(map(str, taken)) if len(taken) < 4 else f"{taken[0]} to {taken[-1]}"
            return Flaw.PARAMETER, field, f"{field} is {number(field)}, expected {wanted}"
    return None


def _allowed_param_lengths(spec: LinkSpec) -> list[tuple[str, tuple[int, ...]]]:
    lengths: list[tuple[str, tuple[int, ...]]] = [
        ("block_length", (TCON_PARAM_SIZE,)),
        ("rem_subnet_id_len", (0,)),
        ("next_staddr_len", (0,)),
        ("rem_staddr_len", (4,) if spec.is_active else (0, 4)),
    ]
    if spec.protocol is Transport.ISO:
        sizes = tuple(TSAP_SIZES)
        lengths += [
            ("local_tsap_id_len", sizes),
            ("rem_tsap_id_len", sizes if spec.is_active else (0, *sizes)),
        ]
    elif spec.protocol is Transport.UDP:
        lengths += [("local_tsap_id_len", (2,)), ("rem_tsap_id_len", (0,))]
    else:
        lengths += [
            ("local_tsap_id_len", (0, 2) if spec.is_active else (2,)),
            ("rem_tsap_id_len", (2,) if spec.is_active else (0, 2)),
        ]
    return lengths


def _check_tcp_ports(connect: DescribedConnect) -> FlawAnswer | None:
    spec = connect.meaning
    if spec.protocol is not Transport.TCP:
        return None
    if spec.is_active and not spec.remote_port and not connect.remote_is_known:
        return Flaw.PARAMETER, "RemotePort", "RemotePort is 0, but an active end needs one"
    if not spec.is_active and not spec.local_port and not connect.takes_free_port:
        return Flaw.PARAMETER, "LocalPort", "LocalPort is 0, but a passive end needs one"
    return None


def _check_remote(connect: DescribedConnect) -> FlawAnswer | None:
    spec = connect.meaning
    if connect.description.structure.field("RemoteQDN"):
        return None
    # 0.0.0.0 is "any partner" on a passive end.
    if spec.is_active and spec.remote_address == ANY_ADDRESS:
        return Flaw.PARAMETER, "RemoteAddress", "RemoteAddress is 0.0.0.0, expected the partner's address"
    if is_group(spec.remote_address):
        text = f"{spec.remote_address} is no address of a single partner; multicast groups are not joined"
        return Flaw.REMOTE, "RemoteAddress", text
    # On loopback that is no mistake: the bench and its peers share the address.
    if spec.remote_address == connect.own_address and not is_loopback(spec.remote_address):
        return Flaw.REMOTE, "RemoteAddress", f"{spec.remote_address} is this PLC's own address"
    return None


def _check_reserved_port(connect: DescribedConnect) -> FlawAnswer | None:
    port = connect.meaning.local_port
    if port in RESERVED_PORTS or port >= FIRST_DYNAMIC_PORT:
        return Flaw.PORT_RESERVED, "LocalPort", f"port {port} is reserved for the system; use 2000 to 5000"
    return None


def _check_remote_name(connect: DescribedConnect) -> FlawAnswer | None:
    if connect.description.structure.field("RemoteQDN") is None:
        return None
    name = connect.meaning.remote_name
    if not name and not connect.meaning.is_active:
        return None
    if not name:
        return Flaw.NAME_EMPTY, "RemoteQDN", "RemoteQDN is empty"
    if not name.endswith("."):
        return Flaw.NAME_NOT_FULL, "RemoteQDN", "RemoteQDN does not end with a dot"
    return None


def _check_secure_type(connect: DescribedConnect) -> FlawAnswer | None:
    is_udp = connect.description.number("ConnectionType") == UDP_TYPE
    if not is_udp or not connect.description.number("ActivateSecureConn"):
        return None
    return Flaw.SECURE_DATAGRAMS, "ConnectionType", "UDP cannot be secured: there is no DTLS"


def _check_secure(connect: DescribedConnect) -> FlawAnswer | None:
    number = connect.description.number
    if not number("ActivateSecureConn"):
        return None
    if connect.meaning.is_active:
        if number("TLSServerReqClientCert"):
            text = "TLSServerReqClientCert is TRUE: only a server asks for a client's certificate"
            return Flaw.CLIENT_ASKS, "TLSServerReqClientCert", text
        return None
    if number("ExtTLSCapabilities") & CHECKS_NAME_BIT:
        text = "ExtTLSCapabilities has bit 0: only a client checks the subjectAlternateName"
        return Flaw.SERVER_CHECKS, "ExtTLSCapabilities", text
    if not number("TLSServerCertRef"):
        return Flaw.SERVER_BARE, "TLSServerCertRef", "TLSServerCertRef is 0, but a server needs a certificate"
    return None


_CHECKS: Final[tuple[Callable[[DescribedConnect], FlawAnswer | None], ...]] = (
    _check_structure, _check_size, _check_identity, _refuse_configured, _check_interface, _check_secure_type,
    _check_type, _check_tsap, _check_udp_active, _check_param_lengths, _check_udp_port, _check_tcp_ports,
    _check_remote, _check_reserved_port, _check_remote_name, _check_secure,
)  # fmt: skip


PARAM_STRUCTURE: Final = CONNECTIONS["TCON_Param"]
_PARAM_TYPES: Final = {Transport.TCP: 17, Transport.ISO: 18, Transport.UDP: 19}


def to_tcon_param(spec: LinkSpec, has_interface: bool) -> Description | None:
    """Return the TCON_Param with the same meaning, or None if no TCON_Param can have this meaning.

    If the description names an interface (`has_interface`), the TCON_Param names the first interface.
    """
    if spec.protocol not in _PARAM_TYPES or spec.remote_name:
        return None
    local, remote = _param_tsaps(spec)
    if max(len(local), len(remote)) >= TSAP_SIZES.stop:
        return None
    address = bytes(map(int, spec.remote_address.split("."))) if spec.remote_address != ANY_ADDRESS else b""
    values: dict[str, FieldValue] = {
        "block_length": PARAM_STRUCTURE.size,
        "id": spec.identity,
        "connection_type": _PARAM_TYPES[spec.protocol],
        "active_est": spec.is_active,
        "local_device_id": int(has_interface),
        "local_tsap_id_len": len(local),
        "rem_staddr_len": len(address),
        "rem_tsap_id_len": len(remote),
        "local_tsap_id": local,
        "rem_staddr": address,
        "rem_tsap_id": remote,
    }
    return Description(PARAM_STRUCTURE, pack(PARAM_STRUCTURE, values))


def _param_tsaps(spec: LinkSpec) -> tuple[bytes, bytes]:
    if spec.protocol is Transport.ISO:
        return spec.local_tsap, spec.remote_tsap
    local, remote = spec.local_port.to_bytes(2, "big"), spec.remote_port.to_bytes(2, "big")
    if spec.is_active:
        return local if spec.local_port else b"", remote
    return local, remote if spec.remote_port and spec.protocol is Transport.TCP else b""
