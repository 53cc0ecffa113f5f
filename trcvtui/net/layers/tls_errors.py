"""Which word fits what the TLS library says. The names of its reasons are OpenSSL's own."""

from __future__ import annotations

import ssl
from typing import Final

from trcvtui.net.layer import Ended
from trcvtui.net.tls_words import TlsError

# X509_V_ERR_...: what is wrong with the partner's certificate; every other number discards it.
_VERIFYING: Final = {
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
_REASONS: Final = {
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
_ALERT: Final = "_ALERT_"  # SSLV3_ALERT_BAD_CERTIFICATE: the partner says so


def ended_of(problem: Exception) -> Ended:
    """Return why a session ends that met this exception."""
    if isinstance(problem, ssl.SSLCertVerificationError):
        error = _VERIFYING.get(problem.verify_code, TlsError.DISCARDED)
        return Ended(error, f"the partner's certificate: {problem.verify_message}")
    reason = str(getattr(problem, "reason", None) or problem)
    before, alert, said = reason.partition(_ALERT)
    if alert and before in ("SSLV3", "TLSV1", "TLSV13"):
        return Ended(TlsError.REFUSED, f"the partner says: {_in_words(said)}")
    return Ended(_REASONS.get(reason, TlsError.HANDSHAKE), _in_words(reason))


def _in_words(reason: str) -> str:
    return reason.lower().replace("_", " ")
