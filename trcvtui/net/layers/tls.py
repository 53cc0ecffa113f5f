"""One end of a TLS connection over a stream of bytes, made with Python's ssl; no sockets.

Rule 1: bytes in, bytes out. A wrong input raises no exception, but ends the session.
Rule 2: at most MOST_HELD_BYTES wait here, read or unread. Then no more may be fed (`wants_more`).
One feed reads at most `most` records. The other records wait in front of the library (`has_backlog`).
Rule 3: a partner asked for a certificate must show a verified one, unless the project allows others.
"""

from __future__ import annotations

import ssl
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final

from trcvtui.files import check_readable, is_disk_replaced
from trcvtui.net.connection.resources import HANDSHAKE_UNITS as HANDSHAKE_UNITS
from trcvtui.net.layer import Credentials, LayerMessage, LayerSession, SessionEnd, TlsError
from trcvtui.net.results import Endpoint, Unread

# X509_V_ERR_...: what is wrong with the partner's certificate; every other number is DISCARDED.
_VERIFY_ERRORS: Final = {
    2: TlsError.NO_CA,  # UNABLE_TO_GET_ISSUER_CERT
    9: TlsError.DISCARDED,  # CERT_NOT_YET_VALID
    10: TlsError.EXPIRED,  # CERT_HAS_EXPIRED
    18: TlsError.NO_CA,  # DEPTH_ZERO_SELF_SIGNED_CERT
    19: TlsError.NO_CA,  # SELF_SIGNED_CERT_IN_CHAIN
    20: TlsError.NO_CA,  # UNABLE_TO_GET_ISSUER_CERT_LOCALLY
    21: TlsError.NO_CA,  # UNABLE_TO_VERIFY_LEAF_SIGNATURE
    24: TlsError.UNSUPPORTED,  # INVALID_CA
    26: TlsError.UNSUPPORTED,  # INVALID_PURPOSE
    27: TlsError.NO_CA,  # CERT_UNTRUSTED
    34: TlsError.EXTENSION,  # UNHANDLED_CRITICAL_EXTENSION
    41: TlsError.EXTENSION,  # INVALID_EXTENSION
    62: TlsError.WRONG_NAME,  # HOSTNAME_MISMATCH
    64: TlsError.WRONG_NAME,  # IP_ADDRESS_MISMATCH
    66: TlsError.UNSUPPORTED,  # EE_KEY_TOO_SMALL
    67: TlsError.UNSUPPORTED,  # CA_KEY_TOO_SMALL
    68: TlsError.UNSUPPORTED,  # CA_MD_TOO_WEAK
}
_REASON_ERRORS: Final = {
    "HTTP_REQUEST": TlsError.PLAIN,
    "HTTPS_PROXY_REQUEST": TlsError.PLAIN,
    "WRONG_VERSION_NUMBER": TlsError.PLAIN,
    "UNKNOWN_PROTOCOL": TlsError.PLAIN,
    "PACKET_LENGTH_TOO_LONG": TlsError.PLAIN,
    "RECORD_LAYER_FAILURE": TlsError.PLAIN,
    "RECORD_TOO_SMALL": TlsError.PLAIN,
    "PEER_DID_NOT_RETURN_A_CERTIFICATE": TlsError.NO_CERTIFICATE,
    "UNKNOWN_CERTIFICATE_TYPE": TlsError.UNSUPPORTED,
    "WRONG_CERTIFICATE_TYPE": TlsError.UNSUPPORTED,
    "DECRYPTION_FAILED_OR_BAD_RECORD_MAC": TlsError.INTEGRITY,
    "DIGEST_CHECK_FAILED": TlsError.INTEGRITY,
    "BAD_SIGNATURE": TlsError.INTEGRITY,
    "BAD_EXTENSION": TlsError.EXTENSION,
    "UNSOLICITED_EXTENSION": TlsError.EXTENSION,
}
_ALERT_INFIX: Final = "_ALERT_"  # SSLV3_ALERT_BAD_CERTIFICATE: an alert that the partner has sent


def session_end_of(problem: Exception) -> SessionEnd:
    """Return why a session ends, from an exception of the ssl library."""
    if isinstance(problem, ssl.SSLCertVerificationError):
        error = _VERIFY_ERRORS.get(problem.verify_code, TlsError.DISCARDED)
        return SessionEnd(error, f"the partner's certificate: {problem.verify_message}")
    reason = str(getattr(problem, "reason", None) or problem)
    before, alert, name = reason.partition(_ALERT_INFIX)
    if alert and before in ("SSLV3", "TLSV1", "TLSV13"):
        return SessionEnd(TlsError.REFUSED, f"the partner says: {_format_reason(name)}", name.lower())
    return SessionEnd(_REASON_ERRORS.get(reason, TlsError.HANDSHAKE), _format_reason(reason), reason.lower())


def _format_reason(reason: str) -> str:
    return reason.lower().replace("_", " ")


class TlsSettings(Credentials, frozen=True):
    """Credentials with which TLS sessions are made. As on plain TCP, there are no messages."""

    is_message_oriented: bool = False
    shares_port: bool = False

    def make_session(self, is_active: bool) -> LayerSession:
        return TlsSession(self, is_active)


MOST_HELD_BYTES: Final = 128 * 1024  # bytes
RECORD_BYTES: Final = 16 * 1024  # the most data in one record (RFC 8446 5.1)
NO_LIMIT: Final = 1 << 62
MOST_CONTEXTS: Final = 256
# The first byte of a record; a server's first record may be an alert, a client's may not.
HANDSHAKE_RECORD: Final = 0x16
ALERT_RECORD: Final = 0x15

# What the library raises: for bytes, for files, and for an invalid server name.
_LIBRARY_ERRORS: Final = (ssl.SSLError, OSError, ValueError)


class TlsSession:
    """One end. `ended` is why the session failed. `partner_is_done` means that close_notify has come."""

    open_message = 0  # no time limit: a record is no message, and an incomplete one is bounded in size

    def __init__(self, credentials: Credentials, is_active: bool) -> None:
        self.ended: SessionEnd | None = None
        self.can_take_back = False  # records are numbered: one that is encoded must be sent
        self.is_up = False
        self.partner_is_done = False
        self._has_fed = False
        self._has_said_goodbye = False
        self._stopped_short = False  # there may be records that were not read
        self._first_bytes = (HANDSHAKE_RECORD, ALERT_RECORD) if is_active else (HANDSHAKE_RECORD,)
        self._plain = bytearray()
        self._incoming = ssl.MemoryBIO()
        self._outgoing = ssl.MemoryBIO()
        self._engine: ssl.SSLObject | None = None
        try:
            self._engine = get_context(credentials, is_active).wrap_bio(
                self._incoming,
                self._outgoing,
                server_side=not is_active,
                server_hostname=credentials.server_name.rstrip(".") or None if is_active else None,
            )
        except _LIBRARY_ERRORS as problem:
            self.ended = SessionEnd(TlsError.REFERENCE, f"our own certificates: {problem}")
        if is_active:
            self._shake_hands()

    # -- as every session ---------------------------------------------------------------------------------

    @property
    def has_data(self) -> bool:
        return bool(self._plain)

    @property
    def wants_more(self) -> bool:
        return self.ended is None and not self.partner_is_done and self.held_bytes < MOST_HELD_BYTES  # Rule 2

    def unread(self, peer: Endpoint, skip: int) -> Unread:
        return Unread(
            len(self._plain), bytes(self._plain[skip:]), is_full=not self.wants_more, has_session=True
        )

    @property
    def held_bytes(self) -> int:
        return len(self._plain) + self._incoming.pending

    def feed(self, data: bytes | memoryview, most: int = NO_LIMIT) -> int:
        """Take bytes of the stream, and read at most `most` records. Return the units of work (ScanBudget).

        If `most` is 0, only the first byte is checked.
        """
        if self.ended is not None or self.partner_is_done:
            return 0
        # Checked here, since the library would wait for the rest of a record of up to 16 KiB.
        if not self._has_fed and data and data[0] not in self._first_bytes:
            self._end(SessionEnd(TlsError.PLAIN, f"no TLS: the data begins with {data[0]:02X}, not with 16"))
            return 0
        if data:
            self._has_fed = True
            self._incoming.write(data)
        self._stopped_short = True
        return self._read_records(most) if most else 0

    @property
    def has_backlog(self) -> bool:
        return self._stopped_short and len(self._plain) < MOST_HELD_BYTES and self.wants_more

    @property
    def next_is_costly(self) -> bool:
        return not self.is_up  # signatures and key exchange: ms, while a record takes us

    def note_partner_end(self) -> None:
        """Note the end of the stream; without close_notify, an attacker may have cut it (TRUNCATED)."""
        if self.ended is not None or self.partner_is_done:
            return
        self._incoming.write_eof()
        if self.is_up:
            self._read_records(1)
        elif self._has_fed:
            self._end(SessionEnd(TlsError.HANDSHAKE, "closed in the middle of the handshake"))

    def take_remarks(self) -> list[str]:
        return []  # the library does not report what it ignores

    def time_out(self, why: str) -> None:
        if not self.is_up:
            self._end(SessionEnd(TlsError.SILENT, "the handshake does not continue"))

    def say_goodbye(self) -> bool:
        """Send close_notify, only once; return whether it has been sent."""
        if self.is_up and self.ended is None and self._engine is not None and not self._has_said_goodbye:
            self._has_said_goodbye = True
            with suppress(*_LIBRARY_ERRORS):  # ours is in the output; unwrap raises until the partner's comes
                self._engine.unwrap()
        return self._has_said_goodbye

    def take_output(self) -> bytes:
        return self._outgoing.read()

    def read(self, into: memoryview) -> LayerMessage | None:
        size = min(len(self._plain), len(into))
        if not size:
            return None
        data = bytes(memoryview(self._plain)[:size])
        into[:size] = data
        del self._plain[:size]
        return LayerMessage(data, size)

    def encode(self, data: bytes) -> bytes:
        """Return the records that carry this data, or b"" if the session is not up or fails."""
        if not self.is_up or self._engine is None:
            return b""
        try:
            self._engine.write(data)
        except _LIBRARY_ERRORS as problem:
            self._end(session_end_of(problem))
            return b""
        return self._outgoing.read()

    def drop_data(self) -> int:
        dropped = len(self._plain)
        self._plain.clear()
        return dropped

    # -- the library ----------------------------------------------------------------------------------------

    def _read_records(self, most: int) -> int:
        units = 0
        if not self.is_up:  # a step costs its units, also one that fails: else garbage would be free work
            self._shake_hands()
            units = HANDSHAKE_UNITS
        self._stopped_short = False
        return units + (self._decrypt(most - units) if self.is_up else 0)

    def _shake_hands(self) -> None:
        if self.ended is not None or self._engine is None:
            return
        try:
            self._engine.do_handshake()
            self.is_up = True
        except ssl.SSLWantReadError:
            pass
        except _LIBRARY_ERRORS as problem:  # Rule 1
            self._end(session_end_of(problem))

    def _decrypt(self, most: int) -> int:
        """Read at most `most` records, until none is left or enough bytes wait. Return how many."""
        assert self._engine is not None
        count = 0
        while self.ended is None and not self.partner_is_done:
            if len(self._plain) >= MOST_HELD_BYTES or count >= most:  # Rule 2
                self._stopped_short = True
                break
            count += 1
            try:
                got = self._engine.read(RECORD_BYTES)
            except ssl.SSLWantReadError:
                break
            except ssl.SSLZeroReturnError:  # the partner's close_notify
                got = b""
            except ssl.SSLEOFError:  # RFC 8446 6.1: a FIN alone may be forged
                self._end(SessionEnd(TlsError.TRUNCATED, "the stream ended without a close_notify"))
                break
            except _LIBRARY_ERRORS as problem:
                self._end(session_end_of(problem))
                break
            self._plain += got
            self.partner_is_done = not got
        return count

    def _end(self, ended: SessionEnd) -> None:
        if self.ended is None:
            self.ended = ended


# -- certificates --------------------------------------------------------------------------------------------


def get_context(credentials: Credentials, is_active: bool) -> ssl.SSLContext:
    """Return the context of these credentials; files are read again only when they have changed."""
    files = (credentials.certificate, credentials.key, *credentials.authorities)
    stamps = tuple(_file_stamp(file) for file in files if file)
    return _make_context(credentials, is_active, stamps)


_key_log: Final[list[str]] = []


def set_key_log(name: str) -> None:
    """Let sessions of contexts made from now on write their secrets into a file. With "" they do not."""
    _key_log[:] = [name] if name else []
    _make_context.cache_clear()  # a context in the cache would not write them


def _file_stamp(file: str) -> tuple[int, int]:
    seen = Path(file).stat()
    return seen.st_mtime_ns, seen.st_size


@lru_cache(maxsize=MOST_CONTEXTS)
def _make_context(
    credentials: Credentials, is_active: bool, stamps: tuple[tuple[int, int], ...]
) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT if is_active else ssl.PROTOCOL_TLS_SERVER)
    for name in _key_log:
        context.keylog_filename = name
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    # Renegotiation would let a partner repeat the costly handshake at will (CVE-2011-1473).
    context.options |= ssl.OP_NO_COMPRESSION | ssl.OP_NO_RENEGOTIATION | ssl.OP_NO_TICKET
    if not is_active:
        context.num_tickets = 0  # OP_NO_TICKET does not cover TLS 1.3
    # Only a subjectAlternateName counts as a name (RFC 6125), and only with `checks_name`.
    context.hostname_checks_common_name = False
    context.check_hostname = is_active and credentials.checks_name and not credentials.is_unverified
    asks = is_active or credentials.asks_client  # Rule 3
    context.verify_mode = ssl.CERT_REQUIRED if asks and not credentials.is_unverified else ssl.CERT_NONE
    context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN  # a trusted certificate needs no issuer above it
    for file in credentials.authorities:
        context.load_verify_locations(cafile=file)
    if credentials.certificate:
        context.load_cert_chain(credentials.certificate, credentials.key or None, password=_no_password)
    return context


def _no_password() -> str:
    return ""  # without it the library would ask at the terminal


def find_certificate_flaw(certificate: str, key: str) -> str:
    """Return what is wrong with PEM files, or "". If `key` is "", only the certificate is checked."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        check_readable(certificate)  # the library would wait for the other end of a FIFO
        if is_disk_replaced():
            return ""  # a replay: the file was checked when the run was recorded
        context.load_verify_locations(cafile=certificate)
    except OSError as problem:
        return _file_flaw(problem, certificate, "no certificate in PEM")
    if not key:
        return ""
    try:
        check_readable(key)
        context.load_cert_chain(certificate, key, password=_no_password)
    except OSError as problem:
        return _file_flaw(problem, key, "no key in PEM without a password, or not that of the certificate")
    return ""


def _file_flaw(problem: OSError, file: str, otherwise: str) -> str:
    return f"{file}: {otherwise if isinstance(problem, ssl.SSLError) else problem.strerror}"
