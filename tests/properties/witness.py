"""What stands beside the PLC and counts: what its partners have heard, and what it holds of its resources."""

from __future__ import annotations

from collections.abc import Mapping

from tests.properties.byte_model import ByteModel, Ends
from trcvtui.bench.bench import Bench
from trcvtui.bench.peers.peer import Peer
from trcvtui.bench.peers.queues import Inbox
from trcvtui.plc.ledger import KEPT_LINES
from trcvtui.plc.snapshot import Snapshot


class Ear(Inbox):
    """A peer's inbox that forgets nothing."""

    def __init__(self, peer: Peer, heard: dict[Ends, bytearray], fresh: set[Ends]) -> None:
        super().__init__()
        self._peer = peer
        self._heard = heard
        self._fresh = fresh

    def begin_connection(self) -> None:
        super().begin_connection()
        seen = self._peer.snapshot()
        self._ends = seen.remote, seen.local
        self._here = self._heard[self._ends] = bytearray()

    def add_bytes(self, arrived: memoryview) -> None:
        super().add_bytes(arrived)
        self._here += arrived
        self._fresh.add(self._ends)


class Witness:
    """Ears at every peer, and a look at the resources of one bench."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.heard: dict[Ends, bytearray] = {}
        self.crowded: set[Ends] = set()  # connections on which a window may have closed
        self._fresh: set[Ends] = set()  # on which something has arrived since the last check
        self._compared: dict[Ends, int] = {}
        for peer in bench.peers.values():
            assert isinstance(peer, Peer)
            peer.queues.inbox = Ear(peer, self.heard, self._fresh)
        self._resources = bench.runtime._resources  # what no reader gets: buffers, queue, unsettled

    def check(self, said: Mapping[Ends, bytearray], jobs: int) -> None:
        """Check that partners hear what was sent, from the first byte on, and that each job has a buffer."""
        while self._fresh:
            ends = self._fresh.pop()
            heard, known = self.heard[ends], self._compared.get(ends, 0)
            assert heard[known:] == said[ends][known : len(heard)], "nothing is lost, doubled or mixed"
            self._compared[ends] = len(heard)
        assert self._resources.buffers.used == jobs

    def has_all(self, picture: Snapshot, model: ByteModel) -> bool:
        """Return whether the partners of all connections that stand have heard all that was sent on them."""
        for connection in picture.connections:
            link = model.links.get((connection.name, connection.incarnation))
            if link is None or link.is_over or (link.local, link.peer) not in self.heard:
                continue
            if self.heard[link.local, link.peer] != model.said[link.local, link.peer]:
                return False
        return True

    def check_no_job_left(self) -> None:
        """Check that no block is there that could hold anything but its lock."""
        assert self._resources.buffers.used == 0
        for connection in self.bench.runtime.snapshot().connections:
            for name in (*connection.receivers, *connection.senders):
                assert name.endswith("(gone)")

    def check_nothing_left(self, picture: Snapshot) -> None:
        assert len(self.bench.runtime.ledger.lines_since(0)) <= KEPT_LINES
        assert self._resources.buffers.used == picture.connections_used == 0
        assert not self._resources.unsettled
        assert self._resources.queue.put("a job") is None, "the queue has been served"
        assert {c.state for c in picture.connections} == {"closed"}
        for connection in picture.connections:
            assert connection.receivers == connection.senders == ()
