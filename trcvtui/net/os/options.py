"""Socket options of the real network (status-reproduction 5.5), and what each system calls them."""

from __future__ import annotations

import errno
import socket
import struct
import sys
from collections.abc import Iterator
from typing import Final

from trcvtui.net.kernel import SocketOptions

SAME_ERROR: Final = {"EWOULDBLOCK": "EAGAIN", "ENOTSUP": "EOPNOTSUPP"}


def error_name(problem: OSError | ValueError | KeyError) -> str:
    """Return the POSIX name of a failure; an unknown handle and a closed socket object are EBADF."""
    if not isinstance(problem, OSError):
        return "EBADF"
    name = errno.errorcode.get(problem.errno or 0, f"E{problem.errno}").removeprefix("WSA")
    return SAME_ERROR.get(name, name)


KEEP_ALIVE_LIMITS_S: Final = (1, 32767)
KEEP_ALIVE_PROBES: Final = 2
SMALL_SEND_BUFFER: Final = 4608
SMALL_RECEIVE_BUFFER: Final = 2304
RTO_MAX_MS: Final = 1000
LARGEST: Final = (1 << 31) - 1  # a socket option is a C int

TCP: Final = socket.IPPROTO_TCP
BASE: Final = socket.SOL_SOCKET
# Numbers that the socket module does not name; TCP_RTO_MAX_MS is Linux 6.15 and later.
TCP_RTO_MAX_MS: Final = 44 if sys.platform == "linux" else None
TCP_KEEPIDLE: Final = getattr(socket, "TCP_KEEPIDLE", None) or getattr(socket, "TCP_KEEPALIVE", None)
TCP_KEEPINTVL: Final = getattr(socket, "TCP_KEEPINTVL", None)
TCP_KEEPCNT: Final = getattr(socket, "TCP_KEEPCNT", None)
# TCP_USER_TIMEOUT, TCP_RXT_CONNDROPTIME, TCP_MAXRT, and how many milliseconds their unit has.
USER_TIMEOUT: Final = {"linux": (18, 1), "darwin": (0x80, 1000), "win32": (5, 1000)}.get(sys.platform)
# On Windows SO_REUSEADDR allows stealing a listening port; SO_EXCLUSIVEADDRUSE is its like (section 4).
REUSE: Final = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
RESET_ON_CLOSE: Final = struct.pack("hh" if sys.platform == "win32" else "ii", 1, 0)


def apply_options(sock: socket.socket, options: SocketOptions) -> tuple[str, ...]:
    """Set the options; return the names of those that this system refused."""
    low, high = KEEP_ALIVE_LIMITS_S
    refused = [
        name
        for name, level, option, value in _wanted(options)
        if (name in ("TCP_KEEPIDLE", "TCP_KEEPINTVL") and not low <= value <= high)
        or not _accepts(sock, level, option, value)
    ]
    # Nobody asked for this one: where it is unknown, `probes_often` says so.
    _accepts(sock, TCP, TCP_RTO_MAX_MS, RTO_MAX_MS)
    if not limit_unacknowledged(sock, options.user_timeout_ms) and options.user_timeout_ms:
        refused.append("TCP_USER_TIMEOUT")
    return tuple(refused)


def limit_unacknowledged(sock: socket.socket, milliseconds: int) -> bool:
    """Limit how long sent data may stay unacknowledged; return whether the system took it."""
    option, unit = USER_TIMEOUT or (None, 1)
    return _accepts(sock, TCP, option, -(-milliseconds // unit))


def probes_often(sock: socket.socket) -> bool:
    """Return whether retransmissions and window probes are at most a second apart."""
    try:
        return TCP_RTO_MAX_MS is not None and sock.getsockopt(TCP, TCP_RTO_MAX_MS) <= RTO_MAX_MS
    except (OSError, ValueError):
        return False


def _wanted(options: SocketOptions) -> Iterator[tuple[str, int, int | None, int]]:
    """Yield (name, level, option or None where unknown, value) in the order of setting."""
    yield "TCP_NODELAY", TCP, socket.TCP_NODELAY, int(options.nodelay)
    yield "TCP_KEEPIDLE", TCP, TCP_KEEPIDLE, options.keep_alive_s
    yield "TCP_KEEPINTVL", TCP, TCP_KEEPINTVL, options.keep_alive_s
    yield "TCP_KEEPCNT", TCP, TCP_KEEPCNT, KEEP_ALIVE_PROBES
    yield "SO_KEEPALIVE", BASE, socket.SO_KEEPALIVE, 1
    if options.small_buffers:
        yield "SO_SNDBUF", BASE, socket.SO_SNDBUF, SMALL_SEND_BUFFER
        yield "SO_RCVBUF", BASE, socket.SO_RCVBUF, SMALL_RECEIVE_BUFFER


def _accepts(sock: socket.socket, level: int, option: int | None, value: int) -> bool:
    if option is None or not -LARGEST <= value <= LARGEST:
        return False
    try:
        sock.setsockopt(level, option, value)
    except (OSError, ValueError):
        return False
    return True
