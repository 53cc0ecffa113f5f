"""What the ledger says about bytes, believed line by line: whose they were, and where each of them ended."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from trcvtui.blocks.environment import ReceiveEnded, ReceiveStarted, SendEnded, SendStarted
from trcvtui.net.events import BytesDropped, BytesReceived, BytesSent, ConnectionChanged, EventKind
from trcvtui.plc.ledger import BenchNote, Line
from trcvtui.project.project import InstanceDecl

Ends = tuple[str, str]  # who says it, to whom
THE_END = {EventKind.PARTNER_CLOSED, EventKind.LOST, EventKind.DISCONNECTED, EventKind.RESET}


@dataclass
class Link:
    """One TCP connection of a CONNECT, as the PLC sees it. Sizes in bytes."""

    local: str
    peer: str
    received: int = 0
    dropped_unread: int = 0
    is_over: bool = False


@dataclass
class Receiving:
    """A receive job: the stretches of the stream that it has and that have no end yet."""

    link: Link
    spans: list[tuple[int, int]] = field(default_factory=list)

    def strike_out(self, offset: int, size: int) -> bool:
        """Take these bytes out; return whether the job had exactly them at one of its stretches' ends."""
        for place, (start, length) in enumerate(self.spans):
            if start <= offset and offset + size == start + length:
                self.spans[place : place + 1] = [(start, offset - start)] if offset > start else []
                return True
        return False


@dataclass
class Sending:
    """A send job: the frame, and how many of its bytes the stack has."""

    link: Link
    frame: bytes
    taken: int = 0


class ByteModel:
    """Feed it every line of the ledger; it asserts that no byte is lost, doubled, or told wrongly."""

    def __init__(self, data: dict[str, int], decls: tuple[InstanceDecl, ...]) -> None:
        self.data = {name: bytes(size) for name, size in data.items()}
        self.decls = {decl.name: decl for decl in decls}
        self.created: deque[InstanceDecl] = deque()  # what is to come, in the order of the commands
        self.changes: deque[tuple[str, Callable[[bytes], bytes]]] = deque()
        self.said: dict[Ends, bytearray] = {}
        self.finished: dict[Ends, int] = {}  # FIN after so many bytes, seen by the PLC before it next acts
        self.ended: set[Ends] = set()  # FIN or RST seen by the PLC before it next acts
        self.links: dict[tuple[str, int], Link] = {}
        self.receiving: dict[str, Receiving] = {}
        self.sending: dict[str, Sending] = {}
        self.began: list[str] = []  # whose jobs began in this scan
        self.done: list[str] = []  # whose jobs ended well in this scan
        self.anew: list[str] = []  # which instances began anew in this scan

    def read(self, news: tuple[Line, ...]) -> None:
        self.began, self.done, self.anew = [], [], []
        for line in news:
            match line.event:
                case ConnectionChanged():
                    self._connection(line.event)
                case BytesReceived() | BytesDropped() | ReceiveStarted() | ReceiveEnded():
                    self._receive(line.event)
                case BytesSent() | SendStarted() | SendEnded():
                    self._send(line.event)
                case BenchNote(name, what):
                    self._bench(name, what)

    # -- the program changes -------------------------------------------------------------------------

    def _bench(self, name: str, what: str) -> None:
        if what in ("written", "resized"):
            data, change = self.changes.popleft()
            assert data == name
            self.data[name] = change(self.data[name])
        elif what == "created":
            decl = self.created.popleft()
            assert decl.name == name
            self.decls[name] = decl
        if what in ("created", "downloaded"):
            self.anew.append(name)

    # -- connections ---------------------------------------------------------------------------------

    def _connection(self, note: ConnectionChanged) -> None:
        key = note.connection, note.incarnation
        if note.what is EventKind.CONNECTED:
            assert key not in self.links
            self.links[key] = Link(note.local, note.peer)
            for ends in ((note.local, note.peer), (note.peer, note.local)):
                self.said.setdefault(ends, bytearray())
        elif note.what in THE_END:
            link = self.links[key]
            assert not link.is_over
            link.is_over = True
            said = self.finished.get((link.peer, link.local))
            if note.what is EventKind.PARTNER_CLOSED and said is not None:
                assert link.received + link.dropped_unread == said, "FIN overtakes no byte"

    def _link(self, connection: str, incarnation: int) -> Link:
        link = self.links[connection, incarnation]
        assert not link.is_over, "nothing moves after the end of a connection"
        return link

    # -- received bytes ------------------------------------------------------------------------------

    def _receive(self, event: BytesReceived | BytesDropped | ReceiveStarted | ReceiveEnded) -> None:
        match event:
            case ReceiveStarted(instance, _, name, incarnation, offset):
                assert instance not in self.receiving
                link = self._link(name, incarnation)
                assert offset == link.received
                self.receiving[instance] = Receiving(link)
                self.began.append(instance)
            case BytesReceived(name, incarnation, _, offset, size, instance):
                job, link = self.receiving[instance], self._link(name, incarnation)
                assert job.link is link
                assert offset == link.received, "no byte is lost or doubled"
                link.received += size
                if job.spans and sum(job.spans[-1]) == offset:
                    offset, first = job.spans.pop()
                    size += first
                job.spans.append((offset, size))
            case BytesDropped(name, incarnation, -1, size):
                self._link(name, incarnation).dropped_unread += size
            case BytesDropped(name, incarnation, offset, size, reason):
                link = self.links[name, incarnation]
                jobs = [job for job in self.receiving.values() if job.link is link]
                assert reason and any(job.strike_out(offset, size) for job in jobs), "dropped once"
            case ReceiveEnded():
                self._receive_ended(event)

    def _receive_ended(self, event: ReceiveEnded) -> None:
        job = self.receiving.pop(event.instance)
        if not event.done:
            assert not job.spans, "bytes that do not reach DATA are named, with a reason"
            return
        assert event.size == sum(size for _, size in job.spans)
        assert not job.spans or event.offset == job.spans[0][0]
        self.done.append(event.instance)
        said = self.said[job.link.peer, job.link.local]
        frame = b"".join(said[offset : offset + size] for offset, size in job.spans)
        assert len(frame) == event.size, "only what was said can be received"
        name = self.decls[event.instance].data
        assert name is not None
        self.data[name] = frame + self.data[name][len(frame) :]

    # -- sent bytes ----------------------------------------------------------------------------------

    def _send(self, event: BytesSent | SendStarted | SendEnded) -> None:
        match event:
            case SendStarted(instance, _, name, incarnation, offset, length):
                assert instance not in self.sending
                link = self._link(name, incarnation)
                assert offset == len(self.said[link.local, link.peer])
                data = self.decls[instance].data
                assert data is not None
                self.sending[instance] = Sending(link, self.data[data][:length])
                assert 0 < length <= len(self.data[data])
                self.began.append(instance)
            case BytesSent(name, incarnation, _, offset, size, instance):
                job, link = self.sending[instance], self._link(name, incarnation)
                said = self.said[link.local, link.peer]
                assert job.link is link and offset == len(said)
                said += job.frame[job.taken : job.taken + size]
                job.taken += size
            case SendEnded(instance, _, _, _, _, size, done):
                job = self.sending.pop(instance)
                assert size == job.taken <= len(job.frame)
                if done:
                    assert job.taken == len(job.frame), "DONE: the stack has the whole frame"
                    assert not job.link.is_over
                    assert (job.link.peer, job.link.local) not in self.ended, "no DONE after a FIN"
                    self.done.append(instance)
