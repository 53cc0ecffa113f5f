"""A simulated network for tests: time that passes by name, and the usual two partners."""

from __future__ import annotations

from collections.abc import Callable

from tests.net.net_bench import Bench, Pair
from trcvtui.net.kernel import Handle, SocketOptions
from trcvtui.net.results import Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel

MS = 1_000_000
SECOND = 1000 * MS


class SimNetwork:
    """A simulated network on which a millisecond passes at each breath."""

    def __init__(self, kernel: SimKernel) -> None:
        self.kernel = kernel

    def breathe(self) -> None:
        """Let a millisecond pass, without a poll."""
        self.kernel.advance(self.kernel.now_ns + MS)

    def pass_ms(self, milliseconds: int) -> None:
        self.kernel.advance(self.kernel.now_ns + milliseconds * MS)
        self.kernel.poll()

    @property
    def now_ms(self) -> int:
        return self.kernel.now_ns // MS


class SimBench(Bench):
    """A bench whose partners are the PLC's `C1` and a peer `P1`, so that their links can be cut."""

    def __init__(self, kernel: SimKernel | None = None) -> None:
        self.sim = SimKernel() if kernel is None else kernel
        self.time = SimNetwork(self.sim)
        super().__init__(self.time)

    def owned(self, owner: str, options: SocketOptions | None = None) -> Handle:
        handle = self.sim.socket(owner)
        assert not isinstance(handle, Fault)
        if options is not None:
            assert self.sim.set_options(handle, options) == ()
        return handle

    def partners(self, ours: SocketOptions | None = None, theirs: SocketOptions | None = None) -> Pair:
        """Return C1's connection to P1's listener: `client` is C1, `server` is P1."""
        listener = self.owned("P1", theirs)
        assert self.sim.bind(listener, Endpoint("127.0.0.1", 0)) is None
        assert self.sim.listen(listener, 4) is None
        assert self.sim.poll_add(listener) is None
        return self.pair(listener, client=self.owned("C1", ours))

    def cut(self) -> None:
        self.sim.set_link("C1", up=False)

    def mend(self) -> None:
        """Mend C1's wire."""
        self.sim.set_link("C1", up=True)

    def ms_until(self, holds: Callable[[], object], most_ms: int) -> int:
        """Return after how many milliseconds from now it holds; fail after most_ms."""
        start = self.time.now_ms
        self.until(holds, most_ms)
        return self.time.now_ms - start
