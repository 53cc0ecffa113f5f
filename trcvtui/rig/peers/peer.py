"""The partner of the PLC: one TCP connection at a time, driven by commands, stepped between scans.

It knows the Kernel alone, so it is the same device on real sockets and on the simulated network. When the
partner ends the connection the peer closes its end too; a passive peer goes on listening.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.net.kernel import Accepted, Handle, Kernel, SocketOptions
from trcvtui.net.results import Endpoint, Fault
from trcvtui.plc.ledger import BenchNote, Event
from trcvtui.project.project import PeerDecl
from trcvtui.rig.commands.inbox import Inbox
from trcvtui.rig.commands.words import PeerPlay, PeerSend
from trcvtui.rig.peers.peer_traffic import FIN, PeerTraffic
from trcvtui.rig.peers.replies import Replies
from trcvtui.rig.snapshots import PeerSnapshot

BACKLOG: Final = 4
MOST_ACCEPTS: Final = 64  # a flood of clients costs bounded work between two scans
PEER_OPTIONS: Final = SocketOptions(nodelay=True)
LAST_SHOWN: Final = 4096  # received bytes in a snapshot


class Peer:
    """One peer. Commands answer "" or what is wrong; `step` does what goes on by itself."""

    def __init__(
        self,
        decl: PeerDecl,
        kernel: Kernel,
        resolve: Callable[[str], Endpoint | None],
        journal: Callable[[Event], None],
        options: SocketOptions = PEER_OPTIONS,
    ) -> None:
        self.decl = decl
        self.stalled = False
        self.traffic = PeerTraffic(decl.name, kernel, journal)
        self._kernel = kernel
        self._resolve = resolve
        self._journal = journal
        self._options = options
        self._listener: Handle | None = None
        self._attempt: Handle | None = None
        self._handle: Handle | None = None
        self._half_closed = False
        self._ended: tuple[str, ...] = ()  # in which words the last connection ended; the first is shown
        self._local: Endpoint | None = None
        self._remote: Endpoint | None = None
        self._port = 0 if isinstance(decl.end, str) else decl.end.port
        self._now = 0

    # -- what others ask -----------------------------------------------------------------------------

    @property
    def state(self) -> str:
        """Return closed, listening, connecting, connected, reset or refused."""
        if self._handle is not None:
            return "connected"
        if self._attempt is not None:
            return "connecting"
        if self._listener is not None:
            return "listening"
        return self._ended[0] if self._ended else "closed"

    @property
    def can_send(self) -> bool:
        """Return whether a message could go now."""
        return self._handle is not None

    def is_in(self, state: str) -> bool:
        """Return whether a state word of the bench commands is true.

        closed, reset and refused say how the last connection or attempt ended, also while a passive peer
        listens again; the peer's own RST is a reset and closed.
        """
        if state == self.state:
            return True
        return self._handle is None and self._attempt is None and state in self._ended

    def has_received(self, payload: bytes) -> bool:
        """Return whether exactly these bytes came on this connection, or since this last was true."""
        return self.traffic.inbox.is_exactly(payload)

    @property
    def inbox(self) -> Inbox:
        """Return what it has received."""
        return self.traffic.inbox

    @property
    def unsent(self) -> int:
        """Return how many bytes are still to come."""
        return self.traffic.unsent

    @property
    def replies(self) -> Replies:
        """Return what it answers by itself."""
        return self.traffic.replies

    @property
    def listening_port(self) -> int | None:
        """Return the port that a passive peer listens on, None while it does not."""
        return self._port if self._listener is not None else None

    @property
    def last_port(self) -> int | None:
        """Return the port that a passive peer listens on or listened on last: there a CONNECT is refused."""
        return self._port or None

    def snapshot(self) -> PeerSnapshot:
        """Return the frozen picture."""
        return PeerSnapshot(
            name=self.decl.name,
            active=self.decl.active,
            state=self.state,
            local=str(self._local or ""),
            remote=str(self._remote or ""),
            stalled=self.stalled,
            messages_sent=self.traffic.messages,
            bytes_sent=self.traffic.bytes_sent,
            bytes_received=self.traffic.inbox.total,
            pending=self.traffic.unsent,
            last_received=self.traffic.inbox.last[-LAST_SHOWN:],
            received_here=self.traffic.inbox.count,
            replies=self.traffic.replies.snapshot(),
        )

    # -- commands ------------------------------------------------------------------------------------

    def listen(self) -> str:
        """Open the listener of a passive peer; one that is open stays."""
        if self._listener is not None:
            return ""
        assert isinstance(self.decl.end, Endpoint)
        handle = self._socket(Endpoint(self.decl.end.address, self._port))
        if isinstance(handle, Fault):
            return self._failed("cannot listen", handle)
        fault = self._kernel.listen(handle, BACKLOG)
        if fault is not None:
            self._kernel.close(handle)
            return self._failed("cannot listen", fault)
        self._listener, self._local = handle, self._kernel.local_end(handle)
        if self._local is not None:
            self._port = self._local.port  # a free port, once taken, is kept
        self._note("listening", str(self._local))
        return ""

    def connect(self, now: int) -> str:
        """Begin one attempt of an active peer; a refusal is told by the ledger and is no error."""
        if self._handle is not None or self._attempt is not None:
            self._note("connects already")
            return ""
        self._now = now
        self._ended = ("closed",)
        end = self.decl.end if isinstance(self.decl.end, Endpoint) else self._resolve(self.decl.end[1:])
        if end is None:
            self._refused(f"{self.decl.end} does not listen")
            return ""
        handle = self._socket(self.decl.source)
        if isinstance(handle, Fault):
            return self._failed("cannot connect", handle)
        self._attempt, self._remote = handle, end
        fault = self._kernel.connect(handle, end)
        if fault is not None:
            self._withdraw()
            self._refused(str(fault))
        else:
            self._look()
        return ""

    def close(self) -> str:
        """Send FIN; without a connection, withdraw the attempt or stop to listen."""
        if self._handle is not None:
            self._close_connection(self._handle)
        elif self._attempt is not None:
            self._withdraw()
            self._note("attempt withdrawn")
        elif self._listener is not None:
            self._kernel.close(self._listener)
            self._listener = None
            self._note("stopped listening")
        return ""

    def _close_connection(self, handle: Handle) -> None:
        self._read(handle)  # unread bytes would turn the FIN into a RST
        if self._handle is not None:  # else the partner was faster
            self._kernel.shutdown(handle)
            self._kernel.close(handle)
            self._end(("closed",), "closed")

    def rst(self) -> str:
        """Send RST; without a connection nothing is sent."""
        if self._handle is not None:
            self._kernel.abort(self._handle)
            self._end(("reset", "closed"), "sent RST")
        else:
            self._note("nothing to reset")
        return ""

    def shutdown(self) -> str:
        """Send FIN but go on reading (half-close)."""
        if self._handle is None or self._half_closed:
            self._note("nothing to shut down")
            return ""
        fault = self._kernel.shutdown(self._handle, both=False)
        self._half_closed = True
        self._note("half closed", str(fault or ""))
        self._drop_unsent()
        return ""

    def stall(self) -> str:
        """Stop reading, so that the partner's window closes."""
        self.stalled = True
        self._note("stopped reading")
        return ""

    def resume(self) -> str:
        """Read again."""
        self.stalled = False
        self._note("reads again")
        return ""

    def send(self, send: PeerSend, now: int, number: int = 0) -> str:
        """Send a message, at once as far as the stack takes it; the rest goes on in `step`.

        `number` is filled in where the message has a place for it.
        """
        wrong = self._obstacle()
        if not wrong:
            self.traffic.put(send, now, number)
            self._go_on(now)
        return wrong

    def play(self, sequence: PeerPlay, now: int) -> str:
        """Send the messages of a sequence one after the other, each behind its pause."""
        wrong = self._obstacle()
        if not wrong:
            for pause_ns, send in sequence.steps:
                self.traffic.put(send, now, pause_ns=pause_ns)
            self._go_on(now)
        return wrong

    def _obstacle(self) -> str:
        """Return what keeps a message from being sent, or ""."""
        if self._handle is None:
            return f"{self.decl.name} is {self.state}, not connected"
        return f"{self.decl.name} has shut down its sending side" if self._half_closed else ""

    def _go_on(self, now: int) -> None:
        self._now = now
        assert self._handle is not None
        self._send_due(self._handle)

    def end(self) -> None:
        """Free every socket; the run is over."""
        for handle in (self._handle, self._attempt):
            if handle is not None:
                self._kernel.abort(handle)
        if self._listener is not None:
            self._kernel.close(self._listener)
        self._handle = self._attempt = self._listener = None

    # -- between scans -------------------------------------------------------------------------------

    def step(self, now: int) -> None:
        """Look for a verdict, read what has arrived, accept, send what is due; time in ns of the run."""
        self._now = now
        if self._attempt is not None:
            self._look()
        if self._handle is not None:
            self._watch(self._handle) if self.stalled else self._read(self._handle)
        if self._listener is not None:
            self._accept(self._listener)
        if self._handle is not None:
            self._send_due(self._handle)

    def _look(self) -> None:
        assert self._attempt is not None
        verdict = self._kernel.connect_result(self._attempt)
        if verdict is None:
            handle, self._attempt = self._attempt, None
            assert self._remote is not None
            self._connected(handle, self._remote)
        elif isinstance(verdict, Fault):
            self._withdraw()
            self._refused(str(verdict))

    def _accept(self, listener: Handle) -> None:
        for _ in range(MOST_ACCEPTS):
            got = self._kernel.accept(listener)
            if not isinstance(got, Accepted):
                return
            # The newest wins: the PLC that comes again after a silent loss is not turned away for ever.
            if self._handle is not None:
                self._kernel.abort(self._handle)
                self._end(("reset", "closed"), "reset for a newer connection")
            self._kernel.set_options(got.handle, self._options)
            self._connected(got.handle, got.peer)

    def _connected(self, handle: Handle, remote: Endpoint) -> None:
        self._handle, self._remote = handle, remote
        self._local = self._kernel.local_end(handle)
        self._half_closed = False
        self.traffic.begin(str(self._local or ""), str(remote))
        self._note("connected", f"{self._local} to {remote}")

    def _watch(self, handle: Handle) -> None:
        """Notice the end of a connection that nobody reads, as far as a stack tells it."""
        loss = self._kernel.loss(handle)
        if loss is not None and loss.fault is not None:
            self._lost(handle, loss.fault)
        elif loss is not None and not loss.unread:
            self._partner_closed(handle)

    def _read(self, handle: Handle) -> None:
        ending = self.traffic.read(handle, self._now, not self._half_closed)
        if isinstance(ending, Fault):
            self._lost(handle, ending)
        elif ending is FIN:
            self._partner_closed(handle)

    def _send_due(self, handle: Handle) -> None:
        fault = self.traffic.send_due(handle, self._now)
        if fault is not None:
            self._lost(handle, fault)

    # -- ends ----------------------------------------------------------------------------------------

    def _partner_closed(self, handle: Handle) -> None:
        self._kernel.close(handle)
        self._end(("closed",), "partner closed")

    def _lost(self, handle: Handle, fault: Fault) -> None:
        self._kernel.abort(handle)
        self._end(("reset",), "lost", str(fault))

    def _end(self, words: tuple[str, ...], what: str, detail: str = "") -> None:
        self._handle, self._ended = None, words
        self._note(what, detail)
        self._drop_unsent()

    def _drop_unsent(self) -> None:
        unsent = self.traffic.drop_unsent()
        if unsent:
            self._note("not sent", f"{unsent} bytes")

    def _withdraw(self) -> None:
        assert self._attempt is not None
        self._kernel.abort(self._attempt)
        self._attempt = None

    def _refused(self, why: str) -> None:
        self._ended = ("refused",)
        self._note("refused", why)

    def _socket(self, local: Endpoint | None) -> Handle | Fault:
        """Return a socket with the peer's options, bound where an end is given."""
        handle = self._kernel.socket(self.decl.name)
        if isinstance(handle, Fault):
            return handle
        self._kernel.set_options(handle, self._options)
        if local is not None:
            fault = self._kernel.set_reuse(handle) or self._kernel.bind(handle, local)
            if fault is not None:
                self._kernel.close(handle)
                return fault
        return handle

    def _failed(self, what: str, fault: Fault) -> str:
        self._note(what, str(fault))
        return f"{self.decl.name} {what}: {fault}"

    def _note(self, what: str, detail: str = "") -> None:
        self._journal(BenchNote(self.decl.name, what, detail))
