"""How far sent bytes have come: DONE of a send job means the local stack, and nothing beyond it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from trcvtui.blocks.table import block_row
from trcvtui.plc.ledger import StatusEdge
from trcvtui.rig.bench.bench import Bench


@dataclass(frozen=True, slots=True)
class Delivery:
    """Bytes of a CONNECT's present connection, from its beginning.

    `accepted` by the local stack; `unacknowledged` of these by the partner's stack (None: this system does
    not say); `read_by_peer`: by the partner's program (None: the partner is no peer of this bench).
    """

    accepted: int
    unacknowledged: int | None
    read_by_peer: int | None


NONE_SENT: Final[Mapping[str, Delivery]] = {}


def deliveries(bench: Bench, changed: Iterable[StatusEdge]) -> Mapping[str, Delivery]:
    """Return how far the bytes have come, for each instance that shows a sent frame in this scan."""
    return {
        edge.instance: found
        for edge in changed
        if edge.outputs.done
        and block_row(edge.block).sends_stream
        and (found := _delivery(bench, edge.instance)) is not None
    }


def _delivery(bench: Bench, instance: str) -> Delivery | None:
    decl = bench.project.instance(instance)
    sent = bench.runtime.sent(decl.connect) if decl is not None else None
    if sent is None:
        return None
    read = [
        peer.received_here
        for peer in (peer.snapshot() for peer in bench.peers.values())
        if peer.state == "connected" and (peer.local, peer.remote) == (sent.remote, sent.local)
    ]
    return Delivery(sent.accepted, sent.unacknowledged, read[0] if read else None)
