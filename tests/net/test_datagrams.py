"""Datagrams beyond the shared facts: links and latency of the simulation, planned faults, ICMP on Windows."""

from __future__ import annotations

import errno
import socket

import pytest

from tests.net.facts_datagrams import opened, say, take, try_take
from tests.net.net_bench import ANY_PORT, Bench, OsNetwork
from tests.net.sim.net_sim import MS, SimBench
from tests.net.test_faults import FaultyBench, injected
from trcvtui.net.broadcast import enable_broadcasts
from trcvtui.net.kernel import Handle
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel


def owned(b: SimBench, owner: str) -> Handle:
    handle = b.sim.datagram_socket(owner)
    assert not isinstance(handle, Fault)
    assert b.sim.bind(handle, ANY_PORT) is None
    return handle


# -- the simulated wire --------------------------------------------------------------------------------------


def test_latency_delays_a_datagram_once() -> None:
    b = SimBench(SimKernel(latency_ns=5 * MS))
    here, there = owned(b, "C1"), owned(b, "P1")
    say(b, here, b"later", there)
    assert b.ms_until(lambda: b.sim.readable(there), 100) == 5
    assert take(b, there)[0] == b"later"


def test_a_machine_without_an_address_has_no_way_to_another_one() -> None:
    b = SimBench(SimKernel(addresses=()))
    handle = opened(b, end=None)
    far = Endpoint("198.51.100.7", 9)
    assert b.sim.send_to(handle, memoryview(b"x"), far) == Fault("send", "ENETUNREACH")
    assert b.sim.connect(b.socket(), far) == Fault("connect", "ENETUNREACH")


def test_datagrams_are_no_connection() -> None:
    b = SimBench()
    stream, handle = b.socket(), opened(b)
    assert b.sim.connect(handle, b.end(handle)) == Fault("connect", "EOPNOTSUPP")
    assert try_take(b, stream) == Fault("recv", "ENOTCONN")
    assert b.sim.send_to(stream, memoryview(b"x"), b.end(handle)) == Fault("send", "EPIPE")
    assert b.sim.loss(handle) is None


def test_where_no_broadcast_address_is_known_broadcasts_are_sent_and_not_heard(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    b = SimBench()
    handle = opened(b)
    monkeypatch.setattr(b.sim, "local_addresses", lambda: ())
    hearing, why = enable_broadcasts(b.sim, "X", handle, b.end(handle))
    assert (hearing, why) == (None, "the broadcast address of 127.0.0.1 is unknown")
    assert b.sim.send_to(handle, memoryview(b"x"), Endpoint("127.255.255.255", 9)) == 1


# -- planned faults ------------------------------------------------------------------------------------------


def test_a_plan_fails_the_datagram_calls_by_their_usual_names() -> None:
    b = FaultyBench()
    here, there = opened(b), opened(b)
    say(b, here, b"waits", there)
    for call in ("socket", "bind", "send", "recv", "close"):
        b.plan.add(call, "EIO", on="X")
    assert b.kernel.datagram_socket("X") == injected("socket", "EIO")
    assert b.kernel.bind(opened(b, end=None), ANY_PORT) == injected("bind", "EIO")
    assert b.kernel.send_to(here, memoryview(b"x"), b.end(there)) == injected("send", "EIO")
    assert try_take(b, there) == injected("recv", "EIO")
    assert try_take(b, there) == b"waits"
    assert b.kernel.close(here) == injected("close", "EIO")
    assert b.kernel.close(here) == Fault("close", "EBADF")
    assert not b.plan.active


# -- late ICMP messages on the real network ------------------------------------------------------------------


class Told(socket.socket):
    """A socket to which the system tells late ICMP messages, as Windows does."""

    def __init__(self, times: int, number: int) -> None:
        super().__init__(socket.AF_INET, socket.SOCK_DGRAM)
        self.times = times
        self.number = number

    def _tell(self) -> None:
        if self.times:
            self.times -= 1
            raise OSError(self.number, "port unreachable")

    def recvfrom_into(self, into: memoryview) -> tuple[int, tuple[str, int]]:  # type: ignore[override]
        self._tell()
        into[:3] = b"new"
        return 3, ("127.0.0.1", 2000)

    def sendto(self, data: memoryview, end: tuple[str, int]) -> int:  # type: ignore[override]
        self._tell()
        return len(data)


def told(network: OsNetwork, times: int, number: int = errno.ECONNRESET) -> Handle:
    return network.kernel._add_socket(Told(times, number), "X")


@pytest.mark.parametrize("number", [errno.ECONNRESET, errno.ECONNREFUSED, errno.ENETRESET])
def test_a_port_unreachable_hides_no_datagram_and_fails_no_send(network: OsNetwork, number: int) -> None:
    b = Bench(network)
    handle = told(network, 2, number)
    assert try_take(b, handle) == b"new"
    handle = told(network, 2, number)
    assert b.kernel.send_to(handle, memoryview(b"four"), ANY_PORT) == 4


def test_a_flood_of_port_unreachables_costs_bounded_work(network: OsNetwork) -> None:
    b = Bench(network)
    handle = told(network, 1_000_000)
    assert try_take(b, handle) is WOULD_BLOCK
    assert b.kernel.send_to(handle, memoryview(b"x"), ANY_PORT) == Fault("send", "ECONNRESET")


def test_any_other_error_is_told(network: OsNetwork) -> None:
    b = Bench(network)
    handle = told(network, 1, errno.ENOBUFS)
    assert try_take(b, handle) == Fault("recv", "ENOBUFS")
    handle = told(network, 1, errno.ENOBUFS)
    assert b.kernel.send_to(handle, memoryview(b"x"), ANY_PORT) == Fault("send", "ENOBUFS")
