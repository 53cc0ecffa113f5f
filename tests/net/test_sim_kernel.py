"""The shared facts on the simulated network: plain, with latency, and with its bytes in random pieces."""

from __future__ import annotations

import pytest
from contract import FACTS, Fact
from net_bench import Bench

from trcvtui.net.sim_kernel import SimKernel

MS = 1_000_000


class SimNetwork:
    """A simulated network on which a millisecond passes at each breath."""

    def __init__(self, kernel: SimKernel) -> None:
        self.kernel = kernel

    def breathe(self) -> None:
        self.kernel.advance(self.kernel.now_ns + MS)


KERNELS = {
    "plain": lambda: SimKernel(),
    "latency": lambda: SimKernel(latency_ns=MS),
    "pieces": lambda: SimKernel(seed=7, fragment=True),
}


@pytest.mark.parametrize("kind", KERNELS)
@pytest.mark.parametrize("fact", FACTS, ids=lambda f: f.__name__)
def test_the_simulated_network_keeps_the_contract(fact: Fact, kind: str) -> None:
    fact(Bench(SimNetwork(KERNELS[kind]())))
