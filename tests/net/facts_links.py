"""Facts of a wire that is cut and mended, and of what the stack knows of a path."""

from __future__ import annotations

import pytest

from tests.net.facts_data import fill
from tests.net.net_bench import ANY_PORT, Bench, Pair
from tests.net.net_facts import on_the_wire
from trcvtui.net.kernel import Handle, KernelLoss, PathInfo, SocketOptions
from trcvtui.net.results import WOULD_BLOCK, Datagram, Fault

TIMED_OUT = Fault("recv", "ETIMEDOUT")


def partners(b: Bench, small: bool = False) -> Pair:
    return b.pair(small=small, client=b.socket(owner="C1"))


def cut(b: Bench, owner: str = "C1") -> None:
    if b.kernel.set_link(owner, up=False):
        pytest.skip("this system cannot cut a wire")


def mend(b: Bench, owner: str = "C1") -> None:
    assert b.kernel.set_link(owner, up=True) == ""


def path(b: Bench, handle: Handle) -> PathInfo:
    seen = b.kernel.path(handle)
    assert seen is not None
    return seen


@on_the_wire
def a_cut_wire_is_silent_both_ways_and_a_mended_one_brings_everything(b: Bench) -> None:
    one = partners(b)
    cut(b)
    b.send(one.client, b"there")
    b.send(one.server, b"back")
    b.settle()
    assert (b.try_recv(one.server), b.try_recv(one.client)) == (WOULD_BLOCK, WOULD_BLOCK)
    assert (path(b, one.client).unacked, path(b, one.client).unsent) == (5, 0)
    mend(b)
    assert b.receive(one.server, 5) == b"there"
    assert b.receive(one.client, 4) == b"back"
    assert (b.kernel.loss(one.client), b.kernel.loss(one.server)) == (None, None)


@on_the_wire
def other_owners_do_not_feel_a_cut(b: Bench) -> None:
    partners(b)
    other = b.pair(client=b.socket(owner="C2"))
    cut(b)
    b.send(other.client, b"untouched")
    assert b.receive(other.server, 9) == b"untouched"
    b.pair(other.listener)


@on_the_wire
def a_wire_between_two_cut_owners_speaks_when_both_are_mended(b: Bench) -> None:
    listener = b.socket(owner="C2", end=ANY_PORT, polled=True)
    assert b.kernel.listen(listener, 1) is None
    one = b.pair(listener, client=b.socket(owner="C1"))
    cut(b, "C1")
    cut(b, "C2")
    mend(b, "C1")
    b.send(one.client, b"x")
    b.settle()
    assert b.try_recv(one.server) is WOULD_BLOCK
    mend(b, "C2")
    assert b.receive(one.server, 1) == b"x"


@on_the_wire
def an_attempt_begun_on_a_cut_wire_gets_no_answer_not_even_a_refusal(b: Bench) -> None:
    listener = b.listener()
    refusing = b.end(b.socket(end=ANY_PORT))
    cut(b)
    attempts = [b.socket(owner="C1"), b.socket(owner="C1")]
    for attempt, end in zip(attempts, (b.end(listener), refusing), strict=True):
        assert b.kernel.connect(attempt, end) is None
    b.settle()
    assert [b.kernel.connect_result(attempt) for attempt in attempts] == [WOULD_BLOCK, WOULD_BLOCK]
    assert not b.kernel.readable(listener)


@on_the_wire
def a_listener_on_a_cut_wire_hears_no_newcomer(b: Bench) -> None:
    listener = b.socket(owner="C1", end=ANY_PORT, polled=True)
    assert b.kernel.listen(listener, 1) is None
    cut(b)
    client = b.socket()
    assert b.kernel.connect(client, b.end(listener)) is None
    b.settle()
    assert b.kernel.connect_result(client) is WOULD_BLOCK
    assert not b.kernel.readable(listener)


@on_the_wire
def a_client_accepted_on_a_cut_wire_is_silent_too(b: Bench) -> None:
    listener = b.socket(owner="C1", end=ANY_PORT, polled=True)
    assert b.kernel.listen(listener, 1) is None
    client = b.connect(b.end(listener))
    cut(b)
    server = b.accept(listener).handle
    b.send(client, b"there")
    b.send(server, b"back")
    b.settle()
    assert (b.try_recv(server), b.try_recv(client)) == (WOULD_BLOCK, WOULD_BLOCK)


@on_the_wire
def neither_fin_nor_rst_crosses_a_cut_wire_and_only_the_fin_comes_again(b: Bench) -> None:
    fin, rst = partners(b), partners(b)
    cut(b)
    assert b.kernel.shutdown(fin.server, both=False) is None
    b.kernel.abort(rst.server)
    b.settle()
    assert (b.kernel.loss(fin.client), b.kernel.loss(rst.client)) == (None, None)
    mend(b)
    assert b.loss(fin.client) == KernelLoss(None, 0)
    assert b.kernel.loss(rst.client) is None


@on_the_wire
def a_handle_freed_on_a_cut_wire_leaves_nothing_after_for_the_next(b: Bench) -> None:
    one = partners(b)
    cut(b)
    b.kernel.abort(one.client)
    again = b.pair(one.listener)  # on a real system it has the number of the freed one
    b.send(again.client, b"fresh")
    assert b.receive(again.server, 5) == b"fresh"
    mend(b)


@on_the_wire
def a_datagram_on_a_cut_wire_goes_nowhere_and_never_comes_later(b: Bench) -> None:
    ours, theirs = b.kernel.datagram_socket("C1"), b.kernel.datagram_socket("X")
    assert not isinstance(ours, Fault)
    assert not isinstance(theirs, Fault)
    ends = (ours, theirs), (theirs, ours)
    for handle in (ours, theirs):
        assert b.kernel.bind(handle, ANY_PORT) is None
    cut(b)
    for sender, receiver in ends:
        assert b.kernel.send_to(sender, memoryview(b"lost"), b.end(receiver)) == 4
    b.settle()
    mend(b)
    for sender, receiver in ends:
        assert b.kernel.send_to(sender, memoryview(b"x"), b.end(receiver)) == 1
        b.settle()
        got = b.kernel.recv_from(receiver, memoryview(bytearray(10)))
        assert isinstance(got, Datagram)
        assert (got.size, got.source) == (1, b.end(sender))


# -- what the stack knows of a path ------------------------------------------------------------------------


@on_the_wire
def the_age_of_the_last_ack_grows_on_a_cut_wire(b: Bench) -> None:
    one = partners(b)
    b.settle()
    cut(b)
    b.until(lambda: path(b, one.client).last_ack_ms >= 100, most=200)
    mend(b)
    b.send(one.client, b"x")
    b.until(lambda: path(b, one.client).last_ack_ms < 50)


@on_the_wire
def a_closed_window_holds_bytes_back_and_an_answered_probe_renews_the_last_ack(b: Bench) -> None:
    one = partners(b, small=True)
    fill(b, one.client, bytes(100))
    b.until(lambda: path(b, one.client).last_ack_ms >= 100)
    assert path(b, one.client).unacked == 0
    assert path(b, one.client).unsent > 0
    b.until(lambda: path(b, one.client).last_ack_ms < 50)


@on_the_wire
def a_user_timeout_ends_what_nobody_acknowledges_and_what_a_closed_window_holds_back(b: Bench) -> None:
    unheard, idle = partners(b), partners(b)
    unread = b.pair(small=True)  # X's wire, which stays up
    fill(b, unread.client, bytes(100))
    for one in (unheard, idle, unread):
        b.kernel.set_user_timeout(one.client, 300)
    cut(b)
    b.send(unheard.client, b"into the dark")
    assert b.loss(unheard.client) == KernelLoss(TIMED_OUT, 0)
    assert b.loss(unread.client) == KernelLoss(TIMED_OUT, 0)
    assert (b.kernel.loss(idle.client), b.kernel.loss(unread.server)) == (None, None)


@on_the_wire
def a_user_timeout_that_is_switched_off_ends_nothing(b: Bench) -> None:
    one = partners(b, small=True)
    b.kernel.set_options(one.client, SocketOptions(user_timeout_ms=300, small_buffers=True))
    fill(b, one.client, bytes(100))
    b.kernel.set_user_timeout(one.client, 0)
    b.until(lambda: path(b, one.client).last_ack_ms >= 150)
    b.until(lambda: path(b, one.client).last_ack_ms < 50)
    b.until(lambda: path(b, one.client).last_ack_ms >= 300)
    assert b.kernel.loss(one.client) is None
