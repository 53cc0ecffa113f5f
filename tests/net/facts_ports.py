"""Facts of local ends: who may bind and listen where."""

from __future__ import annotations

from tests.net.net_bench import ANY_PORT, LOOPBACK, Bench
from tests.net.net_facts import fact
from trcvtui.net.results import Endpoint, Fault

OWN = Endpoint("127.68.5.1", 0)  # nobody else takes a port here between giving it back and taking it again


@fact
def addresses_that_bind_refuses_and_those_that_it_takes(b: Bench) -> None:
    for foreign in ("198.51.100.7", "240.0.0.1", "0.0.0.1"):
        assert b.kernel.bind(b.socket(), Endpoint(foreign, 0)) == Fault("bind", "EADDRNOTAVAIL")
    for odd in ("0.0.0.0", "255.255.255.255", "224.0.0.1", "127.255.255.255", "127.1.2.3"):
        b.socket(end=Endpoint(odd, 0))


@fact
def port_0_takes_a_free_port_and_a_second_bind_is_einval(b: Bench) -> None:
    handle = b.socket(end=ANY_PORT)
    assert b.end(handle).address == LOOPBACK
    assert b.end(handle).port > 0
    assert b.kernel.bind(handle, ANY_PORT) == Fault("bind", "EINVAL")


@fact
def without_reuse_a_bound_port_is_taken(b: Bench) -> None:
    end = b.end(b.socket(end=ANY_PORT))
    for reuse in (False, True):
        assert b.kernel.bind(b.socket(reuse), end) == Fault("bind", "EADDRINUSE")


@fact
def with_reuse_two_may_bind_but_only_one_may_listen(b: Bench) -> None:
    first = b.socket(reuse=True, end=ANY_PORT)
    second = b.socket(reuse=True, end=b.end(first))
    assert b.kernel.listen(second, 1) is None
    assert b.kernel.listen(first, 1) == Fault("listen", "EADDRINUSE")


@fact
def a_listening_port_is_taken_for_everybody(b: Bench) -> None:
    end = b.end(b.listener())
    for reuse in (False, True):
        assert b.kernel.bind(b.socket(reuse), end) == Fault("bind", "EADDRINUSE")


@fact
def a_listener_on_all_addresses_takes_the_port_of_each(b: Bench) -> None:
    end = b.end(b.listener(Endpoint("0.0.0.0", 0)))
    assert end.address == "0.0.0.0"
    taken = Endpoint(LOOPBACK, end.port)
    assert b.kernel.bind(b.socket(reuse=True), taken) == Fault("bind", "EADDRINUSE")
    client = b.connect(taken)
    assert b.kernel.local_end(client) is not None


@fact
def two_loopback_addresses_may_share_a_port(b: Bench) -> None:
    port = b.end(b.listener()).port
    other = b.listener(Endpoint("127.0.0.2", port))
    b.connect(Endpoint("127.0.0.2", port))
    b.accept(other)


@fact
def a_listener_opens_again_over_its_old_connections_only_with_reuse(b: Bench) -> None:
    one = b.pair()
    b.kernel.close(one.listener)
    assert b.kernel.bind(b.socket(), one.end) == Fault("bind", "EADDRINUSE")
    again = b.listener(one.end)
    b.kernel.close(again)
    b.kernel.close(one.server)  # closed here first: TIME_WAIT stays on this side
    b.kernel.close(one.client)
    b.settle()
    assert b.kernel.bind(b.socket(), one.end) == Fault("bind", "EADDRINUSE")
    b.pair(b.listener(one.end))


@fact
def the_same_two_ends_cannot_be_connected_twice(b: Bench) -> None:
    one = b.pair(client=b.socket(reuse=True, end=ANY_PORT))
    local = b.end(one.client)
    assert b.kernel.bind(b.socket(), local) == Fault("bind", "EADDRINUSE")
    second = b.socket(reuse=True, end=local)
    assert b.kernel.connect(second, one.end) == Fault("connect", "EADDRNOTAVAIL")


@fact
def a_fixed_port_connects_again_over_its_own_time_wait_with_reuse(b: Bench) -> None:
    one = b.pair(client=b.socket(reuse=True, end=ANY_PORT))
    local = b.end(one.client)
    b.kernel.close(one.client)
    assert b.answer(one.server) == 0
    b.kernel.close(one.server)
    b.settle()
    assert b.kernel.bind(b.socket(), local) == Fault("bind", "EADDRINUSE")
    again = b.pair(one.listener, client=b.socket(reuse=True, end=local))
    assert b.end(again.client) == local


@fact
def a_fixed_port_connects_again_when_the_partner_closed_first(b: Bench) -> None:
    one = b.pair(client=b.socket(reuse=True, end=ANY_PORT))
    local = b.end(one.client)
    b.kernel.close(one.server)
    assert b.answer(one.client) == 0
    b.kernel.close(one.client)
    b.settle()
    b.pair(one.listener, client=b.socket(reuse=True, end=local))


@fact
def an_abort_leaves_no_time_wait(b: Bench) -> None:
    one = b.pair(client=b.socket(end=OWN))
    local = b.end(one.client)
    assert b.kernel.abort(one.client) is None
    assert b.answer(one.server) == Fault("recv", "ECONNRESET")
    b.kernel.close(one.server)
    b.pair(one.listener, client=b.socket(end=local))


@fact
def a_port_that_a_connection_borrowed_is_taken(b: Bench) -> None:
    one = b.pair()
    for reuse in (False, True):
        assert b.kernel.bind(b.socket(reuse), b.end(one.client)) == Fault("bind", "EADDRINUSE")


@fact
def closing_gives_the_port_back(b: Bench) -> None:
    handle = b.socket(end=OWN)
    end = b.end(handle)
    b.kernel.close(handle)
    b.socket(end=end)


@fact
def a_port_asked_for_by_number_is_kept_until_close_even_after_a_rst(b: Bench) -> None:
    found = b.socket(end=OWN)
    local = b.end(found)
    b.kernel.close(found)
    for port, then in ((local.port, Fault("bind", "EADDRINUSE")), (0, None)):
        one = b.pair(client=b.socket(end=Endpoint(OWN.address, port)))
        local = b.end(one.client)
        b.kernel.abort(one.server)
        assert b.answer(one.client) == Fault("recv", "ECONNRESET")
        assert b.kernel.bind(b.socket(), local) == then
        b.kernel.close(one.client)
        if then is not None:
            b.socket(end=local)


@fact
def a_name_becomes_an_address_and_an_unknown_one_a_fault(b: Bench) -> None:
    for name in ("localhost.", "localhost"):
        assert answer(b, name) == LOOPBACK
    for nobody in ("nobody.invalid.", "a\0b."):
        assert answer(b, nobody) == Fault("resolve", "EAI_NONAME")


@fact
def a_freed_handle_asks_no_more(b: Bench) -> None:
    handle = b.socket()
    b.kernel.resolve(handle, "localhost.")
    assert b.kernel.close(handle) is None
    assert b.kernel.resolve(handle, "localhost.") == Fault("resolve", "EBADF")


def answer(b: Bench, name: str) -> str | Fault:
    handle = b.socket()
    found: list[str | Fault] = []

    def is_there() -> bool:
        got = b.kernel.resolve(handle, name)
        if isinstance(got, str | Fault):
            found.append(got)
        return bool(found)

    b.until(is_there)
    return found[0]
