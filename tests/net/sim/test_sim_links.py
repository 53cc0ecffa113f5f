"""Cut links in virtual time: keep-alive, user timeout, closed windows, lost SYN, FIN and RST (3.2)."""

from __future__ import annotations

import pytest

from tests.net.net_bench import Pair
from tests.net.sim.net_sim import MS, SimBench
from trcvtui.net.kernel import KernelLoss, PathInfo, SocketOptions
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel

TIMED_OUT = Fault("recv", "ETIMEDOUT")


def dead_after(b: SimBench, one: Pair, most_ms: int) -> int:
    """Return after how many milliseconds C1 sees its loss, which is a timeout."""
    after = b.ms_until(lambda: b.sim.readable(one.client), most_ms)
    seen = b.sim.loss(one.client)
    assert seen is not None
    assert seen.fault == TIMED_OUT
    return after


@pytest.mark.parametrize("interval", [1, 2, 10])
def test_an_idle_link_is_dead_three_intervals_after_the_last_packet(b: SimBench, interval: int) -> None:
    one = b.partners(SocketOptions(keep_alive_s=interval))
    b.cut()
    assert dead_after(b, one, 40_000) == 3000 * interval


def test_the_clock_starts_at_the_last_packet_received_not_at_the_cut(b: SimBench) -> None:
    one = b.partners(SocketOptions(keep_alive_s=1))
    b.send(one.server, b"x")
    assert b.receive(one.client, 1) == b"x"
    b.time.pass_ms(700)
    b.cut()
    assert dead_after(b, one, 10_000) == 2300


def test_answered_probes_keep_an_idle_link_alive_and_move_the_clock(b: SimBench) -> None:
    one = b.partners(SocketOptions(keep_alive_s=2))
    b.time.pass_ms(3_600_500)
    assert b.sim.loss(one.client) is None
    b.cut()
    assert dead_after(b, one, 10_000) == 5500  # the last answered probe is half a second old


def test_without_keep_alive_nobody_notices_a_cut(b: SimBench) -> None:
    one = b.partners()
    b.cut()
    b.time.pass_ms(24 * 3_600_000)
    assert b.sim.loss(one.client) is None


@pytest.mark.parametrize(("user_timeout", "expected"), [(2500, 3000), (3000, 3000), (9000, 9000)])
def test_a_user_timeout_takes_the_place_of_the_probe_count(
    b: SimBench, user_timeout: int, expected: int
) -> None:
    one = b.partners(SocketOptions(keep_alive_s=1, user_timeout_ms=user_timeout))
    b.cut()
    assert dead_after(b, one, 20_000) == expected


@pytest.mark.parametrize(("user_timeout", "expected"), [(3000, 3420), (15_000, 15_420)])
def test_data_in_flight_dies_by_the_user_timeout(b: SimBench, user_timeout: int, expected: int) -> None:
    one = b.partners(SocketOptions(keep_alive_s=1, user_timeout_ms=user_timeout))
    b.cut()
    b.send(one.client, b"into the dark")
    assert dead_after(b, one, 20_000) == expected


def test_data_in_flight_suspends_keep_alive(b: SimBench) -> None:
    one = b.partners(SocketOptions(keep_alive_s=1))
    b.cut()
    b.send(one.client, b"into the dark")
    assert 14_000 < dead_after(b, one, 20_000) < 16_000  # 15 retransmissions, a second apart at most


def test_the_timeout_is_told_once_to_whoever_asks_first(b: SimBench) -> None:
    one = b.partners(SocketOptions(keep_alive_s=1))
    b.send(one.server, b"kept")
    b.cut()
    b.time.pass_ms(3000)
    assert b.try_send(one.client) == Fault("send", "ETIMEDOUT")
    assert b.try_send(one.client) == Fault("send", "EPIPE")
    assert b.sim.loss(one.client) == KernelLoss(None, 4)
    assert b.receive(one.client, 4) == b"kept"
    assert b.try_recv(one.client) == 0


def test_a_cut_shorter_than_three_intervals_is_invisible_and_loses_nothing(b: SimBench) -> None:
    one = b.partners(SocketOptions(keep_alive_s=1, user_timeout_ms=3000))
    b.cut()
    b.send(one.client, b"one ")
    b.send(one.client, b"two ")
    assert b.sim.path(one.client) == PathInfo(unacked=8, unsent=0, last_ack_ms=0, probes_often=True)
    b.time.pass_ms(1500)
    b.send(one.client, b"three")
    b.mend()
    assert b.try_recv(one.server) is WOULD_BLOCK
    assert b.ms_until(lambda: b.sim.unread(one.server) == 13, 2000) < 1100
    assert b.receive(one.server, 13) == b"one two three"
    assert b.sim.loss(one.client) is None


def test_a_probe_to_a_partner_that_died_during_the_cut_is_answered_with_rst(b: SimBench) -> None:
    one = b.partners(SocketOptions(keep_alive_s=10))
    b.cut()
    b.sim.abort(one.server)
    b.time.pass_ms(5000)
    b.mend()
    b.until(lambda: b.sim.readable(one.client), 20_000)
    assert b.sim.loss(one.client) == KernelLoss(Fault("recv", "ECONNRESET"), 0)


# -- a closed window (3.2, the remedy; 2.3, 80A8) ------------------------------------------------------------


def stalled(b: SimBench, user_timeout: int) -> Pair:
    """Return a connection whose partner does not read and whose buffers are full."""
    options = SocketOptions(keep_alive_s=1, user_timeout_ms=user_timeout, small_buffers=True)
    one = b.partners(options, SocketOptions(small_buffers=True))
    assert b.try_send(one.client, bytes(9216)) == 9216
    assert b.try_send(one.client, bytes(9216)) == 4608
    assert b.try_send(one.client) is WOULD_BLOCK
    return one


def test_a_closed_window_without_user_timeout_lives_for_ever(b: SimBench) -> None:
    one = stalled(b, user_timeout=0)
    b.time.pass_ms(3_600_000)
    assert b.sim.loss(one.client) is None
    seen = b.sim.path(one.client)
    assert seen is not None
    assert (seen.unacked, seen.unsent) == (0, 9216)
    assert seen.last_ack_ms <= 1300  # the figure that tells a closed window from a dead link
    assert len(b.receive(one.server, 13824)) == 13824


def test_a_window_that_opens_while_the_link_is_cut_is_found_by_a_probe(b: SimBench) -> None:
    one = stalled(b, user_timeout=0)
    b.cut()
    assert b.receive(one.server, 4608) == bytes(4608)
    b.mend()
    assert b.ms_until(lambda: b.sim.unread(one.server) == 4608, 2000) < 1100


# -- attempts ------------------------------------------------------------------------------------------------


def test_an_attempt_into_a_cut_link_is_silent_and_succeeds_at_the_next_syn_after_the_repair(
    b: SimBench,
) -> None:
    one = b.partners()
    b.cut()
    client = b.owned("C1")
    assert b.sim.connect(client, one.end) is None
    b.time.pass_ms(2500)
    assert b.sim.connect_result(client) is WOULD_BLOCK
    b.mend()
    assert b.ms_until(lambda: b.sim.connect_result(client) is None, 2000) == 3072 - 2500


@pytest.mark.parametrize(("user_timeout", "expected"), [(0, 134_144), (2500, 2500)])
def test_swallowed_syns_end_in_etimedout(b: SimBench, user_timeout: int, expected: int) -> None:
    one = b.partners()
    b.cut()
    client = b.owned("C1", SocketOptions(user_timeout_ms=user_timeout))
    assert b.sim.connect(client, one.end) is None
    assert (
        b.ms_until(lambda: b.sim.connect_result(client) == Fault("connect", "ETIMEDOUT"), 140_000) == expected
    )


def test_a_new_connection_with_the_same_ends_ends_the_partner_s_old_one(b: SimBench) -> None:
    one = b.partners()
    local = b.end(one.client)
    b.cut()
    b.sim.abort(one.client)  # the RST is lost: P1 still holds the old connection
    b.mend()
    again = b.owned("C1")
    assert b.sim.bind(again, local) is None
    two = b.pair(one.listener, client=again)
    assert b.answer(one.server) == Fault("recv", "ECONNRESET")
    b.send(two.client, b"fresh")
    assert b.receive(two.server, 5) == b"fresh"


def test_an_attempt_given_up_on_its_way_leaves_no_client_behind() -> None:
    b = SimBench(SimKernel(latency_ns=5 * MS))
    one = b.partners()
    client = b.owned("C1")
    assert b.sim.connect(client, one.end) is None
    b.sim.close(client)
    b.time.pass_ms(20)
    assert not b.sim.readable(one.listener)


def test_a_last_fin_whose_acknowledgement_was_lost_is_acknowledged_in_time_wait() -> None:
    b = SimBench(SimKernel(latency_ns=5 * MS))
    one = b.partners()
    b.sim.close(one.client)
    b.time.pass_ms(20)
    assert b.sim.shutdown(one.server, both=False) is None
    b.time.pass_ms(6)  # the FIN has arrived, its acknowledgement is on the way
    b.cut()
    b.time.pass_ms(20)
    b.mend()
    b.time.pass_ms(1000)
    assert b.sim.loss(one.server) == KernelLoss(None, 0)
    assert b.sim.shutdown(one.server) == Fault("shutdown", "ENOTCONN")


def test_a_refusal_can_be_lost_on_its_way() -> None:
    b = SimBench(SimKernel(latency_ns=5 * MS))
    client = b.owned("C1")
    assert b.sim.connect(client, Endpoint("127.0.0.1", 9)) is None
    b.time.pass_ms(7)
    b.cut()
    b.time.pass_ms(500)
    assert b.sim.connect_result(client) is WOULD_BLOCK
    b.mend()
    assert b.verdict(client) == Fault("connect", "ECONNREFUSED")
