"""The transports of a peer: one TCP connection at a time, or one UDP socket for datagrams.

Both use only the Kernel, so a peer acts alike on real sockets and on the simulated network.
Commands return "" or what is wrong. Rule: work between scans is bounded, whatever partners do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.bench.peers.queues import PeerQueues
from trcvtui.commands.tokens import chunks
from trcvtui.commands.words import PeerSend
from trcvtui.net.broadcast import enable_broadcasts, receive_datagram
from trcvtui.net.kernel import Handle, Kernel, NewClient, SocketOptions
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock
from trcvtui.project.project import PeerDecl

BACKLOG: Final = 4
MOST_ACCEPTS: Final = 64  # this one and the next two bound a step (the rule above)
MOST_READS: Final = 64
MOST_DATAGRAMS: Final = 256
LARGEST_BYTES: Final = 65507  # payload of an IPv4 datagram: 65535 without its IP and UDP headers


class _Transport:
    """What both transports have: the peer's queues, and one local endpoint for all sockets of the peer."""

    broadcasts = False  # whether datagrams to a broadcast address are sent and received

    def __init__(
        self,
        decl: PeerDecl,
        kernel: Kernel,
        resolve: Callable[[str], Endpoint | None],
        queues: PeerQueues,
        options: SocketOptions,
    ) -> None:
        self.local: Endpoint | None = None
        self._decl = decl
        self._kernel = kernel
        self._resolve = resolve
        self._queues = queues
        self._options = options
        self._port = 0 if isinstance(decl.end, str) else decl.end.port

    @property
    def last_port(self) -> int | None:
        return self._port or None

    def _own_end(self) -> Endpoint:
        assert isinstance(self._decl.end, Endpoint)
        return Endpoint(self._decl.end.address, self._port)

    def _note_local_end(self, handle: Handle) -> None:
        self.local = self._kernel.local_end(handle)
        if self.local is not None:
            self._port = self.local.port

    def _report_failure(self, what: str, fault: Fault) -> str:
        self._queues.note(what, str(fault))
        return f"{self._decl.name} {what}: {fault}"


class StreamTransport(_Transport):
    """One TCP connection at a time, opened or accepted. A new client replaces the earlier client.

    When the partner ends the connection, the peer closes it as well. A passive peer continues to listen.
    """

    remote: Endpoint | None = None
    _listener: Handle | None = None
    _kept: Handle | None = None  # bound while it does not listen, so that no other program gets its port
    _attempt: Handle | None = None
    _handle: Handle | None = None
    _half_closed = False
    _ended: tuple[str, ...] = ()  # states that describe the end of the last connection; the first is shown
    _offset = 0  # bytes sent on this connection
    _now = 0
    _is_stalled = False

    @property
    def state(self) -> str:
        if self._handle is not None:
            return "connected"
        if self._attempt is not None:
            return "connecting"
        if self._listener is not None:
            return "listening"
        return self._ended[0] if self._ended else "closed"

    def is_in_state(self, state: str) -> bool:
        """Return whether a state word of the bench commands is true of this peer.

        `closed`, `reset` and `refused` say how the last connection or attempt ended, also while a passive
        peer listens again. After the peer's own RST, `reset` and `closed` are both true.
        """
        if state == self.state:
            return True
        return self._handle is None and self._attempt is None and state in self._ended

    @property
    def can_send(self) -> bool:
        return self._handle is not None

    # -- commands ------------------------------------------------------------------------------------

    def listen(self) -> str:
        """Open the listener of a passive peer, unless it is open."""
        if self._listener is not None:
            return ""
        handle = self._kept if self._kept is not None else self._open(self._own_end())
        self._kept = None
        if isinstance(handle, Fault):
            return self._report_failure("cannot listen", handle)
        fault = self._kernel.listen(handle, BACKLOG)
        if fault is not None:
            self._kernel.close(handle)
            return self._report_failure("cannot listen", fault)
        self._listener = handle
        self._note_local_end(handle)
        self._queues.note("listening", str(self.local))
        return ""

    def connect(self, now: int) -> str:
        """Begin one attempt of an active peer; a refusal is written into the ledger and is no error."""
        if self._handle is not None or self._attempt is not None:
            self._queues.note("connects already")
            return ""
        self._now = now
        self._ended = ("closed",)
        end = self._decl.end if isinstance(self._decl.end, Endpoint) else self._resolve(self._decl.end[1:])
        if end is None:
            self._note_refusal(f"{self._decl.end} does not listen")
            return ""
        handle = self._open(self._decl.source)
        if isinstance(handle, Fault):
            return self._report_failure("cannot connect", handle)
        self._attempt, self.remote = handle, end
        fault = self._kernel.connect(handle, end)
        if fault is not None:
            self._withdraw_attempt()
            self._note_refusal(str(fault))
        else:
            self._poll_attempt()
        return ""

    def close(self) -> str:
        """Send FIN; without a connection, withdraw the attempt or stop listening."""
        if self._handle is not None:
            self._close_connection(self._handle)
        elif self._attempt is not None:
            self._withdraw_attempt()
            self._queues.note("attempt withdrawn")
        elif self._listener is not None:
            self._kernel.close(self._listener)
            self._listener = None
            self._keep_port()
            self._queues.note("stopped listening")
        return ""

    def _keep_port(self) -> None:
        assert isinstance(self._decl.end, Endpoint)
        held = self._open(self._own_end()) if not self._decl.end.port else None  # port 0: it got a free one
        self._kept = None if isinstance(held, Fault) else held

    def _close_connection(self, handle: Handle) -> None:
        self._read(handle)  # unread bytes would turn the FIN into a RST
        if self._handle is not None:  # else the read found that the partner has closed
            self._kernel.shutdown(handle)
            self._kernel.close(handle)
            self._end_connection(("closed",), "closed")

    def rst(self) -> str:
        """Send RST; without a connection only write a note into the ledger."""
        if self._handle is not None:
            self._kernel.abort(self._handle)
            self._end_connection(("reset", "closed"), "sent RST")
        else:
            self._queues.note("nothing to reset")
        return ""

    def shutdown(self) -> str:
        """Send FIN, but continue to read (half-close)."""
        if self._handle is None or self._half_closed:
            self._queues.note("nothing to shut down")
            return ""
        fault = self._kernel.shutdown(self._handle, both=False)
        self._half_closed = True
        self._queues.note("half closed", str(fault or ""))
        self._queues.drop_unsent()
        return ""

    def obstacle(self, send: PeerSend | None = None) -> str:
        """Return why a message cannot be sent, or ""."""
        if self._handle is None:
            return f"{self._decl.name} is {self.state}, not connected"
        return f"{self._decl.name} has shut down its sending side" if self._half_closed else ""

    def free_sockets(self) -> None:
        """Free every socket at the end of the run."""
        for handle in (self._handle, self._attempt):
            if handle is not None:
                self._kernel.abort(handle)
        for handle in (self._listener, self._kept):
            if handle is not None:
                self._kernel.close(handle)
        self._handle = self._attempt = self._listener = self._kept = None

    # -- between scans -------------------------------------------------------------------------------

    def step(self, now: int, is_stalled: bool) -> None:
        """Check the attempt, read what has arrived, accept, send what is due; time in ns of the run."""
        self._now, self._is_stalled = now, is_stalled
        if self._attempt is not None:
            self._poll_attempt()
        if self._handle is not None:
            self._check_loss(self._handle) if is_stalled else self._read(self._handle)
        if self._listener is not None:
            self._accept(self._listener)
        self.send_due(now)

    def send_due(self, now: int) -> str:
        """Send as many due bytes as the stack takes; a Fault ends the connection and is no error."""
        self._now = now
        outbox = self._queues.outbox
        while self._handle is not None and (chunk := outbox.due_bytes(now)) is not None:
            got = self._kernel.send(self._handle, chunk)
            if isinstance(got, Fault):
                self._handle_loss(self._handle, got) if self._is_stalled else self._read(self._handle, got)
            elif isinstance(got, int):
                self._queues.note_sent(got, str(self.local or ""), str(self.remote), self._offset)
                self._offset += got
                outbox.count_sent(got, now)
            else:
                break
        return ""

    def _poll_attempt(self) -> None:
        assert self._attempt is not None
        verdict = self._kernel.connect_result(self._attempt)
        if verdict is None:
            handle, self._attempt = self._attempt, None
            assert self.remote is not None
            self._begin_connection(handle, self.remote)
        elif isinstance(verdict, Fault):
            self._withdraw_attempt()
            self._note_refusal(str(verdict))

    def _accept(self, listener: Handle) -> None:
        for _ in range(MOST_ACCEPTS):
            got = self._kernel.accept(listener)
            if not isinstance(got, NewClient):
                return
            # The newest wins: after a silent loss the old connection would refuse the PLC for ever.
            if self._handle is not None and not self._is_stalled:
                self._read(self._handle)  # bytes of a client that sent and left at once still count
            if self._handle is not None:
                self._kernel.abort(self._handle)
                self._end_connection(("reset", "closed"), "reset for a newer connection")
            self._kernel.set_options(got.handle, self._options)
            self._begin_connection(got.handle, got.peer)

    def _begin_connection(self, handle: Handle, remote: Endpoint) -> None:
        self._handle, self.remote = handle, remote
        self.local = self._kernel.local_end(handle)
        self._half_closed = False
        self._offset = 0
        self._queues.begin_connection()
        self._queues.note("connected", f"to {remote}", str(self.local or ""))

    def _check_loss(self, handle: Handle) -> None:
        loss = self._kernel.loss(handle)
        if loss is not None and loss.fault is not None:
            self._handle_loss(handle, loss.fault)
        elif loss is not None and not loss.unread:
            self._handle_partner_end(handle)

    def _read(self, handle: Handle, lost: Fault | None = None) -> None:
        """Read what has arrived. If a send has failed with `lost`, handle that after the arrived bytes."""
        for _ in range(MOST_READS):
            got = self._kernel.recv(handle, self._queues.landing)
            if lost is not None and not (isinstance(got, int) and got):
                got = lost
            if isinstance(got, WouldBlock):
                return
            if isinstance(got, Fault):
                self._handle_loss(handle, got)
                return
            if got == 0:
                self._handle_partner_end(handle)
                return
            self._queues.handle_received(got, self._now, may_answer=not self._half_closed)

    # -- ends ----------------------------------------------------------------------------------------

    def _handle_partner_end(self, handle: Handle) -> None:
        self._kernel.close(handle)
        self._end_connection(("closed",), "partner closed")

    def _handle_loss(self, handle: Handle, fault: Fault) -> None:
        self._kernel.abort(handle)
        self._end_connection(("reset",), "lost", str(fault))

    def _end_connection(self, words: tuple[str, ...], what: str, detail: str = "") -> None:
        self._handle, self._ended = None, words
        self._queues.note(what, detail)
        self._queues.drop_unsent()

    def _withdraw_attempt(self) -> None:
        assert self._attempt is not None
        self._kernel.abort(self._attempt)
        self._attempt = None

    def _note_refusal(self, why: str) -> None:
        self._ended = ("refused",)
        self._queues.note("refused", why)

    def _open(self, local: Endpoint | None) -> Handle | Fault:
        handle = self._kernel.socket(self._decl.name)
        if isinstance(handle, Fault):
            return handle
        self._kernel.set_options(handle, self._options)
        if local is not None:
            fault = self._kernel.set_reuse(handle) or self._kernel.bind(handle, local)
            if fault is not None:
                self._kernel.close(handle)
                return fault
        return handle


class DatagramTransport(_Transport):
    """One UDP socket. Each message is a datagram to the declared `remote`, or else to the last sender."""

    _handle: Handle | None = None
    _hearing: Handle | None = None  # a second socket, for broadcasts
    _heard: Endpoint | None = None  # the last sender

    @property
    def state(self) -> str:
        """Return listening or closed: UDP has no connection."""
        return "closed" if self._handle is None else "listening"

    def is_in_state(self, state: str) -> bool:
        return state == self.state

    @property
    def can_send(self) -> bool:
        return self._handle is not None and self.remote is not None

    @property
    def remote(self) -> Endpoint | None:
        remote = self._decl.remote
        if remote is None:
            return self._heard
        return remote if isinstance(remote, Endpoint) else self._resolve(remote[1:])

    # -- commands ------------------------------------------------------------------------------------

    def listen(self) -> str:
        """Open the socket, unless it is open."""
        if self._handle is not None:
            return ""
        own = self._own_end()
        handle = self._kernel.datagram_socket(self._decl.name)
        if isinstance(handle, Fault):
            return self._report_failure("cannot listen", handle)
        fault = self._kernel.bind(handle, own)
        if fault is not None:
            self._kernel.close(handle)
            return self._report_failure("cannot listen", fault)
        self._handle, self._heard = handle, None
        self._note_local_end(handle)
        self._queues.begin_connection()
        self._queues.note("listening", f"{self.local} (UDP)")
        if self.broadcasts and self.local is not None:
            name = self._decl.name
            self._hearing, why = enable_broadcasts(self._kernel, name, handle, self.local, polled=False)
            if why:
                self._queues.note("no socket for broadcasts", why)
        return ""

    def close(self) -> str:
        """Close the socket. Unread datagrams and unsent bytes are lost."""
        if self._handle is not None:
            self.free_sockets()
            self._queues.note("stopped listening")
            self._queues.drop_unsent()
        return ""

    def connect(self, now: int) -> str:
        return self._no_connection_error("connect")

    def rst(self) -> str:
        return self._no_connection_error("rst")

    def shutdown(self) -> str:
        return self._no_connection_error("shutdown")

    def _no_connection_error(self, verb: str) -> str:
        return f"{self._decl.name} speaks UDP: there is no connection to {verb}"

    def obstacle(self, send: PeerSend | None = None) -> str:
        """Return why a message cannot be sent, or "". If `send` is None, check only for an open socket."""
        if self._handle is None:
            return f"{self._decl.name} is closed"
        if send is None:
            return ""
        if self.remote is None:
            return f"{self._decl.name} has no partner to send to: no remote is open, and no datagram has come"
        largest = max(map(len, chunks(send.payload, send.split)))
        if largest > LARGEST_BYTES:
            return f"{self._decl.name}: a datagram of {largest} bytes exceeds {LARGEST_BYTES}: use split="
        return ""

    def free_sockets(self) -> None:
        for handle in (self._handle, self._hearing):
            if handle is not None:
                self._kernel.close(handle)
        self._handle = self._hearing = None

    # -- between scans -------------------------------------------------------------------------------

    def step(self, now: int, is_stalled: bool) -> None:
        """Read what has arrived and send what is due; time in ns of the run."""
        if self._handle is not None:
            if not is_stalled:
                self._read(self._handle, now)
            self.send_due(now)

    def _read(self, handle: Handle, now: int) -> None:
        for _ in range(MOST_DATAGRAMS):
            got = receive_datagram(self._kernel, handle, self._hearing, self._queues.landing, self.local)
            if isinstance(got, Fault):
                self._queues.note("cannot receive", str(got))
            if not isinstance(got, Datagram):
                return
            if got.source != self._heard:
                self._queues.note("heard", str(got.source))
            self._heard = got.source
            self._queues.replies.reset_matchers()  # a match does not continue in the next datagram
            self._queues.handle_received(got.size, now)

    def send_due(self, now: int) -> str:
        """Send what is due. Return why a datagram failed, or "". A failed datagram is not sent later."""
        wrong, outbox = "", self._queues.outbox
        while self._handle is not None and (chunk := outbox.due_bytes(now)) is not None:
            target = self.remote
            got = None if target is None else self._kernel.send_to(self._handle, chunk, target)
            if got is WOULD_BLOCK:
                break
            if isinstance(got, int):
                self._queues.note_sent(got, str(self.local), str(target), self._queues.bytes_sent)
            else:
                why = got or "no partner to send to"
                wrong = f"{self._decl.name} cannot send: {why}"
                self._queues.note("not sent", f"{len(chunk)} bytes: {why}")
            outbox.count_sent(len(chunk), now)
        return wrong
