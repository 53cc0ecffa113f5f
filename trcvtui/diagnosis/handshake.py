"""What a failed TLS handshake proves, and what mends it at which end: no check is ever turned off."""

from __future__ import annotations

from typing import Final

from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import Answer, Sentence, do
from trcvtui.net.layer import TlsError, tls_of
from trcvtui.net.results import octets

_LOOK: Final = "`openssl s_client -showcerts -connect {peer}` shows it"
_TEXT: Final = "`openssl x509 -in FILE -noout -text` shows it"
_VERSION: Final = "let it take TLS 1.2 or 1.3"
# {shows}: the reference to what this end shows, {trusts}: to whom it trusts, {name}: whom it has asked for.
_THEIRS: Final[dict[str, tuple[str, str]]] = {  # what is wrong with the partner's certificate
    TlsError.WRONG_NAME: (
        "the certificate of {peer} is not valid for {name}",
        "have it made anew with {name} in its subjectAltName, or call it by a name that stands there",
    ),
    TlsError.NO_CA: (
        "the certificate of {peer} was signed by none that {trusts} trusts",
        "give {trusts} the certificate of its CA, or a self-signed one itself once you know it to be genuine",
    ),
    TlsError.EXPIRED: (
        "the certificate of {peer} has expired, or the clock here is wrong",
        "renew it there, and compare the clock with its last day",
    ),
    TlsError.DISCARDED: (
        "the certificate of {peer} is not valid yet, or cannot be used for another reason",
        "compare the clocks of both ends with its first day",
    ),
    TlsError.UNSUPPORTED: (
        "{peer} showed a certificate for another use, or with too short a key",
        "have it made anew for that use, with a longer key",
    ),
    TlsError.EXTENSION: (
        "the certificate of {peer} has a critical extension that is not known here",
        "have it made anew without that extension",
    ),
}
_OTHERS: Final[dict[str, tuple[str, str]]] = {  # an error, or what the library or an alert calls the reason
    TlsError.NO_CERTIFICATE: (
        "{peer} showed no certificate, and is asked for one",
        "set its own certificate there",
    ),
    TlsError.PLAIN: ("{peer} speaks no TLS on this port", "let it speak TLS there, or correct the port"),
    "protocol_version": ("{peer} does not speak TLS 1.2 or 1.3", _VERSION),
    "unsupported_protocol": ("{peer} does not speak TLS 1.2 or 1.3", _VERSION),
    "no_shared_cipher": ("{peer} has no cipher that this end takes", "let it take those of TLS 1.2 or 1.3"),
    "certificate_required": (
        "{peer} asks for a certificate, and this end shows none",
        "set {shows} to one that has its key here and a CA that is trusted there",
    ),
    "handshake_failure": (
        "{peer} refuses and tells no reason: it wants a certificate of this end, or another cipher",
        "look into its log; with TLS 1.2 set {shows} where it wants a certificate",
    ),
    "unknown_ca": (
        "{peer} does not trust who signed the certificate of this end",
        "give it the CA of the one in {shows}",
    ),
    "certificate_expired": (
        "for {peer} the certificate of this end has expired, or is not valid yet",
        "renew the one in {shows}, or set the clock there right",
    ),
    **dict.fromkeys(
        ("bad_certificate", "certificate_unknown", "unsupported_certificate", "certificate_revoked"),
        (
            "{peer} does not take the certificate of this end",
            f"compare the one in {{shows}} with what it asks for (name, use, key, CA): {_TEXT}",
        ),
    ),
}


def why_it_failed(e: Evidence) -> Answer:
    """Return what the session knows of its end, and the remedy for just that."""
    session = tls_of(e.config.session) if e.config is not None else None
    if e.cause.call != "session" or e.config is None or session is None:
        return ""
    theirs = _THEIRS.get(e.cause.error)
    told = theirs or _OTHERS.get(e.cause.error) or _OTHERS.get(e.cause.words)
    if told is None:
        is_open = e.config.active and e.cause.error == TlsError.HANDSHAKE
        return do("", _LOOK.format(peer=e.cause.peer)) if is_open else ""
    name = session.server_name.rstrip(".")
    ends = (
        ("TLSClientCertRef", "TLSServerCertRef")
        if e.config.active
        else ("TLSServerCertRef", "TLSClientCertRef")
    )
    known = {
        "peer": e.cause.peer or "the partner",
        "name": f"{'DNS' if octets(name) is None else 'IP'}:{name}",
        "shows": ends[0],
        "trusts": ends[1],
    }
    cause, text = (each.format(**known) for each in told)
    look = do("", _LOOK.format(**known)).do if theirs and e.config.active else ()
    return Sentence(cause, (*do("", text).do, *look))
