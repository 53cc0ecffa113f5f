"""The networks on which ISO-on-TCP is tried."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.net.layers.iso_bench import IsoBench, Net
from tests.net.net_bench import OsNetwork
from tests.net.sim.net_sim import SimNetwork
from trcvtui.net.sim.kernel import SimKernel


@pytest.fixture(params=["sim", "os"])
def b(request: pytest.FixtureRequest) -> Iterator[IsoBench]:
    if request.param == "sim":
        sim = SimKernel()
        made = IsoBench(Net(SimNetwork(sim)))
        yield made
        made.close()
        assert sim.leaks() == ()
    else:
        real = OsNetwork()
        made = IsoBench(Net(real))
        yield made
        made.close()
        leaks = real.kernel.leaks()
        real.close()
        assert leaks == ()


@pytest.fixture
def network() -> Iterator[OsNetwork]:
    made = OsNetwork()
    yield made
    made.close()
