"""What has come to a recorded PLC and lies unread, noted after its blocks have read and before a handle goes.

Rule 1: what was read, the read tells; here stands what it leaves.
Rule 2: what lies there came before this scan's reads, unless one of them found nothing more: then it is late.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import Endpoint, Unread

ARRIVED, MESSAGE, ENDED, WAITING, DROPPED = "arrived", "message", "ended", "waiting", "dropped"


LATE, FULL, DISCARD_FLAG = (
    1,
    2,
    4,
)  # flags: it belongs to the next scan; much is unread; it goes with the close


class ArrivalLog(Protocol):
    """What keeps what is noted: owner, call, arguments, answer."""

    def note_arrival(self, owner: str, call: str, args: tuple[object, ...], answer: object) -> None: ...
    def note_wire(
        self, owner: str, call: str, handle: int, args: tuple[object, ...], answer: object, data: bytes
    ) -> None: ...


class _ReceiveQueue:
    """What is known of a handle, counted from its beginning: bytes of a stream, or messages."""

    __slots__ = ("dropped", "has_ended", "is_udp", "read", "told", "whole")

    def __init__(self, is_udp: bool) -> None:
        self.is_udp = is_udp
        self.read = self.told = self.whole = self.dropped = 0
        self.has_ended = False


class ArrivalRecorder:
    """Notes what `kernel` has unread; `owners` has the owner of each handle."""

    def __init__(self, log: ArrivalLog, kernel: Kernel, owners: dict[Handle, str], label: str) -> None:
        self._log, self._kernel, self._owners, self._label = log, kernel, owners, label
        self._queues: dict[Handle, _ReceiveQueue] = {}
        self._clients: dict[Handle, int] = {}  # of each listener, those that wait
        self._seen: Collection[Handle] | None = None  # by the poll; None: everything is looked at
        self._emptied: set[Handle] = set()  # in this scan a read of it found nothing more

    # -- what the calls of a run tell ----------------------------------------------------------------------

    def add_handle(self, handle: Handle, is_udp: bool = False) -> None:
        self._queues[handle] = _ReceiveQueue(is_udp)

    def add_listener(self, handle: Handle) -> None:
        self._clients[handle] = 0

    def note_poll(self, seen: Collection[Handle] | None) -> None:
        self._seen = seen
        self._emptied.clear()

    def note_ready(self, handle: Handle) -> None:
        """Take that one more handle was seen to have something."""
        if self._seen is not None and handle not in self._seen:
            self._seen = {*self._seen, handle}

    def note_read(self, handle: Handle, size: int, room: int) -> None:
        """Take a read of a stream: `size` bytes into `room`."""
        queue = self._queues.get(handle)
        if size < room:
            self._emptied.add(handle)
        if queue is not None and size:
            queue.read += size
            queue.told = max(queue.told, queue.read)
            queue.whole = max(queue.whole, queue.read)

    def note_empty(self, handle: Handle) -> None:
        self._emptied.add(handle)

    def note_message_read(self, handle: Handle, source: Endpoint, data: bytes, whole: int) -> None:
        """Take a message that is read, and note it where that has not been done."""
        queue = self._queues.setdefault(handle, _ReceiveQueue(is_udp=False))
        queue.read += 1
        if queue.read > queue.told:
            queue.told = queue.read
            self._note_message(handle, source, data, whole, 0)

    def forget(self, handle: Handle) -> None:
        for known in (self._queues, self._clients):
            known.pop(handle, None)

    # -- what is noted -------------------------------------------------------------------------------------

    def note_all_unread(self) -> None:
        """Note what is left after the blocks of a scan have read."""
        seen, queues = self._seen, self._queues
        looked_at = queues if seen is None else seen
        for handle in self._kernel.list_unread(looked_at) if looked_at else ():
            if handle in queues:
                self.note_unread(handle)
        for handle, known in self._clients.items():
            if known or seen is None or handle in seen:
                self._note_clients(handle, self._kernel.peek(handle, 0).clients)

    def note_unread(self, handle: Handle, flags: int = 0) -> None:
        queue = self._queues.get(handle)
        if queue is None:
            return
        found = self._kernel.peek(handle, queue.told - queue.read)
        is_late = handle in self._emptied or (self._seen is not None and handle not in self._seen)
        flags |= (LATE if is_late else 0) | (FULL if found.is_full else 0)
        if found.messages is not None:
            for message in found.messages:
                queue.told += 1
                self._note_message(handle, *message, flags)
            if found.dropped > queue.dropped:
                self._log_arrival(DROPPED, handle, (handle, flags), found.dropped - queue.dropped)
                queue.dropped = found.dropped
            return
        self._note_bytes(handle, queue, found, flags)
        if found.end and not queue.has_ended:
            queue.has_ended = True
            self._log.note_wire(self._owner(handle), ENDED, handle, (found.end,), None, b"")
            self._log_arrival(ENDED, handle, (handle, flags), found.end)

    def _note_bytes(self, handle: Handle, queue: _ReceiveQueue, found: Unread, flags: int) -> None:
        whole = queue.read + found.size
        if whole <= queue.whole and not found.data and not (flags & DISCARD_FLAG and found.size):
            return
        queue.whole = max(queue.whole, whole)
        queue.told += len(found.data)
        if not found.has_session:
            self._log.note_wire(self._owner(handle), ARRIVED, handle, (whole,), None, found.data)
        self._log_arrival(ARRIVED, handle, (handle, whole, found.size, flags), found.data)

    def _note_message(self, handle: Handle, source: Endpoint, data: bytes, whole: int, flags: int) -> None:
        """Note a message; one of a session (its queue began as a stream) has other bytes at the wire."""
        if self._queues[handle].is_udp:
            self._log.note_wire(self._owner(handle), MESSAGE, handle, (source, whole), None, data)
        self._log_arrival(MESSAGE, handle, (handle, source, whole, flags), data)

    def _note_clients(self, handle: Handle, number: int) -> None:
        if number != self._clients[handle]:
            self._clients[handle] = number
            is_late = LATE if handle in self._emptied else 0
            self._log_arrival(WAITING, handle, (handle, is_late), number)

    def _owner(self, handle: Handle) -> str:
        return self._owners.get(handle, self._label)

    def _log_arrival(self, call: str, handle: Handle, args: tuple[object, ...], answer: object) -> None:
        self._log.note_arrival(self._owner(handle), call, args, answer)
