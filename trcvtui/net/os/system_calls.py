"""What differs between systems: poll sets, socket options, unread bytes, cut links."""

from __future__ import annotations

import ctypes
import errno
import select
import socket
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Final, Protocol

from trcvtui.net.kernel import PathInfo, SocketOptions
from trcvtui.net.results import PEEK_DEPTH, Endpoint, Unread, WaitingMessage

# poll and epoll share these numbers.
IN: Final = 0x1
OUT: Final = 0x4
ERR: Final = 0x8
HUP: Final = 0x10
RDHUP: Final = getattr(select, "EPOLLRDHUP", 0)
HAS_POLL: Final = hasattr(select, "poll")
GONE_MASK: Final = ERR | HUP | RDHUP
# While an attempt to connect is running, an ICMP message raises ERR alone: that is no verdict.
# select has no HUP: there a refusal shows as ERR.
VERDICT_MASK: Final = OUT | HUP if HAS_POLL else OUT | ERR


class PollSet(Protocol):
    def register(self, fd: int, mask: int) -> None: ...
    def unregister(self, fd: int) -> None: ...
    def poll(self, timeout: float, maxevents: int) -> list[tuple[int, int]]: ...
    def close(self) -> None: ...


class PollList:
    """The poll set of a system without epoll. It may see an RST late if nobody reads the socket."""

    def __init__(self) -> None:
        self._wanted: dict[int, int] = {}

    def register(self, fd: int, mask: int) -> None:
        if fd in self._wanted:
            raise OSError(errno.EEXIST, "already in the poll set")
        self._wanted[fd] = mask

    def unregister(self, fd: int) -> None:
        if self._wanted.pop(fd, None) is None:
            raise OSError(errno.ENOENT, "not in the poll set")

    def modify(self, fd: int, mask: int) -> None:
        self._wanted[fd] = mask

    def poll(self, timeout: float, maxevents: int = -1) -> list[tuple[int, int]]:
        return poll_once(self._wanted, timeout) if self._wanted else []

    def close(self) -> None:
        self._wanted.clear()


def new_poll_set() -> PollSet:
    """Return an empty poll set; raise OSError (EMFILE) if the system has no descriptor for it."""
    return select.epoll() if hasattr(select, "epoll") else PollList()


def poll_once(wanted: dict[int, int], timeout: float = 0) -> list[tuple[int, int]]:
    """Return (descriptor, events) of each ready descriptor. Wait at most `timeout` s; -1 means no limit."""
    if HAS_POLL:
        poller = select.poll()
        for fd, mask in wanted.items():
            poller.register(fd, mask)
        return poller.poll(None if timeout < 0 else timeout * 1000)
    return _select(wanted, None if timeout < 0 else timeout)


def _select(wanted: dict[int, int], timeout: float | None) -> list[tuple[int, int]]:
    readers = [fd for fd, mask in wanted.items() if mask & IN]
    writers = [fd for fd, mask in wanted.items() if mask & OUT]
    seen: dict[int, int] = {}
    for fds, mask in zip(select.select(readers, writers, list(wanted), timeout), (IN, OUT, ERR), strict=True):
        for fd in fds:
            seen[fd] = seen.get(fd, 0) | mask
    return list(seen.items())


ERROR_ALIASES: Final = {"EWOULDBLOCK": "EAGAIN", "ENOTSUP": "EOPNOTSUPP"}


def error_name(problem: OSError | ValueError | KeyError) -> str:
    """Return the POSIX name of a failure; EBADF for an unknown handle or a closed socket."""
    if not isinstance(problem, OSError):
        return "EBADF"
    name = errno.errorcode.get(problem.errno or 0, f"E{problem.errno}").removeprefix("WSA")
    return ERROR_ALIASES.get(name, name)


KEEP_ALIVE_LIMITS_S: Final = (1, 32767)  # those of Linux (MAX_TCP_KEEPIDLE), kept on all systems
KEEP_ALIVE_PROBES: Final = 2  # idle + 2 intervals: a dead link is found within 3 x I
SMALL_SEND_BUFFER: Final = 4608  # bytes; both are the minima of Linux (SOCK_MIN_SNDBUF, SOCK_MIN_RCVBUF)
SMALL_RECEIVE_BUFFER: Final = 2304
RTO_MAX_MS: Final = 1000  # the least that TCP_RTO_MAX_MS takes
LARGEST_C_INT: Final = (1 << 31) - 1  # a socket option is a C int

TCP_LEVEL: Final = socket.IPPROTO_TCP
BASE: Final = socket.SOL_SOCKET
# Numbers that the socket module does not name; TCP_RTO_MAX_MS is Linux 6.15 and later.
TCP_RTO_MAX_MS: Final = 44 if sys.platform == "linux" else None
TCP_KEEPIDLE: Final = getattr(socket, "TCP_KEEPIDLE", None) or getattr(socket, "TCP_KEEPALIVE", None)
TCP_KEEPINTVL: Final = getattr(socket, "TCP_KEEPINTVL", None)
TCP_KEEPCNT: Final = getattr(socket, "TCP_KEEPCNT", None)
# TCP_USER_TIMEOUT, TCP_RXT_CONNDROPTIME, TCP_MAXRT: the option, and its unit in milliseconds.
USER_TIMEOUT: Final = {"linux": (18, 1), "darwin": (0x80, 1000), "win32": (5, 1000)}.get(sys.platform)
# On Windows SO_REUSEADDR allows stealing a listening port; SO_EXCLUSIVEADDRUSE does there what it does here.
REUSE_OPTION: Final = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
RESET_ON_CLOSE: Final = struct.pack("hh" if sys.platform == "win32" else "ii", 1, 0)


def apply_options(sock: socket.socket, options: SocketOptions) -> tuple[str, ...]:
    """Set the options; return the names of the options that this system refused."""
    low, high = KEEP_ALIVE_LIMITS_S
    refused = [
        name
        for name, level, option, value in _list_options(options)
        if (name in ("TCP_KEEPIDLE", "TCP_KEEPINTVL") and not low <= value <= high)
        or not _set_option(sock, level, option, value)
    ]
    # The project does not ask for this one, so a refusal is not reported: see `probes_often`.
    _set_option(sock, TCP_LEVEL, TCP_RTO_MAX_MS, RTO_MAX_MS)
    if not limit_unacknowledged(sock, options.user_timeout_ms) and options.user_timeout_ms:
        refused.append("TCP_USER_TIMEOUT")
    return tuple(refused)


def limit_unacknowledged(sock: socket.socket, milliseconds: int) -> bool:
    """Limit how long sent data may stay unacknowledged; return whether the system took the option."""
    option, unit = USER_TIMEOUT or (None, 1)
    return _set_option(sock, TCP_LEVEL, option, -(-milliseconds // unit))  # rounded up: 0 would be no limit


def retransmits_often(sock: socket.socket) -> bool:
    """Return whether retransmissions and window probes are at most a second apart."""
    try:
        return TCP_RTO_MAX_MS is not None and sock.getsockopt(TCP_LEVEL, TCP_RTO_MAX_MS) <= RTO_MAX_MS
    except (OSError, ValueError):
        return False


def _list_options(options: SocketOptions) -> Iterator[tuple[str, int, int | None, int]]:
    """Yield (name, level, option or None if unknown, value) in the order of setting."""
    yield "TCP_NODELAY", TCP_LEVEL, socket.TCP_NODELAY, int(options.nodelay)
    yield "TCP_KEEPIDLE", TCP_LEVEL, TCP_KEEPIDLE, options.keep_alive_s
    yield "TCP_KEEPINTVL", TCP_LEVEL, TCP_KEEPINTVL, options.keep_alive_s
    yield "TCP_KEEPCNT", TCP_LEVEL, TCP_KEEPCNT, KEEP_ALIVE_PROBES
    yield "SO_KEEPALIVE", BASE, socket.SO_KEEPALIVE, 1
    if options.small_buffers:
        yield "SO_SNDBUF", BASE, socket.SO_SNDBUF, SMALL_SEND_BUFFER
        yield "SO_RCVBUF", BASE, socket.SO_RCVBUF, SMALL_RECEIVE_BUFFER


def _set_option(sock: socket.socket, level: int, option: int | None, value: int) -> bool:
    if option is None or not -LARGEST_C_INT <= value <= LARGEST_C_INT:  # setsockopt would raise OverflowError
        return False
    try:
        sock.setsockopt(level, option, value)
    except (OSError, ValueError):
        return False
    return True


try:
    import fcntl
    import termios
except ImportError:  # Windows
    CAN_IOCTL = False
else:
    CAN_IOCTL = True

PEEK_BYTES: Final = 65536
MOST_DATAGRAMS: Final = 1024  # of one peek
_FIONREAD_BUFFER: Final = bytearray(4)  # where FIONREAD writes
_ZERO_COUNT: Final = bytes(4)
# TCP_INFO: its first byte is the state; of a listener tcpi_unacked is the number of waiting clients.
LISTEN_STATE: Final = b"\x0a"
# States of a stream that the partner has ended: TIME_WAIT, CLOSE, CLOSE_WAIT, LAST_ACK, CLOSING.
END_STATES: Final = {b"\x06": "fin", b"\x07": "rst", b"\x08": "fin", b"\x09": "fin", b"\x0b": "fin"}
CLIENTS_AT: Final = 24
SO_PEEK_OFF, SO_MEMINFO, DROPS_AT = 42, 55, 32
MOST_READS: Final = 64  # a partner that keeps sending single bytes must not keep the scan here
# Offsets in struct tcp_info of Linux: milliseconds since the last ACK, bytes not yet sent. Newer systems add
# the retransmitted bytes (4.19) and the window of the other end.
LAST_ACK_AT: Final = 56
ROUND_TRIP_AT: Final = 68  # us, smoothed
UNSENT_AT: Final = 144
TCP_INFO_BYTES: Final = 160
SENT_AGAIN_AT: Final = 208
WINDOW_AT: Final = 228
LONG_TCP_INFO_BYTES: Final = 232


def count_unread(sock: socket.socket | None) -> int:
    """Return how many received bytes are unread; at most 65536 if the system does not count them."""
    try:
        if sock is None:
            return 0
        return (
            _ioctl_int(sock, termios.FIONREAD) if CAN_IOCTL else len(sock.recv(PEEK_BYTES, socket.MSG_PEEK))
        )
    except (OSError, ValueError):
        return 0


def may_have_unread(sock: socket.socket) -> bool:
    """Return whether a socket may have unread data. For listeners, UDP or without FIONREAD: True."""
    if not CAN_IOCTL:
        return True
    try:
        fcntl.ioctl(sock, termios.FIONREAD, _FIONREAD_BUFFER)
    except OSError:  # a listener
        return True
    return _FIONREAD_BUFFER != _ZERO_COUNT or sock.type == socket.SOCK_DGRAM  # 0: maybe an empty datagram


def peek_at(sock: socket.socket, skip: int, is_gone: bool) -> Unread:
    """Return what is unread at a socket that the poll saw. `is_gone` means that the poll saw an end.

    If the system has no FIONREAD, peek at bytes only while no end was seen.
    """
    try:
        if sock.type == socket.SOCK_DGRAM:
            return _peek_datagrams(sock, skip)
        info = sock.getsockopt(TCP_LEVEL, socket.TCP_INFO, CLIENTS_AT + 4) if sys.platform == "linux" else b""
        if info[:1] == LISTEN_STATE:
            return Unread(clients=int.from_bytes(info[CLIENTS_AT : CLIENTS_AT + 4], sys.byteorder))
        size = _ioctl_int(sock, termios.FIONREAD) if CAN_IOCTL else 0
        most = min(size, PEEK_DEPTH) if CAN_IOCTL else 0 if is_gone else PEEK_BYTES
        # A peek at an empty queue would take a pending error away from the next recv.
        data = sock.recv(most, socket.MSG_PEEK)[skip:] if most > skip else b""
        end = END_STATES.get(info[:1], "") if is_gone else ""
        room = sock.getsockopt(BASE, socket.SO_RCVBUF)
        return Unread(max(size, skip + len(data)), data, end, size * 2 >= room)  # half of it is overhead
    except (OSError, ValueError):
        return Unread()


def _peek_datagrams(sock: socket.socket, skip: int) -> Unread:
    found: list[WaitingMessage] = []
    dropped = 0
    if sys.platform == "linux":
        if sock.getsockopt(BASE, SO_PEEK_OFF) < 0:  # -1: each peek would return the same datagram
            sock.setsockopt(BASE, SO_PEEK_OFF, 0)
        drops = sock.getsockopt(BASE, SO_MEMINFO, DROPS_AT + 4)[DROPS_AT:]
        dropped = int.from_bytes(drops, sys.byteorder)
    with suppress(BlockingIOError):
        while (sys.platform == "linux" or not skip) and len(found) < MOST_DATAGRAMS:
            data, (address, port) = sock.recvfrom(PEEK_BYTES, socket.MSG_PEEK)
            found.append(WaitingMessage(Endpoint(address, port), data, len(data)))
            skip += 1
    return Unread(messages=tuple(found), dropped=dropped)


def discard_unread(sock: socket.socket | None, most: int) -> int:
    """Read and drop at most `most` queued bytes, in MOST_READS calls at most. Return their number."""
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
        pass  # empty, or at an end
    return gone


def tcp_info(sock: socket.socket | None) -> PathInfo | None:
    """Return the state of sending from TCP_INFO, or None if the system does not provide it."""
    if sock is None or sys.platform != "linux":
        return None
    try:
        info = sock.getsockopt(TCP_LEVEL, socket.TCP_INFO, TCP_INFO_BYTES).ljust(TCP_INFO_BYTES, b"\0")
        queued = _ioctl_int(sock, termios.TIOCOUTQ)
        often = retransmits_often(sock)
    except (OSError, ValueError):
        return None
    (last_ack_ms,) = struct.unpack_from("=I", info, LAST_ACK_AT)
    (unsent,) = struct.unpack_from("=I", info, UNSENT_AT)
    return PathInfo(max(0, queued - unsent), unsent, last_ack_ms, often)  # two calls: they can disagree


def read_path_figures(sock: socket.socket) -> tuple[int, int, int] | None:
    """Return the round trip in us, the partner's window, and the bytes retransmitted to it, or None."""
    if sys.platform != "linux":
        return None
    try:
        info = sock.getsockopt(TCP_LEVEL, socket.TCP_INFO, LONG_TCP_INFO_BYTES)
    except OSError:
        return None
    if len(info) < LONG_TCP_INFO_BYTES:  # an older kernel
        return None
    (round_trip,) = struct.unpack_from("=I", info, ROUND_TRIP_AT)
    (again,) = struct.unpack_from("=Q", info, SENT_AGAIN_AT)
    (window,) = struct.unpack_from("=I", info, WINDOW_AT)
    return round_trip, window, again


def _ioctl_int(sock: socket.socket, request: int) -> int:
    (number,) = struct.unpack("i", fcntl.ioctl(sock.fileno(), request, b"\0\0\0\0"))
    return int(number)


# -- a cut wire without privileges: a packet filter at a socket that lets nothing in ----------------------
#
# Linux lets a program put a classic BPF filter on its own sockets. "Take 0 bytes" on every socket of a
# CONNECT, and on the bench's own sockets at their other ends, silences that wire both ways without FIN or
# RST; the stack's own timers notice it. A partner outside this bench still receives the PLC's segments, and
# only its answers are dropped. A socket that is closed already (TIME_WAIT, an unfinished FIN) is not silent.

CAN_CUT: Final = sys.platform == "linux"
CANNOT_CUT: Final = "this system cannot drop packets at a socket: link works on Linux and with --kernel sim"
SO_ATTACH_FILTER: Final = 26
SO_DETACH_FILTER: Final = 27
DROP_ALL: Final = struct.pack("HBBI", 0x06, 0, 0, 0)  # one struct sock_filter: BPF_RET | BPF_K, take 0 bytes

_program: Final = ctypes.create_string_buffer(DROP_ALL)
_filter: Final = struct.pack("HP", 1, ctypes.addressof(_program))  # struct sock_fprog

SocketEnds = tuple[object, object]


class CutLinks:
    """The owners whose wires are cut. Also the owners that cut off each socket that gets no packets."""

    def __init__(self, sockets: Mapping[int, socket.socket]) -> None:
        self._sockets = sockets
        self._owners: dict[int, str] = {}
        self._down: set[str] = set()
        self._deaf: dict[int, set[str]] = {}

    def owner(self, handle: int) -> str:
        return self._owners.get(handle, "")

    def is_down(self, handle: int) -> bool:
        return bool(self._down) and self.owner(handle) in self._down

    def add_handle(self, handle: int, owner: str) -> None:
        """Add a new handle. If its wire is cut, its packets are dropped at once."""
        self._owners[handle] = owner
        if self._down:
            self._deafen_wires([handle])

    def remove_handle(self, handle: int) -> None:
        self._owners.pop(handle, None)
        self._deaf.pop(handle, None)

    def set_link(self, owner: str, up: bool) -> str:
        if not CAN_CUT:
            return CANNOT_CUT
        if up:
            self._mend_link(owner)
            return ""
        self._down.add(owner)
        refused = self._deafen_wires(list(self._sockets))
        if refused:  # all sockets or none: a wire that is cut in part would mislead
            self._mend_link(owner)
            return f"the system refuses a packet filter: {refused}"
        return ""

    def _deafen_wires(self, handles: Iterable[int]) -> str:
        """Stop the packets at both ends of these handles' cut wires; return a refusal's errno, or ""."""
        by_ends = {ends: handle for handle, sock in self._sockets.items() if (ends := _read_ends(sock))}
        refused = ""
        for handle in handles:
            ends = _read_ends(self._sockets[handle])
            partner = by_ends.get((ends[1], ends[0])) if ends else None
            both = {handle, handle if partner is None else partner}
            for owner in {self.owner(end) for end in both} & self._down:
                for end in both:
                    refused = self._deafen(end, owner) or refused
        return refused

    def _deafen(self, handle: int, because_of: str) -> str:
        owners = self._deaf.setdefault(handle, set())
        if not owners:
            try:
                self._sockets[handle].setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, _filter)
            except (OSError, ValueError) as problem:
                del self._deaf[handle]
                return error_name(problem)
        owners.add(because_of)
        return ""

    def _mend_link(self, owner: str) -> None:
        self._down.discard(owner)
        for handle, owners in list(self._deaf.items()):
            owners.discard(owner)
            if not owners:  # the wire of its other end may still be cut
                del self._deaf[handle]
                _detach_filter(self._sockets[handle])


def _read_ends(sock: socket.socket) -> SocketEnds | None:
    """Return both ends of a connection, or None before it is connected."""
    try:
        return sock.getsockname(), sock.getpeername()
    except (OSError, ValueError):
        return None


def _detach_filter(sock: socket.socket) -> None:
    with suppress(OSError, ValueError):  # the socket may be closed
        sock.setsockopt(socket.SOL_SOCKET, SO_DETACH_FILTER, 0)
