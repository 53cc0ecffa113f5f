"""What TLS needs to know and how it can fail, as words: nothing here asks for the library itself."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class TlsError(StrEnum):
    """Why a secure connection did not come up, or ended."""

    PLAIN = "TLS_PLAIN"  # no TLS at all came
    HANDSHAKE = "TLS_HANDSHAKE"
    SILENT = "TLS_SILENT"
    REFUSED = "TLS_REFUSED"  # by the partner, who told it
    WRONG_NAME = "TLS_WRONG_NAME"
    NO_CERTIFICATE = "TLS_NO_CERTIFICATE"
    UNSUPPORTED = "TLS_UNSUPPORTED"
    DISCARDED = "TLS_DISCARDED"
    NO_CA = "TLS_NO_CA"
    EXPIRED = "TLS_EXPIRED"
    INTEGRITY = "TLS_INTEGRITY"
    EXTENSION = "TLS_EXTENSION"
    REFERENCE = "TLS_REFERENCE"  # our own certificate cannot be read any more
    TRUNCATED = "TLS_TRUNCATED"  # the stream ended without the partner's close_notify


@dataclass(frozen=True, slots=True)
class Credentials:
    """What one end shows and what it asks of the other. Files are PEM, by absolute path; "" is none.

    `authorities`: who may have signed the partner's certificate. `asks_client`: the passive end wants one.
    `server_name`: whom the active end asks for; `checks_name`: the certificate must bear it as a
    subjectAlternateName. `is_unverified`: any certificate will do, which the project must say in plain words.
    """

    certificate: str = ""
    key: str = ""
    authorities: tuple[str, ...] = ()
    asks_client: bool = False
    server_name: str = ""
    checks_name: bool = False
    is_unverified: bool = False
