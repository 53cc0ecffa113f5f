"""The simulated network: the shared facts, and what only a simulation can show."""

from __future__ import annotations

import gc

import pytest

from tests.net.contract import FACTS, Fact
from tests.net.net_bench import ANY_PORT, Bench
from tests.net.sim.net_sim import MS, SimBench, SimNetwork
from trcvtui.net.kernel import LocalAddress
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel
from trcvtui.net.sim.stream import SimStream

KERNELS = {
    "plain": lambda: SimKernel(),
    "latency": lambda: SimKernel(latency_ns=MS),
    "pieces": lambda: SimKernel(seed=7, fragment=True),
}


@pytest.mark.parametrize("kind", KERNELS)
@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_the_simulated_network_keeps_the_contract(fact: Fact, kind: str) -> None:
    fact(Bench(SimNetwork(KERNELS[kind]())))


# -- time ----------------------------------------------------------------------------------------------------


def test_without_latency_everything_is_there_at_once(b: SimBench) -> None:
    listener, client = b.listener(), b.socket(polled=True)
    assert b.sim.connect(client, b.end(listener)) is None
    assert b.sim.connect_result(client) is None
    b.sim.poll()
    server = b.accept(listener).handle
    b.send(client, b"now")
    b.sim.poll()
    assert b.try_recv(server) == b"now"
    b.sim.close(client)
    b.sim.poll()
    assert b.try_recv(server) == 0
    assert b.time.now_ms == 0


def test_latency_delays_a_verdict_twice_and_data_once() -> None:
    b = SimBench(SimKernel(latency_ns=5 * MS))
    listener, client = b.listener(), b.socket()
    assert b.sim.connect(client, b.end(listener)) is None
    assert b.ms_until(lambda: b.sim.readable(listener), 100) == 5
    assert b.ms_until(lambda: b.sim.connect_result(client) is None, 100) == 5
    server = b.accept(listener).handle
    b.send(client, b"later")
    assert b.ms_until(lambda: b.sim.readable(server), 100) == 5
    refused = b.socket()
    assert b.sim.connect(refused, Endpoint("127.0.0.1", 9)) is None
    assert b.ms_until(lambda: b.sim.connect_result(refused) is not WOULD_BLOCK, 100) == 10


def test_time_does_not_run_backwards() -> None:
    kernel = SimKernel()
    kernel.advance(5)
    with pytest.raises(ValueError, match="forwards"):
        kernel.advance(4)


def test_time_wait_holds_a_port_for_a_minute(b: SimBench) -> None:
    one = b.pair(client=b.socket(end=ANY_PORT))
    local = b.end(one.client)
    b.sim.close(one.client)
    b.sim.close(one.server)
    b.time.pass_ms(59_999)
    assert b.sim.bind(b.socket(), local) == Fault("bind", "EADDRINUSE")
    b.time.pass_ms(1)
    b.socket(end=local)


def test_what_a_closed_handle_cannot_deliver_is_given_up_after_two_minutes(b: SimBench) -> None:
    one = b.pair(small=True)
    b.send(one.client, bytes(4608))
    b.send(one.client, b"more than the window takes")
    b.sim.close(one.client)
    b.time.pass_ms(119_000)
    assert b.sim.loss(one.server) is None
    b.time.pass_ms(2000)
    assert b.loss(one.server).fault == Fault("recv", "ECONNRESET")
    assert len(b.receive(one.server, 4608)) == 4608


# -- addresses -----------------------------------------------------------------------------------------------


def test_the_machine_owns_loopback_and_what_it_was_given() -> None:
    kernel = SimKernel(addresses=("10.0.0.1", "10.0.0.2"), not_ethernet=("10.8.0.1",))
    assert kernel.local_addresses() == (
        LocalAddress("127.0.0.1", "lo", ethernet=False, loopback=True, broadcast="127.255.255.255"),
        LocalAddress("10.0.0.1", "eth0", broadcast="10.0.0.255"),
        LocalAddress("10.0.0.2", "eth0", broadcast="10.0.0.255"),
        LocalAddress("10.8.0.1", "tun0", ethernet=False),
    )


def test_own_addresses_can_be_bound_and_reached(b: SimBench) -> None:
    one = b.pair(b.listener(Endpoint("10.0.0.1", 2000)))
    assert b.end(one.client).address == "10.0.0.1"
    assert b.sim.bind(b.socket(), Endpoint("10.0.0.9", 0)) == Fault("bind", "EADDRNOTAVAIL")
    from_loopback = b.socket(end=ANY_PORT)
    assert b.sim.connect(from_loopback, one.end) is None
    assert b.verdict(from_loopback) is None


def test_an_address_that_nobody_has_is_ehostunreach_after_three_seconds(b: SimBench) -> None:
    client = b.socket()
    assert b.sim.connect(client, Endpoint("10.0.0.7", 2000)) is None
    assert b.end(client).address == "10.0.0.1"
    verdict = Fault("connect", "EHOSTUNREACH")
    assert b.ms_until(lambda: b.sim.connect_result(client) == verdict, 5000) == 3070


def test_when_every_port_is_borrowed_bind_and_connect_say_so(b: SimBench) -> None:
    listener = b.listener()
    while not isinstance(fault := b.sim.bind(b.socket(), ANY_PORT), Fault):
        pass
    assert fault == Fault("bind", "EADDRINUSE")
    assert b.sim.connect(b.socket(), b.end(listener)) == Fault("connect", "EADDRNOTAVAIL")


# -- what tests and the runner rely on -----------------------------------------------------------------------


def test_leaks_names_every_open_handle_and_nothing_else(b: SimBench) -> None:
    one = b.partners()
    fresh = b.owned("C2")
    local, remote = b.end(one.client), one.end
    assert b.sim.leaks() == (
        f"1 P1 listening {remote}",
        f"2 C1 open {local} {remote}",
        f"3 P1 open {remote} {local}",
        "4 C2 fresh",
    )
    for handle in (one.client, one.server, one.listener, fresh):
        b.sim.close(handle)
    assert b.sim.leaks() == ()


def transcript(seed: int) -> list[int]:
    b = SimBench(SimKernel(seed=seed, fragment=True))
    one = b.pair()
    b.send(one.client, bytes(2000))
    pieces: list[int] = []
    while sum(pieces) < 2000:
        b.sim.poll()
        got = b.try_recv(one.server, 2000)
        assert isinstance(got, bytes)
        pieces.append(len(got))
    return pieces


def test_the_same_seed_gives_the_same_pieces_and_another_seed_others() -> None:
    assert transcript(1) == transcript(1)
    assert len(transcript(1)) > 1
    assert transcript(1) != transcript(2)


def streams_in_memory() -> int:
    gc.collect()
    return sum(isinstance(thing, SimStream) for thing in gc.get_objects())


def test_connections_that_are_over_are_forgotten() -> None:
    before = streams_in_memory()
    b = SimBench()
    listener = b.listener()
    for turn in range(300):
        one = b.pair(listener)
        b.send(one.client, b"x")
        for handle in (one.client, one.server):
            b.sim.abort(handle) if turn % 2 else b.sim.close(handle)
    assert b.sim.leaks() == (f"1 X listening {b.end(listener)}",)
    b.time.pass_ms(61_000)
    assert streams_in_memory() == before


def test_a_scan_s_poll_costs_nothing_for_idle_connections(b: SimBench) -> None:
    listener = b.listener(backlog=300)
    pairs = [b.pair(listener) for _ in range(200)]
    b.send(pairs[7].client, b"x")
    b.sim.poll()
    assert [b.sim.readable(one.server) for one in pairs].count(True) == 1
