"""Messages from a service with `Type=notify` to systemd: "ready" or "alive" (sd_notify(3))."""

from __future__ import annotations

import os
import socket
from contextlib import suppress


def notify(line: str) -> None:
    """Send the service manager a line such as READY=1; do nothing if there is none."""
    place = os.environ.get("NOTIFY_SOCKET", "")
    if place[:1] not in ("/", "@"):  # other families (vsock:) are not sent to
        return
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sock:
        sock.sendto(line.encode(), f"\0{place[1:]}" if place[0] == "@" else place)  # @: an abstract name
