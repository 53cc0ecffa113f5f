"""Certificates for the tests, made by openssl in a fresh folder: no key stands in the repository."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from trcvtui.net.layers.tls import TlsSettings

OPENSSL = shutil.which("openssl")
NEEDS_OPENSSL = pytest.mark.skipif(OPENSSL is None, reason="the openssl program is not here")
SCRIPT = Path(__file__).parents[1] / "configs" / "tls" / "make_certificates.sh"


class Certificates:
    """A folder of PEM files: NAME.pem and NAME.key."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        subprocess.run(["sh", str(SCRIPT), str(folder)], check=True, capture_output=True)

    def pem(self, name: str) -> str:
        return str(self.folder / f"{name}.pem")

    def key(self, name: str) -> str:
        return str(self.folder / f"{name}.key")

    def locked_key(self, name: str) -> str:
        assert OPENSSL is not None
        words = f"ec -in {name}.key -aes256 -passout pass:secret -out {name}-locked.key"
        subprocess.run([OPENSSL, *words.split()], cwd=self.folder, check=True, capture_output=True)
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


@pytest.fixture(scope="session")
def secure_bench(certificates: Certificates) -> Path:
    """Return a folder with the scenarios of configs/tls, and what they need beside them."""
    folder = certificates.folder.parent
    for file in SCRIPT.parent.glob("*.toml"):
        shutil.copy(file, folder)
    return folder


@pytest.fixture(scope="session")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    if OPENSSL is None:
        pytest.skip("the openssl program is not here")
    return Certificates(tmp_path_factory.mktemp("tls") / "certificates")
