"""Certificates for the tests, made by openssl in a fresh folder: no key stands in the repository."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from trcvtui.net.tls_settings import TlsSettings

OPENSSL = shutil.which("openssl")
NEEDS_OPENSSL = pytest.mark.skipif(OPENSSL is None, reason="the openssl program is not here")
# Name: who signs it, for how many days, what it is for.
CERTIFICATES = {
    "plc": ("ca", 365, "IP:127.0.0.1,DNS:plc.line.local"),
    "partner": ("ca", 365, "IP:127.0.0.1,DNS:partner.line.local"),
    "expired": ("ca", -1, "IP:127.0.0.1"),
    "elsewhere": ("ca", 365, "IP:10.9.8.7,DNS:elsewhere.line.local"),
    "stranger": ("strangers", 365, "IP:127.0.0.1,DNS:plc.line.local"),
}
AUTHORITIES = ("ca", "strangers")


class Certificates:
    """A folder of PEM files: NAME.pem and NAME.key."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in AUTHORITIES:
            self._openssl(
                f"req -x509 {NEW_KEY} -keyout {name}.key -out {name}.pem -days 365 -subj /CN={name}"
            )
        for name, (authority, days, names) in CERTIFICATES.items():
            (folder / "names").write_text(f"subjectAltName={names}\n")
            self._openssl(f"req {NEW_KEY} -keyout {name}.key -out request -subj /CN={name}")
            self._openssl(
                f"x509 -req -in request -CA {authority}.pem -CAkey {authority}.key -CAcreateserial"
                f" -out {name}.pem -days {days} -extfile names"
            )

    def _openssl(self, words: str) -> None:
        assert OPENSSL is not None
        subprocess.run([OPENSSL, *words.split()], cwd=self.folder, check=True, capture_output=True)

    def pem(self, name: str) -> str:
        return str(self.folder / f"{name}.pem")

    def key(self, name: str) -> str:
        return str(self.folder / f"{name}.key")

    def locked_key(self, name: str) -> str:
        """Return a copy of the key that wants a password."""
        self._openssl(f"ec -in {name}.key -aes256 -passout pass:secret -out {name}-locked.key")
        return self.key(f"{name}-locked")

    def settings(
        self,
        shows: str = "",
        trusts: str = "ca",
        asks_client: bool = False,
        server_name: str = "",
        checks_name: bool = False,
        is_unverified: bool = False,
    ) -> TlsSettings:
        return TlsSettings(
            certificate=self.pem(shows) if shows else "",
            key=self.key(shows) if shows else "",
            authorities=(self.pem(trusts),) if trusts else (),
            asks_client=asks_client,
            server_name=server_name,
            checks_name=checks_name,
            is_unverified=is_unverified,
        )


NEW_KEY = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"


@pytest.fixture(scope="session")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    """Return certificates that are made once."""
    if OPENSSL is None:
        pytest.skip("the openssl program is not here")
    return Certificates(tmp_path_factory.mktemp("certificates"))
