"""What systemd is told of a service with `Type=notify`: that it is ready, that it is alive (sd_notify(3))."""

from __future__ import annotations

import os
import socket
from contextlib import suppress


def notify(line: str) -> None:
    """Tell the service manager a line such as READY=1; without one, or where it does not hear, nothing."""
    place = os.environ.get("NOTIFY_SOCKET", "")
    if place[:1] not in ("/", "@"):
        return
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as way:
        way.sendto(line.encode(), f"\0{place[1:]}" if place[0] == "@" else place)
