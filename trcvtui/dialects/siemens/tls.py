"""Siemens STATUS words of secure connections: 80E0 to 80EE (siemens.md 2.3 to 2.5, 2.7)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.siemens.blocks import SET_UP, UDP

_SHOWN_BY: Final = {
    0x80E0: Condition.TLS_MESSAGE,
    0x80E1: Condition.TLS_HANDSHAKE,
    0x80E2: Condition.TLS_UNSUPPORTED,
    0x80E3: Condition.TLS_DISCARDED,
    0x80E4: Condition.TLS_NO_CA,
    0x80E5: Condition.TLS_EXPIRED,
    0x80E6: Condition.TLS_INTEGRITY,
    0x80E7: Condition.TLS_EXTENSION,
    0x80E9: Condition.TLS_SERVER_BARE,
    0x80EA: Condition.TLS_DATAGRAMS,
    0x80EB: Condition.TLS_CLIENT_ASKS,
    0x80EC: Condition.TLS_SERVER_CHECKS,
    0x80ED: Condition.TLS_REFERENCE,
}
# No device of this bench changes a record on its way; 80E9 on are seen in the description.
_REACH: Final = {0x80E6: Reach.INJECTED, **dict.fromkeys(range(0x80E9, 0x80EE), Reach.LOGIC)}
# Code: what it means, two causes, two things to look at. The list of codes is read, what each covers is not.
_FAILURES: Final = {
    0x80E0: (
        "TLS: a message that makes no sense",
        ("the partner speaks plain TCP on this port", "another protocol version, or bytes that were damaged"),
        (
            "`openssl s_client -connect ADDRESS:PORT`: does TLS answer at all?",
            "ActivateSecureConn at both ends",
        ),
    ),
    0x80E1: (
        "TLS: the handshake failed",
        (
            "no version or cipher that both sides have, or the partner did not accept what this side showed",
            "ExtTLSCapabilities bit 0: the certificate does not bear the partner's address or name",
        ),
        (
            "the ledger: the alert and who sent it; `openssl s_client -connect ADDRESS:PORT -msg`",
            "`openssl x509 -in FILE -noout -ext subjectAltName` against RemoteAddress or RemoteQDN",
        ),
    ),
    0x80E2: (
        "TLS: certificate not supported, or missing",
        (
            "the client has shown no certificate (TLSServerReqClientCert asks for one)",
            "a key, a signature or a use of a kind that is not taken",
        ),
        ("`openssl x509 -in FILE -noout -text`: key, signature, extended key usage", "another certificate"),
    ),
    0x80E3: (
        "TLS: the certificate was discarded",
        ("it was revoked, or it is not valid yet", "the clock of the CPU is wrong"),
        ("`openssl x509 -in FILE -noout -dates` and the clock", "the certificate manager of the CPU"),
    ),
    0x80E4: (
        "TLS: no authority for the certificate",
        ("the authority that signed it is not among those that are trusted", "part of the chain is missing"),
        (
            "`openssl verify -CAfile CA.pem FILE.pem`",
            "the chain that the partner sends: `s_client -showcerts`",
        ),
    ),
    0x80E5: (
        "TLS: the certificate has expired",
        ("its last day is over", "the clock of the CPU is wrong"),
        ("`openssl x509 -in FILE -noout -enddate`", "the time of day of the CPU"),
    ),
    0x80E6: (
        "TLS: integrity check failed",
        ("a record was changed on its way", "a device in between opens the connection"),
        ("`tcpdump -ni any -w FILE tcp port PORT` at both ends", "firewalls that look into TLS"),
    ),
    0x80E7: (
        "TLS: an extension is not supported",
        ("the certificate has a critical extension that is not known", "the handshake asks for one"),
        ("`openssl x509 -in FILE -noout -ext all`", "a certificate without it"),
    ),
    0x80E9: (
        "TLS: a server without a certificate",
        ("TLSServerCertRef is 0 on the passive side", "the certificate of that number was not loaded"),
        ("TLSServerCertRef in the description", "the certificates of the project or the CPU"),
    ),
    0x80EA: (
        "TLS: not for datagrams",
        ("a secure connection of UDP (DTLS) was asked for", "ActivateSecureConn with a type of UDP"),
        ("ConnectionType of the description", "protect the datagrams another way"),
    ),
    0x80EB: (
        "TLS: a client asks for a client certificate",
        ("TLSServerReqClientCert is TRUE on the active side", "the description was copied from the server"),
        ("TLSServerReqClientCert: FALSE on the client", "ActiveEstablished at both ends"),
    ),
    0x80EC: (
        "TLS: a server checks the partner's name",
        (
            "bit 0 of ExtTLSCapabilities is set on the passive side",
            "the description was copied from the client",
        ),
        ("ExtTLSCapabilities: 0 on the server", "ActiveEstablished at both ends"),
    ),
    0x80ED: (
        "TLS: the number of a certificate is wrong",
        ("no certificate has the number in TLSServerCertRef or TLSClientCertRef", "it was not loaded"),
        ("the numbers in the certificate manager", "server and client reference: were they mixed up?"),
    ),
}
_UNSURE: Final = "the sources list this code in a row of short names; which failure shows it is inferred"
_NO_DATAGRAM_TLS: Final = "a UDP connection has no secure structure: ActivateSecureConn cannot be written"
_NOT_BEFORE: Final = "a job starts behind the handshake: until then the connection is not up (80A1)"


def _row(code: int) -> StatusRow:
    title, causes, checks = _FAILURES[code]
    return StatusRow(
        code,
        _SHOWN_BY[code],
        SET_UP,
        True,
        title,
        causes,
        checks,
        _REACH.get(code, Reach.REAL),
        "siemens.md 2.3, 3.5",
        unsure=_UNSURE,
    )


TLS_ERRORS: Final = (
    *(_row(code) for code in _FAILURES),
    StatusRow(
        0x80EA,
        None,
        UDP,
        True,
        *_FAILURES[0x80EA],
        Reach.NEVER,
        "siemens.md 2.7",
        unreached=_NO_DATAGRAM_TLS,
        unsure=_UNSURE,
    ),
    StatusRow(
        0x80EE,
        None,
        ("TSEND", "TRCV"),
        True,
        "TLS: the handshake has not ended",
        (
            "a job came before the secure connection was ready",
            "the partner does not go on with the handshake",
        ),
        ("start jobs behind the DONE of TCON", "`tcpdump -ni any tcp port PORT`: whose message is missing?"),
        Reach.NEVER,
        "siemens.md 2.4, 2.5",
        unreached=_NOT_BEFORE,
    ),
)
