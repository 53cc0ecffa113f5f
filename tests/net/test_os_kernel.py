"""The shared facts on the real network, through epoll and through the poll sets of other systems."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator

import pytest
from contract import FACTS, NEEDS_RDHUP, Fact
from net_bench import Bench

from trcvtui.net import os_kernel, os_poll
from trcvtui.net.os_kernel import OsKernel


class OsNetwork:
    """This machine's network; a breath waits a millisecond on a socket that is never ready."""

    def __init__(self, kernel: OsKernel) -> None:
        self.kernel = kernel
        self._quiet, self._other = socket.socketpair()

    def breathe(self) -> None:
        select.select([self._quiet], [], [], 0.001)

    def close(self) -> None:
        self.kernel.close_all()
        self._quiet.close()
        self._other.close()


@pytest.fixture
def network() -> Iterator[OsNetwork]:
    made = OsNetwork(OsKernel())
    yield made
    made.close()
    assert made.kernel.leaks() == ()


def only_poll(patch: pytest.MonkeyPatch) -> None:
    """Take epoll away, as on macOS."""
    patch.setattr(os_kernel, "new_poll_set", os_poll.PollList)


def only_select(patch: pytest.MonkeyPatch) -> None:
    """Take poll and RDHUP away too, as on Windows."""
    only_poll(patch)
    for module in (os_poll, os_kernel):
        patch.setattr(module, "RDHUP", 0)
    patch.setattr(os_poll, "HAS_POLL", False)
    patch.setattr(os_kernel, "GONE", os_poll.ERR | os_poll.HUP)
    patch.setattr(os_kernel, "VERDICT", os_poll.OUT | os_poll.ERR)


@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_the_real_network_keeps_the_contract(fact: Fact, network: OsNetwork) -> None:
    fact(Bench(network))


@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_a_poll_set_without_epoll_keeps_the_contract(
    fact: Fact, network: OsNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    only_poll(monkeypatch)
    fact(Bench(network))


@pytest.mark.parametrize("fact", [f for f in FACTS if f not in NEEDS_RDHUP], ids=lambda f: f.__name__)
def test_a_poll_set_of_select_keeps_the_contract(
    fact: Fact, network: OsNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    only_select(monkeypatch)
    fact(Bench(network))
