"""Reads and writes CONNECT and ADDR in dialects with connection descriptions, by field or as bytes of a DB.

Rule: a value is refused only if no type can hold it. If a CPU rejects a value, the block shows the `flaw`.
Keys of the bench are keys that no CPU has. These keys set what this machine does.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.blocks.rules import VendorRules
from trcvtui.errors import UserError
from trcvtui.files import absolute_name
from trcvtui.net.connection.config import TADDR_PARAM, AddrParam, ConnectConfig, parse_address
from trcvtui.net.connection.description import (
    ADDRESSES,
    CONNECTIONS,
    LONGEST_NAME,
    LONGEST_SELECTOR,
    Description,
    DescriptionField,
    FieldType,
    FieldValue,
    Structure,
    find_structure,
    pack,
    selector_hex,
)
from trcvtui.net.connection.description_check import (
    CHECKS_NAME_BIT,
    DescribedConnect,
    DescriptionFlaw,
    Flaw,
    LinkSpec,
    Transport,
    connection_types_of,
    find_flaw,
    read_spec,
    speaks_iso,
    to_tcon_param,
)
from trcvtui.net.layer import LayerSettings, tls_credentials_of
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.received_ring import DEFAULT_HISTORY
from trcvtui.net.results import ANY_ADDRESS, Endpoint, is_loopback, parse_octets
from trcvtui.project.key_rows import KeyPairs
from trcvtui.project.project import CertificateDecl, Certificates
from trcvtui.project.tables import (
    ADDRESS,
    PORT_OR_NAME,
    TEXT,
    TRUTH,
    UDP_PORT_OR_NAME,
    UINT,
    Kind,
    Table,
    integer,
    parse_reference,
    quote,
    text_kind,
)
from trcvtui.udt.byte_text import parse_hex
from trcvtui.wording import exact_size

if TYPE_CHECKING:
    from trcvtui.net.layers.tls import TlsSettings

LONGEST_MESSAGE: Final = 65536
SIZES: Final = {1 << code: code for code in range(7, 14)}  # 128 .. 8192 bytes
_TIA_TSAP: Final = re.compile(r"[0-9a-fA-F]{2}\.[0-9a-fA-F]{2}")  # as TIA writes a TSAP of two bytes


def parse_selector(text: str) -> bytes | None:
    """Return a TSAP. `16#E002` and TIA's `E0.02` are hex. `text:E002` and all that cannot be hex are ASCII.

    Return None if the text could be both hex and ASCII (see `unambiguous_spellings`), or is no TSAP. Older
    files have `hex E0 02` and `text E0 02`.
    """
    if text.startswith(("16#", "hex ")):
        found = try_parse_hex(text[3:].replace(".", " ")) or None
    elif text.startswith(("text:", "text ")):
        found = _encode_ascii(text[5:])
    elif _TIA_TSAP.fullmatch(text):
        found = bytes.fromhex(text.replace(".", ""))
    else:
        found = None if _is_ambiguous(text) else _encode_ascii(text)
    return found if found is not None and len(found) <= LONGEST_SELECTOR else None


def _is_ambiguous(text: str) -> bool:
    return bool(text) and not text.strip("0123456789abcdefABCDEF .")


def unambiguous_spellings(text: str) -> str:
    """For a text of hex digits, return both clear spellings, as hex and as text; for others, return ""."""
    if not _is_ambiguous(text) or _TIA_TSAP.fullmatch(text):
        return ""
    digits = "".join(char for char in text if char not in " .").upper()
    digits = digits.zfill(len(digits) + len(digits) % 2)
    as_text = f'"text:{text}" (the text)'
    if not digits or len(digits) > 2 * LONGEST_SELECTOR:
        return as_text
    return f'"16#{digits}" (the bytes {selector_hex(bytes.fromhex(digits))}) or {as_text}'


def try_parse_hex(text: str) -> bytes | None:
    try:
        return parse_hex(text)
    except UserError:
        return None


def parse_db_bytes(text: str) -> bytes | None:
    """Return the bytes of a DB. Return None if a group has an odd number of digits (a copy cut off?)."""
    groups = text.replace(",", " ").split()
    lone = any(len(group.lower().removeprefix("0x").removeprefix("16#")) % 2 for group in groups)
    return None if lone else try_parse_hex(text)


def _encode_ascii(text: str) -> bytes | None:
    return text.encode("ascii") if text.isascii() else None


TSAP: Final = text_kind(
    'a TSAP of at most 32 bytes such as "16#E002", "E0.02" or "TCP-1"',
    parse_selector,
    unambiguous_spellings,
    write=lambda tsap: f"16#{tsap.hex().upper()}",
)
TPDU: Final[Kind[int]] = Kind(
    "a TPDU size: 128, 256, 512, 1024, 2048, 4096 or 8192",
    lambda value: SIZES.get(value) if isinstance(value, int) else None,
    lambda text: SIZES.get(int(text)) if text.isascii() and text.isdigit() and len(text) < 6 else None,
    write=lambda code: 1 << code,
)


DB_BYTES: Final = text_kind(
    'the bytes of a DB in hex, two digits each, such as "00 40 00 01 0b 01 ..."', parse_db_bytes
)


UNSAFE: Final = "none, this is unsafe"
CERTIFICATE_NUMBER: Final = integer(1, (1 << 32) - 1)
VERIFY: Final = text_kind(
    f'"{UNSAFE}"; if left out, certificates are verified', lambda text: text if text == UNSAFE else None
)
HOST: Final = text_kind("the name or address that the certificate must have", lambda text: text or None)
TLS_KEYS: Final = ("tls", "certificate", "authority", "client_certificate", "server_name", "verify")


def make_certificate(number: int, file: str, key: str, table: Table, base: Path) -> CertificateDecl:
    """Return a certificate; report files that are not usable."""
    from trcvtui.net.layers import tls  # loads the TLS library: only a project with certificates needs it

    found = CertificateDecl(number, absolute_name(base / file), absolute_name(base / key) if key else "")
    if flaw := tls.find_certificate_flaw(found.file, ""):
        table.report("file", flaw, "a PEM file")
    elif found.key and (flaw := tls.find_certificate_flaw(found.file, found.key)):
        table.report("key", flaw, "a PEM file")
    return found


# -- a secure CONNECT ----------------------------------------------------------------------------------------


def is_secure(description: Description) -> bool:
    """Return whether the description asks for TLS."""
    return bool(description.number("ActivateSecureConn"))


def resolve_tls(
    description: Description, spec: LinkSpec, known: Certificates, is_unverified: bool
) -> TlsSettings | DescriptionFlaw:
    """Return the TLS settings: the active end trusts TLSServerCertRef and shows TLSClientCertRef.

    The passive end trusts TLSClientCertRef and shows TLSServerCertRef. If the number of the trusted
    certificate is 0, all certificates without a key are trusted. An end with certificate number 0 shows
    none.
    """
    server, client = description.number("TLSServerCertRef"), description.number("TLSClientCertRef")
    own, trusted = (client, server) if spec.is_active else (server, client)
    for field, number, needs_key in (
        ("TLSClientCertRef" if spec.is_active else "TLSServerCertRef", own, True),
        ("TLSServerCertRef" if spec.is_active else "TLSClientCertRef", trusted, False),
    ):
        if number and (number not in known or (needs_key and not known[number].key)):
            kind = "certificate with a key" if needs_key else "certificate"
            return DescriptionFlaw(Flaw.CERTIFICATE, field, f"{field} is {number}, no {kind} has that number")
    shows = known.get(own)
    from trcvtui.net.layers.tls import TlsSettings  # loads the TLS library: only a secure one needs it

    return TlsSettings(
        certificate=shows.file if shows else "",
        key=shows.key if shows else "",
        authorities=_authorities(known, trusted),
        asks_client=bool(description.number("TLSServerReqClientCert")),
        server_name=spec.remote_name or spec.remote_address,
        checks_name=bool(description.number("ExtTLSCapabilities") & CHECKS_NAME_BIT),
        is_unverified=is_unverified,
    )


def _authorities(known: Certificates, number: int) -> tuple[str, ...]:
    return (known[number].file,) if number else tuple(one.file for one in known.values() if not one.key)


# -- a peer --------------------------------------------------------------------------------------------------


def tls_of_peer(
    values: Mapping[str, Any], table: Table, known: Certificates
) -> tuple[TlsSettings, tuple[tuple[str, bool | int | str], ...]]:
    """Return the TLS settings of a peer's table, and the same as keys of the table."""
    own, authority = [_look_up(table, key, values[key], known) for key in ("certificate", "authority")]
    if own is not None and not own.key:
        table.report("certificate", f"{own.number}, which has no key", "one with a key")
    name = values["server_name"]
    from trcvtui.net.layers.tls import TlsSettings

    settings = TlsSettings(
        certificate=own.file if own else "",
        key=own.key if own else "",
        authorities=_authorities(known, authority.number if authority else 0),
        asks_client=values["client_certificate"],
        server_name=name or "",
        checks_name=name is not None,
        is_unverified=values["verify"] is not None,
    )
    return settings, tuple([(key, values[key]) for key in TLS_KEYS if values[key]])


def _look_up(table: Table, key: str, number: int | None, known: Certificates) -> CertificateDecl | None:
    if number is not None and number not in known:
        numbers = ", ".join(map(str, known))
        table.report(key, quote(number), "the number of a [[certificate]]" + f": {numbers}" * bool(known))
    return None if number is None else known.get(number)


STRUCTURES: Final = CONNECTIONS | ADDRESSES
_ADDR_FIELDS: Final = ("rem_ip_addr", "rem_port_nr", "reserved")


def has_structure_keys(table: Table) -> bool:
    """Return whether a table has a key of a structure other than RemoteAddress and RemotePort."""
    return any(table.has(key) for key in ("type", "bytes", *_ADDR_FIELDS))


def read_addr_structure(table: Table) -> dict[str, Any] | None:
    """Return the arguments of an ADDR from a structure, or None if the structure cannot be read."""
    type_name = table.read("type", TEXT)
    if type_name is not None and type_name not in STRUCTURES:
        table.report_unknown_name("type", type_name, ADDRESSES, "structure")
        table.mark_known(*table.unread_keys())
        return None
    raw = table.read("bytes", DB_BYTES)
    if table.has("bytes"):
        found = None if raw is None else _addr_of_bytes(raw, type_name)
    else:
        found = _addr_of_fields(table, STRUCTURES[type_name or TADDR_PARAM.name])
    port = table.read("RemotePort", UDP_PORT_OR_NAME) if table.has("bytes") else None
    if found is None:
        return None
    description, given_port = found
    is_param = description.structure == TADDR_PARAM  # a receiver writes TADDR_RCV_IP: it names no partner
    address = description.text("rem_ip_addr") if is_param else ANY_ADDRESS
    port = given_port if port is None else port
    port = description.number("rem_port_nr") if port is None else port
    return {"remote_address": address, "remote_port": port, "description": description}


def _addr_of_bytes(raw: bytes, type_name: str | None) -> tuple[Description, int | str | None]:
    by_size = next((one for one in ADDRESSES.values() if one.size == len(raw)), TADDR_PARAM)
    return Description(STRUCTURES[type_name] if type_name else by_size, raw), None


def _addr_of_fields(table: Table, structure: Structure) -> tuple[Description, int | str | None]:
    if structure != TADDR_PARAM:
        return Description(structure, bytes(structure.size)), None
    address = table.get("rem_ip_addr", ADDRESS, ANY_ADDRESS)
    port = table.get("rem_port_nr", UDP_PORT_OR_NAME, 0)
    number = port if isinstance(port, int) else 0
    values: dict[str, FieldValue] = {
        "rem_ip_addr": address,
        "rem_port_nr": number,
        "reserved": table.get("reserved", UINT, 0),
    }
    return Description(structure, pack(structure, values)), port


LOOPBACK: Final = "127.0.0.1"
ISO_PORT: Final = 102
DEFAULT_TYPE: Final = "TCON_IP_v4"
USUAL_INTERFACE: Final = 64  # the first PROFINET port of a CPU


# -- how the fields are written ------------------------------------------------------------------------------


def _parser(size: int) -> Callable[[str], bytes | None]:
    def read(text: str) -> bytes | None:
        numbers = parse_octets(text)
        found = bytes(numbers) if numbers is not None else parse_db_bytes(text)
        return found if found is not None and len(found) <= size else None

    return read


REFERENCE: Final = text_kind(
    "@NAME of a peer or CONNECT, not a number", lambda text: text if parse_reference(text) else None
)
NO_SERVER: Final = "none"
DNS_ANSWER: Final = text_kind(
    'the address that the DNS server of the bench answers, or "none": no server',
    lambda text: text if text == NO_SERVER else parse_address(text),
)
STRUCTURE: Final = text_kind("the name of a structure such as TCON_IP_RFC", lambda text: text)
QDN: Final = text_kind(
    f"a name of at most {LONGEST_NAME} ASCII characters such as plc2.line.local.",
    lambda text: text if text.isascii() and len(text) <= LONGEST_NAME else None,
)


def _field_kind(field: DescriptionField) -> Kind[Any]:
    match field.type:
        case FieldType.NUMBER if field.name == "RemotePort":
            return PORT_OR_NAME
        case FieldType.NUMBER:
            return integer(0, (1 << 8 * field.size) - 1)
        case FieldType.TRUTH:
            return TRUTH
        case FieldType.ADDRESS:
            return ADDRESS
        case FieldType.SELECTOR:
            return TSAP
        case FieldType.NAME:
            return QDN
        case FieldType.BYTES:
            return text_kind(f"at most {field.size} bytes in hex, or an IPv4 address", _parser(field.size))


# -- one table ------------------------------------------------------------------------------------------


class WrittenDescription(Struct, frozen=True):
    """A description as in the file. `reference` is a RemotePort `@NAME` of a peer or CONNECT."""

    description: Description
    reference: str | None = None
    flaw: DescriptionFlaw | None = None
    is_plain: bool = False  # neither `type` nor `bytes`: LocalPort 0 is a free port, as in any dialect


class BenchKeys(Struct, frozen=True):
    address: str | None
    listen_port: int | None
    iso_port: int | str
    dns_answer: str | None
    keep_alive: int
    is_unverified: bool


def check_bench_keys(table: Table, description: Description) -> None:
    """Report the first bench key that has no effect on a CONNECT with this description."""
    spec = read_spec(description)
    iso_port, is_iso = table.text("IsoPort"), spec.protocol is Transport.ISO
    may_be_iso = is_iso or (spec.protocol is Transport.UNKNOWN and speaks_iso(description.structure.name))
    useless = (
        ("IsoPort", not may_be_iso, "nothing: only ISO-on-TCP has it"),
        ("ListenPort", is_iso, "IsoPort"),
        ("ListenPort", spec.is_active, "nothing: an active end does not listen"),
        ("DnsAnswer", not _has_name_field(description), "nothing: there is no RemoteQDN"),
        ("verify", not is_secure(description), "nothing: only a secure connection has certificates"),
        (
            "IsoPort",
            iso_port is not None and iso_port.startswith("@") and not spec.is_active,
            "a port: a passive end listens on a port of its own",
        ),
    )
    for key, is_useless, expected in useless:
        if table.has(key) and is_useless:
            table.report(key, quote(table.peek(key)), expected)
            return


def read_description(table: Table, number: int, structures: tuple[str, ...]) -> WrittenDescription | None:
    """Return the description in a table, by its fields or as bytes. Without an ID, the ID is `number`."""
    type_name = table.read("type", STRUCTURE)
    if type_name is not None and type_name not in CONNECTIONS:
        table.report_unknown_name("type", type_name, CONNECTIONS, "structure")
        table.mark_known(*table.unread_keys())
        return None
    raw = table.read("bytes", DB_BYTES)
    if table.has("bytes"):
        reference = table.read("RemotePort", REFERENCE)
        return None if raw is None else _describe_from_bytes(raw, type_name, reference)
    structure = CONNECTIONS[type_name or _default_type(table, structures)]
    written = _read_fields(table, structure, number, is_plain=type_name is None)
    is_taken = not structures or structure.name in structures
    return written if type_name or is_taken else _convert_to_tcon_param(written)


def _default_type(table: Table, structures: tuple[str, ...]) -> str:
    """Return the structure of a CONNECT without `type`: the first with a field that the table has."""
    own = [name for name in structures if any(table.has(field.name) for field in CONNECTIONS[name].fields)]
    return own[0] if own else DEFAULT_TYPE


def _convert_to_tcon_param(written: WrittenDescription) -> WrittenDescription:
    description = written.description
    found = to_tcon_param(read_spec(description), has_interface=bool(description.number("InterfaceId")))
    return replace(written, description=found) if found is not None else written


def _describe_from_bytes(raw: bytes, type_name: str | None, reference: str | None) -> WrittenDescription:
    structure = CONNECTIONS[type_name] if type_name else find_structure(raw)
    if structure is None:
        text = f"{len(raw)} bytes are no connection description"
        flaw = DescriptionFlaw(Flaw.NO_DESCRIPTION, "", text)
        return WrittenDescription(Description(CONNECTIONS[DEFAULT_TYPE], raw), flaw=flaw)
    return WrittenDescription(Description(structure, raw), reference)


def _read_fields(table: Table, structure: Structure, number: int, is_plain: bool) -> WrittenDescription:
    read = {field.name: table.read(field.name, _field_kind(field)) for field in structure.fields}
    port = read.get("RemotePort")
    reference = port if isinstance(port, str) else None
    if reference is not None:
        read["RemotePort"] = 0  # not known before the partner listens
    elif "RemotePort" not in read:
        reference = table.read("RemotePort", REFERENCE)
    given: dict[str, FieldValue] = {name: value for name, value in read.items() if value is not None}
    data = pack(structure, _default_values(structure, number, given) | given)
    return WrittenDescription(Description(structure, data), reference, is_plain=is_plain)


def _default_values(structure: Structure, number: int, given: dict[str, FieldValue]) -> dict[str, FieldValue]:
    """Return the values that STEP 7 gives a new description; lengths follow from the given fields."""
    kind = connection_types_of(structure.name)[0]
    if structure.name != "TCON_Param":
        return {"InterfaceId": USUAL_INTERFACE, "ID": number, "ConnectionType": kind}
    usual: dict[str, FieldValue] = {"block_length": structure.size, "id": number, "connection_type": kind}
    usual |= {"active_est": True, "local_device_id": 1}
    for size, part in (
        ("local_tsap_id_len", "local_tsap_id"),
        ("rem_tsap_id_len", "rem_tsap_id"),
        ("rem_staddr_len", "rem_staddr"),
    ):
        content = given.get(part, b"")
        usual[size] = len(content) if isinstance(content, bytes) else 0
    return usual


def _has_name_field(description: Description) -> bool:
    return description.structure.field("RemoteQDN") is not None


def make_config_fields(
    written: WrittenDescription,
    bench: BenchKeys,
    rules: VendorRules,
    certificates: Certificates,
    structures: tuple[str, ...],
) -> dict[str, Any]:
    """Return a CONNECT's arguments without its name. Blocks accept only `structures`; () means all."""
    spec = read_spec(written.description)
    session = _make_session(written.description, spec, bench, rules, certificates)
    remote, name_flaw = _remote_address(written, spec, bench)
    any_local = spec.is_active and bench.address is None and not is_loopback(remote)
    address = bench.address or LOOPBACK
    takes_free_port = bench.listen_port is not None or written.is_plain
    described = DescribedConnect(
        written.description,
        spec,
        address,
        takes_free_port,
        remote_is_known=written.reference is not None,
        structures=structures,
        narrow_tsaps=rules.policy.narrow_tsaps,
    )
    local_port, remote_port = _choose_ports(written, spec, bench)
    of_session = session if isinstance(session, DescriptionFlaw) else None
    return {
        "active": spec.is_active,
        "local": Endpoint(ANY_ADDRESS if any_local else address, local_port),
        "remote_address": remote,
        "remote_port": remote_port,
        "keep_alive_interval_s": bench.keep_alive,
        "keep_alive_default_s": rules.policy.keep_alive_s,
        "session": None if isinstance(session, DescriptionFlaw) else session,
        "description": written.description,
        "flaw": written.flaw or find_flaw(described) or name_flaw or of_session,
        "any_local": any_local,
        "remote_name": spec.remote_name if bench.dns_answer is None else "",
        "is_datagram": spec.protocol is Transport.UDP,
    }


def _choose_ports(written: WrittenDescription, spec: LinkSpec, bench: BenchKeys) -> tuple[int, int | str]:
    if spec.protocol is Transport.ISO and spec.is_active:
        return 0, bench.iso_port
    if spec.protocol is Transport.ISO:
        return bench.iso_port if isinstance(bench.iso_port, int) else 0, 0
    own = spec.local_port if bench.listen_port is None else bench.listen_port
    return own, written.reference or spec.remote_port


def _remote_address(
    written: WrittenDescription, spec: LinkSpec, bench: BenchKeys
) -> tuple[str, DescriptionFlaw | None]:
    if not _has_name_field(written.description) or not spec.remote_name:
        return spec.remote_address, None
    if bench.dns_answer is None:  # the real DNS is asked at each attempt to connect
        return spec.remote_address, None
    if bench.dns_answer == NO_SERVER:
        flaw = DescriptionFlaw(Flaw.NO_RESOLVER, "RemoteQDN", "no DNS server (DnsAnswer)")
        return spec.remote_address, flaw
    if parse_octets(bench.dns_answer) == (0, 0, 0, 0):
        text = f"the DNS server does not know {spec.remote_name}"
        return spec.remote_address, DescriptionFlaw(Flaw.NAME_UNKNOWN, "RemoteQDN", text)
    return bench.dns_answer, None


def _make_session(
    description: Description, spec: LinkSpec, bench: BenchKeys, rules: VendorRules, certificates: Certificates
) -> LayerSettings | DescriptionFlaw | None:
    if is_secure(description):
        return resolve_tls(description, spec, certificates, bench.is_unverified)
    if spec.protocol is not Transport.ISO:
        return None
    own = spec.local_tsap, spec.remote_tsap
    return IsoSettings(*own, cap=rules.max_len, default_dt_bytes=rules.policy.tpdu_default)


def bytes_keys(config: ConnectConfig) -> KeyPairs:
    """Return structure and bytes; with the bench keys, these give the same CONNECT again."""
    description = _require_description(config)
    is_known = config.flaw is None or config.flaw.flaw is not Flaw.NO_DESCRIPTION
    keys: KeyPairs = [("type", description.structure.name)] if is_known else []
    keys.append(("bytes", description.data.hex(" ")))
    if isinstance(config.remote_port, str) and read_spec(description).protocol is not Transport.ISO:
        keys.append(("RemotePort", config.remote_port))
    return keys


def field_keys(config: ConnectConfig) -> KeyPairs:
    """Return the structure and all its fields, so that each field can be changed."""
    description = _require_description(config)
    keys: KeyPairs = [("type", description.structure.name)]
    for field in description.structure.fields:
        is_named = field.name == "RemotePort" and isinstance(config.remote_port, str)
        value = config.remote_port if is_named else description.value(field.name)
        keys.append((field.name, f"hex {value.hex(' ')}" if isinstance(value, bytes) else value))
    return [(key, value) for key, value in keys if value != "hex "]


def plain_keys(config: ConnectConfig) -> KeyPairs:
    """Return the keys of a plain TCP CONNECT that names no structure."""
    description = _require_description(config)
    keys: KeyPairs = [] if config.any_local else [("LocalAddress", config.local.address)]
    keys += [("ActiveEstablished", config.active), ("LocalPort", config.local.port)]
    keys += [("RemoteAddress", config.remote_address), ("RemotePort", config.remote_port)]
    keys.append(("ID", read_spec(description).identity))
    optional = (
        ("InterfaceId", description.number("InterfaceId")),
        ("KeepAliveTimeInterval", config.keep_alive_interval_s),
        ("history", exact_size(config.history) if config.history != DEFAULT_HISTORY else ""),
    )
    return keys + [(key, value) for key, value in optional if value]


def _require_description(config: ConnectConfig) -> Description:
    assert config.description is not None
    return config.description


def iso_port_of(config: ConnectConfig) -> int | str | None:
    """Return the value of IsoPort, or None without ISO-on-TCP."""
    if read_spec(_require_description(config)).protocol is not Transport.ISO:
        return None
    return config.remote_port if config.active else config.local.port


def listen_port_of(config: ConnectConfig) -> int | None:
    """Return ListenPort, or None if nothing listens or if the description or IsoPort gives the port."""
    spec, port = read_spec(_require_description(config)), config.local.port
    if spec.protocol is Transport.ISO or config.active:
        return None
    wants_port = config.flaw is not None and config.flaw.field == "LocalPort"
    takes_free_port = not port and not wants_port
    return port if port != spec.local_port or takes_free_port else None


def dns_answer_of(config: ConnectConfig) -> str | None:
    """Return DnsAnswer, None if the network's DNS is asked or the description has no name."""
    if not read_spec(_require_description(config)).remote_name or config.remote_name:
        return None
    is_without = config.flaw is not None and config.flaw.flaw is Flaw.NO_RESOLVER
    return NO_SERVER if is_without else config.remote_address


def verify_value_of(config: ConnectConfig) -> str | None:
    """Return the value that switches off the check of certificates, or None if they are checked."""
    tls = tls_credentials_of(config.session)
    return UNSAFE if tls is not None and tls.is_unverified else None


def addr_keys(addr: AddrParam) -> KeyPairs:
    assert addr.description is not None
    keys: KeyPairs = [("type", addr.description.structure.name), ("bytes", addr.description.data.hex(" "))]
    return keys + ([("RemotePort", addr.remote_port)] if isinstance(addr.remote_port, str) else [])
