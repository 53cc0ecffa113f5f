"""When a connection counts as dead: TCP_USER_TIMEOUT kept in step with the partner's window (3.2, 5.5).

Rule 1: bytes that nobody acknowledges for 3 keep-alive intervals end the connection; idle ones are left to
keep-alive, which takes as long.
Rule 2: a partner that lives but does not read has closed its window: then no limit, it may take for ever.
Rule 3: where closed windows are probed often, an ACK older than the limit is a dead link behind one.
"""

from __future__ import annotations

from enum import Enum, auto

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.kernel import Handle, Kernel


class Sent(Enum):
    """How the bytes that were sent stand."""

    SETTLED = auto()  # the partner's stack has acknowledged all, or this system does not say
    UNDER_WAY = auto()
    DEAD = auto()


class DeadLinkWatch:
    """The watch over one connection's sent bytes; `begin` with each TCP connection."""

    def __init__(self, config: ConnectConfig, kernel: Kernel, is_on: bool) -> None:
        self._limit_ms = config.dead_after_ms
        self._kernel = kernel
        self._is_on = is_on
        self._set_ms = 0

    def begin(self, handle: Handle) -> None:
        """Limit how long bytes may stay unacknowledged; before "connected" it would cut attempts too."""
        self._set_ms = 0
        self._limit(handle, closed_window=False)

    def look(self, handle: Handle) -> Sent:
        """Look once; done in each scan as long as bytes are under way."""
        path = self._kernel.path(handle)
        if path is None or not (path.unacked or path.unsent):
            self._limit(handle, closed_window=False)
            return Sent.SETTLED
        closed_window = path.unacked == 0
        self._limit(handle, closed_window)
        speaks = not path.probes_often or path.last_ack_ms < self._limit_ms
        return Sent.DEAD if self._is_on and closed_window and not speaks else Sent.UNDER_WAY

    def _limit(self, handle: Handle, closed_window: bool) -> None:
        limit = self._limit_ms if self._is_on and not closed_window else 0
        if limit != self._set_ms:
            self._set_ms = limit
            self._kernel.set_user_timeout(handle, limit)
