"""What a failed TLS handshake proves, and what mends it at which end: no check is ever turned off."""

from __future__ import annotations

from typing import Final

from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import AdvisedCause, RuleAnswer, SuggestedAction
from trcvtui.net.layer import TlsError, tls_credentials_of
from trcvtui.net.results import parse_octets

_SHOW_CERTIFICATES: Final = "`openssl s_client -showcerts -connect {peer}` shows it"
_WRONG_VERSION: Final = "{peer} does not speak TLS 1.2 or 1.3", "let it take TLS 1.2 or 1.3"
_OWN_CERT_REFUSED: Final = (
    "{peer} does not take the certificate of this end",
    "compare the one in {shows} (`openssl x509 -noout -text -in FILE`) with the name, use, CA it wants",
)
# {shows}: the reference to what this end shows, {trusts}: to whom it trusts, {name}: whom it has asked for.
# fmt: off
_PEER_ERRORS: Final[dict[str, tuple[str, str]]] = {  # what is wrong with the partner's certificate
    TlsError.WRONG_NAME: ("the certificate of {peer} is not valid for {name}",
        "have it made anew with {name} in its subjectAltName, or call it by a name that stands there"),
    TlsError.NO_CA: ("the certificate of {peer} was signed by none that {trusts} trusts",
        "give {trusts} the certificate of its CA, or a self-signed one itself once you know it is genuine"),
    TlsError.EXPIRED: ("the certificate of {peer} has expired, or the clock here is wrong",
        "renew it there, and compare the clock with its last day"),
    TlsError.DISCARDED: ("the certificate of {peer} is not valid yet, or cannot be used for another reason",
        "compare the clocks of both ends with its first day"),
    TlsError.UNSUPPORTED: ("{peer} showed a certificate for another use, or with too short a key",
        "have it made anew for that use, with a longer key"),
    TlsError.EXTENSION: ("the certificate of {peer} has a critical extension that is not known here",
        "have it made anew without that extension"),
}
_REASONS: Final[dict[str, tuple[str, str]]] = {  # an error, or what the library or an alert calls the reason
    TlsError.NO_CERTIFICATE: ("{peer} showed no certificate, and is asked for one",
        "set its own certificate there"),
    TlsError.PLAIN: ("{peer} speaks no TLS on this port", "let it speak TLS there, or correct the port"),
    TlsError.SILENT: ("{peer} does not go on with the handshake: it speaks no TLS on this port, or hangs",
        "correct the port, or look into its log"),
    "protocol_version": _WRONG_VERSION, "unsupported_protocol": _WRONG_VERSION,
    "no_shared_cipher": ("{peer} has no cipher that this end takes", "let it take those of TLS 1.2 or 1.3"),
    "certificate_required": ("{peer} asks for a certificate, and this end shows none",
        "set {shows} to one that has its key here and a CA that is trusted there"),
    "handshake_failure": (
        "{peer} refuses and tells no reason: it wants a certificate of this end, or another cipher",
        "look into its log; with TLS 1.2 set {shows} where it wants a certificate"),
    "unknown_ca": ("{peer} does not trust who signed the certificate of this end",
        "give it the CA of the one in {shows}"),
    "certificate_expired": ("for {peer} the certificate of this end has expired, or is not valid yet",
        "renew the one in {shows}, or set the clock there right"),
    "bad_certificate": _OWN_CERT_REFUSED, "certificate_unknown": _OWN_CERT_REFUSED,
    "unsupported_certificate": _OWN_CERT_REFUSED, "certificate_revoked": _OWN_CERT_REFUSED,
}
# fmt: on
_HANDSHAKE_REFUSED: Final = "{peer} refuses the handshake: {words}", "look into its log, which may tell why"


def explain_handshake_failure(e: Evidence) -> RuleAnswer:
    """Return what the session knows of its end, and the remedy for just that."""
    session = tls_credentials_of(e.config.session) if e.config is not None else None
    if e.config is None or session is None or e.cause.call != "session":
        return ""
    error, is_active, name = e.cause.error, e.config.active, session.server_name.rstrip(".")
    told = _PEER_ERRORS.get(error) or _REASONS.get(error) or _REASONS.get(e.cause.words)
    told = told or (_HANDSHAKE_REFUSED if error == TlsError.REFUSED and e.cause.words else ("", ""))
    words = e.cause.words.replace("_", " ")
    references = ["TLSClientCertRef", "TLSServerCertRef"]
    shows, trusts = references if is_active else reversed(references)
    peer, name = e.cause.peer or "the partner", f"{'DNS' if parse_octets(name) is None else 'IP'}:{name}"
    is_open = error in _PEER_ERRORS or (error == TlsError.HANDSHAKE and not told[0])
    cause, *texts = (
        each.format(peer=peer, name=name, shows=shows, trusts=trusts, words=words)
        for each in (*told, _SHOW_CERTIFICATES if is_active and is_open else "")
    )
    return AdvisedCause(cause, tuple([SuggestedAction(text) for text in texts if text]))
