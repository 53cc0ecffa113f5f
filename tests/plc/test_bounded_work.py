"""Partners who ask for more work than a scan has time for, counted, not timed; beside them nobody suffers."""

from __future__ import annotations

import ssl
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import trcvtui.net.layers.iso_on_tcp as cotp
from tests.bench.bench_lines import do
from tests.certificates import NEEDS_OPENSSL
from trcvtui.bench.bench import Bench
from trcvtui.net.connection.resources import ACCEPT_UNITS, DEFAULT_INTERVAL_NS, HANDSHAKE_UNITS, ScanBudget
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.net.layers.iso_on_tcp import MOST_EMPTY_PIECES, Code, ConnectTpdu, DataTpdu, encode_tpdu
from trcvtui.net.layers.tls import TlsSession
from trcvtui.plc.ledger import BenchNote
from trcvtui.project.file import read_project

GOOD = 8
SCANS = 120
UNITS = ScanBudget(interval_ns=DEFAULT_INTERVAL_NS).units
REQUEST = encode_tpdu(ConnectTpdu(Code.CR, 0, 1, b"\xe0\x01", b"\xe0\xff", 10))
EMPTY, ONE_BYTE = encode_tpdu(DataTpdu(b"", False)), encode_tpdu(DataTpdu(b"x", False))
EMPTY_MESSAGE, EXPEDITED = encode_tpdu(DataTpdu(b"", True)), b"\x03\0\0\x0b\x06\x10\0\1\0\1\7"
WAITS = (EventKind.TPDUS_WAIT, EventKind.RECORDS_WAIT, EventKind.CLIENTS_WAIT, EventKind.HANDSHAKES_WAIT)


def document(attackers: int, secure: bool = False, plain: bool = False) -> dict[str, object]:
    """Return eight good connections with a frame each 20 ms, a CONNECT X, and those who come for X."""
    names = [f"C{n}" for n in range(1, GOOD + 1)]
    described: dict[str, object] = {"type": "TCON_IP_RFC", "IsoPort": 0, "LocalTSelector": "16#E0FF"}
    if secure:
        described = {"type": "TCON_IP_V4_SEC", "ListenPort": 0, "ActivateSecureConn": True}
        described |= {"TLSServerCertRef": 1}
    if plain:
        described = {"LocalPort": 0}
    return {
        "dialect": "s7-1500",
        "certificate": [{"number": 1, "file": "plc.pem", "key": "plc.key"}] if secure else [],
        "data": [{"name": f"D{name}", "type": "ARRAY[0..31] OF BYTE"} for name in (*names, "X")],
        "connect": [
            {"name": name, "type": "TCON_IP_RFC", "IsoPort": 0, "LocalTSelector": f"16#E00{n}"}
            for n, name in enumerate(names, 1)
        ]
        + [{"name": "X", **described}],
        "instance": [
            {"name": f"T{name}", "block": "TRCV_C", "connect": name, "data": f"D{name}"}
            | {"CONT": True, "EN_R": True}
            for name in (*names, "X")
        ],
        "peer": [
            {"name": f"P{name}", "active": True, "remote": f"@{name}", "iso": True}
            | {"local_tsap": "16#E0F0", "remote_tsap": f"16#E00{n}"}
            for n, name in enumerate(names, 1)
        ]
        + [{"name": f"A{n}", "active": True, "remote": "@X"} for n in range(attackers)],
    }


class Works:
    """A simulated bench in which each good partner sends a frame each 20 ms."""

    def __init__(self, folder: Path, attackers: int = 0, **how: bool) -> None:
        self.bench = Bench(read_project(document(attackers, **how), "works", folder), "sim")
        self.attackers = [f"A{n}" for n in range(attackers)]
        self.dones = 0
        self.run(5)
        self.say(*(f"peer PC{n} connect" for n in range(1, GOOD + 1)))
        self.run(10)
        self.say(*(f"peer PC{n} check on size=32 every=T#20ms on TC{n}" for n in range(1, GOOD + 1)))
        self.dones = 0

    def say(self, *lines: str) -> None:
        do(self.bench, *lines)

    def run(self, scans: int, each: Callable[[], None] = lambda: None) -> None:
        for _ in range(scans):
            each()
            self.bench.step()
            self.dones += sum(
                out.outputs.done and out.instance != "TX" for out in self.bench.runtime.due_edges
            )

    def told(self, *what: EventKind) -> list[ConnectionChanged]:
        events = [line.event for line in self.bench.runtime.ledger]
        return [one for one in events if isinstance(one, ConnectionChanged) and one.what in (what or WAITS)]

    def noted(self, what: str) -> list[str]:
        events = [line.event for line in self.bench.runtime.ledger]
        return [one.detail for one in events if isinstance(one, BenchNote) and one.what == what]

    def nothing_is_wrong(self) -> bool:
        checks = [one.check.data for one in self.bench.peer_snapshots() if one.check is not None]
        assert len(checks) == GOOD
        return all(one and one.frames and not one.lost + one.doubled + one.shifts for one in checks)


class Counter:
    """Calls of one function since the last look."""

    def __init__(self) -> None:
        self.calls = self.most = 0

    def look(self) -> None:
        self.most, self.calls = max(self.most, self.calls), 0

    def count(self, act: Callable[..., object]) -> Callable[..., object]:
        def counted(*args: object) -> object:
            self.calls += 1
            return act(*args)

        return counted


@pytest.fixture
def tpdus(monkeypatch: pytest.MonkeyPatch) -> Counter:
    counter = Counter()
    monkeypatch.setattr(cotp, "parse_tpdu", counter.count(cotp.parse_tpdu))
    return counter


@pytest.fixture
def undisturbed(tmp_path: Path) -> Iterator[int]:
    """Return the DONEs of the good connections while nobody else is there."""
    works = Works(tmp_path)
    works.run(SCANS)
    assert works.nothing_is_wrong()
    assert works.told() == []
    works.bench.close()
    yield works.dones


# -- TPDUs ---------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("unit", [ONE_BYTE, EMPTY_MESSAGE, EXPEDITED])
def test_a_flood_of_the_smallest_tpdus_costs_a_scan_its_share_and_no_more(
    tmp_path: Path, undisturbed: int, tpdus: Counter, unit: bytes
) -> None:
    works = Works(tmp_path, attackers=1)
    works.say("peer A0 connect", f"peer A0 send hex {REQUEST.hex()}")
    works.run(3)
    works.say(f"peer A0 send hex {(unit * 4000).hex()} repeat=1000")
    before = works.dones
    works.run(SCANS, tpdus.look)
    assert 0 < tpdus.most <= UNITS  # both ends are counted
    assert works.dones - before >= 0.95 * undisturbed
    assert works.nothing_is_wrong()
    assert [(one.connection, one.what) for one in works.told()] == [("X", EventKind.TPDUS_WAIT)]
    works.bench.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "why"),
    [(EMPTY, f"more than {MOST_EMPTY_PIECES} empty DTs"), (ONE_BYTE, "more than {cap} DTs")],
)
def test_a_message_in_pieces_without_end_reaches_a_limit(tmp_path: Path, unit: bytes, why: str) -> None:
    works = Works(tmp_path, attackers=1)
    cap = works.bench.project.rules.max_len
    works.say("peer A0 connect", f"peer A0 send hex {REQUEST.hex()}")
    works.run(3)
    works.say(f"peer A0 send hex {(unit * 4000).hex()} repeat=1000")
    works.run(cap // (UNITS // 2) + 20)
    (told,) = works.noted("session ended")
    assert told.endswith(why.format(cap=cap))
    assert works.nothing_is_wrong()
    works.bench.close()


def test_a_good_message_in_many_pieces_comes_whole_and_its_close_does_not_overtake_it(tmp_path: Path) -> None:
    works = Works(tmp_path, attackers=1)
    message = b"".join(encode_tpdu(DataTpdu(bytes([n % 251]), n == 2000)) for n in range(1, 2001))
    works.say("resize DX ARRAY[0..1999] OF BYTE", "peer A0 connect", f"peer A0 send hex {REQUEST.hex()}")
    works.run(3)
    works.say(f"peer A0 send hex {message.hex()}", "peer A0 close")
    lens: list[int] = []
    works.run(30, lambda: lens.append(works.bench.runtime.outputs("TX").rcvd_len or 0))
    assert max(lens) == 2000
    assert works.bench.runtime.data("DX") == bytes(n % 251 for n in range(1, 2001))
    works.bench.close()


# -- clients and handshakes ----------------------------------------------------------------------------


def come_and_go(works: Works, data: bytes = b"") -> Callable[[], None]:
    """Let every attacker go, come again and say this, before each scan."""

    def again() -> None:
        for name in works.attackers:
            works.say(f"peer {name} close", f"peer {name} connect")
        works.bench.step_peers()
        for name, peer in works.bench.peers.items():
            if data and name in works.attackers and peer.can_send:
                works.say(f"peer {name} send hex {data.hex()}")

    return again


@pytest.mark.slow
def test_a_flood_of_clients_at_a_plain_connect_is_turned_away_a_few_a_scan(
    tmp_path: Path, undisturbed: int
) -> None:
    works = Works(tmp_path, attackers=60, plain=True)
    works.say("peer A0 connect")
    works.run(3)
    works.attackers.remove("A0")
    before, seen, most = works.dones, 0, 0

    again = come_and_go(works)

    def attack() -> None:
        nonlocal seen, most
        again()
        now = len(works.told(EventKind.SECOND_CLIENT))
        most, seen = max(most, now - seen), now

    works.run(SCANS, attack)
    assert 0 < most <= UNITS // ACCEPT_UNITS
    assert works.dones - before >= 0.95 * undisturbed
    assert works.nothing_is_wrong()
    assert len(works.told()) <= 1
    works.bench.close()


def client_hello() -> bytes:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    out = ssl.MemoryBIO()
    end = context.wrap_bio(ssl.MemoryBIO(), out)
    with pytest.raises(ssl.SSLWantReadError):
        end.do_handshake()
    return out.read()


@pytest.mark.slow
@NEEDS_OPENSSL
@pytest.mark.parametrize("leaves", [True, False], ids=["dropped", "stopped"])
def test_handshakes_that_begin_and_do_not_end_are_a_few_a_scan(
    secure_bench: Path, undisturbed: int, monkeypatch: pytest.MonkeyPatch, leaves: bool
) -> None:
    steps = Counter()
    monkeypatch.setattr(TlsSession, "_shake_hands", steps.count(TlsSession._shake_hands))
    works = Works(secure_bench / "certificates", attackers=40, secure=True)
    before, hello = works.dones, client_hello()
    again = come_and_go(works, hello)

    def attack() -> None:
        steps.look()
        if leaves or works.bench.runtime.scans % 20 == 0:
            again()
        if leaves:
            works.say(*(f"peer {name} close" for name in works.attackers))

    works.run(SCANS, attack)
    assert steps.most <= UNITS // HANDSHAKE_UNITS
    assert works.dones - before >= 0.95 * undisturbed
    assert works.nothing_is_wrong()
    works.bench.close()


@NEEDS_OPENSSL
@pytest.mark.parametrize(("step_ms", "steps_a_scan", "is_told"), [(0.4, 2, False), (3.0, 1, True)])
def test_handshakes_get_a_tenth_of_the_interval_by_the_clock_and_one_step_at_least(
    secure_bench: Path, monkeypatch: pytest.MonkeyPatch, step_ms: float, steps_a_scan: int, is_told: bool
) -> None:
    steps, ticks = Counter(), iter(range(1 << 30))
    monkeypatch.setattr(TlsSession, "_shake_hands", steps.count(TlsSession._shake_hands))
    works = Works(secure_bench / "certificates", attackers=12, secure=True)
    works.bench._work.clock = lambda: int(next(ticks) * step_ms * 1_000_000)  # each look is so much later
    again = come_and_go(works, client_hello())
    again()
    works.run(20, steps.look)
    assert steps.most == steps_a_scan
    assert [one.connection for one in works.told(EventKind.LONG_HANDSHAKE)] == ["X"] * is_told
    assert [one.connection for one in works.told(EventKind.HANDSHAKES_WAIT)] == ["X"]
    works.bench.close()
