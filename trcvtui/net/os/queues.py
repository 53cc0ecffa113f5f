"""What the stack holds of a connection: bytes received and not read, bytes sent and not acknowledged."""

from __future__ import annotations

import socket
import struct
import sys
from typing import Final

from trcvtui.net.kernel import PathInfo
from trcvtui.net.os.options import TCP, probes_often

try:
    import fcntl
    import termios
except ImportError:  # Windows
    CAN_ASK = False
else:
    CAN_ASK = True

PEEK_BYTES: Final = 65536
MOST_READS: Final = 64  # a partner who sends byte by byte must not keep the scan here
# struct tcp_info of Linux: milliseconds since the last ACK, bytes not yet sent.
LAST_ACK_AT: Final = 56
UNSENT_AT: Final = 144
TCP_INFO_BYTES: Final = 160


def unread_bytes(sock: socket.socket | None) -> int:
    """Return how many received bytes wait in the stack; at most 65536 where it does not count them."""
    try:
        if sock is None:
            return 0
        return _ask(sock, termios.FIONREAD) if CAN_ASK else len(sock.recv(PEEK_BYTES, socket.MSG_PEEK))
    except (OSError, ValueError):
        return 0


def read_away(sock: socket.socket | None, most: int) -> int:
    """Read away at most so many queued bytes, in MOST_READS calls at most, and return how many."""
    waste, gone = bytearray(min(most, PEEK_BYTES)), 0
    try:
        for _ in range(MOST_READS):
            if sock is None or gone >= most:
                break
            taken = sock.recv_into(waste)
            if not taken:
                break
            gone += taken
    except (OSError, ValueError):
        pass  # empty, or at an end: what was read away is what counts
    return gone


def path_of(sock: socket.socket | None) -> PathInfo | None:
    """Return the send side's state from TCP_INFO, or None where the system does not say."""
    if sock is None or sys.platform != "linux":
        return None
    try:
        info = sock.getsockopt(TCP, socket.TCP_INFO, TCP_INFO_BYTES).ljust(TCP_INFO_BYTES, b"\0")
        queued = _ask(sock, termios.TIOCOUTQ)
        often = probes_often(sock)
    except (OSError, ValueError):
        return None
    (last_ack_ms,) = struct.unpack_from("=I", info, LAST_ACK_AT)
    (unsent,) = struct.unpack_from("=I", info, UNSENT_AT)
    return PathInfo(max(0, queued - unsent), unsent, last_ack_ms, often)


def _ask(sock: socket.socket, request: int) -> int:
    """Return the int that an ioctl answers."""
    (number,) = struct.unpack("i", fcntl.ioctl(sock.fileno(), request, b"\0\0\0\0"))
    return int(number)
