"""Facts of bytes, FIN and RST, and of a partner who does not read."""

from __future__ import annotations

from tests.net.net_bench import ANY_PORT, Bench, Pair
from tests.net.net_facts import fact, needs_rdhup
from trcvtui.net.kernel import Handle, KernelLoss, PathInfo, SocketOptions
from trcvtui.net.results import WOULD_BLOCK, Fault


@fact
def bytes_arrive_in_order_and_as_far_as_the_view_goes(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"AAAABBBB")
    b.send(one.client, b"CCCC")
    b.until(lambda: b.kernel.unread(one.server) == 12)
    assert b.receive(one.server, 5) == b"AAAAB"
    assert b.kernel.unread(one.server) == 7
    assert b.receive(one.server, 7) == b"BBBCCCC"
    b.settle()
    assert b.try_recv(one.server) is WOULD_BLOCK


@fact
def a_large_message_crosses_in_both_directions(b: Bench) -> None:
    one = b.pair()
    message = bytes(range(256)) * 255
    b.send(one.client, message)
    b.send(one.server, message[::-1])
    assert b.receive(one.server, len(message)) == message
    assert b.receive(one.client, len(message)) == message[::-1]


@fact
def an_empty_view_is_0_and_puts_nothing_on_the_wire(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"")
    b.send(one.client, b"x")
    b.until(lambda: b.kernel.readable(one.server))
    assert b.try_recv(one.server, 0) == 0
    assert b.receive(one.server, 1) == b"x"


@fact
def queued_bytes_come_before_a_fin_which_stays(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"frame")
    b.kernel.close(one.client)
    assert b.receive(one.server, 5) == b"frame"
    assert b.answer(one.server) == 0
    assert b.answer(one.server) == 0


@needs_rdhup
@fact
def a_fin_shows_after_unread_bytes_without_consuming_them(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"frame")
    b.kernel.close(one.client)
    assert b.loss(one.server) == KernelLoss(None, 5)
    assert b.loss(one.server) == KernelLoss(None, 5)
    assert b.receive(one.server, 5) == b"frame"
    assert b.answer(one.server) == 0


@fact
def a_fin_shows_as_a_loss_without_a_fault(b: Bench) -> None:
    one = b.pair()
    assert b.kernel.loss(one.server) is None
    b.kernel.close(one.client)
    assert b.loss(one.server) == KernelLoss(None, 0)


@fact
def the_first_send_after_a_fin_succeeds_and_the_second_is_epipe(b: Bench) -> None:
    one = b.pair()
    b.kernel.close(one.client)
    assert b.answer(one.server) == 0
    b.send(one.server, b"lost")
    b.settle()
    assert b.try_send(one.server) == Fault("send", "EPIPE")
    assert b.try_recv(one.server) == 0


@fact
def after_a_half_close_the_other_direction_goes_on(b: Bench) -> None:
    one = b.pair()
    assert b.kernel.shutdown(one.client, both=False) is None
    assert b.answer(one.server) == 0
    b.send(one.server, b"first")
    b.send(one.server, b"second")
    assert b.receive(one.client, 11) == b"firstsecond"
    assert b.try_send(one.client) == Fault("send", "EPIPE")
    assert b.kernel.shutdown(one.server, both=False) is None
    assert b.answer(one.client) == 0


def five_bytes_and_a_rst(b: Bench) -> Pair:
    """Return a connection whose client has sent five bytes and a RST."""
    one = b.pair()
    b.send(one.client, b"five!")
    b.until(lambda: b.kernel.unread(one.server) == 5)
    b.kernel.abort(one.client)
    b.settle()
    return one


@fact
def queued_bytes_survive_a_rst_and_a_look_at_the_end_and_the_error_is_told_once(b: Bench) -> None:
    one = five_bytes_and_a_rst(b)
    assert b.kernel.renew(one.server)
    assert b.receive(one.server, 5) == b"five!"
    assert b.answer(one.server) == Fault("recv", "ECONNRESET")
    assert b.answer(one.server) == 0
    assert b.try_send(one.server) == Fault("send", "EPIPE")
    assert b.loss(one.server) == KernelLoss(None, 0)


@fact
def a_view_larger_than_what_came_before_a_rst_still_hides_no_error(b: Bench) -> None:
    one = five_bytes_and_a_rst(b)
    received = b""
    while (got := b.try_recv(one.server)) and isinstance(got, bytes):
        received += got
    assert (received, got) == (b"five!", Fault("recv", "ECONNRESET"))


@fact
def a_send_that_finds_the_rst_takes_the_error(b: Bench) -> None:
    one = b.pair()
    b.kernel.abort(one.client)
    b.settle()
    assert b.try_send(one.server) == Fault("send", "ECONNRESET")
    assert b.try_send(one.server) == Fault("send", "EPIPE")
    assert b.try_recv(one.server) == 0


@fact
def loss_takes_the_error_and_leaves_the_bytes(b: Bench) -> None:
    one = five_bytes_and_a_rst(b)
    assert b.loss(one.server) == KernelLoss(Fault("recv", "ECONNRESET"), 5)
    assert b.loss(one.server) == KernelLoss(None, 5)
    assert b.receive(one.server, 5) == b"five!"
    assert b.answer(one.server) == 0
    assert b.try_send(one.server) == Fault("send", "EPIPE")


@fact
def a_rst_after_a_fin_stays_a_fin_for_the_reader_and_epipe_for_the_sender(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"five!")
    assert b.kernel.shutdown(one.client, both=False) is None
    b.kernel.abort(one.client)
    b.settle()
    assert b.receive(one.server, 5) == b"five!"
    assert b.answer(one.server) == 0
    assert b.loss(one.server) == KernelLoss(None, 0)
    assert b.try_send(one.server) == Fault("send", "EPIPE")
    assert b.kernel.shutdown(one.server) == Fault("shutdown", "ENOTCONN")


@fact
def closing_with_unread_input_is_a_rst(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"nobody reads this")
    b.until(lambda: b.kernel.unread(one.server))
    assert b.kernel.close(one.server) is None
    assert b.answer(one.client) == Fault("recv", "ECONNRESET")


@fact
def on_a_reset_connection_shutdown_is_enotconn_but_options_and_close_succeed(b: Bench) -> None:
    for free in (b.kernel.close, b.kernel.abort):
        one = b.pair()
        b.kernel.abort(one.client)
        b.settle()
        assert b.kernel.shutdown(one.server) == Fault("shutdown", "ENOTCONN")
        assert b.kernel.set_options(one.server, SocketOptions(nodelay=True)) == ()
        assert free(one.server) is None


@fact
def own_shutdown_ends_both_directions(b: Bench) -> None:
    one = b.pair()
    assert b.kernel.shutdown(one.server) is None
    assert b.answer(one.client) == 0
    assert b.answer(one.server) == 0
    assert b.loss(one.server) == KernelLoss(None, 0)
    assert b.try_send(one.server) == Fault("send", "EPIPE")


@fact
def data_for_a_connection_that_was_shut_down_is_answered_with_rst(b: Bench) -> None:
    one = b.pair()
    assert b.kernel.shutdown(one.server) is None
    assert b.answer(one.client) == 0
    b.send(one.client, b"late")
    b.settle()
    assert b.try_send(one.client) == Fault("send", "EPIPE")
    assert b.try_recv(one.server) == Fault("recv", "ECONNRESET")


@fact
def a_probe_puts_nothing_on_the_wire_so_that_the_abort_after_it_is_a_rst(b: Bench) -> None:
    one = b.pair()
    assert b.kernel.probe(one.client) is None
    b.settle()
    assert b.kernel.loss(one.server) is None
    assert b.kernel.abort(one.client) is None
    assert b.answer(one.server) == Fault("recv", "ECONNRESET")


@fact
def a_probe_answers_as_shutdown_would(b: Bench) -> None:
    one = b.pair()
    b.kernel.abort(one.client)
    b.settle()
    assert b.kernel.probe(one.server) == Fault("shutdown", "ENOTCONN")
    fresh = b.socket()
    assert b.kernel.probe(fresh) == Fault("shutdown", "ENOTCONN")
    b.kernel.close(fresh)
    assert b.kernel.probe(fresh) == Fault("shutdown", "EBADF")
    two = b.pair()
    b.kernel.close(two.client)
    assert b.answer(two.server) == 0
    assert b.kernel.probe(two.server) is None
    assert b.kernel.shutdown(two.server) is None


@fact
def a_shutdown_before_an_abort_leaves_no_time_wait_either(b: Bench) -> None:
    one = b.pair(client=b.socket(end=ANY_PORT))
    local = b.end(one.client)
    assert b.kernel.shutdown(one.client) is None
    assert b.kernel.abort(one.client) is None
    b.settle()
    b.kernel.close(one.server)
    b.pair(one.listener, client=b.socket(end=local))


@fact
def an_orderly_close_delivers_what_is_queued(b: Bench) -> None:
    one = b.pair()
    message = bytes(range(250)) * 400
    b.send(one.client, message)
    assert b.kernel.shutdown(one.client) is None
    assert b.kernel.close(one.client) is None
    assert b.receive(one.server, len(message)) == message
    assert b.answer(one.server) == 0


def fill(b: Bench, handle: Handle, frame: bytes) -> int:
    """Send frames until the stack takes no more; return how many bytes it took."""
    taken, full = 0, 0

    def stays_full() -> bool:
        nonlocal taken, full
        got = b.kernel.send(handle, memoryview(frame))
        assert not isinstance(got, Fault)
        if got is WOULD_BLOCK:
            full += 1
        else:
            assert isinstance(got, int) and got > 0
            taken, full = taken + got, 0
        return full == 5

    b.until(stays_full, most=100_000)
    return taken


@fact
def small_buffers_take_a_few_thousand_bytes_and_a_partial_count_comes_before_would_block(b: Bench) -> None:
    one = b.pair(small=True)
    first = b.try_send(one.client, bytes(65535))
    assert isinstance(first, int)
    assert 0 < first < 65535
    taken = first + fill(b, one.client, bytes(100))
    assert 4000 < taken < 40000
    seen = b.kernel.path(one.client)
    assert isinstance(seen, PathInfo)
    assert seen.unsent > 0
    assert b.receive(one.server, taken) == bytes(taken)
    b.until(lambda: isinstance(b.try_send(one.client, b"more"), int))


@fact
def default_buffers_swallow_megabytes(b: Bench) -> None:
    one = b.pair()
    taken = fill(b, one.client, bytes(1 << 20))
    assert 1 << 20 < taken < 64 << 20
    assert b.receive(one.server, taken) == bytes(taken)


@fact
def a_full_queue_is_still_delivered_after_close(b: Bench) -> None:
    one = b.pair(small=True)
    message = bytes(range(256)) * 8
    b.send(one.client, message)
    b.send(one.client, message)
    b.kernel.close(one.client)
    assert b.receive(one.server, 2 * len(message)) == 2 * message
    assert b.answer(one.server) == 0


@fact
def an_idle_path_has_nothing_under_way(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"x")
    assert b.receive(one.server, 1) == b"x"
    b.settle()
    seen = b.kernel.path(one.client)
    assert seen is not None
    assert (seen.unacked, seen.unsent) == (0, 0)
    assert 0 <= seen.last_ack_ms < 10_000


@fact
def a_look_at_unread_bytes_takes_none_of_them(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"AAAABBBB")
    b.until(lambda: b.kernel.unread(one.server) == 8)
    assert b.kernel.list_unread([one.server]) == [one.server]
    assert b.kernel.peek(one.server, 0)[:2] == (8, b"AAAABBBB")
    assert b.kernel.peek(one.server, 6).data == b"BB"
    assert b.kernel.peek(one.server, 8)[:2] == (8, b"")
    assert b.receive(one.server, 8) == b"AAAABBBB"
    assert b.kernel.list_unread([one.server]) == []
    assert b.kernel.peek(one.server, 0)[:2] == (0, b"")


@needs_rdhup
@fact
def a_look_tells_the_partners_end_and_leaves_its_error_to_recv(b: Bench) -> None:
    ends: list[object] = []
    for end in (b.kernel.close, b.kernel.abort):
        one = b.pair()
        b.send(one.client, b"frame")
        b.until(lambda one=one: b.kernel.unread(one.server) == 5)  # type: ignore[misc]
        end(one.client)
        b.until(lambda one=one: bool(b.kernel.peek(one.server, 0).end))  # type: ignore[misc]
        ends.append(b.kernel.peek(one.server, 5).end)
        assert b.receive(one.server, 5) == b"frame"
        assert b.kernel.peek(one.server, 0).data == b""
        ends.append(b.answer(one.server))
    assert ends == ["fin", 0, "rst", Fault("recv", "ECONNRESET")]
