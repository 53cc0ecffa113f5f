"""The partner that speaks UDP: one socket, a datagram a message, commanded and stepped like the TCP peer.

It sends to the `remote` of the file, else to whoever was heard last. Commands that need a connection answer
one line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault
from trcvtui.plc.ledger import BenchNote, Event, PeerSent
from trcvtui.project.project import PeerDecl
from trcvtui.rig.commands.inbox import Inbox
from trcvtui.rig.commands.payload import chunks
from trcvtui.rig.commands.words import PeerPlay, PeerSend
from trcvtui.rig.peers.outbox import Outbox
from trcvtui.rig.peers.peer import LAST_SHOWN, PEER_OPTIONS, Peer
from trcvtui.rig.peers.replies import Replies
from trcvtui.rig.snapshots import PeerSnapshot

READ_BYTES: Final = 65536  # no datagram is larger
LARGEST: Final = 65507
MOST_READS: Final = 256  # a flood costs bounded work between two scans


class UdpPeer:
    """One peer. Commands answer "" or what is wrong; `step` does what goes on by itself."""

    def __init__(
        self,
        decl: PeerDecl,
        kernel: Kernel,
        resolve: Callable[[str], Endpoint | None],
        journal: Callable[[Event], None],
    ) -> None:
        self.decl = decl
        self.stalled = False
        self.inbox = Inbox()
        self.replies = Replies()
        self.messages = self.bytes_sent = 0
        self._kernel = kernel
        self._resolve = resolve
        self._journal = journal
        self._outbox = Outbox()
        self._buffer = memoryview(bytearray(READ_BYTES))
        self._handle: Handle | None = None
        self._local: Endpoint | None = None
        self._heard: Endpoint | None = None  # who sent last
        self._port = 0 if isinstance(decl.end, str) else decl.end.port

    # -- what others ask -----------------------------------------------------------------------------

    @property
    def state(self) -> str:
        """Return listening or closed: there is no connection that could be anything else."""
        return "closed" if self._handle is None else "listening"

    @property
    def can_send(self) -> bool:
        """Return whether a message could go now."""
        return self._handle is not None and self._target() is not None

    def is_in(self, state: str) -> bool:
        """Return whether a state word of the bench commands is true."""
        return state == self.state

    def has_received(self, payload: bytes) -> bool:
        """Return whether the datagrams of this socket, or all since this last was true, hold these bytes."""
        return self.inbox.is_exactly(payload)

    @property
    def last_port(self) -> int | None:
        """Return the port that it receives on, or received on last."""
        return self._port or None

    def snapshot(self) -> PeerSnapshot:
        """Return the frozen picture."""
        return PeerSnapshot(
            name=self.decl.name,
            active=False,
            state=self.state,
            local=str(self._local or ""),
            remote=str(self._target() or ""),
            stalled=self.stalled,
            messages_sent=self.messages,
            bytes_sent=self.bytes_sent,
            bytes_received=self.inbox.total,
            pending=self._outbox.unsent,
            last_received=self.inbox.last[-LAST_SHOWN:],
            received_here=self.inbox.count,
            udp=True,
            replies=self.replies.snapshot(),
        )

    # -- commands ------------------------------------------------------------------------------------

    def listen(self) -> str:
        """Open the socket; one that is open stays."""
        if self._handle is not None:
            return ""
        assert isinstance(self.decl.end, Endpoint)
        handle = self._kernel.datagram_socket(self.decl.name)
        if isinstance(handle, Fault):
            return self._failed(handle)
        fault = self._kernel.bind(handle, Endpoint(self.decl.end.address, self._port))
        if fault is not None:
            self._kernel.close(handle)
            return self._failed(fault)
        self._handle, self._local, self._heard = handle, self._kernel.local_end(handle), None
        if self._local is not None:
            self._port = self._local.port  # a free port, once taken, is kept
        self.inbox.begin()
        self._note("listening", f"{self._local} (UDP)")
        return ""

    def _failed(self, fault: Fault) -> str:
        self._note("cannot listen", str(fault))
        return f"{self.decl.name} cannot listen: {fault}"

    def close(self) -> str:
        """Close the socket; what waits in it, and what is still to be sent, is gone."""
        if self._handle is not None:
            self._kernel.close(self._handle)
            self._handle = None
            self._note("stopped listening")
            unsent = self._outbox.clear()
            if unsent:
                self._note("not sent", f"{unsent} bytes")
        return ""

    def stall(self) -> str:
        """Stop reading, so that the queue of the stack fills and drops what is newer."""
        self.stalled = True
        self._note("stopped reading")
        return ""

    def resume(self) -> str:
        """Read again."""
        self.stalled = False
        self._note("reads again")
        return ""

    @property
    def unsent(self) -> int:
        """Return how many bytes are still to come."""
        return self._outbox.unsent

    def send(self, send: PeerSend, now: int, number: int = 0) -> str:
        """Send a message as one datagram, or one for each piece of `split`; the rest goes on in `step`."""
        if self._handle is None:
            return f"{self.decl.name} is closed"
        if self._target() is None:
            return f"{self.decl.name} has nobody to send to: no remote that is open, and nobody was heard"
        largest = max(map(len, chunks(send.payload, send.split)))
        if largest > LARGEST:
            return f"{self.decl.name}: a datagram of {largest} bytes; at most {LARGEST}, so use split="
        self._outbox.put(send, now, number)
        return self._send_due(self._handle, now)

    def play(self, sequence: PeerPlay, now: int) -> str:
        """Send the messages of a sequence one after the other, each behind its pause."""
        if self._handle is None:
            return f"{self.decl.name} is closed"
        for pause_ns, send in sequence.steps:
            self._outbox.put(send, now, pause_ns=pause_ns)
        return self._send_due(self._handle, now)

    def connect(self, now: int) -> str:
        """Refuse."""
        return self._no_connection("connect")

    def rst(self) -> str:
        """Refuse."""
        return self._no_connection("rst")

    def shutdown(self) -> str:
        """Refuse."""
        return self._no_connection("shutdown")

    def _no_connection(self, verb: str) -> str:
        return f"{self.decl.name} speaks UDP: there is no connection to {verb}"

    def end(self) -> None:
        """Free the socket; the run is over."""
        if self._handle is not None:
            self._kernel.close(self._handle)
            self._handle = None

    # -- between scans -------------------------------------------------------------------------------

    def step(self, now: int) -> None:
        """Read what has arrived and send what is due; time in ns of the run."""
        if self._handle is not None:
            if not self.stalled:
                self._read(self._handle, now)
            self._send_due(self._handle, now)

    def _read(self, handle: Handle, now: int) -> None:
        for _ in range(MOST_READS):
            got = self._kernel.recv_from(handle, self._buffer)
            if isinstance(got, Fault):
                self._note("cannot receive", str(got))
            if not isinstance(got, Datagram):
                return
            if got.source != self._heard:
                self._note("heard", str(got.source))
            self._heard = got.source
            self.inbox.take(self._buffer[: got.size])
            if self.replies:
                self._answer(bytes(self._buffer[: got.size]), now)

    def _answer(self, datagram: bytes, now: int) -> None:
        self.replies.begin()  # nothing is looked for across datagrams
        for send, number in self.replies.take(datagram, now, self._outbox.room):
            self._outbox.put(send, now, number)

    def _target(self) -> Endpoint | None:
        remote = self.decl.remote
        if remote is None:
            return self._heard
        return remote if isinstance(remote, Endpoint) else self._resolve(remote[1:])

    def _send_due(self, handle: Handle, now: int) -> str:
        """Send what is due; return why a datagram did not go. It is not tried again."""
        wrong = ""
        while (chunk := self._outbox.due(now)) is not None:
            target = self._target()
            got = None if target is None else self._kernel.send_to(handle, chunk, target)
            if got is WOULD_BLOCK:
                break
            if isinstance(got, int):
                self._sent(got, str(target))
            else:
                why = got or "nobody to send to"
                wrong = f"{self.decl.name} cannot send: {why}"
                self._note("not sent", f"{len(chunk)} bytes: {why}")
            self._outbox.taken(len(chunk), now)
        return wrong

    def _sent(self, count: int, target: str) -> None:
        size = self._outbox.message_begins
        if size:
            self.messages += 1
            ends = str(self._local), target
            self._journal(PeerSent(self.decl.name, self.messages, *ends, self.bytes_sent, size))
        self.bytes_sent += count

    def _note(self, what: str, detail: str = "") -> None:
        self._journal(BenchNote(self.decl.name, what, detail))


AnyPeer = Peer | UdpPeer


def new_peer(
    decl: PeerDecl,
    kernel: Kernel,
    resolve: Callable[[str], Endpoint | None],
    journal: Callable[[Event], None],
    small_buffers: bool = False,
) -> AnyPeer:
    """Return the peer of a declaration; `small_buffers`: as small as those of the PLC's CONNECTs."""
    if decl.udp:
        return UdpPeer(decl, kernel, resolve, journal)
    options = replace(PEER_OPTIONS, small_buffers=small_buffers, session=decl.session)
    return Peer(decl, kernel, resolve, journal, options)
