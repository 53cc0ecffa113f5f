"""What a CONNECT or a peer says about TLS, as the settings of a session."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.net.layer import Session
from trcvtui.net.tls_words import Credentials


@dataclass(frozen=True, slots=True)
class TlsSettings(Credentials):
    """Credentials that make sessions. Bytes flow as on plain TCP: no messages."""

    is_message_oriented: bool = False
    shares_port: bool = False

    def new(self, is_active: bool) -> Session:
        """Return a fresh session; the library is loaded with the first, for who has none need not wait."""
        from trcvtui.net.layers.tls import Tls

        return Tls(self, is_active)
