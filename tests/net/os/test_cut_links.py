"""A cut wire on real sockets: how long the stack takes to find out, and what a system may refuse."""

from __future__ import annotations

import socket
import sys
import time

import pytest

import trcvtui.net.os.system_calls as os_link
from tests.net.net_bench import Bench
from trcvtui.net.kernel import KernelLoss, SocketOptions
from trcvtui.net.os import system_calls as os_options
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="packet filters at sockets are Linux's own")


@pytest.mark.slow
@linux_only
def test_keep_alive_finds_an_idle_cut_wire_within_three_intervals(b: Bench) -> None:
    one = b.pair(client=b.socket(owner="C1"))
    b.kernel.set_options(one.client, SocketOptions(keep_alive_s=1))
    assert b.kernel.set_link("C1", up=False) == ""
    start = time.monotonic()
    b.until(lambda: b.kernel.readable(one.client), most=8000)
    assert 1.8 < time.monotonic() - start < 3.6
    assert b.kernel.loss(one.client) == KernelLoss(Fault("recv", "ETIMEDOUT"), 0)
    assert b.kernel.loss(one.server) is None  # nobody has told the partner


@linux_only
def test_a_partner_outside_the_bench_hears_the_plc_but_is_not_heard(b: Bench) -> None:
    with socket.create_server(("127.0.0.1", 0)) as foreign:
        client = b.connect(Endpoint(*foreign.getsockname()), b.socket(owner="C1"))
        partner, _ = foreign.accept()
        with partner:
            assert b.kernel.set_link("C1", up=False) == ""
            b.send(client, b"there")
            assert partner.recv(5) == b"there"
            partner.sendall(b"back")
            b.settle()
            assert b.try_recv(client) is WOULD_BLOCK
            assert b.kernel.set_link("C1", up=True) == ""
            assert b.receive(client, 4) == b"back"


def test_a_system_without_packet_filters_says_so(b: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os_link, "CAN_CUT", False)
    assert b.kernel.set_link("C1", up=False) == os_link.CANNOT_CUT
    assert "Linux" in os_link.CANNOT_CUT


@linux_only
def test_a_refused_filter_leaves_the_wire_whole(b: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    one = b.pair(client=b.socket(owner="C1"))
    monkeypatch.setattr(os_link, "_filter", b"too short")
    assert b.kernel.set_link("C1", up=False) == "the system refuses a packet filter: EINVAL"
    b.send(one.server, b"heard")
    assert b.receive(one.client, 5) == b"heard"


@linux_only
def test_a_system_without_rto_max_refuses_nothing_and_says_that_it_probes_seldom(
    b: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os_options, "TCP_RTO_MAX_MS", 0x7FFF)  # what an older Linux makes of 44
    one = b.pair()
    assert b.kernel.set_options(one.client, SocketOptions()) == ()
    seen = b.kernel.path(one.client)
    assert seen is not None
    assert not seen.probes_often


@linux_only
def test_probes_often_is_what_the_socket_says(b: Bench) -> None:
    one = b.pair()
    b.kernel.set_options(one.client, SocketOptions())
    with socket.socket(fileno=socket.dup(one.client)) as seen:
        try:
            in_force = seen.getsockopt(socket.IPPROTO_TCP, 44) == 1000
        except OSError:
            in_force = False
    path, others = b.kernel.path(one.client), b.kernel.path(one.server)
    assert path is not None and others is not None
    assert (path.probes_often, others.probes_often) == (in_force, False)
