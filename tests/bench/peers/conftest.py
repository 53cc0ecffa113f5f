"""A wire on each of the two kernels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import pytest

from tests.bench.peers.peer_wire import Wire
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.sim.kernel import SimKernel


@pytest.fixture(params=["sim", "live"])
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    """Return a wire on each of the two kernels; nothing stays open after a test."""
    with closing(Wire(SimKernel() if request.param == "sim" else OsKernel())) as wire:
        yield wire
