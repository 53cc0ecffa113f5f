"""Notes the bytes that a recorded PLC has not read: after each scan's reads, and before a close.

Rule 1: bytes that a block reads are in the entry of that read. The notes have only unread bytes.
Rule 2: unread bytes came before the scan's reads, LATE bytes after (their handle was emptied or not ready).
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import Endpoint, Unread

BYTES_ARRIVED, MESSAGE, ENDED, WAITING, DROPPED = "arrived", "message", "ended", "waiting", "dropped"
LATE, FULL, DISCARD_FLAG = 1, 2, 4  # flags: it came after this scan's reads; much is unread; a close loses it


class ArrivalLog(Protocol):
    """Keeps notes, each with an owner, a call, its arguments and its answer."""

    def note_arrival(self, owner: str, call: str, args: tuple[object, ...], answer: object) -> None: ...
    def note_call(
        self, owner: str, call: str, handle: int, args: tuple[object, ...], answer: object, data: bytes
    ) -> None: ...


class _ReceiveCounts:
    """Counters of one handle since its beginning, in bytes of a stream or in messages."""

    __slots__ = ("dropped", "has_ended", "is_udp", "noted", "read", "whole")

    def __init__(self, is_udp: bool) -> None:
        self.is_udp = is_udp
        self.read = self.noted = self.whole = self.dropped = 0  # read; read or noted; came; lost
        self.has_ended = False


class ArrivalRecorder:
    """Notes the unread bytes and messages in `kernel`. `owners` has the owner of each handle."""

    def __init__(self, log: ArrivalLog, kernel: Kernel, owners: dict[Handle, str], label: str) -> None:
        self._log, self._kernel, self._owners, self._label = log, kernel, owners, label
        self._queues: dict[Handle, _ReceiveCounts] = {}
        self._clients: dict[Handle, int] = {}  # waiting at each listener, as noted
        self._seen: Collection[Handle] | None = None  # by the poll; None: each handle is checked
        self._emptied: set[Handle] = set()  # by a read of this scan

    # -- calls of the run ----------------------------------------------------------------------------------

    def add_handle(self, handle: Handle, is_udp: bool = False) -> None:
        self._queues[handle] = _ReceiveCounts(is_udp)

    def add_listener(self, handle: Handle) -> None:
        self._clients[handle] = 0

    def note_poll(self, seen: Collection[Handle] | None) -> None:
        self._seen = seen
        self._emptied.clear()

    def note_ready(self, handle: Handle) -> None:
        """Add a handle that became ready after the poll."""
        if self._seen is not None and handle not in self._seen:
            self._seen = {*self._seen, handle}

    def note_read(self, handle: Handle, size: int, room: int) -> None:
        """Count a read of `size` bytes from a stream. The read could take at most `room` bytes."""
        queue = self._queues.get(handle)
        if size < room:  # a short read has emptied the handle
            self._emptied.add(handle)
        if queue is not None and size:
            queue.read += size
            queue.noted = max(queue.noted, queue.read)
            queue.whole = max(queue.whole, queue.read)

    def note_empty(self, handle: Handle) -> None:
        self._emptied.add(handle)

    def note_message_read(self, handle: Handle, source: Endpoint, data: bytes, whole: int) -> None:
        """Count a message that is read. Note the message if no note has it yet."""
        queue = self._queues.setdefault(handle, _ReceiveCounts(is_udp=False))
        queue.read += 1
        if queue.read > queue.noted:  # it came and was read in one scan
            queue.noted = queue.read
            self._note_message(handle, source, data, whole, 0)

    def forget(self, handle: Handle) -> None:
        for known in (self._queues, self._clients):
            known.pop(handle, None)

    # -- notes ---------------------------------------------------------------------------------------------

    def note_all_unread(self) -> None:
        """Note what the blocks of a scan have not read."""
        seen, queues = self._seen, self._queues
        looked_at = queues if seen is None else seen
        for handle in self._kernel.list_unread(looked_at) if looked_at else ():
            if handle in queues:
                self.note_unread(handle)
        for handle, known in self._clients.items():
            if known or seen is None or handle in seen:  # else no client can have come or gone
                self._note_clients(handle, self._kernel.peek(handle, 0).clients)

    def note_unread(self, handle: Handle, flags: int = 0) -> None:
        queue = self._queues.get(handle)
        if queue is None:
            return
        found = self._kernel.peek(handle, queue.noted - queue.read)
        is_late = handle in self._emptied or (self._seen is not None and handle not in self._seen)  # Rule 2
        flags |= (LATE if is_late else 0) | (FULL if found.is_full else 0)
        if found.messages is not None:
            for message in found.messages:
                queue.noted += 1
                self._note_message(handle, *message, flags)
            if found.dropped > queue.dropped:
                self._log_arrival(DROPPED, handle, (handle, flags), found.dropped - queue.dropped)
                queue.dropped = found.dropped
            return
        self._note_bytes(handle, queue, found, flags)
        if found.end and not queue.has_ended:  # the poll keeps seeing it
            queue.has_ended = True
            self._log.note_call(self._get_owner(handle), ENDED, handle, (found.end,), None, b"")
            self._log_arrival(ENDED, handle, (handle, flags), found.end)

    def _note_bytes(self, handle: Handle, queue: _ReceiveCounts, found: Unread, flags: int) -> None:
        whole = queue.read + found.size
        if whole <= queue.whole and not found.data and not (flags & DISCARD_FLAG and found.size):
            return  # nothing new; but a close notes again what it loses
        queue.whole = max(queue.whole, whole)
        queue.noted += len(found.data)
        if not found.has_session:  # else the wire has other bytes
            self._log.note_call(self._get_owner(handle), BYTES_ARRIVED, handle, (whole,), None, found.data)
        self._log_arrival(BYTES_ARRIVED, handle, (handle, whole, found.size, flags), found.data)

    def _note_message(self, handle: Handle, source: Endpoint, data: bytes, whole: int, flags: int) -> None:
        """Note a message; note a datagram also at the wire, where messages of a session look different."""
        if self._queues[handle].is_udp:
            self._log.note_call(self._get_owner(handle), MESSAGE, handle, (source, whole), None, data)
        self._log_arrival(MESSAGE, handle, (handle, source, whole, flags), data)

    def _note_clients(self, handle: Handle, number: int) -> None:
        if number != self._clients[handle]:
            self._clients[handle] = number
            is_late = LATE if handle in self._emptied else 0
            self._log_arrival(WAITING, handle, (handle, is_late), number)

    def _get_owner(self, handle: Handle) -> str:
        return self._owners.get(handle, self._label)

    def _log_arrival(self, call: str, handle: Handle, args: tuple[object, ...], answer: object) -> None:
        self._log.note_arrival(self._get_owner(handle), call, args, answer)
