"""What a handle of the simulated network stands for: at first nothing, then a listener or a connection.

The methods answer "" or an errno name, as the system calls of Linux do (status-reproduction 2.2, 2.3, 3.1).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.net.connection.ipv4 import is_group, is_loopback, octets
from trcvtui.net.kernel import Endpoint, SocketOptions
from trcvtui.net.sim.ports import ANY, Claim
from trcvtui.net.sim.stream import RTO_MAX, Phase, Stream, Tuning, nobody_looks
from trcvtui.net.sim.timers import MS, SECOND
from trcvtui.net.sim.wire import Listener, SimWire

LOOPBACK: Final = "127.0.0.1"
KEEP_ALIVE_LIMITS_S: Final = (1, 32767)
KEEP_ALIVE_DEFAULT: Final = 7200 * SECOND
SMALL_SEND_BUFFER: Final = 2 * 4608  # Linux doubles what it is asked for
SMALL_RECEIVE_BUFFER: Final = 2 * 2304
# What a second connect on the same socket answers (3.3).
CONNECT_AGAIN: Final = {Phase.SYN_SENT: "EALREADY", Phase.OPEN: "EISCONN", Phase.OVER: "ECONNABORTED"}


class SimSocket:
    """One socket. `changed` is called whenever its readiness may be another one."""

    __slots__ = ("_wire", "changed", "claim", "listener", "owner", "polled", "stream", "tuning")

    def __init__(self, wire: SimWire, owner: str, stream: Stream | None = None) -> None:
        self._wire = wire
        self.owner = owner
        self.stream = stream
        self.claim = Claim() if stream is None else stream.claim
        self.tuning = Tuning() if stream is None else stream.tuning
        self.listener: Listener | None = None
        self.polled = False
        self.changed: Callable[[], None] = nobody_looks

    def watched_by(self, changed: Callable[[], None]) -> None:
        """Tell every change of readiness to changed."""
        self.changed = changed
        if self.stream is not None:
            self.stream.changed = changed

    @property
    def is_readable(self) -> bool:
        """Return whether poll would see it; a socket that is nothing yet shows HUP."""
        if self.stream is not None:
            return self.stream.is_readable
        return self.listener is None or bool(self.listener.queue)

    @property
    def is_gone(self) -> bool:
        """Return whether poll would see FIN, HUP or an error."""
        return self.stream.is_gone if self.stream is not None else self.listener is None

    @property
    def end(self) -> Endpoint | None:
        """Return the local end, None while there is none."""
        return self.stream.local if self.stream is not None else self.claim.end

    def __str__(self) -> str:
        """Return owner, state and ends for a list of leaks."""
        if self.stream is not None:
            return f"{self.owner} {self.stream.phase.value} {self.stream.local} {self.stream.remote}"
        state = "fresh" if self.listener is None else "listening"
        return f"{self.owner} {state} {self.claim.end or ''}".rstrip()

    def set_options(self, options: SocketOptions) -> tuple[str, ...]:
        """Obey the options; return the names of those that were refused."""
        low, high = KEEP_ALIVE_LIMITS_S
        is_valid = low <= options.keep_alive_s <= high
        self.tuning.keep_alive = options.keep_alive_s * SECOND if is_valid else KEEP_ALIVE_DEFAULT
        self.tuning.user_timeout = options.user_timeout_ms * MS
        self.tuning.longest_wait = RTO_MAX
        if options.small_buffers:
            self.tuning.send_room, self.tuning.receive_room = SMALL_SEND_BUFFER, SMALL_RECEIVE_BUFFER
        if self.stream is not None:
            self.stream.obey_options()
        return () if is_valid else ("TCP_KEEPIDLE", "TCP_KEEPINTVL")

    def bind(self, end: Endpoint) -> str:
        """Bind to a local end; port 0 takes a free one."""
        return self._cannot_bind(end) or self._wire.ports.bind(self.claim, end)

    def _cannot_bind(self, end: Endpoint) -> str:
        if not is_sane(end) or self.claim.port:
            return "EINVAL"
        # Linux binds to broadcast and multicast addresses without complaint (2.2, 8081).
        if not (self._wire.owns(end.address) or end.address == ANY or is_group(end.address)):
            return "EADDRNOTAVAIL"
        return ""

    def listen(self, backlog: int) -> str:
        """Start to listen; backlog + 1 handshakes are finished without accept."""
        if self.stream is not None:
            return "EINVAL"
        if self.listener is not None:
            self.listener.backlog = backlog
            return ""
        error = self._wire.ports.listen(self.claim)
        if not error:
            self.listener = Listener(self.owner, self.claim, self.tuning, backlog, self.changed)
            self._wire.listen(self.listener)
            self.changed()
        return error

    def connect(self, end: Endpoint) -> str:
        """Start to connect; "" = pending."""
        if self.listener is not None:
            return "EISCONN"
        if self.stream is not None:
            return CONNECT_AGAIN[self.stream.phase]
        if not is_sane(end):
            return "EINVAL"
        remote = Endpoint(LOOPBACK, end.port) if end.address == ANY else end
        error = self._no_way_to(remote.address)
        if error:
            return error
        local = self._source_for(remote.address)
        if not self._wire.ports.borrow(self.claim, local):
            return "EADDRNOTAVAIL"
        return self._begin(Endpoint(local, self.claim.port), remote)

    def _begin(self, local: Endpoint, remote: Endpoint) -> str:
        stream = Stream(self._wire, self.owner, self.claim, local, remote, self.tuning)
        if self._wire.is_taken(stream):
            return "EADDRNOTAVAIL"
        self.stream = stream
        self.watched_by(self.changed)
        self._wire.connect(stream)
        self.changed()
        return ""

    def _no_way_to(self, remote: str) -> str:
        """Return why the call itself refuses a target (2.3, 80A0)."""
        if is_group(remote):
            return "ENETUNREACH"
        if self._wire.owns(remote):
            return ""
        if is_loopback(self.claim.address):
            return "EINVAL"
        return "" if self._wire.addresses else "ENETUNREACH"

    def _source_for(self, remote: str) -> str:
        if self.claim.address != ANY:
            return self.claim.address
        if is_loopback(remote):
            return LOOPBACK
        return remote if self._wire.owns(remote) else self._wire.addresses[0]

    def probe(self) -> str:
        """Return what `shut` would answer, without a FIN."""
        return "ENOTCONN" if self.stream is None or self.stream.phase is Phase.OVER else ""

    def shut(self, both: bool) -> str:
        """Send FIN; a listener stops to listen when reading is shut as well."""
        if self.stream is not None:
            return self.stream.shut(both)
        if self.listener is None:
            return "ENOTCONN"
        if both:
            self._stop_listening()
            self.changed()
        return ""

    def free(self, abort: bool) -> None:
        """Let the connection, the listener and the port go."""
        self._stop_listening()
        if self.stream is None:
            self._wire.ports.release(self.claim)
            return
        if abort:
            self.stream.abort()
        else:
            self.stream.close()
        self._wire.let_go(self.stream)

    def _stop_listening(self) -> None:
        if self.listener is not None:
            self._wire.stop_listening(self.listener)
            self.claim.listening = False
            self.listener = None


def is_sane(end: Endpoint) -> bool:
    """Return whether it is a dotted address and a port."""
    return octets(end.address) is not None and 0 <= end.port < 65536
