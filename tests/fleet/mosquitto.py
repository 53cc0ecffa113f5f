"""Debian's mosquitto for a test: on a port of its own, with TLS and a password where asked."""

from __future__ import annotations

import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest

PROGRAM = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
needs_mosquitto = pytest.mark.skipif(PROGRAM is None, reason="mosquitto cannot be had here")


class Certificate:
    """A certificate of `localhost` that has signed itself, and its key: files that mosquitto can read."""

    def __init__(self, folder: Path) -> None:
        self.pem, self.key = folder / "c.pem", folder / "k.pem"
        words = f"openssl req -x509 -newkey rsa:2048 -nodes -keyout {self.key} -out {self.pem} -days 2"
        names = "-subj /CN=localhost -addext subjectAltName=DNS:localhost,IP:127.0.0.1"
        subprocess.run(f"{words} {names}".split(), check=True, capture_output=True)
        for file in (self.pem, self.key):
            file.chmod(0o644)
        folder.chmod(0o755)

    @property
    def lines(self) -> str:
        """Return the lines of a broker that has it."""
        return f"certfile {self.pem}\nkeyfile {self.key}\nuser root"


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
