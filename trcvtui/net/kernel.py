"""The interface to a network: socket-like calls that a real and a simulated network both answer.

Rule 1: no call raises an exception. Every call returns a value, WOULD_BLOCK or a Fault.
Rule 2: a Fault names the call and the errno *name*, never its number, which differs between systems.
Rule 3: a handle is opaque and is never used again after `abort` or `close`.
The contract suite tests/net/contract.py checks the behaviour that all kernels must share.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final, NewType, Protocol

from msgspec import Struct

from trcvtui.net.layer import LayerSettings
from trcvtui.net.results import Datagram, Endpoint, Fault, Unread, WouldBlock

Handle = NewType("Handle", int)

DRAIN_BYTES: Final = 1 << 20  # unread input read away before a FIN, else the partner would see RST

# The calls that a fault plan can make fail; `buffer` and `queue` are the PLC's own (connection/resources.py).
KERNEL_CALLS: Final = (
    "socket", "set_reuse", "bind", "listen", "poll_add", "poll_del", "accept", "resolve", "connect",
    "recv", "send", "shutdown", "abort", "close", "buffer", "queue",
)  # fmt: skip


class LocalAddress(Struct, frozen=True):
    """One address of this machine and the port (interface) it belongs to.

    `broadcast` is the address of all hosts on the network, or "" if there is none.
    """

    address: str
    interface: str
    ethernet: bool = True
    loopback: bool = False
    broadcast: str = ""


class NewClient(Struct, frozen=True):
    """A new connection taken from a listener's queue."""

    handle: Handle
    peer: Endpoint


class KernelLoss(Struct, frozen=True):
    """Why a connection is gone. `fault` is None for the partner's FIN."""

    fault: Fault | None
    unread: int


class PathInfo(Struct, frozen=True):
    """What the stack knows of a connection's send side, in bytes and milliseconds.

    With `probes_often`, TCP_RTO_MAX_MS is in force, and the stack probes a closed window every second. Then
    `last_ack_ms` stays small while the link lives, and silence for 3 keep-alive intervals means it is dead.
    """

    unacked: int
    unsent: int
    last_ack_ms: int
    probes_often: bool = False


class SocketOptions(Struct, frozen=True):
    """Options set before connect or listen, and again after accept.

    `keep_alive_s` is the interval I in seconds. Keep-alive uses I as idle time and as interval, and sends 2
    probes. So a dead link is found within 3 x I. If `user_timeout_ms` is 0, the limit of the system is
    used. `small_buffers` asks for SNDBUF 4608 and RCVBUF 2304.
    """

    nodelay: bool = False
    keep_alive_s: int = 10
    user_timeout_ms: int = 0
    small_buffers: bool = False
    session: LayerSettings | None = None  # what runs on the stream, where it is no plain TCP


class Kernel(Protocol):
    """The calls of a network. `owner` names the CONNECT or peer that a handle was made for."""

    def local_addresses(self) -> tuple[LocalAddress, ...]:
        """Return the addresses of this machine, including loopback, or () if they are unknown."""

    def set_link(self, owner: str, up: bool) -> str:
        """Cut the wire of an owner's handles, or mend it if `up`. Later handles are included.

        As with a pulled cable, nothing passes, and no call reports the cut. Return what is wrong, or "".
        """

    def poll(self) -> None:
        """Check once which handles are ready. `readable` uses this result."""

    def readable(self, handle: Handle) -> bool:
        """Return whether the last poll saw data, a FIN, an error or a waiting client on the handle."""

    def renew(self, handle: Handle) -> bool:
        """Poll one handle again, consuming nothing; return whether FIN, RST or an error has ended it."""

    def socket(self, owner: str) -> Handle | Fault: ...

    def set_reuse(self, handle: Handle) -> Fault | None:
        """Allow an address and port to be bound while old connections of this end linger."""

    def set_options(self, handle: Handle, options: SocketOptions) -> tuple[str, ...]:
        """Set the options; return the names of the options that this system refused."""

    def set_user_timeout(self, handle: Handle, milliseconds: int) -> None:
        """Limit how long sent data may stay unacknowledged; 0: the system's limit. Ignored where unknown."""

    def bind(self, handle: Handle, end: Endpoint) -> Fault | None:
        """Bind to a local address and port; port 0 means any free port."""

    def listen(self, handle: Handle, backlog: int) -> Fault | None:
        """Start to listen; the stack finishes backlog + 1 handshakes by itself."""

    def local_end(self, handle: Handle) -> Endpoint | None:
        """Return the local address and port, or None before the handle is bound."""

    def poll_add(self, handle: Handle) -> Fault | None:
        """Put the handle into the poll set (8084 names its failure)."""

    def poll_del(self, handle: Handle) -> Fault | None:
        """Take the handle out of the poll set (8087 names its failure)."""

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        """Take one finished handshake from a listener; the new handle has the listener's owner."""

    def resolve(self, handle: Handle, name: str) -> str | WouldBlock | Fault:
        """Return the address of a name; WOULD_BLOCK: ask again. Freeing the handle ends the look-up.

        EAI_NONAME: the name is unknown, or no name server answers.
        """

    def connect(self, handle: Handle, end: Endpoint) -> Fault | None:
        """Start to connect. None means that the attempt is pending; then ask `connect_result`."""

    def connect_result(self, handle: Handle) -> WouldBlock | Fault | None:
        """Return None when connected, WOULD_BLOCK while pending, or a failed attempt's Fault (once)."""

    def recv(self, handle: Handle, into: memoryview) -> int | WouldBlock | Fault:
        """Read at most len(into) bytes; 0 = the partner's FIN. Received bytes come before a Fault."""

    def send(self, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
        """Write as many bytes as the stack takes now; return their number."""

    def datagram_socket(self, owner: str) -> Handle | Fault:
        """Make a UDP socket. After `set_reuse` several of them can be bound to one broadcast address."""

    def set_broadcast(self, handle: Handle) -> Fault | None:
        """Let a UDP socket send to broadcast addresses; such a send fails with EACCES without this call."""

    def send_to(self, handle: Handle, data: memoryview, end: Endpoint) -> int | WouldBlock | Fault:
        """Send one whole datagram. If no port is bound, use a free port. A Fault names the call `send`.

        No call reports that the datagram found no receiver.
        """

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        """Take one datagram, which may be empty. A Fault names the call `recv`."""

    def loss(self, handle: Handle) -> KernelLoss | None:
        """Return why the connection is gone, or None while it is up. Consume no data.

        A FIN is seen even while data before the FIN is unread. An error is reported only once: by this
        call, `recv` or `send`.
        """

    def discard(self, handle: Handle, most: int) -> int:
        """Drop at most `most` queued bytes; return their number. Fault plans do not count this call."""

    def unread(self, handle: Handle) -> int:
        """Return how many received bytes wait in the stack."""

    def list_unread(self, handles: Collection[Handle]) -> list[Handle]:
        """Return the handles among `handles` at which something is unread, or an end was seen."""

    def peek(self, handle: Handle, skip: int) -> Unread:
        """Return what is unread at a handle that `list_unread` or the poll named. Consume nothing.

        The stack is asked only if more than `skip` bytes are unread. A peek at an empty queue would take a
        pending error away from the next `recv`.
        """

    def path(self, handle: Handle) -> PathInfo | None:
        """Return the state of sending, or None if the system does not provide it."""

    def shutdown(self, handle: Handle, both: bool = True) -> Fault | None:
        """Send FIN. If `both` is False, reading stays possible. Return ENOTCONN after the partner's RST."""

    def probe(self, handle: Handle) -> Fault | None:
        """Return what `shutdown` would return (ENOTCONN after the partner's RST), but send nothing."""

    def abort(self, handle: Handle) -> Fault | None:
        """Send RST and free the handle, even if the call returns a Fault; there is no TIME_WAIT."""

    def close(self, handle: Handle) -> Fault | None:
        """Send FIN, or RST if unread data is queued. Free the handle, even if the call returns a Fault."""


_AnyKernel: Any = object  # for mypy: a proxy has every call of a Kernel


class KernelProxy(_AnyKernel):  # type: ignore[misc]
    """A kernel in front of an inner kernel. Calls not defined here are the inner kernel's."""

    def __init__(self, inner: Kernel) -> None:
        self.inner = inner
        for name in vars(Kernel):
            if not name.startswith("_") and not hasattr(type(self), name):
                setattr(self, name, getattr(inner, name))  # not __getattr__: these are called in every scan
