"""Signals that a child process ignores. The parent gets these, and the child ends when the pipe closes."""

import signal
from typing import Final

# Ctrl+C, Ctrl+\ and a closed terminal: the kernel sends them to all processes of the terminal.
TERMINAL_SIGNALS: Final = ("SIGINT", "SIGQUIT", "SIGHUP")
# `timeout` and a service manager send this one to all processes, too.
GROUP_SIGNALS: Final = (*TERMINAL_SIGNALS, "SIGTERM")


def ignore_signals(names: tuple[str, ...]) -> None:
    """Ignore these signals, except those that the system does not have."""
    for name in names:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
