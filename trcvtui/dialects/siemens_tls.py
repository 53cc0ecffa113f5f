"""Siemens STATUS words of secure connections: 80E0 to 80EE (siemens.md 2.3 to 2.5, 2.7)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.siemens_blocks import SET_UP, UDP

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
        ("no version or cipher that both sides have", "the partner did not accept what this side showed"),
        ("`openssl s_client -connect ADDRESS:PORT -msg`: the alert and who sent it", "versions at both ends"),
    ),
    0x80E2: (
        "TLS: the certificate is not supported",
        ("a key or signature of a kind that is not taken", "a certificate for another use"),
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
_NOT_YET: Final = "the bench speaks no TLS on a CONNECT"


def _blocks(code: int) -> tuple[str, ...]:
    return (*SET_UP, *UDP) if code == 0x80EA else SET_UP


TLS_ERRORS: Final = (
    *(
        StatusRow(
            code,
            None,
            _blocks(code),
            True,
            title,
            causes,
            checks,
            Reach.NEVER,
            "siemens.md 2.3, 2.7, 3.5" if code == 0x80EA else "siemens.md 2.3, 3.5",
            unreached=_NOT_YET,
            unsure=_UNSURE,
        )
        for code, (title, causes, checks) in _FAILURES.items()
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
        unreached=_NOT_YET,
    ),
)
