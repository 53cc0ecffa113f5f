"""Facts of the poll set, of freed handles and of socket options."""

from __future__ import annotations

from tests.net.net_bench import ANY_PORT, LOOPBACK, Bench
from tests.net.net_facts import fact
from trcvtui.net.kernel import KernelLoss, NewClient, SocketOptions
from trcvtui.net.results import WOULD_BLOCK, Fault


@fact
def adding_twice_is_eexist_and_removing_twice_is_enoent(b: Bench) -> None:
    listener = b.listener()
    assert b.kernel.poll_add(listener) == Fault("poll_add", "EEXIST")
    assert b.kernel.poll_del(listener) is None
    assert b.kernel.poll_del(listener) == Fault("poll_del", "ENOENT")
    assert b.kernel.poll_add(listener) is None


@fact
def what_a_poll_did_not_see_waits_for_the_next_poll(b: Bench) -> None:
    one = b.pair()
    b.settle()
    b.send(one.client, b"now")
    b.network.breathe()
    b.network.breathe()
    b.network.breathe()
    assert not b.kernel.readable(one.server)
    assert b.try_recv(one.server) is WOULD_BLOCK
    assert b.kernel.loss(one.server) is None
    assert b.receive(one.server, 3) == b"now"


@fact
def a_handle_outside_the_poll_set_is_always_tried(b: Bench) -> None:
    one = b.pair()
    assert b.kernel.poll_del(one.server) is None
    assert not b.kernel.readable(one.server)
    b.send(one.client, b"now")
    for _ in range(3000):
        if b.kernel.readable(one.server):
            break
        b.network.breathe()
    assert b.receive(one.server, 3) == b"now"
    b.kernel.close(one.client)
    for _ in range(3000):
        if b.kernel.loss(one.server) is not None:
            break
        b.network.breathe()
    assert b.kernel.loss(one.server) == KernelLoss(None, 0)


@fact
def a_listener_outside_the_poll_set_accepts_as_well(b: Bench) -> None:
    listener = b.listener()
    assert b.kernel.poll_del(listener) is None
    assert b.kernel.accept(listener) is WOULD_BLOCK
    b.connect(b.end(listener))
    b.until(lambda: b.kernel.readable(listener))
    assert isinstance(b.kernel.accept(listener), NewClient)


@fact
def unread_data_shows_at_every_poll(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"12345678")
    b.until(lambda: b.kernel.unread(one.server) == 8)
    for _ in range(4):
        b.kernel.poll()
        assert b.kernel.readable(one.server)
        assert b.receive(one.server, 2)
    b.kernel.poll()
    assert not b.kernel.readable(one.server)


@fact
def a_client_who_waits_when_the_listener_is_added_is_seen(b: Bench) -> None:
    listener = b.socket(end=ANY_PORT)
    assert b.kernel.listen(listener, 1) is None
    b.connect(b.end(listener))
    b.settle()
    assert b.kernel.poll_add(listener) is None
    b.kernel.poll()
    assert b.kernel.readable(listener)


@fact
def a_freed_handle_answers_ebadf(b: Bench) -> None:
    kernel, handle = b.kernel, b.socket(polled=True)
    assert kernel.close(handle) is None
    b.kernel.poll()
    assert not kernel.readable(handle)
    assert kernel.set_reuse(handle) == Fault("set_reuse", "EBADF")
    assert kernel.bind(handle, ANY_PORT) == Fault("bind", "EBADF")
    assert kernel.listen(handle, 1) == Fault("listen", "EBADF")
    assert kernel.poll_add(handle) == Fault("poll_add", "EBADF")
    assert kernel.poll_del(handle) == Fault("poll_del", "EBADF")
    assert kernel.accept(handle) == Fault("accept", "EBADF")
    assert kernel.connect(handle, ANY_PORT) == Fault("connect", "EBADF")
    assert kernel.connect_result(handle) == Fault("connect", "EBADF")
    assert b.try_recv(handle) == Fault("recv", "EBADF")
    assert b.try_send(handle) == Fault("send", "EBADF")
    assert kernel.loss(handle) == KernelLoss(Fault("recv", "EBADF"), 0)
    assert kernel.shutdown(handle) == Fault("shutdown", "EBADF")
    assert kernel.abort(handle) == Fault("abort", "EBADF")
    assert kernel.close(handle) == Fault("close", "EBADF")
    assert kernel.set_options(handle, SocketOptions()) == ()
    assert kernel.local_end(handle) is None
    assert kernel.path(handle) is None
    assert kernel.unread(handle) == 0


@fact
def a_keep_alive_interval_out_of_range_is_refused_by_name(b: Bench) -> None:
    handle = b.socket()
    for wrong in (0, -1, 32768, 1 << 40):
        refused = b.kernel.set_options(handle, SocketOptions(keep_alive_s=wrong))
        assert refused[:2] == ("TCP_KEEPIDLE", "TCP_KEEPINTVL")
    for right in (1, 32767):
        assert "TCP_KEEPIDLE" not in b.kernel.set_options(handle, SocketOptions(keep_alive_s=right))


@fact
def options_may_be_set_again_on_a_standing_connection(b: Bench) -> None:
    one = b.pair()
    for handle in (one.client, one.server):
        options = SocketOptions(nodelay=True, keep_alive_s=1, user_timeout_ms=3000, small_buffers=True)
        assert "TCP_NODELAY" not in b.kernel.set_options(handle, options)
        b.kernel.set_user_timeout(handle, 0)
    b.send(one.client, b"works")
    assert b.receive(one.server, 5) == b"works"


@fact
def loopback_is_in_the_address_list(b: Bench) -> None:
    own = b.kernel.local_addresses()
    loopback = [address for address in own if address.address == LOOPBACK]
    assert len(loopback) == 1
    assert loopback[0].loopback
    assert not loopback[0].ethernet
