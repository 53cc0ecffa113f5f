"""One attempt to open a serial port, in a thread of its own: a device or a far host may let it wait.

Rule: these are the only threads below the rig: pyserial opens and closes with calls that wait, and a scan
must not. They hold nothing but their port.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any


class Attempt:
    """An attempt that runs. `is_over` tells when `port` or `problem` is there."""

    def __init__(self, make_port: Callable[[], Any]) -> None:
        self.port: Any = None
        self.problem: Exception | None = None
        self._over = threading.Event()
        threading.Thread(target=self._run, args=(make_port,), daemon=True).start()

    @property
    def is_over(self) -> bool:
        """Return whether it has come to an end."""
        return self._over.is_set()

    def _run(self, make_port: Callable[[], Any]) -> None:
        port = None
        try:
            port = make_port()
            port.open()
            self.port = port
        except Exception as problem:  # whatever a driver or a URL handler raises: the port is not there
            self.problem = problem
            _close(port)
        self._over.set()


def put_away(port: Any) -> None:
    """Close a port; that waits too (pyserial 3.5: 0.3 s for a socket, a driver until all is sent)."""
    threading.Thread(target=_close, args=(port,), daemon=True).start()


def _close(port: Any) -> None:
    # pyserial 3.5 leaves a socket open that its partner has reset: its shutdown fails before its close.
    left = getattr(port, "_socket", None)
    with suppress(Exception):  # it is gone already
        port.close()
    if left is not None:
        with suppress(OSError):
            left.close()
