"""Facts of connect, listen and accept."""

from __future__ import annotations

from tests.net.net_bench import ANY_PORT, LOOPBACK, Bench
from tests.net.net_facts import fact
from trcvtui.net.kernel import Handle, KernelLoss
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault


@fact
def connect_is_pending_first_even_to_a_local_listener(b: Bench) -> None:
    listener, client = b.listener(), b.socket()
    assert b.kernel.connect(client, b.end(listener)) is None
    assert b.verdict(client) is None
    assert b.kernel.connect_result(client) is None


@fact
def a_refusal_is_told_once(b: Bench) -> None:
    nobody = b.socket(end=ANY_PORT)
    client = b.socket()
    assert b.kernel.connect(client, b.end(nobody)) is None
    assert b.verdict(client) == Fault("connect", "ECONNREFUSED")
    assert b.kernel.connect_result(client) == Fault("connect", "ENOTCONN")
    assert b.kernel.connect(client, b.end(nobody)) == Fault("connect", "ECONNABORTED")


@fact
def bytes_in_front_of_a_rst_make_a_connection_of_it_and_come_before_its_end(b: Bench) -> None:
    client = _called_by_who_sends_and(b, "rst")
    assert b.verdict(client) is None
    assert b.kernel.poll_add(client) is None
    assert b.receive(client, 5) == b"five!"
    assert b.answer(client) == Fault("recv", "ECONNRESET")
    assert b.answer(client) == 0
    assert b.try_send(client) == Fault("send", "EPIPE")


@fact
def a_rst_without_bytes_is_no_connection(b: Bench) -> None:
    listener, client = b.listener(), b.socket()
    assert b.kernel.connect(client, b.end(listener)) is None
    b.kernel.abort(b.accept(listener).handle)
    b.settle()
    assert b.kernel.connect_result(client) == Fault("connect", "ECONNRESET")


@fact
def after_such_a_connect_loss_or_send_takes_the_error_and_leaves_the_bytes(b: Bench) -> None:
    told, sent = _called_by_who_sends_and(b, "rst"), _called_by_who_sends_and(b, "rst")
    assert (b.verdict(told), b.verdict(sent)) == (None, None)
    assert b.loss(told) == KernelLoss(Fault("recv", "ECONNRESET"), 5)
    assert b.try_send(sent) == Fault("send", "ECONNRESET")
    for client in (told, sent):
        assert b.receive(client, 5) == b"five!"
        assert b.answer(client) == 0


@fact
def bytes_a_fin_and_a_rst_are_a_connection_that_ended_by_fin_as_without_the_rst(b: Bench) -> None:
    for end in ("fin, rst", "fin"):
        client = _called_by_who_sends_and(b, end)
        assert b.kernel.connect_result(client) is None
        assert b.receive(client, 5) == b"five!"
        assert b.answer(client) == 0


def _called_by_who_sends_and(b: Bench, end: str) -> Handle:
    """Return a socket whose connect has met five bytes and an end before its verdict was asked for."""
    listener, client = b.listener(), b.socket()
    assert b.kernel.connect(client, b.end(listener)) is None
    partner = b.accept(listener).handle
    b.send(partner, b"five!")
    b.until(lambda: b.kernel.unread(client) == 5)
    if "fin" in end:
        assert b.kernel.shutdown(partner, both=False) is None
    if "rst" in end:
        b.kernel.abort(partner)
    b.settle()
    return client


@fact
def whoever_reads_first_consumes_the_refusal(b: Bench) -> None:
    nobody = b.socket(end=ANY_PORT)
    client = b.socket()
    assert b.kernel.connect(client, b.end(nobody)) is None
    assert b.answer(client) == Fault("recv", "ECONNREFUSED")
    assert b.try_recv(client) == 0
    assert b.try_send(client) == Fault("send", "EPIPE")
    assert b.kernel.connect_result(client) == Fault("connect", "ENOTCONN")


@fact
def accept_gives_the_client_and_its_end_and_then_would_block(b: Bench) -> None:
    listener = b.listener()
    client = b.connect(b.end(listener))
    got = b.accept(listener)
    assert got.peer == b.end(client)
    assert b.kernel.local_end(got.handle) == b.end(listener)
    assert b.kernel.accept(listener) is WOULD_BLOCK
    b.settle()
    assert not b.kernel.readable(listener)


@fact
def early_bytes_wait_for_the_accept(b: Bench) -> None:
    listener = b.listener()
    b.send(b.connect(b.end(listener)), b"early")
    assert b.receive(b.accept(listener).handle, 5) == b"early"


@fact
def a_backlog_of_n_admits_n_plus_one_and_a_free_place_is_used_later(b: Bench) -> None:
    listener = b.listener(backlog=1)
    end = b.end(listener)
    b.connect(end)
    b.connect(end)
    third = b.socket()
    assert b.kernel.connect(third, end) is None
    b.settle()
    assert b.kernel.connect_result(third) is WOULD_BLOCK
    assert b.kernel.connect(third, end) == Fault("connect", "EALREADY")
    assert b.try_recv(third) is WOULD_BLOCK
    assert b.try_send(third) is WOULD_BLOCK
    b.accept(listener)
    assert b.verdict(third) is None


@fact
def a_client_that_reset_in_the_queue_is_still_accepted(b: Bench) -> None:
    listener = b.listener()
    client = b.connect(b.end(listener))
    b.send(client, b"early")
    b.settle()
    assert b.kernel.abort(client) is None
    server = b.accept(listener).handle
    assert b.receive(server, 5) == b"early"
    assert b.answer(server) == Fault("recv", "ECONNRESET")
    assert b.try_recv(server) == 0


@fact
def a_closed_listener_resets_its_queue_and_refuses_newcomers_but_keeps_its_connections(b: Bench) -> None:
    one = b.pair()
    queued = b.connect(one.end)
    b.settle()
    assert b.kernel.close(one.listener) is None
    assert b.answer(queued) == Fault("recv", "ECONNRESET")
    late = b.socket()
    assert b.kernel.connect(late, one.end) is None
    assert b.verdict(late) == Fault("connect", "ECONNREFUSED")
    b.send(one.client, b"still here")
    assert b.receive(one.server, 10) == b"still here"


@fact
def a_listener_after_shutdown_cannot_accept(b: Bench) -> None:
    listener = b.listener()
    end = b.end(listener)
    assert b.kernel.shutdown(listener, both=False) is None
    b.connect(end)
    assert b.kernel.shutdown(listener) is None
    b.until(lambda: b.kernel.readable(listener))
    assert b.kernel.accept(listener) == Fault("accept", "EINVAL")
    late = b.socket()
    assert b.kernel.connect(late, end) is None
    assert b.verdict(late) == Fault("connect", "ECONNREFUSED")


@fact
def a_socket_that_is_no_listener_cannot_accept(b: Bench) -> None:
    assert b.kernel.accept(b.socket()) == Fault("accept", "EINVAL")


@fact
def a_listener_is_no_connection(b: Bench) -> None:
    listener = b.listener()
    assert b.kernel.connect(listener, Endpoint(LOOPBACK, 1)) == Fault("connect", "EISCONN")
    assert b.try_send(listener) == Fault("send", "EPIPE")
    assert b.kernel.listen(listener, 9) is None


@fact
def targets_that_no_connection_can_have(b: Bench) -> None:
    for target in ("255.255.255.255", "127.255.255.255", "224.0.0.1"):
        assert b.kernel.connect(b.socket(), Endpoint(target, 5)) == Fault("connect", "ENETUNREACH")
    bound = b.socket(end=ANY_PORT)
    assert b.kernel.connect(bound, Endpoint("198.51.100.7", 5)) == Fault("connect", "EINVAL")
    zero = b.socket()
    assert b.kernel.connect(zero, Endpoint(LOOPBACK, 0)) is None
    assert b.verdict(zero) == Fault("connect", "ECONNREFUSED")


@fact
def text_never_reaches_a_resolver(b: Bench) -> None:
    for text in ("localhost", "127.1", "", "<broadcast>", "1.2.3.4.5", "1.2.3.256", "1.2.3.-4"):
        assert b.kernel.bind(b.socket(), Endpoint(text, 0)) == Fault("bind", "EINVAL")
        assert b.kernel.connect(b.socket(), Endpoint(text, 5)) == Fault("connect", "EINVAL")
    assert b.kernel.bind(b.socket(), Endpoint(LOOPBACK, 65536)) == Fault("bind", "EINVAL")
    assert b.kernel.connect(b.socket(), Endpoint(LOOPBACK, -1)) == Fault("connect", "EINVAL")


@fact
def remote_address_0_0_0_0_means_loopback(b: Bench) -> None:
    listener = b.listener()
    client = b.connect(Endpoint("0.0.0.0", b.end(listener).port))
    assert b.accept(listener).peer == b.end(client)


@fact
def a_socket_can_connect_to_itself_and_echo(b: Bench) -> None:
    lonely = b.socket(end=ANY_PORT)
    b.connect(b.end(lonely), lonely)
    b.send(lonely, b"echo")
    assert b.receive(lonely, 4) == b"echo"
    assert b.kernel.shutdown(lonely, both=False) is None
    assert b.answer(lonely) == 0
    b.settle()
    assert b.kernel.shutdown(lonely) == Fault("shutdown", "ENOTCONN")


@fact
def before_a_connect_recv_is_enotconn_and_send_is_epipe(b: Bench) -> None:
    fresh = b.socket()
    assert b.kernel.local_end(fresh) is None
    assert b.try_recv(fresh) == Fault("recv", "ENOTCONN")
    assert b.try_send(fresh) == Fault("send", "EPIPE")
    assert b.kernel.shutdown(fresh) == Fault("shutdown", "ENOTCONN")
    assert b.kernel.connect_result(fresh) == Fault("connect", "ENOTCONN")


@fact
def shutdown_gives_up_an_attempt(b: Bench) -> None:
    listener = b.listener(backlog=0)
    b.connect(b.end(listener))
    waiting = b.socket()
    assert b.kernel.connect(waiting, b.end(listener)) is None
    b.settle()
    assert b.kernel.shutdown(waiting) is None
    assert b.verdict(waiting) == Fault("connect", "ECONNRESET")
