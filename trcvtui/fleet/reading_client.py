"""paho's client, but what has come is read at once: it asks the system four times for each message.

Each of these calls lets another thread have the interpreter, for 5 ms where that one is busy: a screen that
reads 20,000 messages would wait for seconds. A module of its own: paho is imported when it is used.
"""

from __future__ import annotations

from typing import Final

from paho.mqtt.client import Client

READ_BYTES: Final = 1 << 16


class ReadingClient(Client):
    """Its loop reads one message; `loop_read` those that are left, while it `has_more`."""

    _held, _at = b"", 0

    def _sock_recv(self, bufsize: int) -> bytes:
        if not self.has_more:
            self._held, self._at = super()._sock_recv(READ_BYTES), 0
        taken = self._held[self._at : self._at + bufsize]
        self._at += len(taken)
        return taken

    @property
    def has_more(self) -> bool:
        """Return whether bytes are left of what was read."""
        return self._at < len(self._held)
