"""Partners that send one message and reset at once: every frame is delivered, whatever else comes between.

Each test prints its line (`pytest -s`). Partners and PLC take turns in one thread: one may be gone before the
PLC looks. No more of them wait than a listener's queue holds (128): beyond that the stack forgets who has
reset before there was room, and a plain accept and recv gets 260 of 300.
"""

from __future__ import annotations

import random
import select
import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pytest

from tests.certificates import NEEDS_OPENSSL, Certificates
from tests.diagnosis.truth.cases import CALLS, pins, receiver
from tests.diagnosis.truth.live_plc import LivePlc
from tests.e2e.tapping import PATIENCE, reset
from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.net.os.forwarder import Forwarder
from trcvtui.net.tap import make_route
from trcvtui.project.file import read_project

pytestmark = pytest.mark.live
T = TypeVar("T")
PARTNERS = 300
SIZE = 8
MOST_SCANS = 20_000
AT_ONCE = 50  # partners that wait in the backlog of 128
NOT_YET = (BlockingIOError, ssl.SSLWantReadError)

CERTIFICATES = [{"number": 1, "file": "ca.pem"}, {"number": 2, "file": "plc.pem", "key": "plc.key"}]


class Line:
    """A PLC on real sockets, its scans without a pause, and what it has received."""

    def __init__(self, connect: dict[str, Any], folder: Path, *more: str, **pins: object) -> None:
        document: dict[str, Any] = {
            "data": [{"name": name, "type": f"ARRAY[1..{SIZE}] OF BYTE"} for name in ("rx", "tx")],
            "connect": [{"name": "C1", **connect}],
            "instance": [
                {"block": block, "name": block, "connect": "C1", "CONT": True}
                | ({"data": "rx", "EN_R": True, **pins} if block == "TRCV_C" else {"data": "tx"})
                for block in ("TRCV_C", *more)
            ],
        }
        document["dialect"] = "s7-1500" if "type" in connect else "baosky"
        if "ActivateSecureConn" in connect:
            document["certificate"] = CERTIFICATES
        self.bench = Bench(read_project(document, "line", folder), "live")
        self.is_active = connect["ActiveEstablished"]
        self.received: list[int] = []
        self.shown: list[str] = []

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *_: object) -> None:
        self.bench.close()

    def run(self, scans: int = 1) -> None:
        for _ in range(scans):
            self.bench.step()
            for out in self.bench.runtime.due_edges:
                if out.instance == "TRCV_C":
                    code = f"{out.outputs.status:04X}" + "!" * out.outputs.error
                    self.shown += [code] if self.shown[-1:] != [code] else []
                    if out.outputs.done:
                        assert out.outputs.rcvd_len == SIZE
                        self.received.append(int.from_bytes(self.bench.runtime.data("rx"), "big"))

    def until(self, holds: Callable[[], object], what: str) -> None:
        for _ in range(MOST_SCANS):
            if holds():
                return
            self.run()
        raise AssertionError(f"{what}: {len(self.received)} frames, {self.shown[-20:]}")

    def got(self, what: str, act: Callable[[], T]) -> T:
        """Return what a call of a socket that does not block answers at last."""
        answers: list[T] = []

        def answered() -> bool:
            with suppress(*NOT_YET):
                answers.append(act())
            return bool(answers)

        self.until(answered, what)
        return answers[0]

    def has_received(self, frames: int) -> bool:
        return len(self.received) >= frames

    def port(self) -> int:
        self.until(lambda: self.bench.runtime.listening_port("C1"), "no listener")
        return self.bench.runtime.listening_port("C1") or 0

    def deliver(self, name: str, count: int = PARTNERS) -> None:
        """Let scans pass until all is delivered, or nothing comes any more; print how much it was."""
        quiet = 0
        for _ in range(MOST_SCANS):
            before = len(self.received)
            self.run()
            quiet = 0 if len(self.received) > before else quiet + 1
            if quiet > 200:
                break
        print(f"{name}: {len(set(self.received))} of {count}")
        assert self.received == list(range(1, count + 1)), self.shown[-40:]


def frame(number: int) -> bytes:
    return number.to_bytes(SIZE, "big")


def prompt(sock: socket.socket) -> socket.socket:
    """Return it without Nagle: a stack throws away at RST what it has kept back."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return sock


def go(sock: socket.socket, dice: random.Random, is_mixed: bool) -> None:
    """Reset; in a mix half of the partners end by FIN, or by FIN and RST."""
    end = dice.choice(["rst", "rst", "fin", "fin, rst"]) if is_mixed else "rst"
    if end == "fin, rst":
        sock.shutdown(socket.SHUT_WR)
    sock.close() if end == "fin" else reset(sock)


PASSIVE: dict[str, Any] = {"ActiveEstablished": False, "LocalAddress": "127.0.0.1"}
TLS: dict[str, Any] = {"type": "TCON_IP_V4_SEC", "ActivateSecureConn": True}
TLS_PASSIVE = TLS | {"ActiveEstablished": False, "ListenPort": 0, "TLSServerCertRef": 2}
ISO: dict[str, Any] = {"type": "TCON_IP_RFC", "LocalTSelector": "PLC", "RemoteTSelector": "PEER"}
# CR of a partner and the CC of one, ISO 8073 13.3 and 13.4 behind the header of RFC 1006
REQUEST = bytes.fromhex("03000016 11e0 0000 0001 00") + b"\xc1\4PEER\xc2\3PLC"
CONFIRM = bytes.fromhex("03000016 11d0 0001 0001 00") + b"\xc1\3PLC\xc2\4PEER"
RECORDED = 'dialect = "baosky"\n[[task]]\nname = "MAIN"\ninterval = "T#2ms"\n'


@pytest.fixture
def door() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as made:
        made.setblocking(False)
        yield made


def calls(door: socket.socket, base: dict[str, Any], port: str = "RemotePort") -> dict[str, Any]:
    ends = {"RemoteAddress": "127.0.0.1", port: door.getsockname()[1]}
    return base | ends | {"ActiveEstablished": True}


Greets = Callable[[Line, socket.socket], socket.socket]


def plain(_: Line, sock: socket.socket) -> socket.socket:
    return sock


def come(line: Line, door: socket.socket | None, greets: Greets = plain, is_mixed: bool = False) -> None:
    """Let all partners come, greet, send and go; in a mix some with scans between, and half without RST."""
    dice, port = random.Random(42), 0 if door else line.port()
    for number in range(1, PARTNERS + 1):
        pause = 3 if is_mixed and dice.random() < 0.5 else 0
        if door is not None:
            sock = line.got("nobody calls", lambda: door.accept()[0])
        else:
            sock = socket.create_connection(("127.0.0.1", port), PATIENCE)
        sock.setblocking(False)
        prompt(sock)
        sock = greets(line, sock)
        line.run(dice.randint(0, pause))
        sock.sendall(frame(number) if greets is not iso else b"\3\0\0\x0f\2\xf0\x80" + frame(number))
        line.run(dice.randint(0, pause))
        go(sock, dice, is_mixed)
        line.until(partial(line.has_received, number - AT_ONCE), "a frame is lost")
    if door is not None:
        door.close()


def ended_by_reset(line: Line) -> bool:
    """Return whether each frame is followed by what a reset in a job shows, and no attempt has failed."""
    walk = " ".join(line.shown)
    is_refused = "80A0" in walk[: walk.rindex("7008")]
    return walk.count("7004 7006 7008 80AA! 7002") == PARTNERS and not is_refused


@pytest.mark.parametrize("name", ["passive static", "passive ad hoc", "active", "active duplex"])
def test_partners_that_all_reset(name: str, door: socket.socket, tmp_path: Path) -> None:
    is_active, sends = name.startswith("active"), ("TSEND_C",) * name.endswith("duplex")
    connect = calls(door, PASSIVE) if is_active else PASSIVE
    with Line(connect, tmp_path, *sends, ADHOC=name.endswith("ad hoc")) as line:
        come(line, door if is_active else None)
        line.deliver(name)
        assert ended_by_reset(line)


@pytest.mark.parametrize("is_active", [False, True], ids=["passive", "active"])
def test_a_mix_in_which_half_of_the_partners_stay_or_end_by_fin(
    is_active: bool, door: socket.socket, tmp_path: Path
) -> None:
    connect = calls(door, PASSIVE) if is_active else PASSIVE
    with Line(connect, tmp_path, "TSEND_C") as line:
        come(line, door if is_active else None, is_mixed=True)
        line.deliver(f"{'active' if is_active else 'passive'} duplex, mixed")


def test_a_recorded_run_with_such_partners_says_the_same_again(door: socket.socket, tmp_path: Path) -> None:
    connect = '[[connect]]\nname = "C1"\n' + CALLS.replace('"@P1"', str(door.getsockname()[1]))
    own = receiver("TRCV_C", SIZE, pins(CONT=True, EN_R=True))
    with LivePlc(RECORDED + connect + own, tmp_path) as plc:
        for number in range(1, 21):
            plc.until(lambda: select.select([door], [], [], 0)[0])
            sock = prompt(door.accept()[0])
            sock.sendall(frame(number))
            reset(sock)
            plc.until_done(number)
    assert main(["replay", str(plc.recording), "--check"]) == 0


@NEEDS_OPENSSL
@pytest.mark.parametrize("version", ["TLSv1_3", "TLSv1_2"])
@pytest.mark.parametrize("is_active", [False, True], ids=["passive", "active"])
def test_tls(
    is_active: bool, version: str, door: socket.socket, certificates: Certificates, tmp_path: Path
) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if is_active else ssl.PROTOCOL_TLS_CLIENT)
    if is_active:
        context.load_cert_chain(certificates.pem("partner"), certificates.key("partner"))
    else:
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.maximum_version = ssl.TLSVersion[version]

    def shakes_hands(line: Line, sock: socket.socket) -> socket.socket:
        secure = context.wrap_socket(sock, server_side=is_active, do_handshake_on_connect=False)
        line.got("no handshake", secure.do_handshake)
        return secure

    connect = (
        calls(door, TLS | {"ExtTLSCapabilities": 1, "TLSServerCertRef": 1}) if is_active else TLS_PASSIVE
    )
    with Line(connect, certificates.folder) as line:
        come(line, door if is_active else None, shakes_hands)
        line.deliver(f"TLS, {'active' if is_active else 'passive'}, {version}")


def iso(line: Line, sock: socket.socket) -> socket.socket:
    if line.is_active:
        assert line.got("no CR", lambda: sock.recv(100))[5] == 0xE0
        sock.sendall(CONFIRM)
    else:
        sock.sendall(REQUEST)
        assert line.got("no CC", lambda: sock.recv(100))[5] == 0xD0
    return sock


@pytest.mark.parametrize("is_active", [False, True], ids=["passive", "active"])
def test_iso_on_tcp(is_active: bool, door: socket.socket, tmp_path: Path) -> None:
    connect = calls(door, ISO, "IsoPort") if is_active else ISO | {"ActiveEstablished": False, "IsoPort": 0}
    with Line(connect, tmp_path) as line:
        come(line, door if is_active else None, iso)
        line.deliver(f"ISO-on-TCP, {'active' if is_active else 'passive'}")


@pytest.mark.parametrize("speaks", ["near", "far"])
def test_a_tap_hands_on_what_came_before_a_reset(speaks: str, door: socket.socket) -> None:
    tap = Forwarder(lambda _: None)
    tap.open_route(
        make_route("T", "127.0.0.1:0", f"127.0.0.1:{door.getsockname()[1]}", ("LISTEN", "CONNECT"))
    )
    address, received, last = tap.routes[0].address, 0, b""
    assert address is not None

    def turned(what: str, act: Callable[[], T]) -> T:
        for _ in range(MOST_SCANS):
            with suppress(BlockingIOError):
                return act()
            tap.run_once(0.01)
        raise AssertionError(f"{what}: {received} frames, {last!r}")

    for number in range(1, PARTNERS + 1):
        near = socket.create_connection(address, PATIENCE)
        if speaks == "near":
            near.sendall(frame(number))
            reset(near)
        far = turned("the tap does not call", lambda: door.accept()[0])
        if speaks == "far":
            far.sendall(frame(number))
            reset(far)
        hears = far if speaks == "near" else near
        hears.setblocking(False)
        last = turned("nothing comes", partial(hears.recv, SIZE))
        received += last == frame(number)
        with pytest.raises(ConnectionResetError):
            turned("no end", partial(hears.recv, SIZE))
        hears.close()
    tap.close()
    print(f"tap, the {speaks} end speaks: {received} of {PARTNERS}")
    assert received == PARTNERS
