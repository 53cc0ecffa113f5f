"""A kernel in front of an inner kernel: it runs the session (ISO-on-TCP, TLS) that a CONNECT asks for.

For the callers, a connection is up when its session is up. `connect_result` and `accept` wait for the
handshake. `recv` and `recv_from` return the session's unpacked data. Calls for other handles go to the
inner kernel.
Rule 1: `poll` reads a limited number of bytes, and so does each call that finds no data.
Rule 2: a client that sends nothing, too much, or nonsense is dropped. The ledger has a note on each dropped
client, on each session that ends by itself, and on ignored TPDUs.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Final, Protocol

from trcvtui.net.connection.resources import BudgetShare, ScanBudget
from trcvtui.net.events import EventKind
from trcvtui.net.kernel import DRAIN_BYTES, Handle, Kernel, KernelLoss, KernelProxy, NewClient, SocketOptions
from trcvtui.net.layer import LayerSettings
from trcvtui.net.layers.layered_stream import (
    CLIENTS_QUEUED,
    SESSION_ENDED,
    TPDU_IGNORED,
    ErrorHandler,
    LayeredStream,
    LayerNote,
    ListeningConnect,
    NoteSink,
    SharedListener,
    find_asking_session,
    raise_error,
)
from trcvtui.net.results import HELD_BACK, WOULD_BLOCK, Datagram, Endpoint, Fault, Unread, WouldBlock

# Less than a CONNECT's own limit of an attempt (5 s): so a partner that accepts and is silent shows another
# error than one that cannot be reached.
ATTEMPT_LIMIT_NS: Final = 4_000_000_000  # ns


class ReadyListKernel(Kernel, Protocol):
    """A kernel that can say which handles its last poll saw."""

    def ready_handles(self) -> Mapping[Handle, str] | None:
        """Return the handles with their owners, or None if every handle must be tried."""


def unknown_ready_handles() -> Mapping[Handle, str] | None:
    return None


class LayerKernel(KernelProxy):
    """`clock` returns the time in ns. `report_note` is called with each note for the ledger.

    If a session raises an exception, `report_error` gets it, and the session is ended. With `polls`,
    clients are put into the poll set before they are accepted. Without `polls`, there is no poll set.
    `work` is a work budget that others use, too. If `work` is None, this kernel makes its own budget.
    """

    def __init__(
        self,
        inner: Kernel,
        clock: Callable[[], int],
        report_note: NoteSink,
        report_error: ErrorHandler = raise_error,
        polls: bool = True,
        work: ScanBudget | None = None,
    ) -> None:
        super().__init__(inner)
        self._work = work or ScanBudget()
        self._begins = work is None  # else its owner says when a scan begins
        self._clock = clock
        self._report_note, self._report_error = report_note, report_error
        self._polls = polls
        self._owners: dict[Handle, str] = {}
        self._wanted: dict[Handle, LayerSettings] = {}
        self._fixed: set[Handle] = set()  # bound to a chosen local port
        self._ends: dict[Handle, Endpoint] = {}  # of handles that share the port of an earlier listener
        self._connecting: dict[Handle, Endpoint] = {}
        self._streams: dict[Handle, LayeredStream] = {}
        self._listeners: dict[Handle, SharedListener] = {}  # by member
        self._ports: dict[Endpoint, SharedListener] = {}
        self._free_ports: dict[str, int] = {}  # by address: the port that was taken for port 0, to share it
        self._ready_inside: Callable[[], Mapping[Handle, str] | None]
        self._ready_inside = getattr(inner, "ready_handles", unknown_ready_handles)

    # -- what the poll saw ---------------------------------------------------------------------------------

    def poll(self) -> None:
        """Poll the inner kernel and the listeners; read streams that have bytes, flush all others."""
        if self._begins:
            self._work.begin_scan(self._clock())
        self.inner.poll()
        for listener in self._listeners_in_turn():
            try:
                if not listener.has_failed:
                    listener.poll(self._clock())
            except Exception as error:  # a fault in one session must not end the scan of all others
                listener.has_failed = True
                self._report_error(listener.owner, error)
        for handle, stream in self._streams.items():
            try:
                if stream.has_backlog or self.inner.readable(handle):
                    stream.pump()
                else:
                    stream.flush()
                if not stream.has_failed:
                    stream.limit_message_time(self._clock())
                    self._report_notes(handle, stream)
            except Exception as error:
                self._report_error(self._owners.get(handle, ""), error)
                stream.fail()

    def _listeners_in_turn(self) -> list[SharedListener]:
        listeners = list(dict.fromkeys(self._listeners.values()))
        first = self._work.scan % len(listeners) if listeners else 0  # else the first could use up all work
        return listeners[first:] + listeners[:first]

    def _make_share(self, handle: Handle, settings: LayerSettings) -> BudgetShare:
        return BudgetShare(
            self._work,
            self._owners.get(handle, ""),
            EventKind.TPDUS_WAIT if settings.is_message_oriented else EventKind.RECORDS_WAIT,
        )

    def _report_notes(self, handle: Handle, stream: LayeredStream) -> None:
        owner, partner = self._owners.get(handle, ""), str(stream.peer)
        for remark in stream.session.take_remarks():
            self._report_note(LayerNote(owner, TPDU_IGNORED, partner, remark))
        end = stream.take_end_text()
        if end:
            self._report_note(LayerNote(owner, SESSION_ENDED, partner, end))

    def readable(self, handle: Handle) -> bool:
        """Return whether there is something to read, an end, or a client that has finished its handshake."""
        member = self._find_member(handle)
        if member is not None:
            return bool(member.ready)
        stream = self._streams.get(handle)
        if stream is None:
            return self.inner.readable(handle)
        return self._has_news(stream) or self.inner.readable(handle)

    def renew(self, handle: Handle) -> bool:
        is_gone = self.inner.renew(handle)
        stream = self._streams.get(handle)
        if stream is None or is_gone:
            return is_gone
        stream.pump()  # the partner may have ended inside the session (close_notify, DR)
        return stream.is_over or stream.end_fault is not None

    @staticmethod
    def _has_news(stream: LayeredStream) -> bool:
        return stream.session.has_data or stream.is_over or stream.session.ended is not None

    def ready_handles(self) -> Mapping[Handle, str] | None:
        seen = self._ready_inside()
        if seen is None:
            return None
        more = {handle: self._owners[handle] for handle, one in self._streams.items() if self._has_news(one)}
        for listener in set(self._listeners.values()):
            more |= {h: member.owner for h, member in listener.members.items() if member.ready}
        return {**seen, **more} if more else seen

    # -- set-up ----------------------------------------------------------------------------------------------

    def socket(self, owner: str) -> Handle | Fault:
        made = self.inner.socket(owner)
        if not isinstance(made, Fault):
            self._owners[made] = owner
        return made

    def set_options(self, handle: Handle, options: SocketOptions) -> tuple[str, ...]:
        """Set the options. A client's options name its CONNECT: then the client's handshake is answered."""
        refused = self.inner.set_options(handle, options)
        stream = self._streams.get(handle)
        if stream is None:
            if options.session is not None:
                self._wanted[handle] = options.session
        elif (choice := find_asking_session(stream.session)) is not None and options.session is not None:
            choice.accept_for(options.session)
            stream.flush()
        return refused

    def bind(self, handle: Handle, end: Endpoint) -> Fault | None:
        """Bind to a local address and port; a port that CONNECTs share is bound once."""
        wanted = self._wanted.get(handle)
        if wanted is None or not wanted.shares_port:
            if wanted is not None and end.port:  # see `abort`
                self._fixed.add(handle)
            return self.inner.bind(handle, end)
        end = end if end.port else Endpoint(end.address, self._free_ports.get(end.address, 0))
        if end in self._ports:
            self._ends[handle] = end
            return None
        fault = self.inner.bind(handle, end)
        bound = self.inner.local_end(handle) if fault is None and not end.port else None
        if bound is not None:
            self._free_ports[end.address] = bound.port
        return fault

    def listen(self, handle: Handle, backlog: int) -> Fault | None:
        """Start to listen, or join the CONNECTs that listen on the same port."""
        wanted = self._wanted.get(handle)
        if wanted is None:
            return self.inner.listen(handle, backlog)
        joined = self._ports.get(self._ends[handle]) if handle in self._ends else None
        if joined is None:
            fault = self.inner.listen(handle, max(backlog, CLIENTS_QUEUED))
            if fault is not None:
                return fault
            party = BudgetShare(self._work, self._owners.get(handle, ""), EventKind.CLIENTS_WAIT)
            joined = SharedListener(
                self.inner, handle, self._report_note, self._polls, party, self._report_error
            )
            end = self.inner.local_end(handle)
            if wanted.shares_port and end is not None:
                self._ports[end] = joined
        joined.members[handle] = ListeningConnect(self._owners.get(handle, ""), wanted)
        self._listeners[handle] = joined
        return None

    def local_end(self, handle: Handle) -> Endpoint | None:
        return self._ends.get(handle) or self.inner.local_end(handle)

    def poll_add(self, handle: Handle) -> Fault | None:
        # In the poll set already: an accepted client with a session, and the listener of a shared port.
        if handle in self._ends or (handle in self._streams and handle not in self._connecting):
            return None
        return self.inner.poll_add(handle)

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        """Take one client that has finished its handshake, or has asked for this CONNECT."""
        member = self._find_member(handle)
        if member is None:
            return self.inner.accept(handle)
        if not member.ready:  # a client may have come since the poll
            self._listeners[handle].poll(self._clock())
        if not member.ready:
            return WOULD_BLOCK
        got = member.ready.popleft()
        if isinstance(got, Fault):
            return got
        self._streams[got.handle] = got
        self._owners[got.handle] = member.owner
        got.party = self._make_share(got.handle, member.settings)
        return NewClient(got.handle, got.peer)

    def connect(self, handle: Handle, end: Endpoint) -> Fault | None:
        fault = self.inner.connect(handle, end)
        if fault is None and handle in self._wanted:
            self._connecting[handle] = end
        return fault

    def connect_result(self, handle: Handle) -> WouldBlock | Fault | None:
        """Return None when the session is up, WOULD_BLOCK before that, or a Fault, only once."""
        end = self._connecting.get(handle)
        if end is None:
            return self.inner.connect_result(handle)
        stream = self._streams.get(handle)
        if stream is None:
            verdict = self.inner.connect_result(handle)
            if verdict is not None:
                return verdict
            wanted, since = self._wanted[handle], self._clock()
            place = handle, end, wanted.make_session(is_active=True), since, self._make_share(handle, wanted)
            stream = self._streams[handle] = LayeredStream(self.inner, *place)
        stream.pump()
        if stream.session.is_up:
            del self._connecting[handle]
            return None
        if stream.end_fault is not None or stream.is_over:  # a FIN in the handshake counts as a reset
            return stream.end_fault or Fault("session", "ECONNRESET")
        if self._clock() - stream.since >= ATTEMPT_LIMIT_NS:
            stream.time_out("no handshake in 4 s")
        return stream.end_fault or WOULD_BLOCK

    # -- data ------------------------------------------------------------------------------------------------

    def recv(self, handle: Handle, into: memoryview) -> int | WouldBlock | Fault:
        stream = self._streams.get(handle)
        if stream is None:
            return self.inner.recv(handle, into)
        got = stream.read(into)
        if got is not None:
            return len(got.data)
        if stream.is_held_back:  # before the end: bytes that were not looked at come first
            return HELD_BACK
        if stream.end_fault is not None:
            return stream.end_fault
        return 0 if stream.is_over else WOULD_BLOCK

    def recv_from(self, handle: Handle, into: memoryview) -> Datagram | WouldBlock | Fault:
        """Take one message. This call does not report the end of a session: `loss` does."""
        stream = self._streams.get(handle)
        if stream is None:
            return self.inner.recv_from(handle, into)
        got = stream.read(into)
        if got is None:
            return HELD_BACK if stream.is_held_back else WOULD_BLOCK
        return Datagram(len(got.data), stream.peer, got.whole)

    def send(self, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
        stream = self._streams.get(handle)
        return self.inner.send(handle, data) if stream is None else stream.send(data)

    def loss(self, handle: Handle) -> KernelLoss | None:
        stream = self._streams.get(handle)
        if stream is None:
            return self.inner.loss(handle)
        if stream.end_fault is not None or stream.is_over:
            return KernelLoss(stream.end_fault, self.unread(handle))
        return self.inner.loss(handle)

    def unread(self, handle: Handle) -> int:
        """Return how many received bytes are unread: in the stack, and in the session."""
        stream = self._streams.get(handle)
        return self.inner.unread(handle) + (stream.session.held_bytes if stream else 0)

    def list_unread(self, handles: Collection[Handle]) -> list[Handle]:
        """Return each handle with a session, and each other handle at which something is unread."""
        plain = [
            handle for handle in handles if handle not in self._streams and handle not in self._listeners
        ]
        return self.inner.list_unread(plain) + [h for h in handles if h in self._streams]

    def peek(self, handle: Handle, skip: int) -> Unread:
        """Return what is unread. For a session, return its unpacked data; only `loss` tells its end."""
        stream = self._streams.get(handle)
        if stream is not None:
            return stream.session.unread(stream.peer, skip)
        member = self._find_member(handle)
        return self.inner.peek(handle, skip) if member is None else Unread(clients=len(member.ready))

    def discard(self, handle: Handle, most: int) -> int:
        stream = self._streams.get(handle)
        dropped = stream.session.drop_data() if stream else 0
        return dropped + self.inner.discard(handle, most)

    # -- the end ---------------------------------------------------------------------------------------------

    def shutdown(self, handle: Handle, both: bool = True) -> Fault | None:
        self._send_goodbye(handle)  # before the FIN
        return self.inner.shutdown(handle, both)

    def _send_goodbye(self, handle: Handle) -> bool:
        """Let a session send its goodbye; an exception is reported, not raised, and ends the session."""
        try:
            return handle in self._streams and self._streams[handle].send_goodbye()
        except Exception as error:
            self._report_error(self._owners.get(handle, ""), error)
            self._streams[handle].fail()
            return False

    def abort(self, handle: Handle) -> Fault | None:
        """Send RST and free the handle. A client that waits for an answer to its CR gets a DR.

        A session with a goodbye (close_notify) sends the goodbye and a FIN instead of the RST. If the local
        port is fixed, the RST is sent in any case. A FIN would block this port for a minute (TIME_WAIT).
        """
        stream = self._streams.get(handle)
        choice = None if stream is None else find_asking_session(stream.session)
        if stream is not None and choice is not None:
            choice.refuse(is_known=True)
            stream.flush()
            stream.is_end_reported = True  # the caller reports why it refused this client
        says_goodbye = choice is None and self._send_goodbye(handle) and handle not in self._fixed
        stays = self._forget(handle)
        if stays:
            return None
        if says_goodbye:  # a RST could overtake it (RFC 8446 6.1), and unread bytes would make the FIN a RST
            self.inner.discard(handle, DRAIN_BYTES)
        return self.inner.close(handle) if choice or says_goodbye else self.inner.abort(handle)

    def close(self, handle: Handle) -> Fault | None:
        self._send_goodbye(handle)
        return None if self._forget(handle) else self.inner.close(handle)

    def _forget(self, handle: Handle) -> bool:
        stream = self._streams.get(handle)
        if stream is not None and not stream.has_failed:
            self._report_notes(handle, stream)
        for known in (self._owners, self._wanted, self._streams, self._connecting):
            known.pop(handle, None)
        self._fixed.discard(handle)
        listener = self._listeners.pop(handle, None)
        joined = self._ends.pop(handle, None) is not None
        if listener is None:
            return False
        for client in listener.members.pop(handle).ready:  # no block has accepted them
            if isinstance(client, LayeredStream):
                client.send_goodbye()
                self.inner.close(client.handle)
        if listener.members:
            return not joined
        self._ports = {end: one for end, one in self._ports.items() if one is not listener}
        listener.close()
        return not joined  # the listener's own handle has just been closed

    def _find_member(self, handle: Handle) -> ListeningConnect | None:
        listener = self._listeners.get(handle)
        return listener.members[handle] if listener else None
