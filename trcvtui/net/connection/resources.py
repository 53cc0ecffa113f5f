"""The PLC's own finite resources: job queue, receive and send buffers, connection budget.

They fail like kernel calls (`queue`, `buffer`, `budget`), so the same fault plan reaches them. Beside them
stand the IDs of its connections, which no plan reaches.
"""

from __future__ import annotations

from collections.abc import Callable

from trcvtui.net.connection.connection_ids import Identities
from trcvtui.net.kernel import Fault
from trcvtui.net.work import Work

TakeFault = Callable[[str, str], Fault | None]


def no_faults(call: str, owner: str) -> Fault | None:
    """Return None: the fault plan of a PLC to which nobody injects anything."""
    return None


class JobQueue:
    """The queue of asynchronous functions (80AC): takes `capacity` jobs a scan, served at its end."""

    def __init__(self, capacity: int, take: TakeFault = no_faults) -> None:
        self.capacity = capacity
        self._take = take
        self._waiting = 0

    def put(self, owner: str) -> Fault | None:
        """Queue one job for the CONNECT named owner."""
        fault = self._take("queue", owner)
        if fault is not None:
            return fault
        if self._waiting >= self.capacity:
            return Fault("queue", "EAGAIN")
        self._waiting += 1
        return None

    def serve(self) -> None:
        """Empty the queue; the communication phase of each scan does this."""
        self._waiting = 0


class BufferPool:
    """The pool of receive and send buffers (80A7): one for each running job."""

    def __init__(self, count: int, take: TakeFault = no_faults) -> None:
        self.count = count
        self._take = take
        self.used = 0

    def acquire(self, owner: str) -> Fault | None:
        """Take one buffer for a job on the CONNECT named owner."""
        fault = self._take("buffer", owner)
        if fault is not None:
            return fault
        if self.is_full:
            return Fault("buffer", "ENOBUFS")
        self.used += 1
        return None

    @property
    def is_full(self) -> bool:
        """Return whether no buffer is left."""
        return self.used >= self.count

    def release(self) -> None:
        """Give one buffer back."""
        self.used -= 1


class ConnectionBudget:
    """How many CONNECTs may hold sockets at once: T3 8, T4 32 (baosky.md section 1)."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self._holders: dict[str, None] = {}

    def acquire(self, owner: str) -> Fault | None:
        """Count the CONNECT named owner; one that is counted already passes."""
        if owner in self._holders:
            return None
        if len(self._holders) >= self.limit:
            return Fault("budget", f"{self.limit} connections in use")
        self._holders[owner] = None
        return None

    def release(self, owner: str) -> None:
        """Take the CONNECT named owner out of the count."""
        self._holders.pop(owner, None)

    @property
    def used(self) -> int:
        """Return how many CONNECTs hold sockets now."""
        return len(self._holders)


class Resources:
    """The resources of one PLC, the work of its scans, and which CONNECTs have bytes on the way."""

    def __init__(
        self, queue: JobQueue, buffers: BufferPool, budget: ConnectionBudget, work: Work | None = None
    ) -> None:
        self.queue = queue
        self.buffers = buffers
        self.budget = budget
        self.work = work or Work()
        self.identities = Identities()
        self.unsettled: dict[str, None] = {}
