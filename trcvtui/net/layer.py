"""Sessions on a TCP stream between the blocks and the kernel: ISO-on-TCP, TLS. Bytes in, bytes out.

The names of TLS errors are here, so that other modules need not load the TLS library.

Rule: a session never touches a socket. No input makes a session raise. A session holds bounded memory.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Protocol

from msgspec import Struct

from trcvtui.net.results import Endpoint, Unread


class TlsError(StrEnum):
    """Why a secure connection did not come up, or ended."""

    PLAIN = "TLS_PLAIN"  # bytes came that are no TLS
    HANDSHAKE = "TLS_HANDSHAKE"
    SILENT = "TLS_SILENT"
    REFUSED = "TLS_REFUSED"  # the partner sent an alert
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


class Credentials(Struct, frozen=True):
    """What one end shows and asks of its partner. Files are PEM, by absolute path; "" means no file.

    `authorities` are the CAs that may have signed the partner's certificate. With `asks_client`, the
    passive end asks for a certificate. The active end asks for `server_name`. With `checks_name`, a
    certificate must have it as subjectAlternateName. `is_unverified` explicitly allows any certificate.
    """

    certificate: str = ""
    key: str = ""
    authorities: tuple[str, ...] = ()
    asks_client: bool = False
    server_name: str = ""
    checks_name: bool = False
    is_unverified: bool = False


def tls_credentials_of(session: object) -> Credentials | None:
    """Return the credentials of a CONNECT with TLS, or None for another session or no session."""
    return session if isinstance(session, Credentials) else None


class LayerMessage(NamedTuple):
    """One message: its first bytes up to the session's cap, and its whole length."""

    data: bytes
    whole: int


class SessionEnd(NamedTuple):
    """Why a session is over. A dialect maps the name `error` to a code. `detail` is a text for the user."""

    error: str
    detail: str
    words: str = ""  # what the library, or an alert of the partner, calls the reason: `protocol_version`


class LayerSession(Protocol):
    ended: SessionEnd | None
    can_take_back: bool  # bytes that `encode` returned need not be sent

    @property
    def is_up(self) -> bool:
        """Return whether the handshake is over and data may flow."""

    @property
    def has_data(self) -> bool:
        """Return whether something can be read."""

    def unread(self, peer: Endpoint, skip: int) -> Unread:
        """Return what can be read, after the first `skip` bytes or messages."""

    @property
    def wants_more(self) -> bool:
        """Return whether the session takes more bytes now."""

    @property
    def held_bytes(self) -> int:
        """Return how many bytes the session stores, decoded or not."""

    def feed(self, data: memoryview, most: int = ...) -> int:
        """Take bytes from the partner, and do at most `most` units of work on these bytes and the backlog.

        Return the units that were used (ScanBudget). Bytes that were not looked at are the new backlog.
        """

    @property
    def has_backlog(self) -> bool:
        """Return whether the session has bytes it has not looked at; a `feed` of no bytes reads them."""

    @property
    def next_is_costly(self) -> bool:
        """Return whether the next step is a handshake step that takes much time."""

    @property
    def partner_is_done(self) -> bool:
        """Return whether the partner has announced the end inside the session (close_notify)."""

    def note_partner_end(self) -> None:
        """Note that the partner sends no more bytes."""

    @property
    def open_message(self) -> int:
        """Return the number of the unfinished message. Return 0 if there is none, or no time limit."""

    def time_out(self, why: str) -> None:
        """End a handshake or a message that takes too long, if the session has a limit for it."""

    def take_remarks(self) -> list[str]:
        """Return remarks on ignored bytes of the partner, each only once; their number is limited."""

    def say_goodbye(self) -> bool:
        """Announce the end to the partner, only once; return whether it has been announced."""

    def take_output(self) -> bytes:
        """Return the bytes that must be sent to the partner, each only once."""

    def read(self, into: memoryview) -> LayerMessage | None:
        """Put the next message or bytes into `into`, and return it. Return None if nothing is there."""

    def encode(self, data: bytes) -> bytes:
        """Return the bytes that carry this data."""

    def drop_data(self) -> int:
        """Drop the data that could be read; return its size in bytes."""


class LayerSettings(Protocol):
    """How to make a session: the settings of its CONNECT."""

    @property
    def is_message_oriented(self) -> bool: ...

    @property
    def shares_port(self) -> bool:
        """Return whether passive CONNECTs may share a port: then the partner names the CONNECT it wants."""

    def make_session(self, is_active: bool) -> LayerSession: ...
