"""Programs of others on both sides of a tap: socat, openssl, python-snap7. None of them notices it."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from tests.certificates import Certificates
from tests.e2e.tapping import Tap
from tests.e2e.terminal import need

pytestmark = pytest.mark.live


def port_told(program: subprocess.Popen[bytes]) -> int:
    """Return the port that a program has found for itself: it ends a line that it prints."""
    said = program.stdout or program.stderr
    assert said is not None
    while line := said.readline():
        if told := re.search(rb"[: ]127\.0\.0\.1:(\d+)$", line.rstrip()):
            return int(told[1])
    raise AssertionError("it has ended")


def test_tls_of_openssl_passes_unopened(tmp_path: Path) -> None:
    openssl, file = need("openssl"), tmp_path / "line.pcapng"
    made = Certificates(tmp_path / "certificates")
    server = [openssl, "s_server", "-accept", "127.0.0.1:0", "-rev"]
    server += ["-cert", made.pem("plc"), "-key", made.key("plc")]
    with subprocess.Popen(server, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as listens:
        with Tap(str(port_told(listens)), "--record", str(file)) as tap:
            command = [openssl, "s_client", "-connect", f"127.0.0.1:{tap.port}", "-quiet", "-no_ign_eof"]
            with subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            ) as client:
                assert client.stdin is not None and client.stdout is not None
                client.stdin.write(b"gnirts terces a\n")
                client.stdin.flush()
                assert client.stdout.readline() == b"a secret string\n"
                client.kill()
            tap.end()
        listens.kill()
    assert b"secret" not in file.read_bytes()


def test_snap7_reads_what_snap7_serves() -> None:
    server_of = pytest.importorskip("snap7.server", reason="python-snap7 is not installed")
    client_of = pytest.importorskip("snap7.client", reason="python-snap7 is not installed")
    area = pytest.importorskip("snap7.type").SrvArea.DB
    content = bytearray(range(100))
    server = server_of.Server()
    server.register_area(area, 1, content)
    server.start(tcp_port=0)
    try:
        with Tap(str(server.server_socket.getsockname()[1])) as tap:
            client = client_of.Client()
            client.connect("127.0.0.1", 0, 1, tap.port)
            assert client.db_read(1, 10, 20) == bytes(range(10, 30))
            client.db_write(1, 0, bytearray(b"written"))
            assert client.db_read(1, 0, 7) == b"written"
            client.disconnect()
            assert tap.end()[0] == 0
    finally:
        server.stop()
