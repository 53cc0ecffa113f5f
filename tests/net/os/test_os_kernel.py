"""The real network: the shared facts, also without epoll, and what only real sockets can show."""

from __future__ import annotations

import errno
import os
import resource
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import trcvtui.net.os.system_calls as os_poll
import trcvtui.net.os.system_calls as os_queues
from tests.net.contract import FACTS, NEEDS_RDHUP, OF_THE_WIRE, Fact
from tests.net.facts_data import five_bytes_and_a_rst
from tests.net.net_bench import Bench, OsNetwork
from trcvtui.net.kernel import Handle, KernelLoss, LocalAddress, NewClient, SocketOptions
from trcvtui.net.os import kernel as os_kernel
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.os.system_calls import error_name
from trcvtui.net.results import WOULD_BLOCK, Endpoint
from trcvtui.net.results import Fault as Failed

OF_THE_POLL_SET = [f for f in FACTS if f not in OF_THE_WIRE]


def only_poll(patch: pytest.MonkeyPatch) -> None:
    """Take epoll away, as on macOS."""
    patch.setattr(os_kernel, "new_poll_set", os_poll.PollList)


def only_select(patch: pytest.MonkeyPatch) -> None:
    """Take poll and RDHUP away too, as on Windows."""
    only_poll(patch)
    for module in (os_poll, os_kernel):
        patch.setattr(module, "RDHUP", 0)
    patch.setattr(os_poll, "HAS_POLL", False)
    patch.setattr(os_kernel, "GONE_MASK", os_poll.ERR | os_poll.HUP)
    patch.setattr(os_kernel, "VERDICT_MASK", os_poll.OUT | os_poll.ERR)


@pytest.mark.slow
@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_the_real_network_keeps_the_contract(fact: Fact, network: OsNetwork) -> None:
    fact(Bench(network))


@pytest.mark.slow
@pytest.mark.parametrize("fact", OF_THE_POLL_SET, ids=lambda f: f.__name__)
def test_a_poll_set_without_epoll_keeps_the_contract(
    fact: Fact, network: OsNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    only_poll(monkeypatch)
    fact(Bench(network))


@pytest.mark.slow
@pytest.mark.parametrize(
    "fact", [f for f in OF_THE_POLL_SET if f not in NEEDS_RDHUP], ids=lambda f: f.__name__
)
def test_a_poll_set_of_select_keeps_the_contract(
    fact: Fact, network: OsNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    only_select(monkeypatch)
    fact(Bench(network))


# -- descriptors that run out (2.2: 8080, 8084, 8086) --------------------------------------------------------


@contextmanager
def no_descriptor_left() -> Iterator[None]:
    """Lower RLIMIT_NOFILE to what is open."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    probe = os.dup(0)  # the lowest free number: nothing below it is left
    os.close(probe)
    resource.setrlimit(resource.RLIMIT_NOFILE, (probe, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_without_a_descriptor_socket_is_emfile_and_recovers(network: OsNetwork) -> None:
    with no_descriptor_left():
        assert network.kernel.socket("X") == Failed("socket", "EMFILE")
    assert not isinstance(network.kernel.socket("X"), Failed)


def test_without_a_descriptor_the_first_poll_add_is_emfile(network: OsNetwork) -> None:
    handle = Bench(network).socket()
    with no_descriptor_left():
        assert network.kernel.poll_add(handle) == Failed("poll_add", "EMFILE")
    assert network.kernel.poll_add(handle) is None


def test_emfile_at_accept_leaves_the_client_queued_with_his_bytes(b: Bench) -> None:
    listener = b.listener()
    client = b.connect(b.end(listener))
    b.send(client, b"early")
    b.until(lambda: b.kernel.readable(listener))
    with no_descriptor_left():
        for _ in range(3):
            b.kernel.poll()
            assert b.kernel.readable(listener)
            assert b.kernel.accept(listener) == Failed("accept", "EMFILE")
    got = b.kernel.accept(listener)
    assert isinstance(got, NewClient)
    assert got.peer == b.end(client)
    assert b.receive(got.handle, 5) == b"early"


# -- descriptors that are taken away (1, L1) -----------------------------------------------------------------


def test_a_descriptor_closed_underneath_is_ebadf(b: Bench) -> None:
    one = b.pair()
    os.close(one.client)
    assert b.kernel.set_reuse(one.client) == Failed("set_reuse", "EBADF")
    assert b.try_send(one.client) == Failed("send", "EBADF")
    assert b.kernel.poll_del(one.client) == Failed("poll_del", "EBADF")
    assert b.try_recv(one.client) == Failed("recv", "EBADF")
    assert b.kernel.close(one.client) == Failed("close", "EBADF")
    assert b.answer(one.server) == 0


def test_a_descriptor_replaced_by_another_file_is_enotsock_and_eperm(network: OsNetwork) -> None:
    handle = Bench(network).socket()
    with open(os.devnull, "rb") as null:
        os.dup2(null.fileno(), handle)
    assert network.kernel.set_reuse(handle) == Failed("set_reuse", "ENOTSOCK")
    assert network.kernel.poll_add(handle) == Failed("poll_add", "EPERM")


def test_a_fault_of_abort_still_frees_the_handle(network: OsNetwork) -> None:
    handle = Bench(network).socket()
    with open(os.devnull, "rb") as null:
        os.dup2(null.fileno(), handle)
    assert network.kernel.abort(handle) == Failed("abort", "ENOTSOCK")
    assert network.kernel.abort(handle) == Failed("abort", "EBADF")
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(handle)


# -- names, options, addresses -------------------------------------------------------------------------------


def test_errno_numbers_become_posix_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(errno.errorcode, 10054, "WSAECONNRESET")
    monkeypatch.setitem(errno.errorcode, 10035, "WSAEWOULDBLOCK")
    numbers = (errno.EADDRINUSE, errno.EAGAIN, 10054, 10035, 99999)
    assert [error_name(OSError(number, "")) for number in numbers] == [
        "EADDRINUSE", "EAGAIN", "ECONNRESET", "EAGAIN", "E99999",
    ]  # fmt: skip
    assert error_name(ValueError("file descriptor cannot be a negative integer (-1)")) == "EBADF"


def option(handle: Handle, level: int, number: int) -> int:
    """Read an option from outside the kernel object."""
    with socket.socket(fileno=os.dup(handle)) as seen:
        return seen.getsockopt(level, number)


TCP, BASE = socket.IPPROTO_TCP, socket.SOL_SOCKET


def test_the_options_reach_the_socket_and_reuseport_is_never_set(b: Bench) -> None:
    options = SocketOptions(nodelay=True, keep_alive_s=7, user_timeout_ms=21_000, small_buffers=True)
    handle = b.socket(reuse=True)
    refused = b.kernel.set_options(handle, options)
    assert refused == ()
    seen = {
        "nodelay": option(handle, TCP, socket.TCP_NODELAY),
        "keep-alive": option(handle, BASE, socket.SO_KEEPALIVE),
        "idle": option(handle, TCP, socket.TCP_KEEPIDLE),
        "interval": option(handle, TCP, socket.TCP_KEEPINTVL),
        "count": option(handle, TCP, socket.TCP_KEEPCNT),
        "user timeout": option(handle, TCP, socket.TCP_USER_TIMEOUT),
        "send buffer": option(handle, BASE, socket.SO_SNDBUF),
        "receive buffer": option(handle, BASE, socket.SO_RCVBUF),
        "reuse address": option(handle, BASE, socket.SO_REUSEADDR),
        "reuse port": option(handle, BASE, socket.SO_REUSEPORT),
    }
    assert seen == {
        "nodelay": 1,
        "keep-alive": 1,
        "idle": 7,
        "interval": 7,
        "count": 2,
        "user timeout": 21_000,
        "send buffer": 9216,
        "receive buffer": 4608,
        "reuse address": 1,
        "reuse port": 0,
    }
    b.kernel.set_user_timeout(handle, 0)
    assert option(handle, TCP, socket.TCP_USER_TIMEOUT) == 0


def test_a_user_timeout_that_no_system_takes_is_refused_by_name(network: OsNetwork) -> None:
    handle = Bench(network).socket()
    refused = network.kernel.set_options(handle, SocketOptions(user_timeout_ms=1 << 40))
    assert "TCP_USER_TIMEOUT" in refused


def test_every_address_in_the_list_can_be_bound(b: Bench) -> None:
    own = b.kernel.local_addresses()
    everybody = "127.255.255.255"
    assert LocalAddress("127.0.0.1", "lo", ethernet=False, loopback=True, broadcast=everybody) in own
    for address in own:
        b.socket(end=Endpoint(address.address, 0))


def test_one_poll_sees_all_that_are_ready_however_many(b: Bench) -> None:
    listener = b.listener(backlog=100)
    pairs = [b.pair(listener) for _ in range(60)]
    for one in pairs:
        b.send(one.client, b"x")
    b.settle()
    assert all(b.kernel.readable(one.server) for one in pairs)


def test_a_descriptor_number_that_is_used_again_begins_unseen(b: Bench) -> None:
    one = b.pair()
    b.send(one.client, b"x")
    b.until(lambda: b.kernel.readable(one.server))
    b.kernel.abort(one.server)
    again = b.socket()
    assert again == one.server
    assert b.kernel.poll_add(again) is None
    assert not b.kernel.readable(again)
    assert b.try_recv(again) is WOULD_BLOCK


def test_close_all_frees_every_handle_and_the_poll_set() -> None:
    before = len(os.listdir("/dev/fd"))
    network = OsNetwork()
    one = Bench(network).pair()
    assert len(network.kernel.leaks()) == 3
    assert f"{one.listener} {one.end}" in network.kernel.leaks()
    network.close()
    assert len(os.listdir("/dev/fd")) == before


# -- a real dead link (3.2) ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_real_cut_link_is_etimedout_idle_and_with_data_in_flight() -> None:
    script = Path(__file__).with_name("cut_loopback.py")
    root = str(script.parents[3])
    run = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True, text=True, timeout=60, check=False, env={**os.environ, "PYTHONPATH": root},
    )  # fmt: skip
    lines = sorted(run.stdout.splitlines())
    if lines == ["refused"]:
        pytest.skip("this system allows no user namespaces")
    assert (lines, run.stderr) == (["busy recv ETIMEDOUT", "idle recv ETIMEDOUT"], "")


def test_a_loss_found_after_bytes_is_kept_for_the_next_call(b: Bench) -> None:
    one = five_bytes_and_a_rst(b)
    assert b.try_recv(one.server, 100) == b"five!"
    assert b.kernel.loss(one.server) == KernelLoss(Failed("recv", "ECONNRESET"), 0)
    assert b.try_recv(one.server) == 0


class Trickle(socket.socket):
    """A socket whose partner is always one byte ahead of the reader."""

    calls = 0

    def recv_into(self, *_: object) -> int:
        self.calls += 1
        return 1


def test_a_partner_who_sends_byte_by_byte_costs_one_read_a_bounded_number_of_calls() -> None:
    kernel, trickle = OsKernel(), Trickle()
    handle = Handle(trickle.fileno())
    kernel._sockets[handle] = trickle
    assert (
        kernel.recv(handle, memoryview(bytearray(65536))) == trickle.calls == 1 + os_kernel.MOST_READS_A_CALL
    )
    trickle.calls = 0
    assert kernel.discard(handle, 1 << 20) == trickle.calls == os_queues.MOST_READS
    kernel.close_all()


@pytest.mark.parametrize("comes", ["before the error is asked for", "after it"])
def test_bytes_and_a_rst_that_come_while_the_verdict_is_asked_for_are_no_refusal(
    network: OsNetwork, monkeypatch: pytest.MonkeyPatch, comes: str
) -> None:
    b, kernel = Bench(network), network.kernel
    listener, client = b.listener(), b.socket()
    assert kernel.connect(client, b.end(listener)) is None
    partner = b.accept(listener).handle
    take_error = kernel._take_error

    def sends_and_resets() -> None:
        b.send(partner, b"five!")
        kernel.abort(partner)
        b.settle()

    def beside(handle: int, sock: socket.socket) -> str:
        if comes == "after it":
            error = take_error(handle, sock)
            sends_and_resets()
            return error
        sends_and_resets()
        return take_error(handle, sock)

    with monkeypatch.context() as patch:
        patch.setattr(kernel, "_take_error", beside)
        assert kernel.connect_result(client) is None
    assert b.receive(client, 5) == b"five!"
    assert b.answer(client) == Failed("recv", "ECONNRESET")
