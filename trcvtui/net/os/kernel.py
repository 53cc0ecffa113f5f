"""The real network: non-blocking IPv4 sockets that answer as `Kernel` says.

A handle is the socket's descriptor. The result of `poll` holds for the whole scan. Until the next poll, a
handle of the poll set that was not ready costs no system call. Handles outside the set are always tried.
Without RDHUP (not Linux), a FIN is seen only after all data before it has been read.
"""

from __future__ import annotations

import errno
import socket
from collections.abc import Callable, Collection
from typing import Final

from trcvtui.net.kernel import Handle, KernelLoss, LocalAddress, NewClient, PathInfo, SocketOptions
from trcvtui.net.os.network import NameResolver, interface_addresses
from trcvtui.net.os.system_calls import (
    BASE,
    GONE_MASK,
    IN,
    OUT,
    RDHUP,
    RESET_ON_CLOSE,
    REUSE_OPTION,
    VERDICT_MASK,
    CutLinks,
    PollList,
    PollSet,
    apply_options,
    count_unread,
    discard_unread,
    error_name,
    limit_unacknowledged,
    may_have_unread,
    new_poll_set,
    peek_at,
    poll_once,
    tcp_info,
)
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, Unread, WouldBlock, sockaddr

# A late ICMP message about a sent datagram says nothing about the socket. Windows reports it in the next call
# (ECONNRESET, ENETRESET), other systems perhaps as ECONNREFUSED; that call is then repeated.
ICMP_ERRORS: Final = frozenset({"ECONNRESET", "ECONNREFUSED", "ENETRESET"})
MOST_ICMP_RETRIES: Final = 64  # so many messages are ignored in one call
LARGEST_DATAGRAM: Final = 65536  # no datagram is larger

# Every datagram is read in here first: on some systems nothing else shows the whole size of one that is cut.
_datagram_buffer: Final = memoryview(bytearray(LARGEST_DATAGRAM))


MOST_READS_A_CALL: Final = 16  # of one call; the rest stays in the stack for the next
Socket = socket.socket  # inside the class `socket` is the call

# A stack reports these in one call only; afterwards Linux answers 0 and EPIPE: here all systems do.
REPORTED_ONCE_ERRORS: Final = frozenset(
    {"ECONNRESET", "ECONNREFUSED", "ECONNABORTED", "ETIMEDOUT", "ENETRESET"}
    | {"EHOSTUNREACH", "ENETUNREACH", "EHOSTDOWN", "ENETDOWN"}
)


class OsKernel:
    """The Kernel of this machine. Call `close_all` at the end."""

    def __init__(self) -> None:
        self._sockets: dict[int, Socket] = {}
        self._links = CutLinks(self._sockets)
        self._questions = NameResolver()
        self._polls: PollSet | None = None
        self._polled: set[int] = set()
        self._ready: dict[int, int] = {}
        self._held: dict[int, str] = {}  # an error that was found after bytes; the bytes are answered first
        self._reported: set[int] = set()  # handles whose error a call has reported
        self._addresses: tuple[LocalAddress, ...] = ()
        self._addresses_are_new = False  # read since the last poll: once a scan, for all attempts in it

    def close_all(self) -> None:
        for handle in list(self._sockets):
            self.close(Handle(handle))
        if self._polls is not None:
            self._polls.close()
            self._polls = None

    def leaks(self) -> tuple[str, ...]:
        return tuple(f"{handle} {self.local_end(Handle(handle))}" for handle in self._sockets)

    def local_addresses(self) -> tuple[LocalAddress, ...]:
        """Return the addresses of this machine. If no descriptor is free, return the last list.

        If the C library has no list (Windows), return () without asking a name server. Then bind decides
        what is valid.
        """
        own = None if self._addresses_are_new else interface_addresses()
        if own is not None:
            self._addresses, self._addresses_are_new = own, True
        return self._addresses

    # -- the poll set ------------------------------------------------------------------------------

    def poll(self) -> None:
        self._addresses_are_new = False
        if self._polls is not None and self._polled:
            self._ready = dict(self._polls.poll(0, len(self._polled)))

    def ready(self) -> Collection[Handle]:
        return self._ready  # type: ignore[return-value]  # a cast would be a call in each scan

    def readable(self, handle: Handle) -> bool:
        if handle in self._polled:
            return handle in self._ready
        return bool(self._poll_socket(handle, IN))

    def renew(self, handle: Handle) -> bool:
        sock = self._sockets.get(handle)
        if sock is None:
            return True
        mask = self._poll_socket(handle, IN)
        if mask and handle in self._polled:  # else the calls that follow would still answer WOULD_BLOCK
            self._ready[handle] = mask
        return bool(mask & GONE_MASK) or (not RDHUP and self._peek_end(handle, sock))

    def _poll_socket(self, handle: int, mask: int) -> int:
        seen = poll_once({handle: mask | RDHUP}) if handle in self._sockets else []
        return seen[0][1] if seen else 0

    def poll_add(self, handle: Handle) -> Fault | None:
        return self._call("poll_add", handle, self._register)

    def _register(self, sock: Socket) -> None:
        if self._polls is None:  # made here, not at the start: so a block can show EMFILE (8084)
            self._polls = new_poll_set()
        self._polls.register(sock.fileno(), IN | RDHUP)
        self._polled.add(sock.fileno())

    def poll_del(self, handle: Handle) -> Fault | None:
        self._polled.discard(handle)
        self._ready.pop(handle, None)
        return self._call("poll_del", handle, self._unregister)

    def _unregister(self, sock: Socket) -> None:
        if self._polls is None:
            raise OSError(errno.ENOENT, "no poll set")
        self._polls.unregister(sock.fileno())

    def set_link(self, owner: str, up: bool) -> str:
        return self._links.set_link(owner, up)

    # -- set-up --------------------------------------------------------------------------------------

    def socket(self, owner: str) -> Handle | Fault:
        try:
            return self._add_socket(Socket(socket.AF_INET, socket.SOCK_STREAM), owner)
        except OSError as problem:
            return Fault("socket", error_name(problem))

    def _add_socket(self, made: Socket, owner: str) -> Handle:
        made.setblocking(False)
        handle = Handle(made.fileno())
        self._sockets[handle] = made
        self._links.add_handle(handle, owner)
        return handle

    def set_reuse(self, handle: Handle) -> Fault | None:
        return self._call("set_reuse", handle, lambda sock: sock.setsockopt(BASE, REUSE_OPTION, 1))

    def set_options(self, handle: Handle, options: SocketOptions) -> tuple[str, ...]:
        sock = self._sockets.get(handle)
        return () if sock is None else apply_options(sock, options)

    def set_user_timeout(self, handle: Handle, milliseconds: int) -> None:
        sock = self._sockets.get(handle)
        if sock is not None:
            limit_unacknowledged(sock, milliseconds)

    def bind(self, handle: Handle, end: Endpoint) -> Fault | None:
        return self._call("bind", handle, lambda sock: sock.bind(sockaddr(end)))

    def listen(self, handle: Handle, backlog: int) -> Fault | None:
        return self._call("listen", handle, lambda sock: sock.listen(backlog))

    def local_end(self, handle: Handle) -> Endpoint | None:
        sock = self._sockets.get(handle)
        try:
            address, port = sock.getsockname() if sock else ("", 0)
        except (OSError, ValueError):
            return None
        return Endpoint(address, port) if port else None

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        if handle in self._polled and handle not in self._ready:  # no system call for an idle listener
            return WOULD_BLOCK
        try:
            made, (address, port) = self._sockets[handle].accept()
        except BlockingIOError:
            return WOULD_BLOCK
        except (OSError, ValueError, KeyError) as problem:
            return Fault("accept", error_name(problem))
        return NewClient(self._add_socket(made, self._links.owner(handle)), Endpoint(address, port))

    def resolve(self, handle: Handle, name: str) -> str | WouldBlock | Fault:
        return self._questions.ask(handle, name) if handle in self._sockets else Fault("resolve", "EBADF")

    def connect(self, handle: Handle, end: Endpoint) -> Fault | None:
        """Start to connect. None means that the attempt is pending, even if it has already succeeded."""
        fault = self._call("connect", handle, lambda sock: sock.connect(sockaddr(end)))
        return None if fault and fault.error in ("EINPROGRESS", "EAGAIN") else fault

    def connect_result(self, handle: Handle) -> WouldBlock | Fault | None:
        """Return the verdict. A connected socket is writable, has no error and has a partner.

        If the partner sent bytes and then RST, the connection was up. Return None; recv gets the bytes.
        """
        sock = self._sockets.get(handle)
        if sock is None:
            return Fault("connect", "EBADF")
        if not self._poll_socket(handle, OUT) & VERDICT_MASK:
            return WOULD_BLOCK
        error = self._take_error(handle, sock)
        fault = Fault("connect", error) if error else self._call("connect", handle, Socket.getpeername)
        if fault is None or not self.unread(handle):
            return fault
        if error and error != "EPIPE":  # EPIPE: a FIN came before the RST, and recv will answer 0
            self._held[handle] = error
        return None

    # -- data ----------------------------------------------------------------------------------------

    def recv(self, handle: Handle, into: memoryview) -> int | WouldBlock | Fault:
        """Read into the view until the view is full or the stack is empty; 0 = the partner's FIN."""
        if handle not in self._ready and handle in self._polled:
            return WOULD_BLOCK
        if handle in self._held and not self.unread(handle):
            return self._take_held_fault("recv", handle)
        try:
            taken = self._sockets[handle].recv_into(into)
        except BlockingIOError:
            return WOULD_BLOCK
        except (OSError, ValueError, KeyError) as problem:
            return self._data_fault("recv", handle, problem) or 0
        return taken if taken == len(into) or not taken else self._read_on(handle, into, taken)

    def _read_on(self, handle: int, into: memoryview, taken: int) -> int:
        """Read again after a first short read: the sender may have refilled the window meanwhile."""
        sock = self._sockets[handle]
        for _ in range(MOST_READS_A_CALL):  # a partner that sends byte by byte must not keep the scan here
            if taken == len(into):
                break
            try:
                more = sock.recv_into(into[taken:])
            except BlockingIOError:
                break
            except (OSError, ValueError) as problem:
                self._held[handle] = error_name(problem)  # the bytes that were read come first
                break
            if not more:  # FIN: the next call reads it again
                break
            taken += more
        return taken

    def send(self, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
        if handle in self._held:
            return self._take_held_fault("send", handle)
        try:
            return self._sockets[handle].send(data)
        except BlockingIOError:
            return WOULD_BLOCK
        except (OSError, ValueError, KeyError) as problem:
            return self._data_fault("send", handle, problem) or Fault("send", "EPIPE")

    def loss(self, handle: Handle) -> KernelLoss | None:
        polled = handle in self._polled
        if polled and handle not in self._ready:
            return None
        sock = self._sockets.get(handle)
        if sock is None:
            return KernelLoss(Fault("recv", "EBADF"), 0)
        mask = self._ready[handle] if polled else self._poll_socket(handle, IN)
        if not mask & GONE_MASK and (RDHUP or not self._peek_end(handle, sock)):
            return None
        error = self._take_error(handle, sock)
        # A RST after a FIN is EPIPE: the FIN came first, and recv answers 0 too.
        fault = Fault("recv", error) if error and error != "EPIPE" else None
        return KernelLoss(fault, self.unread(handle))

    def _peek_end(self, handle: int, sock: Socket) -> bool:
        if handle in self._reported:
            return True
        try:
            number = sock.getsockopt(BASE, socket.SO_ERROR)
            if number:
                self._held[handle] = error_name(OSError(number, ""))
                return True
            return not sock.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except (OSError, ValueError) as problem:
            self._held[handle] = error_name(problem)
            return True

    def discard(self, handle: Handle, most: int) -> int:
        return discard_unread(self._sockets.get(handle), most)

    def unread(self, handle: Handle) -> int:
        return count_unread(self._sockets.get(handle))

    def list_unread(self, handles: Collection[Handle]) -> list[Handle]:
        sockets, ready = self._sockets, self._ready
        return [
            handle
            for handle in handles
            if handle in sockets and (ready.get(handle, 0) & GONE_MASK or may_have_unread(sockets[handle]))
        ]

    def peek(self, handle: Handle, skip: int) -> Unread:
        sock = self._sockets.get(handle)
        return Unread() if sock is None else peek_at(sock, skip, bool(self._ready.get(handle, 0) & GONE_MASK))

    def path(self, handle: Handle) -> PathInfo | None:
        return tcp_info(self._sockets.get(handle))

    # -- datagrams -----------------------------------------------------------------------------------

    def datagram_socket(self, owner: str) -> Handle | Fault:
        try:
            return self._add_socket(Socket(socket.AF_INET, socket.SOCK_DGRAM), owner)
        except OSError as problem:
            return Fault("socket", error_name(problem))

    def set_broadcast(self, handle: Handle) -> Fault | None:
        return self._call("set_broadcast", handle, lambda sock: sock.setsockopt(BASE, socket.SO_BROADCAST, 1))

    def send_to(self, handle: Handle, data: memoryview, end: Endpoint) -> int | WouldBlock | Fault:
        if self._links.is_down(handle):
            return len(data)  # a datagram has no connection whose other end could be made deaf
        error = ""
        for _ in range(MOST_ICMP_RETRIES):
            try:
                return self._sockets[handle].sendto(data, sockaddr(end))
            except BlockingIOError:
                return WOULD_BLOCK
            except (OSError, ValueError, KeyError) as problem:
                error = error_name(problem)
                if error not in ICMP_ERRORS:
                    break
        return Fault("send", error)

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        if handle in self._polled and handle not in self._ready:
            return WOULD_BLOCK
        for _ in range(MOST_ICMP_RETRIES):
            try:
                whole, (address, port) = self._sockets[handle].recvfrom_into(_datagram_buffer)
            except BlockingIOError:
                return WOULD_BLOCK
            except (OSError, ValueError, KeyError) as problem:
                error = error_name(problem)
                if error not in ICMP_ERRORS:
                    return Fault("recv", error)
            else:
                size = min(whole, len(into))
                into[:size] = _datagram_buffer[:size]
                return Datagram(size, Endpoint(address, port), whole)
        return WOULD_BLOCK

    # -- the end -------------------------------------------------------------------------------------

    def shutdown(self, handle: Handle, both: bool = True) -> Fault | None:
        how = socket.SHUT_RDWR if both else socket.SHUT_WR
        return self._call("shutdown", handle, lambda sock: sock.shutdown(how))

    def probe(self, handle: Handle) -> Fault | None:
        # SHUT_RD sends nothing, but fails as SHUT_RDWR would.
        return self._call("shutdown", handle, lambda sock: sock.shutdown(socket.SHUT_RD))

    def abort(self, handle: Handle) -> Fault | None:
        fault = self._call("abort", handle, lambda s: s.setsockopt(BASE, socket.SO_LINGER, RESET_ON_CLOSE))
        freed = self._free("abort", handle)
        return fault or freed

    def close(self, handle: Handle) -> Fault | None:
        return self._free("close", handle)

    def _free(self, call: str, handle: int) -> Fault | None:
        if handle in self._polled:
            self._polled.discard(handle)
            self._ready.pop(handle, None)
            if isinstance(self._polls, PollList):  # epoll forgets a closed descriptor by itself
                self._polls.unregister(handle)
        self._held.pop(handle, None)
        self._reported.discard(handle)
        self._questions.forget(handle)
        self._links.remove_handle(handle)
        fault = self._call(call, handle, Socket.close)
        self._sockets.pop(handle, None)
        return fault

    # -- errors --------------------------------------------------------------------------------------

    def _call(self, call: str, handle: int, act: Callable[[Socket], object]) -> Fault | None:
        """Call a function with the handle's socket; EBADF if there is no such socket."""
        try:
            act(self._sockets[handle])
        except (
            OSError,
            ValueError,
            KeyError,
        ) as problem:  # no exception crosses the seam (kernel.py, Rule 1)
            return Fault(call, error_name(problem))
        return None

    def _data_fault(self, call: str, handle: int, problem: OSError | ValueError | KeyError) -> Fault | None:
        """Return the fault of a data call, None if an earlier call has reported this error."""
        name = error_name(problem)
        if name in REPORTED_ONCE_ERRORS:
            if handle in self._reported:
                return None
            self._reported.add(handle)
        return Fault(call, name)

    def _take_held_fault(self, call: str, handle: int) -> Fault:
        self._reported.add(handle)
        return Fault(call, self._held.pop(handle))

    def _take_error(self, handle: int, sock: Socket) -> str:
        """Return the pending error's name and clear it; "" when there is none."""
        held = self._held.pop(handle, "")
        try:
            number = sock.getsockopt(BASE, socket.SO_ERROR)
        except (OSError, ValueError) as problem:
            return error_name(problem)
        error = held or (error_name(OSError(number, "")) if number else "")
        if error:
            self._reported.add(handle)
        return error
