"""Siemens STATUS words of connection descriptions, names and TLS: 809x, 80B3 to 80B8, 80CE, 80D0 to 80EE."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow, unreached_row
from trcvtui.dialects.siemens.states import SET_UP, TCON, UDP

DESCRIPTION_ERRORS: Final = (
    StatusRow(
        0x809A,
        Condition.DESCRIPTION_LENGTH,
        SET_UP,
        "CONNECT has the wrong length",
        (
            "the bytes at CONNECT are more or fewer than their structure has",
            "a structure that the integrated interface does not take",
        ),
        (
            "sizes: TCON_IP_v4 14, TCON_IP_RFC 80, TCON_QDN 266, IP_V4_SEC 26, QDN_SEC 278, TCON_Param 64",
            "a data block that was made by hand: is it of the standard layout (not optimized)?",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TCON_IP_v4",
        unsure="the sizes of TCON_IP_RFC, TCON_QDN and the SEC structures come from memory",
    ),
    StatusRow(
        0x809B,
        Condition.INTERFACE_WRONG,
        SET_UP,
        "InterfaceId is wrong",
        (
            "InterfaceId is 0, which only a description with a name may have",
            "no port of the CPU has this hardware identifier",
            "on this bench: LocalAddress is no address of this machine",
        ),
        (
            "the hardware identifier of the port in the device configuration, usually 64 (16#40)",
            "`ip -br address`: LocalAddress has to be in that list",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TCON_IP_v4",
        also=(Condition.WRONG_LOCAL_ADDRESS,),
    ),
    unreached_row(
        0x809C,
        TCON,
        "Multicast needs an InterfaceId",
        ("UDP to a multicast group with InterfaceId 0", "the CPU has several ports and cannot choose one"),
        ("the hardware identifier of the port instead of 0", "whether multicast is meant at all"),
        "STEP 7 help: TCON",
        unreached="the bench joins no multicast group; a group as RemoteAddress shows 80A4",
    ),
    StatusRow(
        0x80B3,
        Condition.NEEDS_ADDR,
        (*SET_UP, "TUSEND"),
        "Faulty description, or UDP without ADDR",
        (
            "the description is one of UDP, and this block has no ADDR",
            "TUSEND: the port in ADDR is 0, or the connection is one of TCP",
            "the local port stands in another description as well",
        ),
        (
            "ConnectionType: 16#13 is UDP, which goes with TUSEND and TURCV",
            "ADDR: address and port of the receiver, both of them",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TUSEND",
        also=(Condition.OTHER_TRANSPORT,),
    ),
    StatusRow(
        0x80B3,
        Condition.OTHER_TRANSPORT,
        ("TSEND", "TRCV", "TURCV"),
        "The block does not fit the connection",
        (
            "TSEND or TRCV on a connection of UDP: TUSEND and TURCV are meant",
            "TURCV on a connection of TCP: TRCV is meant",
        ),
        (
            "ConnectionType of the description: 16#13 is UDP, 16#0B and 16#11 are TCP",
            "the ID at both blocks",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND, TRCV, TURCV",
    ),
    StatusRow(
        0x80B4,
        Condition.TSAP_WRONG,
        SET_UP,
        "The local TSAP is not allowed",
        (
            "LocalTSelector is empty, or has two bytes and does not begin with E0",
            "it begins with SIMATIC-, which is the system's own",
            "S7-1200: after E0 or E1 stands neither 00 nor 01, or no ASCII from the third byte on",
        ),
        (
            "LocalTSelector byte by byte: length first, then E0 and rack / slot, or a text such as TCP-1",
            "the partner's remote TSAP has to be these very bytes",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TCON_IP_RFC; S7-1200 System Manual",
        unsure="the help prints 0E where E0 must be meant",
    ),
    StatusRow(
        0x80B5,
        Condition.UDP_ACTIVE,
        SET_UP,
        "UDP cannot be established actively",
        (
            "ConnectionType is UDP and ActiveEstablished is TRUE",
            "a description of TCP was copied and only its type changed",
        ),
        ("ActiveEstablished: FALSE", "LocalPort: UDP needs one"),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON",
    ),
    StatusRow(
        0x80B6,
        Condition.TYPE_WRONG,
        SET_UP,
        "ConnectionType is wrong",
        (
            "the type does not belong to this structure: TCON_IP_v4 takes 0B, 11, 13; TCON_IP_RFC 0C, 12",
            "decimal and hexadecimal were mixed up: 11 and 16#11 are both TCP, 13 and 16#13 are not alike",
        ),
        (
            "field ConnectionType, the fifth byte (TCON_Param: connection_type), in hexadecimal",
            "17 TCP, 18 ISO-on-TCP, 19 UDP are the old numbers, 11, 12, 13 the new ones",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON",
    ),
    StatusRow(
        0x80B7,
        Condition.PARAMETER_WRONG,
        SET_UP,
        "A field of the description is wrong",
        (
            "active with RemotePort 0 or RemoteAddress 0.0.0.0; passive or UDP with LocalPort 0",
            "TCON_Param: a length field does not fit the type of connection",
            "a T-selector of more than 32 bytes",
        ),
        (
            "the ledger names the field, what stands in it and what was expected",
            "passive: RemoteAddress 0.0.0.0 is taken as anyone",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TCON_Param; S7-1200 System Manual",
        unsure="0.0.0.0 on a passive end: one page lists 80B7, another uses it for anyone",
    ),
    StatusRow(
        0x80B7,
        Condition.PARAMETER_WRONG,
        UDP,
        "ADDR has not 8 bytes",
        ("another structure than TADDR_Param stands at ADDR", "a hand-made one without the two spare bytes"),
        ("the type of the variable at ADDR", "TADDR_Param: 4 bytes address, 2 port, 2 that are 0"),
        Reproducibility.LOGIC,
        "STEP 7 help: TUSEND, TURCV",
    ),
    unreached_row(
        0x80B8,
        TCON,
        "ID at the pin and in CONNECT differ",
        (
            "pin ID of TCON has another number than field ID of CONNECT",
            "CONNECT was copied, ID was not changed",
        ),
        ("both numbers side by side", "one constant for both"),
        "STEP 7 help: TCON",
        unreached="a block of the bench names its CONNECT and has no ID of its own beside it",
    ),
    StatusRow(
        0x80CE,
        Condition.INTERFACE_BARE,
        SET_UP,
        "The local interface has no address",
        (
            "the port has the address 0.0.0.0: not configured, or still waiting for DHCP",
            "on this bench: LocalAddress of CONNECT was left out",
        ),
        (
            "`ip -br address`: which address has the port?",
            "LocalAddress of CONNECT in the project file",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
    ),
    StatusRow(
        0x80D0,
        Condition.NAME_EMPTY,
        SET_UP,
        "The partner's name is empty",
        ("RemoteQDN has no character", "the bytes of the STRING are shifted: its length byte is 0"),
        ("RemoteQDN: two bytes of header, then the name", "an active end needs a name with a dot after it"),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON, TCON_QDN",
    ),
    StatusRow(
        0x80D1,
        Condition.NAME_NOT_FULL,
        SET_UP,
        "The partner's name is not fully qualified",
        ("the dot at the end is missing: plc.example. is meant", "only the host's own name was given"),
        ("the last character of RemoteQDN", "`getent hosts NAME`: what is its full name?"),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON, TCON_QDN",
    ),
    StatusRow(
        0x80D2,
        Condition.NO_RESOLVER,
        SET_UP,
        "No server for names",
        ("no DNS server is configured on the CPU", "on this bench: the project names no resolver"),
        ("the DNS servers of the CPU; here `/etc/resolv.conf`", "an address instead of a name: TCON_IP_v4"),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
    ),
    StatusRow(
        0x80D3,
        Condition.NAME_UNKNOWN,
        SET_UP,
        "The partner's name is unknown",
        ("no DNS server knows the name", "the server did not answer in time"),
        ("`getent hosts NAME` and `nslookup NAME`", "a mistake in RemoteQDN: letters, dots, the last dot"),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
    ),
    unreached_row(
        0x80D3,
        ("TUSEND",),
        "The receiver's name is unknown",
        ("the name in a TADDR_SEND_QDN is not known", "the server for names did not answer"),
        ("`getent hosts NAME`", "an address in a TADDR_Param instead"),
        "STEP 7 help: TUSEND, TADDR_Param",
        unreached="an [[addr]] of the project file has an address and no name",
    ),
)

_TLS_CONDITIONS: Final = {
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
# No device of this bench changes a record in transit; 80E9 and up are found in the description.
_TLS_REACH: Final = {
    0x80E6: Reproducibility.INJECTED,
    **dict.fromkeys(range(0x80E9, 0x80EE), Reproducibility.LOGIC),
}
# Code: what it means, two causes, two checks. The list of codes is from the manual, what each covers is not.
_TLS_TEXTS: Final = {
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
_UNSURE_TEXT: Final = "the sources list this code in a row of short names; which failure shows it is inferred"


def _tls_row(code: int) -> StatusRow:
    title, causes, checks = _TLS_TEXTS[code]
    return StatusRow(
        code,
        _TLS_CONDITIONS[code],
        SET_UP,
        title,
        causes,
        checks,
        _TLS_REACH.get(code, Reproducibility.REAL),
        "STEP 7 help: TCON, TCON_IP_V4_SEC",
        unsure=_UNSURE_TEXT,
    )


TLS_ERRORS: Final = (
    *(_tls_row(code) for code in _TLS_TEXTS),
    unreached_row(
        0x80EA,
        UDP,
        *_TLS_TEXTS[0x80EA],
        "STEP 7 help: TUSEND, TURCV",
        unreached="a UDP connection has no secure structure: ActivateSecureConn cannot be written",
        unsure=_UNSURE_TEXT,
    ),
    unreached_row(
        0x80EE,
        ("TSEND", "TRCV"),
        "TLS: the handshake has not ended",
        (
            "a job came before the secure connection was ready",
            "the partner does not go on with the handshake",
        ),
        ("start jobs after the DONE of TCON", "`tcpdump -ni any tcp port PORT`: whose message is missing?"),
        "STEP 7 help: TSEND, TRCV",
        unreached="a job starts after the handshake: until then the connection is not up (80A1)",
    ),
)
