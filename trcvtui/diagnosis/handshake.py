"""What a failed TLS handshake proves, what to correct, and at which end. No remedy turns a check off."""

from __future__ import annotations

from typing import Final

from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import AdvisedCause, RuleAnswer, SuggestedAction
from trcvtui.net.layer import TlsError, tls_credentials_of
from trcvtui.net.results import parse_octets

_SHOW_CERTIFICATES: Final = "`openssl s_client -showcerts -connect {peer}` shows the certificate"
_WRONG_VERSION: Final = "{peer} does not speak TLS 1.2 or 1.3", "enable TLS 1.2 or 1.3 at {peer}"
_OWN_CERT_REFUSED: Final = (
    "{peer} does not accept the certificate of this end",
    "compare {shows} (`openssl x509 -noout -text -in FILE`) with the name, use and CA that {peer} wants",
)
# {shows}: the reference of this end's own certificate, {trusts}: of those it trusts, {name}: what it called.
# fmt: off
_PEER_ERRORS: Final[dict[str, tuple[str, str]]] = {  # what is wrong with the partner's certificate
    TlsError.WRONG_NAME: ("the certificate of {peer} is not valid for {name}",
        "give {peer} a certificate with {name} in its subjectAltName, or call {peer} by a name listed there"),
    TlsError.NO_CA: ("{trusts} trusts no signer of the certificate of {peer}",
        "set {trusts} to that certificate's CA; if self-signed, to the certificate once known to be genuine"),
    TlsError.EXPIRED: ("the certificate of {peer} has expired, or the clock here is wrong",
        "compare the clock here with the last day of the certificate; renew the certificate at {peer}"),
    TlsError.DISCARDED: ("the certificate of {peer} is not valid yet, or cannot be used for another reason",
        "compare the clocks of both ends with the first day of the certificate"),
    TlsError.UNSUPPORTED: ("{peer} showed a certificate for another use, or with too short a key",
        "give {peer} a certificate for this use, with a longer key"),
    TlsError.EXTENSION: ("the certificate of {peer} has a critical extension that is not known here",
        "give {peer} a certificate without that extension"),
}
_REASONS: Final[dict[str, tuple[str, str]]] = {  # an error, or what the library or an alert calls the reason
    TlsError.NO_CERTIFICATE: ("this end asks for a certificate, and {peer} showed none",
        "give {peer} a certificate of its own"),
    TlsError.PLAIN: ("{peer} speaks no TLS on this port", "enable TLS at {peer}, or correct the port"),
    TlsError.SILENT: ("{peer} does not continue the handshake: it speaks no TLS on this port, or hangs",
        "correct the port, or look into the log of {peer}"),
    "protocol_version": _WRONG_VERSION, "unsupported_protocol": _WRONG_VERSION,
    "no_shared_cipher": ("{peer} has no cipher that this end takes", "give {peer} ciphers of TLS 1.2 or 1.3"),
    "certificate_required": ("{peer} asks for a certificate, and this end shows none",
        "set {shows} to a certificate that has its key here and a CA that {peer} trusts"),
    "handshake_failure": (
        "{peer} refuses and gives no reason: it wants a certificate of this end, or another cipher",
        "look into the log of {peer}; with TLS 1.2 set {shows} if {peer} wants a certificate"),
    "unknown_ca": ("{peer} does not trust the signer of the certificate of this end",
        "add the CA of the certificate in {shows} to those that {peer} trusts"),
    "certificate_expired": ("{peer} says that the certificate of this end has expired, or is not valid yet",
        "renew the certificate in {shows}, or correct the clock of {peer}"),
    "bad_certificate": _OWN_CERT_REFUSED, "certificate_unknown": _OWN_CERT_REFUSED,
    "unsupported_certificate": _OWN_CERT_REFUSED, "certificate_revoked": _OWN_CERT_REFUSED,
}
# fmt: on
_HANDSHAKE_REFUSED: Final = "{peer} refuses the handshake: {words}", "look into its log for the reason"


def explain_handshake_failure(e: Evidence) -> RuleAnswer:
    """Return why the session ended, and the remedy for exactly this reason."""
    session = tls_credentials_of(e.config.session) if e.config is not None else None
    if e.config is None or session is None or e.cause.call != "session":
        return ""
    error, is_active, name = e.cause.error, e.config.active, session.server_name.rstrip(".")
    row = _PEER_ERRORS.get(error) or _REASONS.get(error) or _REASONS.get(e.cause.words)
    row = row or (_HANDSHAKE_REFUSED if error == TlsError.REFUSED and e.cause.words else ("", ""))
    words = e.cause.words.replace("_", " ")
    references = ["TLSClientCertRef", "TLSServerCertRef"]
    shows, trusts = references if is_active else reversed(references)
    peer, name = e.cause.peer or "the partner", f"{'DNS' if parse_octets(name) is None else 'IP'}:{name}"
    is_open = error in _PEER_ERRORS or (error == TlsError.HANDSHAKE and not row[0])
    cause, *texts = (
        each.format(peer=peer, name=name, shows=shows, trusts=trusts, words=words)
        for each in (*row, _SHOW_CERTIFICATES if is_active and is_open else "")
    )
    return AdvisedCause(cause, tuple([SuggestedAction(text) for text in texts if text]))
