"""How secure a CONNECT is, as a person reads it: TLS or none, checked or not, and by which files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.layers.tls import TlsSettings
from trcvtui.project.tls_words import UNSAFE

TLS: Final = "TLS"
UNCHECKED: Final = "TLS NOT CHECKED"
WARNING: Final = f'the certificate of the partner is not checked: verify = "{UNSAFE}"'
NOBODY_CHECKED: Final = "not asked for: any client may come"
MOST_FILES: Final = 3


class Security(NamedTuple):
    """What a secure CONNECT says of itself; `is_unsafe`: it takes any certificate, and `text` says so."""

    text: str
    is_unsafe: bool


def security_of(config: ConnectConfig | None) -> Security | None:
    """Return how secure a CONNECT is, None without TLS."""
    if config is None or not isinstance(config.session, TlsSettings):
        return None
    unsafe = config.session.is_unverified
    return Security(UNCHECKED if unsafe else TLS, unsafe)


def certificate_remarks(config: ConnectConfig) -> dict[str, str]:
    """Return which files the references mean, by field name."""
    session = config.session
    if not isinstance(session, TlsSettings):
        return {}
    own, partners = ("Client", "Server") if config.active else ("Server", "Client")
    trusted = _trusted(session)
    if not config.active and not session.asks_client:
        trusted = NOBODY_CHECKED
    shown = f"shows {_file(session.certificate)}" if session.certificate else "shows none"
    return {f"TLS{own}CertRef": shown, f"TLS{partners}CertRef": trusted}


def _trusted(session: TlsSettings) -> str:
    if session.is_unverified:
        return "! NOT CHECKED: any certificate is taken"
    return f"trusts {_files(session.authorities)}" if session.authorities else "trusts nobody"


def _files(paths: Iterable[str]) -> str:
    shown = [_file(path) for path in paths]
    rest = len(shown) - MOST_FILES
    return ", ".join(shown[:MOST_FILES]) + (f" and {rest} more" if rest > 0 else "")


def _file(path: str) -> str:
    """Return a file as it stands in most projects: with the folder that it is in."""
    return "/".join(Path(path).parts[-2:])
