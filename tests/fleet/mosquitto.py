"""Debian's mosquitto for a test: on a port of its own, with TLS and a password where asked."""

from __future__ import annotations

import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest

from tests.certificates import Certificates

PROGRAM = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
needs_mosquitto = pytest.mark.skipif(PROGRAM is None, reason="mosquitto cannot be had here")


def tls_lines(certificates: Certificates) -> str:
    """Return the lines of a broker that shows a certificate for 127.0.0.1."""
    return f"certfile {certificates.pem('plc')}\nkeyfile {certificates.key('plc')}\nuser root"


class Mosquitto:
    """One broker. `kill` and `start` give the same port again."""

    def __init__(self, folder: Path, lines: str = "allow_anonymous true", port: int = 0) -> None:
        self.folder, self.lines, self.port = folder, lines, port
        self._process: subprocess.Popen[bytes] | None = None
        while True:
            with socket.socket() as held:
                held.bind(("127.0.0.1", port))
                self.port = held.getsockname()[1]
            if self.start():
                return  # otherwise another program has taken the port meanwhile

    def start(self) -> bool:
        """Start it; return whether it listens."""
        config = self.folder / "mosquitto.conf"
        config.write_text(f"listener {self.port} 127.0.0.1\npersistence false\n{self.lines}\n")
        config.chmod(0o644)
        assert PROGRAM is not None
        with (self.folder / "mosquitto.log").open("ab") as log:
            self._process = subprocess.Popen([PROGRAM, "-c", str(config)], stdout=log, stderr=log)
        while self._process.poll() is None:
            with socket.socket() as tried:
                if tried.connect_ex(("127.0.0.1", self.port)) == 0:
                    return True
            time.sleep(0.01)
        return False

    def stop(self) -> None:
        """Let it hang: it takes connections and bytes, and answers nothing."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)

    def kill(self) -> None:
        """Kill it: it forgets everything."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
