"""TLS on CONNECTs: the scenarios of configs/tls, the openssl program as the partner, mistakes in a file."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests import golden
from tests.certificates import NEEDS_OPENSSL, OPENSSL, Certificates
from tests.scenario.scenarios import failures, play
from trcvtui.bench.bench import Bench
from trcvtui.commands.words import PlcStop
from trcvtui.errors import UserError
from trcvtui.plc.ledger import BenchNote, StatusEdge
from trcvtui.project.file import load_project
from trcvtui.scenario.command import LivePace

pytestmark = NEEDS_OPENSSL
SCANS = 900  # 9 s at most
HEAD = """
dialect = "s7-1500"
[[data]]
name = "rx"
type = "ARRAY[0..3] OF BYTE"
[[certificate]]
number = 1
file = "certificates/ca.pem"
[[certificate]]
number = 2
file = "certificates/plc.pem"
key = "certificates/plc.key"
"""
CONNECT = """
[[connect]]
name = "C1"
type = "TCON_IP_V4_SEC"
"""
RECEIVES = """
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
data = "rx"
CONT = true
EN_R = true
"""
SENDS = RECEIVES.replace("TRCV_C", "TSEND_C").replace("EN_R", "REQ")
SERVER = """
ListenPort = 0
ActivateSecureConn = true
TLSServerReqClientCert = true
TLSServerCertRef = 2
TLSClientCertRef = 1
"""
CLIENT = """
ActiveEstablished = true
RemoteAddress = "127.0.0.1"
RemotePort = {port}
ActivateSecureConn = true
ExtTLSCapabilities = 1
TLSServerCertRef = 1
TLSClientCertRef = 2
"""


@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["sim", "live"])
@pytest.mark.parametrize("name", ["tls-server.toml", "tls-client.toml"])
def test_a_scenario_holds(secure_bench: Path, name: str, kernel: str) -> None:
    played = play(secure_bench / name, kernel)
    assert played.verdict.has_passed, failures(played.verdict)


# -- the openssl program ------------------------------------------------------------------------------------


class Desk:
    """A live bench whose block, a TRCV_C, connects and begins its job in its first scan."""

    def __init__(self, folder: Path, connect: str, block: str) -> None:
        (folder / "bench.txt").write_text(HEAD + block + CONNECT + connect)
        self.bench = Bench(load_project(folder / "bench.txt"), "live")
        self._pace = LivePace()

    def run_until(self, holds: Callable[[], bool]) -> None:
        for _ in range(SCANS):
            if holds():
                return
            self._pace.next_scan(self.bench)
        raise AssertionError(f"not in {SCANS} scans; so far {self.shown()}")

    def shown(self) -> list[str]:
        edges = [line.event for line in self.bench.runtime.ledger if isinstance(line.event, StatusEdge)]
        return [f"{edge.outputs.status:04X}" for edge in edges if edge.outputs.status & 0x8000]

    def unnamed(self) -> list[StatusEdge]:
        """Return the ERRORs of a handshake or of a connection that do not name the call and the partner."""
        edges = [line.event for line in self.bench.runtime.ledger if isinstance(line.event, StatusEdge)]
        told = [edge for edge in edges if edge.outputs.error and edge.cause.call == "session"]
        return [edge for edge in told if not (edge.cause.kernel_call and edge.cause.peer)]

    def status(self) -> str:
        return f"{self.bench.runtime.outputs('X').status:04X}"

    def port(self) -> int:
        self.run_until(lambda: bool(self.bench.runtime.listening_port("C1")))
        port = self.bench.runtime.listening_port("C1")
        assert port is not None
        return port


@contextmanager
def desk_of(folder: Path, connect: str, block: str = RECEIVES) -> Iterator[Desk]:
    desk = Desk(folder, connect, block)
    try:
        yield desk
        assert desk.unnamed() == []
    finally:
        desk.bench.close()
    assert desk.bench.leaks() == ()


@contextmanager
def openssl(folder: Path, words: str) -> Iterator[subprocess.Popen[bytes]]:
    assert OPENSSL is not None
    pipe = subprocess.PIPE
    program = subprocess.Popen(
        [OPENSSL, *words.split()],
        cwd=folder / "certificates",
        stdin=pipe,
        stdout=pipe,
        stderr=subprocess.STDOUT,
    )
    try:
        yield program
    finally:
        program.kill()
        program.wait()
        for end in (program.stdin, program.stdout):
            assert end is not None
            with suppress(BrokenPipeError):
                end.close()


def s_client(port: int, more: str) -> str:
    return f"s_client -connect 127.0.0.1:{port} -CAfile ca.pem -quiet -no_ign_eof {more}"


@pytest.mark.parametrize("version", ["-tls1_2", "-tls1_3"])
def test_s_client_sends_to_a_passive_connect_and_hears_its_end(secure_bench: Path, version: str) -> None:
    with desk_of(secure_bench, SERVER) as desk:
        words = s_client(desk.port(), f"-cert partner.pem -key partner.key -verify_return_error {version}")
        with openssl(secure_bench, words) as client:
            assert client.stdin is not None
            client.stdin.write(b"abcd")
            client.stdin.flush()
            desk.run_until(lambda: desk.bench.runtime.data("rx") == b"abcd")
            client.stdin.close()  # s_client says close_notify and goes
            desk.run_until(lambda: desk.shown() == ["80C5"] or desk.shown() == ["80C5", "80C4"])
            assert client.wait(10) == 0


@pytest.mark.parametrize(
    ("more", "code"),
    [
        ("", "80E2"),
        ("-cert strange.pem -key strange.key", "80E4"),
        ("-cert expired.pem -key expired.key", "80E5"),
        ("-cert partner.pem -key partner.key -tls1_1 -cipher ALL:@SECLEVEL=0", "80E1"),
    ],
)
def test_a_wrong_s_client_is_a_code_and_is_not_let_in(secure_bench: Path, more: str, code: str) -> None:
    with desk_of(secure_bench, SERVER) as desk, openssl(secure_bench, s_client(desk.port(), more)) as client:
        desk.run_until(lambda: bool(desk.shown()))
        assert desk.shown() == [code]
        desk.run_until(lambda: client.poll() is not None)
        assert client.returncode != 0
        desk.run_until(lambda: desk.status() == "7002")
        assert desk.shown() == [code]


@contextmanager
def s_server(folder: Path, more: str) -> Iterator[tuple[int, subprocess.Popen[bytes]]]:
    with openssl(folder, f"s_server -accept 127.0.0.1:0 -CAfile ca.pem {more}") as server:
        assert server.stdout is not None
        said = b""
        while (found := re.search(rb"ACCEPT 127\.0\.0\.1:(\d+)", said)) is None:
            said += server.stdout.readline()
        yield int(found[1]), server


def shows(name: str) -> str:
    return f"-cert {name}.pem -key {name}.key"


@pytest.mark.parametrize("version", ["-tls1_2", "-tls1_3"])
def test_an_active_connect_receives_from_s_server(secure_bench: Path, version: str) -> None:
    wants = f"{shows('partner')} -Verify 1 -verify_return_error {version}"
    with (
        s_server(secure_bench, wants) as (port, server),
        desk_of(secure_bench, CLIENT.format(port=port)) as desk,
    ):
        assert server.stdin is not None
        desk.run_until(lambda: desk.status() == "7006")
        server.stdin.write(b"wxyz")
        server.stdin.flush()
        desk.run_until(lambda: desk.bench.runtime.data("rx") == b"wxyz")
        assert desk.shown() == []


@pytest.mark.parametrize(
    ("name", "code"), [("strange", "80E4"), ("expired", "80E5"), ("elsewhere", "80E1"), ("critical", "80E7")]
)
def test_a_wrong_s_server_is_a_code(secure_bench: Path, name: str, code: str) -> None:
    with (
        s_server(secure_bench, shows(name)) as (port, _),
        desk_of(secure_bench, CLIENT.format(port=port)) as desk,
    ):
        desk.run_until(lambda: bool(desk.shown()))
        assert desk.shown() == [code]


@pytest.mark.parametrize("version", ["-tls1_2", "-tls1_3"])
def test_s_server_that_refuses_our_certificate_is_a_failed_attempt(secure_bench: Path, version: str) -> None:
    """With TLS 1.3 its alert comes when our end is up already."""
    trusts_others = f"{shows('partner')} -CAfile strangers.pem -Verify 1 -verify_return_error {version}"
    with (
        s_server(secure_bench, trusts_others) as (port, _),
        desk_of(secure_bench, CLIENT.format(port=port)) as desk,
    ):
        desk.run_until(lambda: bool(desk.shown()))
        desk.run_until(lambda: desk.status() == "7002")
        assert desk.shown() == ["80E1"]
        link = desk.bench.runtime.snapshot().connections[0]
        assert link.retry_in_ns
        assert link.attempts == 1


def test_s_server_that_wants_a_certificate_and_gets_none_refuses_also_a_message_under_way(
    secure_bench: Path,
) -> None:
    client = CLIENT.replace("TLSClientCertRef = 2", "")
    with (
        s_server(secure_bench, f"{shows('partner')} -Verify 1 -verify_return_error -tls1_3") as (port, _),
        desk_of(secure_bench, client.format(port=port), SENDS) as desk,
    ):
        desk.run_until(lambda: bool(desk.shown()))
        desk.run_until(lambda: desk.status() == "7002")
        assert desk.shown() == ["80E1"]


def test_a_tls_client_on_a_plain_port_gets_no_handshake(secure_bench: Path) -> None:
    plain = "ListenPort = 0\nActivateSecureConn = false\n"
    with desk_of(secure_bench, plain) as desk, openssl(secure_bench, s_client(desk.port(), "")) as client:
        desk.run_until(lambda: desk.bench.runtime.data("rx")[:2] == b"\x16\x03")  # its hello is plain bytes
        assert desk.bench.do(PlcStop()) == ""
        desk.run_until(lambda: client.poll() is not None)
        assert client.returncode != 0


def test_the_ledger_names_who_was_dropped_and_why(secure_bench: Path) -> None:
    with desk_of(secure_bench, SERVER) as desk, openssl(secure_bench, s_client(desk.port(), "")):
        desk.run_until(lambda: bool(desk.shown()))
        notes = [line.event for line in desk.bench.runtime.ledger if isinstance(line.event, BenchNote)]
        assert [note.detail for note in notes if note.what == "client dropped"] == [
            "peer did not return a certificate"
        ]


# -- mistakes ------------------------------------------------------------------------------------------------


def test_a_connect_without_tls_has_nothing_to_verify(certificates: Certificates) -> None:
    file = certificates.folder.parent / "mistake.txt"
    file.write_text(HEAD + RECEIVES + CONNECT + 'ListenPort = 0\nverify = "none, this is unsafe"\n')
    with pytest.raises(UserError, match="only a secure connection has certificates"):
        load_project(file)


def test_mistakes_are_told(secure_bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(secure_bench)

    def told(text: str) -> list[str]:
        Path("mistake.txt").write_text(HEAD + RECEIVES + CONNECT + SERVER + text.replace("\\n", "\n"))
        with pytest.raises(UserError) as refused:
            load_project("mistake.txt")
        return [line.replace(f"{secure_bench}/", "") for line in refused.value.lines()]

    golden.answers("TLS", told)
