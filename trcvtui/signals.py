"""Signals that a program leaves to the one at the other end of its pipe, whose end ends it too."""

import signal
from typing import Final

# Ctrl+C, Ctrl+\, and a terminal that is closed: sent to all programs of it.
TERMINAL_SIGNALS: Final = ("SIGINT", "SIGQUIT", "SIGHUP")
GROUP_SIGNALS: Final = (
    *TERMINAL_SIGNALS,
    "SIGTERM",
)  # what `timeout` and a service's end send to all of them, too


def ignore_signals(names: tuple[str, ...]) -> None:
    """Do nothing when one of these comes; not every system has all of them."""
    for name in names:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
