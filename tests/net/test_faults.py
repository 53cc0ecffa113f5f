"""The fault plan, and the kernel that obeys it: what fails, whose, when, how often, and what stays whole."""

from __future__ import annotations

import pytest

from tests.net.contract import FACTS, Fact
from tests.net.net_bench import Bench
from tests.net.sim.net_sim import SimNetwork
from trcvtui.errors import UserError
from trcvtui.net.faults import DEFAULT_ERROR, FaultPlan, FaultyKernel
from trcvtui.net.kernel import KERNEL_CALLS, KernelLoss, NewClient
from trcvtui.net.results import WOULD_BLOCK, Fault
from trcvtui.net.sim.kernel import SimKernel


def injected(call: str, error: str) -> Fault:
    return Fault(call, error, injected=True)


class FaultyBench(Bench):
    """A bench on a simulated network whose calls can be made to fail."""

    def __init__(self) -> None:
        self.sim = SimKernel()
        self.plan = FaultPlan()
        network = SimNetwork(self.sim)
        super().__init__(network)
        self.kernel = FaultyKernel(self.sim, self.plan)


# -- the plan ------------------------------------------------------------------------------------------------


@pytest.fixture
def b() -> FaultyBench:
    return FaultyBench()


def test_every_call_has_a_default_errno() -> None:
    for call in KERNEL_CALLS:
        plan = FaultPlan()
        plan.add(call)
        assert plan.take_fault(call, "C1") == injected(call, DEFAULT_ERROR[call])
        assert plan.take_fault(call, "C1") is None
        assert not plan.active


def test_nth_counts_from_the_moment_of_adding() -> None:
    plan = FaultPlan()
    plan.add("send", nth=1)
    plan.take_fault("send", "C1")
    plan.add("send", nth=3, times=2)
    assert [plan.take_fault("send", "C1") is None for _ in range(5)] == [True, True, False, False, True]


def test_times_none_lasts_until_cleared() -> None:
    plan = FaultPlan()
    plan.add("recv", times=None)
    assert all(plan.take_fault("recv", "C1") for _ in range(1000))
    plan.clear()
    assert plan.take_fault("recv", "C1") is None
    assert plan.entries() == ()


def test_entries_side_by_side_each_get_their_turn() -> None:
    plan = FaultPlan()
    plan.add("recv", "ECONNRESET")
    plan.add("recv", "EIO")
    plan.add("recv", "EIO", nth=2)
    found = [plan.take_fault("recv", "C1") for _ in range(4)]
    assert [fault.error if fault else None for fault in found] == ["ECONNRESET", "EIO", "EIO", None]


def test_entries_are_shown_as_the_commands_that_make_them() -> None:
    plan = FaultPlan()
    plan.add("bind", on="C1")
    plan.add("send", "ENOBUFS", nth=2, times=3)
    plan.add("recv", times=None)
    shown = [str(entry) for entry in plan.entries()]
    assert shown == [
        "fault bind EADDRINUSE on C1",
        "fault send ENOBUFS nth=2 times=3",
        "fault recv ECONNRESET times=forever",
    ]
    plan.take_fault("send", "X")
    plan.take_fault("send", "X")
    assert plan.entries()[1].times == 2


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("bnid",), "fault: found bnid, expected one of socket, set_reuse"),
        (("bind", "EADDRINUS"), "fault bind: found EADDRINUS, expected an errno name"),
        (("bind", None, None, 0), "fault bind nth: found 0, expected 1 or more"),
        (("bind", None, None, 1, 0), "fault bind times: found 0, expected 1 or more"),
    ],
)
def test_what_is_no_fault_is_refused_in_one_line(
    arguments: tuple[str, str | None, str | None, int, int], line: str
) -> None:
    plan = FaultPlan()
    with pytest.raises(UserError) as refused:
        plan.add(*arguments)
    assert str(refused.value).startswith(line)
    assert plan.entries() == ()


# -- the kernel that obeys it --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_with_a_plan_for_somebody_else_it_keeps_the_contract(b: FaultyBench, fact: Fact) -> None:
    for call in KERNEL_CALLS:
        b.plan.add(call, on="C99", times=None)
    fact(b)


def test_a_connect_made_to_fail_never_starts(b: FaultyBench) -> None:
    listener, client = b.listener(), b.socket()
    b.plan.add("connect", "ENETUNREACH")
    assert b.kernel.connect(client, b.end(listener)) == injected("connect", "ENETUNREACH")
    b.settle()
    assert not b.kernel.readable(listener)
    b.connect(b.end(listener), client)


def test_an_accept_without_a_client_is_no_attempt(b: FaultyBench) -> None:
    listener = b.listener()
    b.plan.add("accept")
    for _ in range(3):
        assert b.kernel.accept(listener) is WOULD_BLOCK
        b.settle()
    assert b.plan.active


def test_the_client_of_a_failed_accept_stays_queued_and_comes_out_with_his_bytes(b: FaultyBench) -> None:
    listener = b.listener()
    client = b.connect(b.end(listener))
    b.send(client, b"early")
    b.plan.add("accept", times=3)
    for _ in range(3):
        b.settle()
        assert b.kernel.readable(listener)
        assert b.kernel.accept(listener) == injected("accept", "EMFILE")
    b.settle()
    got = b.kernel.accept(listener)
    assert isinstance(got, NewClient)
    assert got.peer == b.end(client)
    assert b.receive(got.handle, 5) == b"early"
    assert b.kernel.accept(listener) is WOULD_BLOCK


def test_closing_the_listener_resets_the_client_of_a_failed_accept(b: FaultyBench) -> None:
    listener = b.listener()
    client = b.connect(b.end(listener))
    b.plan.add("accept")
    b.settle()
    b.kernel.accept(listener)
    b.kernel.close(listener)
    assert b.answer(client) == Fault("recv", "ECONNRESET")
    b.kernel.close(client)
    assert b.sim.leaks() == ()


def test_an_accepted_connection_belongs_to_the_listener_s_owner(b: FaultyBench) -> None:
    one = b.pair()
    b.plan.add("recv", "EIO", on="X")
    b.plan.add("send", on="Y", times=None)
    assert b.try_recv(one.server) == injected("recv", "EIO")
    b.send(one.server, b"not Y")


def test_a_failed_recv_consumes_nothing_and_counts_every_call(b: FaultyBench) -> None:
    one = b.pair()
    b.plan.add("recv", nth=2)
    assert b.try_recv(one.server) is WOULD_BLOCK
    b.send(one.client, b"kept")
    b.settle()
    assert b.try_recv(one.server) == injected("recv", "ECONNRESET")
    assert b.receive(one.server, 4) == b"kept"


def test_a_failed_send_takes_nothing_and_eagain_is_answered_as_a_fault(b: FaultyBench) -> None:
    one = b.pair()
    b.plan.add("send", "EAGAIN")
    assert b.try_send(one.client, b"gone") == injected("send", "EAGAIN")
    b.send(one.client, b"here")
    assert b.receive(one.server, 4) == b"here"


def test_a_failed_shutdown_sends_no_fin(b: FaultyBench) -> None:
    one = b.pair()
    b.plan.add("shutdown")
    assert b.kernel.shutdown(one.client) == injected("shutdown", "ENOTCONN")
    b.settle()
    assert b.kernel.loss(one.server) is None
    b.plan.add("shutdown", on="X")
    assert b.kernel.probe(one.client) == injected("shutdown", "ENOTCONN")
    assert b.kernel.probe(one.client) is None


@pytest.mark.parametrize(
    ("call", "error", "lost"), [("close", "EIO", None), ("abort", "ENOTCONN", Fault("recv", "ECONNRESET"))]
)
def test_a_failed_close_or_abort_frees_the_handle_all_the_same(
    b: FaultyBench, call: str, error: str, lost: Fault | None
) -> None:
    one = b.pair()
    b.plan.add(call)
    assert getattr(b.kernel, call)(one.client) == injected(call, error)
    assert b.loss(one.server) == KernelLoss(lost, 0)
    assert getattr(b.kernel, call)(one.client) == Fault(call, "EBADF")
