"""The network of this machine."""

from __future__ import annotations

import pytest

from tests.net.net_bench import Bench, OsNetwork


@pytest.fixture
def b(network: OsNetwork) -> Bench:
    return Bench(network)
