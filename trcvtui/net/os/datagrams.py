"""The datagram calls of the real network: UDP over IPv4, without waiting.

A late ICMP message about a datagram that was sent says nothing about the socket. Windows tells it to the next
call (ECONNRESET, ENETRESET), others may tell ECONNREFUSED; the call is then made once more.
"""

from __future__ import annotations

import socket
from typing import Final

from trcvtui.net.connection.ipv4 import pair
from trcvtui.net.kernel import WOULD_BLOCK, Datagram, Endpoint, Fault, Handle, WouldBlock
from trcvtui.net.os.link import CutLinks
from trcvtui.net.os.options import error_name

ICMP_ERRORS: Final = frozenset({"ECONNRESET", "ECONNREFUSED", "ENETRESET"})
MOST_ICMP: Final = 64  # so many messages are passed over in one call
LARGEST: Final = 65536  # no datagram is larger

# Every datagram is read in here first: no other way tells on all systems how large the cut one was.
_landing: Final = memoryview(bytearray(LARGEST))


class DatagramCalls:
    """The part of OsKernel that sends and takes datagrams, on its handles and its poll set's picture."""

    _sockets: dict[int, socket.socket]
    _polled: set[int]
    _ready: dict[int, int]
    _links: CutLinks

    def _keep(self, made: socket.socket, owner: str) -> Handle:
        raise NotImplementedError

    def datagram_socket(self, owner: str) -> Handle | Fault:
        """Make a non-blocking UDP socket."""
        try:
            return self._keep(socket.socket(socket.AF_INET, socket.SOCK_DGRAM), owner)
        except OSError as problem:
            return Fault("socket", error_name(problem))

    def send_to(self, handle: Handle, data: memoryview, end: Endpoint) -> int | WouldBlock | Fault:
        """Send one datagram; the stack takes all of it or nothing."""
        if self._links.is_down(handle):
            return len(data)  # a datagram has no connection whose other end could be made deaf
        error = ""
        for _ in range(MOST_ICMP):
            try:
                return self._sockets[handle].sendto(data, pair(end))
            except BlockingIOError:
                return WOULD_BLOCK
            except (OSError, ValueError, KeyError) as problem:
                error = error_name(problem)
                if error not in ICMP_ERRORS:
                    break
        return Fault("send", error)

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        """Take one datagram; what is larger than the view is cut off."""
        if handle in self._polled and handle not in self._ready:
            return WOULD_BLOCK
        for _ in range(MOST_ICMP):
            try:
                whole, (address, port) = self._sockets[handle].recvfrom_into(_landing)
            except BlockingIOError:
                return WOULD_BLOCK
            except (OSError, ValueError, KeyError) as problem:
                error = error_name(problem)
                if error not in ICMP_ERRORS:
                    return Fault("recv", error)
            else:
                size = min(whole, len(into))
                into[:size] = _landing[:size]
                return Datagram(size, Endpoint(address, port), whole)
        return WOULD_BLOCK
