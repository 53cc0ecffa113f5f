"""What a project file says of ISO-on-TCP and TLS: TSAPs, TPDU sizes, certificates, peers that speak them.

Rule: a file that cannot be read is a mistake in the project; a number that nobody has is the block's to show.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.net.connection.description import LONGEST_SELECTOR, Description, selector_bytes
from trcvtui.net.connection.description_check import CHECKS_NAME, Finding, Flaw, Meaning
from trcvtui.net.layers.tls import TlsSettings
from trcvtui.project.project import CertificateDecl, Certificates
from trcvtui.project.tables import Kind, Table, of_text, shown, whole
from trcvtui.udt.byte_text import parse_hex

LONGEST_MESSAGE: Final = 65536
SIZES: Final = {1 << code: code for code in range(7, 14)}  # 128 .. 8192 bytes
_TIA: Final = re.compile(r"[0-9a-fA-F]{2}\.[0-9a-fA-F]{2}")  # as TIA writes a TSAP of two bytes


def parse_selector(text: str) -> bytes | None:
    """Return a TSAP: `16#E002` and TIA's `E0.02` are bytes, `text:E002` and what cannot be hex are text.

    What could be either is None (`either_way` says how to write each), and so is what no TSAP can be.
    `hex E0 02` and `text E0 02` are from older files.
    """
    if text.startswith(("16#", "hex ")):
        found = hex_of(text[3:].replace(".", " ")) or None
    elif text.startswith(("text:", "text ")):
        found = _ascii(text[5:])
    elif _TIA.fullmatch(text):
        found = bytes.fromhex(text.replace(".", ""))
    else:
        found = None if _is_ambiguous(text) else _ascii(text)
    return found if found is not None and len(found) <= LONGEST_SELECTOR else None


def _is_ambiguous(text: str) -> bool:
    return bool(text) and not text.strip("0123456789abcdefABCDEF .")


def either_way(text: str) -> str:
    """Return how to write the two things that a text of hex digits can be, "" where it is none."""
    if not _is_ambiguous(text) or _TIA.fullmatch(text):
        return ""
    digits = "".join(char for char in text if char not in " .").upper()
    digits = digits.zfill(len(digits) + len(digits) % 2)
    as_text = f'"text:{text}" (the text)'
    if not digits or len(digits) > 2 * LONGEST_SELECTOR:
        return as_text
    return f'"16#{digits}" (the bytes {selector_bytes(bytes.fromhex(digits))}) or {as_text}'


def hex_of(text: str) -> bytes | None:
    """Return the bytes of a text in hex, None when it is none."""
    try:
        return parse_hex(text)
    except UserError:
        return None


def db_bytes(text: str) -> bytes | None:
    """Return the bytes of a DB; a lone digit is a copy that was cut off, not a byte."""
    groups = text.replace(",", " ").split()
    lone = any(len(group.lower().removeprefix("0x").removeprefix("16#")) % 2 for group in groups)
    return None if lone else hex_of(text)


def _ascii(text: str) -> bytes | None:
    return text.encode("ascii") if text.isascii() else None


TSAP: Final = of_text(
    'a TSAP of at most 32 bytes such as "16#E002", "E0.02" or "TCP-1"',
    parse_selector,
    either_way,
    write=lambda tsap: f"16#{tsap.hex().upper()}",
)
TPDU: Final[Kind[int]] = Kind(
    "a TPDU size: 128, 256, 512, 1024, 2048, 4096 or 8192",
    lambda value: SIZES.get(value) if isinstance(value, int) else None,
    lambda text: SIZES.get(int(text)) if text.isascii() and text.isdigit() and len(text) < 6 else None,
    write=lambda code: 1 << code,
)


DB_BYTES: Final = of_text(
    'the bytes of a DB in hex, two digits each, such as "00 40 00 01 0b 01 ..."', db_bytes
)


UNSAFE: Final = "none, this is unsafe"
NUMBER: Final = whole(1, (1 << 32) - 1)
VERIFY: Final = of_text(
    f'"{UNSAFE}", or no such key: certificates are verified', lambda text: text if text == UNSAFE else None
)
HOST: Final = of_text("the name or address that the certificate must bear", lambda text: text or None)
TLS_KEYS: Final = ("tls", "certificate", "authority", "client_certificate", "server_name", "verify")


def certificate_of(number: int, file: str, key: str, table: Table, base: Path) -> CertificateDecl:
    """Return a certificate whose files have been looked at."""
    found = CertificateDecl(
        number, str((base / file).absolute()), str((base / key).absolute()) if key else ""
    )
    flaw, at = _flaw_of(found)
    if flaw:
        table.wrong(at, flaw, "a PEM file")
    return found


def _flaw_of(one: CertificateDecl) -> tuple[str, str]:
    """Return what is wrong with the files, and at which key."""
    from trcvtui.net.layers.tls import (
        flaw_of_certificate,  # with the TLS library: only who has certificates waits
    )

    flaw = flaw_of_certificate(one.file, "")
    return (flaw, "file") if flaw or not one.key else (flaw_of_certificate(one.file, one.key), "key")


# -- a secure CONNECT ----------------------------------------------------------------------------------------


def is_secure(description: Description) -> bool:
    """Return whether the description asks for TLS."""
    return bool(description.number("ActivateSecureConn"))


def secure(
    description: Description, says: Meaning, known: Certificates, is_unverified: bool
) -> TlsSettings | Finding:
    """Return what the references mean: the active end trusts TLSServerCertRef and shows TLSClientCertRef.

    On the passive end it is the other way round. 0: every certificate that is here to be trusted; of the
    active end's own: none.
    """
    server, client = description.number("TLSServerCertRef"), description.number("TLSClientCertRef")
    own, trusted = (client, server) if says.is_active else (server, client)
    for field, number, needs_key in (
        ("TLSClientCertRef" if says.is_active else "TLSServerCertRef", own, True),
        ("TLSServerCertRef" if says.is_active else "TLSClientCertRef", trusted, False),
    ):
        if number and (number not in known or (needs_key and not known[number].key)):
            kind = "certificate with a key" if needs_key else "certificate"
            return Finding(Flaw.CERTIFICATE, field, f"{field} is {number}, no {kind} has that number")
    shows = known.get(own)
    return TlsSettings(
        certificate=shows.file if shows else "",
        key=shows.key if shows else "",
        authorities=_authorities(known, trusted),
        asks_client=bool(description.number("TLSServerReqClientCert")),
        server_name=says.remote_name or says.remote_address,
        checks_name=bool(description.number("ExtTLSCapabilities") & CHECKS_NAME),
        is_unverified=is_unverified,
    )


def _authorities(known: Certificates, number: int) -> tuple[str, ...]:
    return (known[number].file,) if number else tuple(one.file for one in known.values() if not one.key)


# -- a peer --------------------------------------------------------------------------------------------------


class PeerTls(NamedTuple):
    """What a peer's table says of TLS: as settings, and as its keys."""

    settings: TlsSettings
    keys: tuple[tuple[str, bool | int | str], ...]


def tls_of_peer(values: Mapping[str, Any], table: Table, known: Certificates) -> PeerTls:
    """Return what the keys of a peer with TLS mean."""
    own, authority = [_known(table, key, values[key], known) for key in ("certificate", "authority")]
    if own is not None and not own.key:
        table.wrong("certificate", f"{own.number}, which has no key", "one with a key")
    name = values["server_name"]
    settings = TlsSettings(
        certificate=own.file if own else "",
        key=own.key if own else "",
        authorities=_authorities(known, authority.number if authority else 0),
        asks_client=values["client_certificate"],
        server_name=name or "",
        checks_name=name is not None,
        is_unverified=values["verify"] is not None,
    )
    return PeerTls(settings, tuple([(key, values[key]) for key in TLS_KEYS if values[key]]))


def _known(table: Table, key: str, number: int | None, known: Certificates) -> CertificateDecl | None:
    if number is not None and number not in known:
        numbers = ", ".join(map(str, known)) or "of a [[certificate]]"
        table.wrong(key, shown(number), f"a number {numbers}" if known else f"the number {numbers}")
    return None if number is None else known.get(number)
