"""The last 16 MiB that receive jobs have delivered: each byte with its job, recv call, message and scan.

Rule 1: only what the ledger tells is kept; DATA is read behind the scan in which a job has written it.
Rule 2: behind one scan at most COPY_A_SCAN bytes are copied, and those of the CONNECT that is looked at; of
more the labels are kept without the values. A flood costs the next scan nothing that it would miss.
Rule 3: all of it is bounded: bytes, jobs and recv calls; the oldest job goes first, whoever's it was.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from trcvtui.blocks.environment import JobEnded
from trcvtui.net.events import BytesDropped, BytesReceived, ConnectionNote
from trcvtui.plc.ledger import Event, PeerSent
from trcvtui.project.project import Project
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.history.frame_history import FrameHistory
from trcvtui.rig.history.job_stream import Chunk, JobStream
from trcvtui.rig.history.sent_messages import Link, SentMessages
from trcvtui.rig.history.window import JobSpan, RecvSpan

MOST_BYTES: Final = 16 * 1024 * 1024
MOST_JOBS: Final = 100_000
MOST_RECVS: Final = 200_000
COPY_A_SCAN: Final = 512 * 1024
DROPPED_SHOWN: Final = 256  # of many dropped bytes so many stand in the stream
NOT_KEPT: Final = "values not kept: more than 512 KiB in one scan"
OVERWRITTEN: Final = "values not kept: overwritten in the same scan by"


@dataclass
class _Open:
    """What a job has so far: its recv calls, their positions still 0, and bytes that it has to drop."""

    link: Link = ("", 0)
    recvs: list[RecvSpan] = field(default_factory=list)
    drops: list[BytesDropped] = field(default_factory=list)

    def holds(self, link: Link, offset: int) -> bool:
        """Return whether the byte at `offset` of the connection is one of this job's."""
        return link == self.link and any(r.offset <= offset < r.offset + r.size for r in self.recvs)


class JobHistory:
    """Reads the ledger behind each scan. One stream a CONNECT."""

    def __init__(self, bench: Bench) -> None:
        self.streams: dict[str, JobStream] = {}
        self.messages = SentMessages()
        self.watched = ""  # the CONNECT whose bytes are always kept
        self._bench = bench
        self._seq = 0
        self._order: deque[JobStream] = deque()
        self._bytes = self._recvs = 0
        self._open: dict[str, _Open] = {}  # by instance
        self._next: dict[str, tuple[int, int]] = {}  # by CONNECT: incarnation, the byte that comes next
        self._project: Project | None = None
        self._data: dict[str, str] = {}
        self._copied = self._scan = self._t_ns = 0
        self._last: dict[str, JobEnded] = {}  # of this scan: by DATA, whose bytes stand there
        self._takers: Final[dict[type, Callable[[Any], None]]] = {
            BytesReceived: self._received,
            BytesDropped: self._dropped,
            JobEnded: self._ended,
            PeerSent: self.messages.sent,
            ConnectionNote: self.messages.noted,
        }
        self._frames = FrameHistory(bench, lambda name, chunk: self._add(self._stream(name), chunk))

    def scanned(self) -> None:
        """Take what the scan that has just passed has written into the ledger, and the DATA of its jobs."""
        ledger, takers = self._bench.runtime.ledger, self._takers
        if ledger.last_seq == self._seq:
            return
        written = ledger.stamped_since(self._seq)
        news = [stamped for stamped in written if type(stamped[2]) in takers]
        self._seq, self._copied = ledger.last_seq, 0
        self._note_last(event for _, _, event in news)
        for self._scan, self._t_ns, event in news:
            takers[type(event)](event)
        if self._bench.project.combuffers:
            self._frames.scanned(written, self._end_of)
        while self._bytes > MOST_BYTES or self._recvs > MOST_RECVS or len(self._order) > MOST_JOBS:
            self._forget_oldest()

    def _note_last(self, events: Iterable[Event]) -> None:
        self._last.clear()
        for event in events:
            if isinstance(event, JobEnded) and event.done:
                self._last[self._data_of(event.instance)] = event

    # -- the ledger's lines ----------------------------------------------------------------------------

    def _received(self, event: BytesReceived) -> None:
        span = RecvSpan(0, event.size, event.recv, self._scan, self._t_ns, event.offset)
        held = self._open.setdefault(event.instance, _Open())
        held.link = event.connection, event.incarnation
        held.recvs.append(span)
        self._next[event.connection] = event.incarnation, event.offset + event.size

    def _dropped(self, event: BytesDropped) -> None:
        """Take bytes that never reach DATA; those of a job stand behind what it delivers."""
        link = event.connection, event.incarnation
        for held in self._open.values():
            if held.holds(link, event.offset):
                held.drops.append(event)
                return
        self._add_drop(event, "", 0, ())

    def _ended(self, event: JobEnded) -> None:
        held = self._open.pop(event.instance, None) or _Open()
        if event.done:
            self._deliver(event, held)
        for drop in held.drops:
            self._add_drop(drop, event.instance, event.job, held.recvs)

    def _deliver(self, event: JobEnded, held: _Open) -> None:
        stream = self._stream(event.connection)
        content, reason = self._content(event)
        span = JobSpan(
            stream.end, event.size, event.instance, event.job, self._scan, self._t_ns, True, reason,
            is_kept=not reason, whole=event.size,
        )  # fmt: skip
        self._add(
            stream, Chunk(span, event.connection, event.incarnation, content, _placed(held.recvs, span))
        )

    def _content(self, event: JobEnded) -> tuple[bytes, str]:
        """Return the job's bytes, or why they are not kept."""
        name = self._data_of(event.instance)
        last = self._last[name]
        if last is not event:
            return b"", f"{OVERWRITTEN} {last.instance}"
        if event.connection != self.watched:
            self._copied += event.size
            if self._copied > COPY_A_SCAN:
                return b"", NOT_KEPT
        return self._bench.runtime.data(name, event.size), ""

    def _data_of(self, instance: str) -> str:
        if self._project is not self._bench.project:
            self._project = self._bench.project
            self._data.update({decl.name: decl.data for decl in self._project.instances if decl.data})
        return self._data[instance]

    def _add_drop(self, event: BytesDropped, instance: str, job: int, recvs: Sequence[RecvSpan]) -> None:
        stream = self._stream(event.connection)
        incarnation, follows = self._next.get(event.connection, (event.incarnation, 0))
        offset = event.offset if event.offset >= 0 else follows if incarnation == event.incarnation else 0
        size = min(event.size, DROPPED_SHOWN)
        span = JobSpan(
            stream.end, size, instance, job, self._scan, self._t_ns, False, event.reason,
            is_kept=False, whole=event.size,
        )  # fmt: skip
        parts = _overlapping(recvs, offset, span)
        unread = (RecvSpan(stream.end, size, 0, self._scan, self._t_ns, offset),)
        self._add(stream, Chunk(span, event.connection, event.incarnation, b"", parts or unread))

    def _end_of(self, name: str) -> int:
        return self._stream(name).end

    # -- keeping and forgetting ------------------------------------------------------------------------

    def _stream(self, connect: str) -> JobStream:
        return self.streams.setdefault(connect, JobStream())

    def _add(self, stream: JobStream, chunk: Chunk) -> None:
        stream.add(chunk)
        self._order.append(stream)
        self._bytes += len(chunk.content)
        self._recvs += len(chunk.recvs)

    def _forget_oldest(self) -> None:
        oldest = self._order.popleft().forget_oldest()
        self._bytes -= len(oldest.content)
        self._recvs -= len(oldest.recvs)


def _placed(recvs: Iterable[RecvSpan], job: JobSpan) -> tuple[RecvSpan, ...]:
    """Return the recv calls of a job at their positions: its bytes are theirs, one after the other."""
    found: list[RecvSpan] = []
    position = job.position
    for recv in recvs:
        size = min(recv.size, job.stop - position)
        if size > 0:
            found.append(RecvSpan(position, size, recv.number, recv.scan, recv.t_ns, recv.offset))
            position += size
    return tuple(found)


def _overlapping(recvs: Iterable[RecvSpan], offset: int, drop: JobSpan) -> tuple[RecvSpan, ...]:
    """Return the parts of recv calls that were dropped, from `offset` of the connection on."""
    found: list[RecvSpan] = []
    for recv in recvs:
        first = max(recv.offset, offset)
        size = min(recv.offset + recv.size, offset + drop.size) - first
        if size > 0:
            position = drop.position + first - offset
            found.append(recv._replace(position=position, size=size, offset=first))
    return tuple(found)
