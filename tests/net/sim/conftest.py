"""The simulated network as it is without latency, pieces or a seed of its own."""

from __future__ import annotations

import pytest

from tests.net.sim.net_sim import SimBench


@pytest.fixture
def b() -> SimBench:
    return SimBench()
