"""LayerKernel: not there where no session is wanted; a connection stands when its session does."""

from __future__ import annotations

import pytest

from tests.net.contract import FACTS, OF_THE_WIRE, Fact
from tests.net.layers.iso_bench import CAP, WAITS, IsoBench
from tests.net.net_bench import Bench, OsNetwork
from tests.net.sim.net_sim import SimNetwork
from trcvtui.net.kernel import KernelLoss, NewClient, SocketOptions
from trcvtui.net.layers.layer_kernel import LayerKernel
from trcvtui.net.results import WOULD_BLOCK, Datagram, Fault
from trcvtui.net.sim.kernel import SimKernel


class Through:
    """A network seen through a LayerKernel that nobody asks for a session."""

    def __init__(self, below: SimNetwork | OsNetwork) -> None:
        self.below = below
        self.kernel = LayerKernel(below.kernel, lambda: 0, lambda *told: None)

    def breathe(self) -> None:
        self.below.breathe()


@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_without_a_session_the_simulated_network_keeps_its_contract(fact: Fact) -> None:
    fact(Bench(Through(SimNetwork(SimKernel()))))


@pytest.mark.slow
@pytest.mark.parametrize("fact", [f for f in FACTS if f not in OF_THE_WIRE], ids=lambda f: f.__name__)
def test_without_a_session_the_real_network_keeps_its_contract(fact: Fact) -> None:
    real = OsNetwork()
    try:
        fact(Bench(Through(real)))
    finally:
        real.close()


# -- a connection stands when its session does ---------------------------------------------------------------


def test_a_connect_is_pending_until_the_partner_takes_the_call(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    caller = b.call(b.end(listener))

    def asked() -> bool:
        assert b.kernel.connect_result(caller) is WOULD_BLOCK
        return b.kernel.readable(listener)

    b.until(asked)
    got = b.kernel.accept(listener)
    assert isinstance(got, NewClient)
    assert b.kernel.connect_result(caller) is WOULD_BLOCK
    b.kernel.set_options(got.handle, SocketOptions(session=WAITS))
    assert b.verdict(caller) is None
    b.kernel.close(got.handle)


def test_messages_arrive_whole_and_one_by_one(b: IsoBench) -> None:
    caller, called = b.up()
    for payload in (b"one", b"three", bytes(9000)):
        b.send(caller, payload)
    assert b.message(called) == (b"one", 3)
    assert b.message(called, room=2) == (b"th", 5)
    assert b.message(called) == (bytes(9000), 9000)
    b.send(called, b"back")
    assert b.receive(caller, 4) == b"back"


def test_a_message_that_the_stack_takes_in_pieces_is_one_message(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    caller = b.call(b.end(listener), small=True)
    called = b.taken(listener, caller=caller)
    assert b.verdict(caller) is None
    payload = bytes(n % 251 for n in range(60_000))
    left = memoryview(payload)
    got: list[tuple[int, bytes]] = []
    into = bytearray(CAP)
    counts = []

    def both() -> bool:
        nonlocal left
        if left:
            sent = b.kernel.send(caller, left)
            assert not isinstance(sent, Fault)
            counts.append(sent)
            left = left[sent:] if isinstance(sent, int) else left
        answer = b.kernel.recv_from(called, memoryview(into))
        if isinstance(answer, Datagram):
            assert not left  # nobody has a message before all of it is sent
            got.append((answer.whole, bytes(into[: answer.size])))
        return bool(got)

    b.until(both)
    assert got == [(60_000, payload)]
    assert len(counts) > 1


def test_a_fin_comes_after_the_last_message(b: IsoBench) -> None:
    caller, called = b.up()
    b.send(caller, b"last")
    assert b.kernel.shutdown(caller) is None
    assert b.message(called) == (b"last", 4)
    assert b.loss(called).fault is None
    assert b.answer(called) == 0


def test_a_reset_is_told_once_the_messages_are_read(b: IsoBench) -> None:
    caller, called = b.up()
    b.kernel.abort(caller)
    assert b.loss(called) == KernelLoss(Fault("recv", "ECONNRESET"), 0)


def test_what_waits_unread_is_counted_and_can_be_discarded(b: IsoBench) -> None:
    caller, called = b.up()
    b.send(caller, b"12345")
    b.until(lambda: b.kernel.unread(called) == 5)
    assert b.kernel.discard(called, 100) == 5
    assert b.kernel.unread(called) == 0
