"""What a peer has received: the last bytes of each connection, and how many there were."""

from __future__ import annotations

from typing import Final

from trcvtui.rig.commands.check_frames import Checker

KEPT_BYTES: Final = 65536  # one job of the largest LEN


class Inbox:
    """The received stream of the current or last connection; bounded, whatever arrives."""

    def __init__(self) -> None:
        self.total = 0  # of all connections
        self.count = 0  # of this one
        self._last = bytearray()
        self._told = 0  # the count up to which an expectation has held
        self._held: tuple[bytes, int] | None = None
        self.checker: Checker | None = None  # of self-checking traffic

    def begin(self) -> None:
        """Begin with a new connection."""
        self.count = self._told = 0
        self._held = None
        self._last.clear()
        if self.checker is not None:
            self.checker.begin()

    def take(self, arrived: memoryview) -> None:
        """Append what has arrived."""
        self.total += len(arrived)
        self.count += len(arrived)
        self._last += arrived
        if self.checker is not None:
            self.checker.take(bytes(arrived))
        if len(self._last) > 2 * KEPT_BYTES:
            del self._last[:-KEPT_BYTES]

    @property
    def last(self) -> bytes:
        """Return the last bytes of this connection, at most 65536."""
        return bytes(self._last[-KEPT_BYTES:])

    def is_exactly(self, payload: bytes) -> bool:
        """Return whether all bytes of this connection, or all since this last held, are these.

        What has held once holds until more arrives.
        """
        if self._held == (payload, self.count):
            return True
        if len(payload) not in (self.count, self.count - self._told):
            return False
        if len(payload) > len(self._last) or not self._last.endswith(payload):
            return False
        self._told, self._held = self.count, (payload, self.count)
        return True
