"""What may run on a TCP stream between the blocks and the kernel: ISO-on-TCP, TLS. Bytes in, bytes out.

The words of TLS stand here too, so that nobody loads the library for a word.

Rule: a session never touches a socket and never raises, whatever comes; it holds bounded memory.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Protocol

from msgspec import Struct

from trcvtui.net.results import Endpoint, Unread


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


class Credentials(Struct, frozen=True):
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


def tls_credentials_of(session: object) -> Credentials | None:
    """Return what a CONNECT with TLS shows and asks; None: it has another session, or none."""
    return session if isinstance(session, Credentials) else None


class LayerMessage(NamedTuple):
    """One message: its first bytes up to the session's cap, and how many it had."""

    data: bytes
    whole: int


class SessionEnd(NamedTuple):
    """Why a session is over: the word that a dialect maps to a code, and what a person should read."""

    error: str
    detail: str
    words: str = ""  # what the library, or an alert of the partner, calls the reason: `protocol_version`


class LayerSession(Protocol):
    """One end of a session."""

    ended: SessionEnd | None
    can_take_back: bool  # what `encode` returned need not be sent

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
        """Return whether bytes may be fed."""

    @property
    def held_bytes(self) -> int:
        """Return how many bytes are kept, read and unread."""

    def feed(self, data: memoryview, most: int = ...) -> int:
        """Take bytes that the partner has sent, and do at most `most` units of work on what is here.

        Return how many units it was (Work). Nothing is lost: what was not looked at is a backlog.
        """

    @property
    def has_backlog(self) -> bool:
        """Return whether a feed of nothing would go on: something waits here that was not looked at."""

    @property
    def is_costly(self) -> bool:
        """Return whether the next step is one of a handshake that costs real time."""

    @property
    def partner_is_done(self) -> bool:
        """Return whether the partner has said, inside the session, that nothing more comes."""

    def note_partner_end(self) -> None:
        """Note the end of the partner's bytes."""

    @property
    def unfinished_message(self) -> int:
        """Return the number of the message that has begun and not ended, 0: there is none, or no limit."""

    def time_out(self, why: str) -> None:
        """End a handshake, or a message, that takes too long, where the session has a word for that."""

    def take_remarks(self) -> list[str]:
        """Return what the partner has sent that was passed over, in words, once; a few of each session."""

    def say_goodbye(self) -> bool:
        """Tell the partner, once, that nothing more comes; return whether the session has a word for it."""

    def take_output(self) -> bytes:
        """Return what must be sent to the partner, once."""

    def read(self, into: memoryview) -> LayerMessage | None:
        """Put the next message, or the next bytes, into `into` and return it; None: nothing is there."""

    def encode(self, data: bytes) -> bytes:
        """Return the bytes that carry this data."""

    def drop_data(self) -> int:
        """Drop what could be read and return how many bytes it was."""


class LayerSettings(Protocol):
    """How to make a session: what a CONNECT says about it."""

    @property
    def is_message_oriented(self) -> bool: ...

    @property
    def shares_port(self) -> bool:
        """Return whether several passive CONNECTs listen on one port: the partner says which it wants."""

    def make_session(self, is_active: bool) -> LayerSession: ...
