"""A wire on each of the two kernels."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.bench.peers.peer_wire import Wire
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.sim.kernel import SimKernel


@pytest.fixture(params=["sim", "live"])
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    """Return a wire on each of the two kernels; nothing stays open after a test."""
    kernel = SimKernel() if request.param == "sim" else OsKernel()
    wire = Wire(kernel)
    yield wire
    for peer in wire.peers:
        peer.end()
    if isinstance(kernel, OsKernel):
        kernel.close_all()
