"""SessionKernel: not there where no session is wanted; ISO-on-TCP on both networks; unruly clients."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator

import pytest

from tests.net.contract import FACTS, OF_THE_WIRE, Fact
from tests.net.net_bench import ANY_PORT, LOOPBACK, Bench
from tests.net.net_sim import SimNetwork
from trcvtui.net.cotp import Code, Connect, Data, Disconnect, TpktReader, encode
from trcvtui.net.faults import FaultPlan, FaultyKernel
from trcvtui.net.iso_on_tcp import IsoSettings
from trcvtui.net.kernel import (
    WOULD_BLOCK,
    Accepted,
    Datagram,
    Endpoint,
    Fault,
    Handle,
    Loss,
    SocketOptions,
)
from trcvtui.net.os_kernel import OsKernel
from trcvtui.net.session_kernel import SessionKernel
from trcvtui.net.shared_listener import CLIENTS_WAITING
from trcvtui.net.sim_kernel import SimKernel

SECOND = 1_000_000_000
E001, E002, E003 = b"\xe0\x01", b"\xe0\x02", b"\xe0\x03"
CAP = 65536
CALLS = IsoSettings(E001, E002, CAP)
WAITS = IsoSettings(E002, E001, CAP)
REFUSED = Fault("session", "ECONNREFUSED")


class OsNetwork:
    """This machine's network; a breath waits a millisecond on a socket that is never ready."""

    def __init__(self) -> None:
        self.kernel = OsKernel()
        self._quiet, self._other = socket.socketpair()

    def breathe(self) -> None:
        select.select([self._quiet], [], [], 0.001)

    def close(self) -> None:
        self.kernel.close_all()
        self._quiet.close()
        self._other.close()


class Net:
    """A network with sessions in front; its clock stands until somebody moves it."""

    def __init__(self, below: SimNetwork | OsNetwork) -> None:
        self.now = 0
        self.told: list[tuple[str, str]] = []
        self.below = below
        self.faulty = FaultyKernel(below.kernel, FaultPlan())
        self.kernel = SessionKernel(self.faulty, lambda: self.now, self._hear)

    def _hear(self, owner: str, client: str, why: str) -> None:
        assert client.startswith(LOOPBACK)
        self.told.append((owner, why))

    def breathe(self) -> None:
        self.below.breathe()


class IsoBench(Bench):
    """A bench with ISO-on-TCP in its hands."""

    def __init__(self, net: Net) -> None:
        super().__init__(net)
        self.net = net

    def iso_socket(self, settings: IsoSettings, owner: str = "C1", small: bool = False) -> Handle:
        handle = self.socket(owner=owner)
        self.kernel.set_options(handle, SocketOptions(session=settings, small_buffers=small))
        return handle

    def iso_listener(self, settings: IsoSettings, end: Endpoint = ANY_PORT, owner: str = "C1") -> Handle:
        handle = self.iso_socket(settings, owner)
        assert self.kernel.set_reuse(handle) is None
        assert self.kernel.bind(handle, end) is None
        assert self.kernel.listen(handle, 4) is None
        assert self.kernel.poll_add(handle) is None
        return handle

    def call(self, end: Endpoint, settings: IsoSettings = CALLS, small: bool = False) -> Handle:
        handle = self.iso_socket(settings, "P1", small)
        assert self.kernel.connect(handle, end) is None
        return handle

    def taken(self, listener: Handle, settings: IsoSettings = WAITS, caller: Handle | None = None) -> Handle:
        """Wait for a client of this listener and take it, as a CONNECT does; `caller` looks meanwhile."""

        def has_come() -> bool:
            if caller is not None:
                assert self.kernel.connect_result(caller) is WOULD_BLOCK
            return self.kernel.readable(listener)

        self.until(has_come)
        got = self.accept(listener)
        self.kernel.set_options(got.handle, SocketOptions(session=settings))
        return got.handle

    def message(self, handle: Handle, room: int = CAP) -> tuple[bytes, int]:
        """Wait for the next message: its bytes as far as there is room, and how many it had."""
        into = bytearray(room)
        found: list[Datagram] = []

        def is_there() -> bool:
            got = self.kernel.recv_from(handle, memoryview(into))
            if isinstance(got, Datagram):
                found.append(got)
            return bool(found)

        self.until(is_there)
        return bytes(into[: found[0].size]), found[0].whole

    def up(self) -> tuple[Handle, Handle, Handle]:
        """Return caller, called and listener of a connection that stands."""
        listener = self.iso_listener(WAITS)
        caller = self.call(self.end(listener))
        called = self.taken(listener, caller=caller)
        assert self.verdict(caller) is None
        assert self.kernel.poll_add(caller) is None
        return caller, called, listener

    def close_all(self, *handles: Handle) -> None:
        for handle in handles:
            self.kernel.close(handle)
        self.settle()


@pytest.fixture(params=["sim", "os"])
def b(request: pytest.FixtureRequest) -> Iterator[IsoBench]:
    if request.param == "sim":
        sim = SimKernel()
        yield IsoBench(Net(SimNetwork(sim)))
        assert sim.leaks() == ()
    else:
        real = OsNetwork()
        yield IsoBench(Net(real))
        leaks = real.kernel.leaks()
        real.close()
        assert leaks == ()


# -- without sessions it is not there ------------------------------------------------------------------------


class Through:
    """A network seen through a SessionKernel that nobody asks for a session."""

    def __init__(self, below: SimNetwork | OsNetwork) -> None:
        self.below = below
        self.kernel = SessionKernel(below.kernel, lambda: 0, lambda owner, client, why: None)

    def breathe(self) -> None:
        self.below.breathe()


@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_without_a_session_the_simulated_network_keeps_its_contract(fact: Fact) -> None:
    fact(Bench(Through(SimNetwork(SimKernel()))))


@pytest.mark.parametrize("fact", [f for f in FACTS if f not in OF_THE_WIRE], ids=lambda f: f.__name__)
def test_without_a_session_the_real_network_keeps_its_contract(fact: Fact) -> None:
    real = OsNetwork()
    try:
        fact(Bench(Through(real)))
    finally:
        real.close()


# -- a connection stands when its session does ---------------------------------------------------------------


def test_a_connect_is_pending_until_the_partner_takes_the_call(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    caller = b.call(b.end(listener))

    def asked() -> bool:
        assert b.kernel.connect_result(caller) is WOULD_BLOCK
        return b.kernel.readable(listener)

    b.until(asked)
    got = b.kernel.accept(listener)
    assert isinstance(got, Accepted)
    assert b.kernel.connect_result(caller) is WOULD_BLOCK
    b.kernel.set_options(got.handle, SocketOptions(session=WAITS))
    assert b.verdict(caller) is None
    b.close_all(caller, got.handle, listener)


def test_messages_arrive_whole_and_one_by_one(b: IsoBench) -> None:
    caller, called, listener = b.up()
    for payload in (b"one", b"three", bytes(9000)):
        b.send(caller, payload)
    assert b.message(called) == (b"one", 3)
    assert b.message(called, room=2) == (b"th", 5)
    assert b.message(called) == (bytes(9000), 9000)
    b.send(called, b"back")
    assert b.receive(caller, 4) == b"back"
    b.close_all(caller, called, listener)


def test_a_message_that_the_stack_takes_in_pieces_is_one_message(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    caller = b.call(b.end(listener), small=True)
    called = b.taken(listener, caller=caller)
    assert b.verdict(caller) is None
    payload = bytes(n % 251 for n in range(60_000))
    left = memoryview(payload)
    got: list[tuple[int, bytes]] = []
    into = bytearray(CAP)
    counts = []

    def both() -> bool:
        nonlocal left
        if left:
            sent = b.kernel.send(caller, left)
            assert not isinstance(sent, Fault)
            counts.append(sent)
            left = left[sent:] if isinstance(sent, int) else left
        answer = b.kernel.recv_from(called, memoryview(into))
        if isinstance(answer, Datagram):
            assert not left  # nobody has a message before all of it is sent
            got.append((answer.whole, bytes(into[: answer.size])))
        return bool(got)

    b.until(both)
    assert got == [(60_000, payload)]
    assert len(counts) > 1
    b.close_all(caller, called, listener)


def test_a_fin_comes_behind_the_last_message(b: IsoBench) -> None:
    caller, called, listener = b.up()
    b.send(caller, b"last")
    assert b.kernel.shutdown(caller) is None
    assert b.message(called) == (b"last", 4)
    assert b.loss(called).fault is None
    assert b.answer(called) == 0
    b.close_all(caller, called, listener)


def test_a_reset_is_told_once_the_messages_are_read(b: IsoBench) -> None:
    caller, called, listener = b.up()
    b.kernel.abort(caller)
    assert b.loss(called) == Loss(Fault("recv", "ECONNRESET"), 0)
    b.close_all(called, listener)


def test_what_waits_unread_is_counted_and_can_be_discarded(b: IsoBench) -> None:
    caller, called, listener = b.up()
    b.send(caller, b"12345")
    b.until(lambda: b.kernel.unread(called) == 5)
    assert b.kernel.discard(called, 100) == 5
    assert b.kernel.unread(called) == 0
    b.close_all(caller, called, listener)


# -- several behind one port ---------------------------------------------------------------------------------


def test_two_connects_share_a_port_and_each_gets_its_own_partner(b: IsoBench) -> None:
    first = b.iso_listener(IsoSettings(E002, b"", CAP), owner="C1")
    end = b.end(first)
    second = b.iso_listener(IsoSettings(E003, b"", CAP), end, owner="C2")
    assert b.end(second) == end
    to_second = b.call(end, IsoSettings(E001, E003, CAP))
    to_first = b.call(end, IsoSettings(E001, E002, CAP))
    took_second = b.taken(second, IsoSettings(E003, b"", CAP), to_second)
    took_first = b.taken(first, IsoSettings(E002, b"", CAP), to_first)
    assert b.verdict(to_second) is None
    assert b.verdict(to_first) is None
    b.send(to_second, b"for E003")
    b.send(to_first, b"for E002")
    assert b.message(took_second) == (b"for E003", 8)
    assert b.message(took_first) == (b"for E002", 8)
    b.close_all(to_second, to_first, took_second, took_first, second, first)


@pytest.mark.parametrize("who_leaves", ["first", "second"])
def test_a_connect_that_leaves_a_shared_port_leaves_it_to_the_other(b: IsoBench, who_leaves: str) -> None:
    first = b.iso_listener(WAITS, owner="C1")
    end = b.end(first)
    second = b.iso_listener(IsoSettings(E003, b"", CAP), end, owner="C2")
    gone, stays, tsap = (first, second, E003) if who_leaves == "first" else (second, first, E002)
    assert b.kernel.close(gone) is None
    caller = b.call(end, IsoSettings(E001, tsap, CAP))
    called = b.taken(stays, IsoSettings(tsap, b"", CAP), caller)
    assert b.verdict(caller) is None
    assert b.kernel.close(stays) is None
    refused = b.socket()
    fault = b.kernel.connect(refused, end) or b.verdict(refused)
    assert fault == Fault("connect", "ECONNREFUSED")
    b.close_all(caller, called, refused)


def test_a_free_port_is_the_same_for_all_and_comes_back(b: IsoBench) -> None:
    first = b.iso_listener(WAITS, owner="C1")
    end = b.end(first)
    second = b.iso_listener(IsoSettings(E003, b"", CAP), owner="C2")
    assert b.end(second) == end
    b.close_all(first, second)
    again = b.iso_listener(WAITS)
    assert b.end(again) == end
    b.close_all(again)


def test_who_is_ready_stirs_its_own_connect(b: IsoBench) -> None:
    first = b.iso_listener(WAITS, owner="C1")
    second = b.iso_listener(IsoSettings(E003, b"", CAP), b.end(first), owner="C2")
    caller = b.call(b.end(first), IsoSettings(E001, E003, CAP))

    def waits_for_c2() -> bool:
        b.kernel.connect_result(caller)
        return "C2" in (b.kernel.stirred() or {}).values() and b.kernel.readable(second)  # type: ignore[attr-defined]

    b.until(waits_for_c2)
    assert not b.kernel.readable(first)
    b.close_all(caller, second, first)


# -- who is refused, and who is dropped ----------------------------------------------------------------------


def test_an_unknown_tsap_is_refused_and_told(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    caller = b.call(b.end(listener), IsoSettings(E001, E003, CAP))
    assert b.verdict(caller) == REFUSED
    assert b.net.told == [("C1", "no CONNECT has the TSAP e0 03")]
    assert not b.kernel.readable(listener)
    b.close_all(caller, listener)


def answer_of(b: IsoBench, client: Handle, size: int) -> list[object]:
    return list(TpktReader().feed(b.receive(client, size)))


def raw_client(b: IsoBench, end: Endpoint, *data: bytes) -> Handle:
    """Return a plain TCP client that has sent these bytes."""
    client = b.connect(end)
    for part in data:
        b.send(client, part)
    return client


@pytest.mark.parametrize(("called", "reason"), [(E003, 3), (E002, 2)])
def test_the_refusal_on_the_wire_is_a_dr_with_its_reason_and_then_the_end(
    b: IsoBench, called: bytes, reason: int
) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), encode(Connect(Code.CR, 0, 0x4431, E001, called, 10)))
    if called == E002:
        b.until(lambda: b.kernel.readable(listener))
        got = b.kernel.accept(listener)
        assert isinstance(got, Accepted)
        b.kernel.abort(got.handle)  # a second client is turned away
    assert answer_of(b, client, 11) == [Disconnect(0x4431, 0, reason)]
    assert b.answer(client) == 0
    b.close_all(client, listener)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", "TPKT version 71"),
        (b"\x16\x03\x01\x02\x00\x01", "TPKT version 22"),
        (b"\x03\x00\x00\x03", "a TPKT of 3 bytes"),
        (encode(Data(b"abc", True)), "a DT out of turn"),
    ],
)
def test_garbage_is_dropped_and_told(b: IsoBench, data: bytes, why: str) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), data)
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", why)]
    assert b.answer(client) in (0, Fault("recv", "ECONNRESET"))
    b.close_all(client, listener)


def test_a_client_that_leaves_before_its_cr_is_told(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), b"\x03\x00")
    b.kernel.close(client)
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", "closed before the handshake")]
    b.close_all(listener)


def test_a_client_that_speaks_too_slowly_is_dropped_after_5_s(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener))
    b.until(lambda: b.kernel.poll_add(client) or True)
    for byte in encode(Connect(Code.CR, 0, 1, E001, E002, 10))[:5]:
        b.net.now += SECOND
        assert b.net.told == []
        b.send(client, bytes([byte]))
        b.settle()
    b.net.now += SECOND
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", "no handshake in 5 s")]
    b.close_all(client, listener)


def test_a_flood_of_silent_clients_holds_so_many_places_and_no_more(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    end = b.end(listener)
    clients = [raw_client(b, end) for _ in range(CLIENTS_WAITING)]
    b.settle()
    last = b.call(end)
    for _ in range(5):
        assert b.kernel.connect_result(last) is WOULD_BLOCK
        b.settle()
        assert not b.kernel.readable(listener)
    b.net.now += 5 * SECOND
    called = b.taken(listener, caller=last)
    assert b.verdict(last) is None
    assert b.net.told == [("C1", "no handshake in 5 s")] * CLIENTS_WAITING
    b.close_all(*clients, last, called, listener)


def test_clients_that_nobody_takes_are_refused_from_a_number_on(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    end = b.end(listener)
    request = encode(Connect(Code.CR, 0, 9, E001, E002, 10))
    clients = []
    for _ in range(CLIENTS_WAITING):
        clients.append(raw_client(b, end, request))
        b.settle()
    assert b.net.told == []
    one_more = raw_client(b, end, request)
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", "16 clients wait there already, and nobody takes them")]
    assert answer_of(b, one_more, 11) == [Disconnect(9, 0, 2)]
    b.close_all(*clients, one_more, listener)


def test_a_dt_larger_than_agreed_ends_an_established_connection(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), encode(Connect(Code.CR, 0, 1, E001, E002, 7)))
    called = b.taken(listener)
    assert answer_of(b, client, 22) == [Connect(Code.CC, 1, 1, E001, E002, 7)]
    b.send(client, encode(Data(bytes(126), True)))
    assert b.loss(called).fault == Fault("session", "EPROTO")
    b.close_all(client, called, listener)


def test_who_does_not_read_makes_the_partner_wait_and_holds_little(b: IsoBench) -> None:
    caller, called, listener = b.up()
    message, sent = memoryview(bytes(30_000)), 0

    def full() -> bool:
        nonlocal sent
        got = b.kernel.send(caller, message[sent % 30_000 :])
        sent += got if isinstance(got, int) else 0
        return got is WOULD_BLOCK

    b.until(full, most=20_000)
    b.settle()
    inside = b.kernel.unread(called) - b.net.faulty.unread(called)
    assert inside <= 2 * CAP + 65535 + 65536
    b.close_all(caller, called, listener)
