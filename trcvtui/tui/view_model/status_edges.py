"""The past of each instance: its STATUS edges, bounded, newest last."""

from __future__ import annotations

from collections import deque
from typing import Final

from trcvtui.plc.ledger import Line, StatusEdge

KEPT_EDGES: Final = 1000


class History:
    """STATUS edges by instance; `skipped` counts ledger lines that never came to the screen."""

    def __init__(self) -> None:
        self._edges: dict[str, deque[Line]] = {}
        self.skipped = 0

    def note(self, line: Line, edge: StatusEdge) -> None:
        """Append one edge."""
        if edge.instance not in self._edges:
            self._edges[edge.instance] = deque(maxlen=KEPT_EDGES)
        self._edges[edge.instance].append(line)

    def of(self, instance: str) -> deque[Line]:
        """Return the edges of one instance, oldest first."""
        return self._edges.get(instance) or deque()
