"""Facts of datagrams: whole, in order, with their source, and lost without a word."""

from __future__ import annotations

from tests.net.net_bench import ANY_PORT, LOOPBACK, Bench
from tests.net.net_facts import fact
from trcvtui.net.kernel import Handle, SocketOptions
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault

NOBODY = Endpoint(LOOPBACK, 9)


def opened(b: Bench, end: Endpoint | None = ANY_PORT, polled: bool = False) -> Handle:
    handle = b.kernel.datagram_socket("X")
    assert not isinstance(handle, Fault), handle
    if end is not None:
        assert b.kernel.bind(handle, end) is None
    if polled:
        assert b.kernel.poll_add(handle) is None
    return handle


def say(b: Bench, handle: Handle, data: bytes, to: Handle) -> None:
    assert b.kernel.send_to(handle, memoryview(data), b.end(to)) == len(data)


def try_take(b: Bench, handle: Handle, size: int = 100) -> object:
    """Return the bytes of the next datagram, WOULD_BLOCK or the Fault."""
    into = bytearray(size)
    got = b.kernel.recv_from(handle, memoryview(into))
    return bytes(into[: got.size]) if isinstance(got, Datagram) else got


def take(b: Bench, handle: Handle, size: int = 100) -> tuple[bytes, Datagram]:
    """Wait for a datagram and return its bytes and what the call told."""
    found: list[tuple[bytes, Datagram]] = []

    def arrived() -> bool:
        into = bytearray(size)
        got = b.kernel.recv_from(handle, memoryview(into))
        if isinstance(got, Datagram):
            found.append((bytes(into[: got.size]), got))
        else:
            assert got is WOULD_BLOCK, got
        return bool(found)

    b.until(arrived)
    return found[0]


@fact
def a_datagram_comes_whole_and_names_its_source(b: Bench) -> None:
    here, there = opened(b), opened(b)
    assert try_take(b, there) is WOULD_BLOCK
    say(b, here, b"hello", there)
    data, told = take(b, there)
    assert data == b"hello"
    assert told == Datagram(5, b.end(here), 5)
    assert (told.is_cut, Datagram(4, told.source, 10).is_cut) == (False, True)
    say(b, there, b"and back", here)
    assert take(b, here)[0] == b"and back"


@fact
def datagrams_stay_apart_and_in_order_and_an_empty_one_is_one(b: Bench) -> None:
    here, there = opened(b), opened(b)
    sent = [b"one", b"", b"three", b"four"]
    for data in sent:
        say(b, here, data, there)
    assert [take(b, there)[0] for _ in sent] == sent
    assert try_take(b, there) is WOULD_BLOCK


@fact
def what_is_larger_than_the_view_is_cut_off_and_gone_and_a_socket_can_send_to_itself(b: Bench) -> None:
    here, there = opened(b), opened(b)
    say(b, here, b"0123456789", there)
    say(b, here, b"next", there)
    assert take(b, there, 4) == (b"0123", Datagram(4, b.end(here), 10))
    assert take(b, there, 0) == (b"", Datagram(0, b.end(here), 4))
    say(b, there, b"me", there)
    assert take(b, there) == (b"me", Datagram(2, b.end(there), 2))


@fact
def nobody_there_is_told_to_nobody_and_the_socket_goes_on(b: Bench) -> None:
    here, there = opened(b), opened(b)
    for _ in range(3):
        assert b.kernel.send_to(here, memoryview(b"x"), NOBODY) == 1
        b.settle()  # by now the port-unreachable has come back
        assert try_take(b, here) is WOULD_BLOCK
    say(b, there, b"still there", here)
    assert take(b, here)[0] == b"still there"


@fact
def a_receiver_that_was_closed_is_nobody(b: Bench) -> None:
    here, gone = opened(b), opened(b)
    end = b.end(gone)
    say(b, here, b"unread", gone)
    b.settle()
    assert b.kernel.close(gone) is None
    assert b.kernel.send_to(here, memoryview(b"lost"), end) == 4
    b.settle()
    again = opened(b, end)
    b.settle()
    assert try_take(b, again) is WOULD_BLOCK
    say(b, here, b"new", again)
    assert take(b, again)[0] == b"new"


@fact
def a_sender_that_was_not_bound_gets_a_free_port_and_keeps_it(b: Bench) -> None:
    here, there = opened(b, end=None), opened(b)
    assert b.kernel.local_end(here) is None
    for data in (b"first", b"second"):
        say(b, here, data, there)
        assert take(b, there)[1].source == Endpoint(LOOPBACK, b.end(here).port)


@fact
def a_socket_on_all_addresses_receives_for_each(b: Bench) -> None:
    here, everywhere = opened(b), opened(b, Endpoint("0.0.0.0", 0))
    port = b.end(everywhere).port
    for address in (LOOPBACK, "127.0.0.2", "0.0.0.0"):
        sender = opened(b, end=None)
        assert b.kernel.send_to(sender, memoryview(b"x"), Endpoint(address, port)) == 1
        assert take(b, everywhere)[0] == b"x"
    assert try_take(b, here) is WOULD_BLOCK


@fact
def two_loopback_addresses_may_share_a_udp_port_and_each_gets_its_own(b: Bench) -> None:
    one = opened(b)
    two = opened(b, Endpoint("127.0.0.2", b.end(one).port))
    sender = opened(b, end=None)
    say(b, sender, b"for two", two)
    assert take(b, two)[0] == b"for two"
    assert try_take(b, one) is WOULD_BLOCK


@fact
def ports_of_udp_are_taken_by_udp_alone(b: Bench) -> None:
    stream = b.socket()
    ends = (opened(b) for _ in range(16))  # another program may hold that very port of TCP
    here = next(udp for udp in ends if b.kernel.bind(stream, b.end(udp)) is None)
    assert b.end(stream) == b.end(here)
    second = opened(b, end=None)
    assert b.kernel.bind(second, b.end(here)) == Fault("bind", "EADDRINUSE")
    everywhere = Endpoint("0.0.0.0", b.end(here).port)
    assert b.kernel.bind(second, everywhere) == Fault("bind", "EADDRINUSE")
    assert b.kernel.bind(here, ANY_PORT) == Fault("bind", "EINVAL")


@fact
def foreign_addresses_cannot_be_bound_and_groups_can(b: Bench) -> None:
    for foreign in ("198.51.100.7", "240.0.0.1"):
        handle = opened(b, end=None)
        assert b.kernel.bind(handle, Endpoint(foreign, 0)) == Fault("bind", "EADDRNOTAVAIL")
    for group in ("255.255.255.255", "224.0.0.1"):
        opened(b, Endpoint(group, 0))


@fact
def targets_and_sizes_that_send_refuses(b: Bench) -> None:
    here, there = opened(b), opened(b)
    end = b.end(there)
    refused = {
        (Endpoint(LOOPBACK, 0), 1): "EINVAL",
        (Endpoint("255.255.255.255", 9), 1): "EACCES",
        (Endpoint("198.51.100.7", 9), 1): "EINVAL",  # from a socket that is bound to loopback
        (Endpoint("no address", 9), 1): "EINVAL",
        (Endpoint(LOOPBACK, 65536), 1): "EINVAL",
        (end, 65508): "EMSGSIZE",
    }
    for (target, size), error in refused.items():
        assert b.kernel.send_to(here, memoryview(bytes(size)), target) == Fault("send", error)
    say(b, here, bytes(65507), there)
    assert take(b, there, 65536) == (bytes(65507), Datagram(65507, b.end(here), 65507))


@fact
def a_broadcast_needs_leave_and_reaches_each_socket_on_that_address(b: Bench) -> None:
    here, there = opened(b), opened(b)
    everybody = Endpoint("127.255.255.255", b.end(there).port)
    one, two = opened(b, end=None), opened(b, end=None)
    for hearing in (one, two):
        assert b.kernel.set_reuse(hearing) is None
        assert b.kernel.bind(hearing, everybody) is None
    for target in (everybody, Endpoint("255.255.255.255", everybody.port)):
        assert b.kernel.send_to(here, memoryview(b"no"), target) == Fault("send", "EACCES")
    assert b.kernel.set_broadcast(here) is None
    assert b.kernel.send_to(here, memoryview(b"all"), Endpoint("255.255.255.255", everybody.port)) == 3
    assert b.kernel.send_to(here, memoryview(b"net"), everybody) == 3
    for hearing in (one, two):
        assert take(b, hearing) == (b"net", Datagram(3, b.end(here), 3))
        assert try_take(b, hearing) is WOULD_BLOCK
    assert try_take(b, there) is WOULD_BLOCK
    third = opened(b, end=None)
    assert b.kernel.bind(third, everybody) == Fault("bind", "EADDRINUSE")


@fact
def a_full_queue_drops_the_newest(b: Bench) -> None:
    here, there = opened(b), opened(b)
    b.kernel.set_options(there, SocketOptions(small_buffers=True))
    sent = [number.to_bytes(2, "big") for number in range(2000)]
    for data in sent:
        say(b, here, data, there)
    b.settle()
    got = []
    while isinstance(taken := try_take(b, there), bytes):
        got.append(taken)
    assert 0 < len(got) < 2000
    assert got == sent[: len(got)]
    say(b, here, bytes(2048), there)  # into an empty queue fits one of any size
    assert take(b, there, 4096)[0] == bytes(2048)


@fact
def the_last_poll_decides_which_datagrams_are_seen(b: Bench) -> None:
    here, there = opened(b), opened(b, polled=True)
    b.kernel.poll()
    assert not b.kernel.readable(there)
    say(b, here, b"one", there)
    say(b, here, b"two", there)
    assert try_take(b, there) is WOULD_BLOCK
    b.settle()
    assert b.kernel.readable(there)
    assert try_take(b, there) == b"one"
    b.kernel.poll()
    assert b.kernel.readable(there)
    assert try_take(b, there) == b"two"
    assert try_take(b, there) is WOULD_BLOCK
    b.kernel.poll()
    assert not b.kernel.readable(there)


@fact
def a_udp_socket_outside_the_poll_set_is_looked_at_now(b: Bench) -> None:
    here, there = opened(b), opened(b, polled=True)
    assert b.kernel.poll_del(there) is None
    assert not b.kernel.readable(there)
    say(b, here, b"seen", there)
    b.settle()
    assert b.kernel.readable(there)
    assert try_take(b, there) == b"seen"
    assert b.kernel.poll_del(there) == Fault("poll_del", "ENOENT")


@fact
def nobody_listens_on_datagrams(b: Bench) -> None:
    assert b.kernel.listen(opened(b), 1) == Fault("listen", "EOPNOTSUPP")


@fact
def close_and_abort_give_the_udp_port_back_and_end_the_handle(b: Bench) -> None:
    for free, call in ((b.kernel.close, "close"), (b.kernel.abort, "abort")):
        handle = opened(b, polled=True)
        end = b.end(handle)
        assert free(handle) is None
        assert free(handle) == Fault(call, "EBADF")
        assert b.kernel.set_broadcast(handle) == Fault("set_broadcast", "EBADF")
        assert b.kernel.send_to(handle, memoryview(b"x"), NOBODY) == Fault("send", "EBADF")
        assert try_take(b, handle) == Fault("recv", "EBADF")
        opened(b, end)


@fact
def a_look_gives_the_next_datagrams_once_and_takes_none(b: Bench) -> None:
    here, there = opened(b), opened(b, polled=True)
    for data in (b"one", b"", b"three"):
        say(b, here, data, there)
    b.until(lambda: b.kernel.readable(there))
    b.settle()
    found = b.kernel.peek(there, 0)
    assert found.messages is not None
    assert [(one.source, one.data, one.whole) for one in found.messages] == [
        (b.end(here), b"one", 3), (b.end(here), b"", 0), (b.end(here), b"three", 5)
    ]  # fmt: skip
    assert b.kernel.peek(there, 3).messages == ()
    assert take(b, there)[0] == b"one"
    say(b, here, b"four", there)
    b.settle()
    assert [one.data for one in b.kernel.peek(there, 2).messages or ()] == [b"four"]
    assert [take(b, there)[0] for _ in range(3)] == [b"", b"three", b"four"]
