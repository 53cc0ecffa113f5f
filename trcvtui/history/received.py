"""The bytes received so far, 16 MiB of them: each with its job or frame, recv call, message and scan.

Rule 1: only what the ledger tells is kept; DATA is read before the next scan, or its values are not kept.
Rule 2: after one scan at most COPY_A_SCAN bytes are copied, and those of the CONNECT that is looked at; of
more the labels are kept without the values. A flood costs the next scan nothing that it would miss.
Rule 3: a block on a ComBuffer delivers one frame a scan at most, so after each scan its framer and its data
still hold the bytes that the lines of the ledger are about.
Rule 4: all of it is bounded: bytes, jobs and recv calls; the oldest job goes first, of whichever instance.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import attrgetter
from typing import Any, Final, NamedTuple

from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import (
    BytesArrived,
    BytesLost,
    FrameEnded,
    JobEnded,
    NoiseDropped,
    PartialFrameDropped,
)
from trcvtui.blocks.framing import Ending
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.records import JobSpan, RecvSpan, ScanStamp
from trcvtui.history.stream_index import Link, Listener
from trcvtui.net.events import BytesDropped
from trcvtui.plc.snapshot import FramerSnapshot
from trcvtui.project.project import Project

_STOP = attrgetter("stop")
_START = attrgetter("position")
_COMPACT: Final = 1024  # forgotten chunks that stay in the list until it is cut
_MOST_STEPS: Final = 256  # back to the job before: one instance among very many on a CONNECT


class ReceivedChunk(NamedTuple):
    """One job, or one stretch of dropped bytes. `content` is empty where the values are not kept.

    Its span and recv calls are put together when somebody looks: a job comes bare, with scan, time, reason.
    """

    position: int
    stop: int
    content: bytes
    link: Link
    told: JobSpan | tuple[int, int, str, Sequence[Any]]  # the last are the fields of JobEnded
    reads: Sequence[RecvSpan]  # RecvSpans, those of a bare job not placed

    @property
    def done(self) -> bool:
        return self.told.done if isinstance(self.told, JobSpan) else True

    @property
    def instance(self) -> str:
        told = self.told
        return told.instance if isinstance(told, JobSpan) else str(told[3][0])

    @property
    def number(self) -> int:
        told = self.told
        return told.number if isinstance(told, JobSpan) else int(told[3][1])

    @property
    def span(self) -> JobSpan:
        told = self.told
        if isinstance(told, JobSpan):
            return told
        scan, t_ns, reason, (instance, job, _, _, _, size, _, _) = told
        is_kept = bool(self.content) or not (size or reason)
        return JobSpan(self.position, size, instance, job, scan, t_ns, True, reason, is_kept, whole=size)

    @property
    def recvs(self) -> tuple[RecvSpan, ...]:
        """Return the recv calls at their positions: the bytes of a job are theirs, one after the other."""
        if isinstance(self.told, JobSpan):
            return tuple(self.reads)
        found: list[RecvSpan] = []
        position = self.position
        for _, whole, number, scan, t_ns, offset, *_ in self.reads:
            size = min(whole, self.stop - position)
            if size > 0:
                found.append(RecvSpan(position, size, number, scan, t_ns, offset))
                position += size
        return tuple(found)


class JobStream:
    """Chunks by position; the oldest are forgotten first."""

    def __init__(self) -> None:
        self.end = 0
        self._chunks: list[ReceivedChunk] = []
        self._first = 0

    @property
    def begin(self) -> int:
        return self._chunks[self._first].position if self._first < len(self._chunks) else self.end

    def add(self, chunk: ReceivedChunk) -> None:
        self._chunks.append(chunk)
        self.end = chunk[1]

    def forget_oldest(self) -> ReceivedChunk:
        oldest = self._chunks[self._first]
        self._first += 1
        if self._first >= _COMPACT:
            del self._chunks[: self._first]
            self._first = 0
        return oldest

    def from_position(self, position: int) -> Iterator[ReceivedChunk]:
        place = bisect_right(self._chunks, position, lo=self._first, key=_STOP)
        for number in range(place, len(self._chunks)):
            yield self._chunks[number]

    def at(self, position: int) -> ReceivedChunk | None:
        chunk = next(self.from_position(position), None)
        return chunk if chunk is not None and chunk.position <= position else None

    def newest_first(self, position: int) -> Iterator[ReceivedChunk]:
        place = bisect_left(self._chunks, position, lo=self._first, key=_START)
        for number in range(place - 1, self._first - 1, -1):
            yield self._chunks[number]

    def job_before(self, position: int, instance: str) -> ReceivedChunk | None:
        """Return the job of an instance that ended with DONE before the chunk at `position`."""
        for steps, chunk in enumerate(self.newest_first(position)):
            if chunk.done and chunk.instance == instance:
                return chunk
            if steps > _MOST_STEPS:
                break
        return None

    def job(self, instance: str, number: int) -> int | None:
        """Return where the newest job, or frame, of that number begins."""
        jobs = (chunk for chunk in self.newest_first(self.end + 1) if chunk.done)
        found = (job.position for job in jobs if job.number == number and job.instance == instance)
        return next(found, None)

    def done(self, position: int, is_forward: bool, is_done: bool = True) -> int | None:
        """Return where the next job that ended with DONE begins, or the one that began before.

        Without `is_done`: the next bytes that were dropped.
        """
        chunks = self.from_position(position) if is_forward else self.newest_first(position)
        for chunk in chunks:
            if chunk.done is is_done and (not is_forward or chunk.position > position):
                return chunk.position
        return None

    def runs(self, start: int, stop: int) -> list[tuple[int, bytes]]:
        """Return the bytes from `start` to `stop`, put together as far as no byte is missing between them."""
        found: list[tuple[int, list[bytes]]] = []
        reached = -1
        for chunk in self.from_position(start):
            begin = chunk.position
            if begin >= stop:
                break
            if not chunk.content:
                continue
            if begin != reached:
                found.append((max(begin, start), []))
            found[-1][1].append(chunk.content[max(0, start - begin) : stop - begin])
            reached = chunk.stop
        return [(place, b"".join(parts)) for place, parts in found]


MOST_BYTES: Final = 16 * 1024 * 1024
MOST_JOBS: Final = 100_000
MOST_RECVS: Final = 200_000
COPY_A_SCAN: Final = 512 * 1024
DROPPED_SHOWN: Final = 256  # of many dropped bytes so many stand in the stream
NOT_KEPT: Final = "values not kept: more than 512 KiB in one scan"
OVERWRITTEN: Final = "values not kept: overwritten in the same scan by"
TOO_LATE: Final = "values not kept: read too late"
LOST: Final = "jobs before this one were overwritten in the ledger before they were read"
NOTHING: Final = b"", TOO_LATE


class JobHistory:
    """Keeps the bytes that the ledger's lines are about. One stream a CONNECT."""

    def __init__(self, bench: Bench, reader: LedgerReader) -> None:
        self.index = index = reader.index
        self.catch_up = reader.catch_up
        self.streams: defaultdict[str, JobStream] = defaultdict(JobStream)
        self.watched = ""  # the CONNECT whose bytes are always kept
        self._bench = bench
        self._order: deque[JobStream] = deque()
        self._bytes = self._recvs = 0
        self._drops: dict[str, list[BytesDropped]] = {}  # by instance: what its running job has to drop
        self._project: Project | None = None
        self._data: dict[str, str] = {}
        self._taken = 0  # the last line whose DATA was looked at
        self._contents: dict[int, tuple[bytes, str]] = {}  # by line: bytes of DATA, or why there are none
        self._unknown: set[str] | None = None  # CONNECTs that have told jobs since the last loss; None: none
        index.listen({BytesDropped: self._dropped})
        index.ends[True] += [self._delivered, self._job_ended]
        index.ends[False].append(self._job_ended)
        self._frames = FrameHistory(
            bench, lambda n, chunk: self._add(self.streams[n], chunk), lambda n: self.streams[n].end
        )
        index.listen(self._frames.listeners)
        reader.first.append(self._take_data)
        reader.lost.append(self._lose)

    def _lose(self, seq: int, scan: int, t_ns: int) -> None:
        self._contents = {known: kept for known, kept in self._contents.items() if known > seq}
        self._drops.clear()
        self._frames.lose()
        self._unknown = set()

    def _forget(self) -> None:
        while self._bytes > MOST_BYTES or self._recvs > MOST_RECVS or len(self._order) > MOST_JOBS:
            oldest = self._order.popleft().forget_oldest()
            self._bytes -= len(oldest.content)
            self._recvs -= len(oldest.reads)

    # -- the bytes of DATA -----------------------------------------------------------------------------

    def _take_data(self) -> None:
        """Take the bytes of the jobs of the last scan; those before it may be overwritten by now."""
        runtime = self._bench.runtime
        if self._taken == runtime.ledger.last_seq:
            return
        news, scan = runtime.ledger.stamped_since(self._taken), runtime.scans
        self._taken = runtime.ledger.last_seq
        first = self._taken - len(news) + 1
        ended = [
            (seq, self._data_of(event.instance), event)
            for seq, (at, _, event) in enumerate(news, first)
            if isinstance(event, JobEnded) and at == scan and event.done
        ]
        last = {name: (seq, event[0]) for seq, name, event in ended}
        copied = 0
        for seq, name, event in ended:
            if last[name][0] != seq:
                self._contents[seq] = b"", f"{OVERWRITTEN} {last[name][1]}"
                continue
            if event[2] != self.watched:
                copied += event[5]
                if copied > COPY_A_SCAN:
                    self._contents[seq] = b"", NOT_KEPT
                    continue
            self._contents[seq] = runtime.data(name, event[5]), ""

    def _data_of(self, instance: str) -> str:
        if self._project is not self._bench.project:
            self._project = self._bench.project
            self._data.update({decl.name: decl.data for decl in self._project.instances if decl.data})
        return self._data[instance]

    # -- the ledger's lines ----------------------------------------------------------------------------

    def _dropped(self, seq: int, scan: int, t_ns: int, event: BytesDropped) -> None:
        """Take bytes that never reach DATA; those of a running job stand after what it delivers."""
        reader = self.index.reader_of((event.connection, event.incarnation), event.offset)
        if reader is not None:
            self._drops.setdefault(reader, []).append(event)
        else:
            self._add_drop(event, ScanStamp(scan, t_ns))

    def _delivered(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        instance, _, connect, incarnation, _, size, _, _ = event
        content, reason = self._contents.pop(seq, NOTHING)
        if self._unknown is not None and connect not in self._unknown:
            self._unknown.add(connect)
            reason = "; ".join(filter(None, (reason, LOST)))
        stream = self.streams[connect]
        begin, reads = stream.end, self.index.reads(instance)
        fields = begin, begin + size, content, (connect, incarnation), (scan, t_ns, reason, event), reads
        self._add(stream, tuple.__new__(ReceivedChunk, fields))

    def _job_ended(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        if self._drops:
            for drop in self._drops.pop(event[0], ()):
                job = self.index.ended(event[0])
                self._add_drop(drop, job.at, event[0], event[1], job.recvs)

    def _add_drop(
        self,
        event: BytesDropped,
        at: ScanStamp,
        instance: str = "",
        job: int = 0,
        recvs: Sequence[RecvSpan] = (),
    ) -> None:
        stream = self.streams[event.connection]
        offset = event.offset
        if offset < 0:
            offset = self.index.next_byte(event.connection, event.incarnation)
        size = min(event.size, DROPPED_SHOWN)
        span = JobSpan(
            stream.end, size, instance, job, at.scan, at.t_ns, False, event.reason,
            is_kept=False, whole=event.size,
        )  # fmt: skip
        parts = _overlapping(recvs, offset, span)
        unread = (RecvSpan(stream.end, size, 0, at.scan, at.t_ns, offset),)
        link = event.connection, event.incarnation
        self._add(stream, ReceivedChunk(span.position, span.stop, b"", link, span, parts or unread))

    # -- keeping and forgetting ------------------------------------------------------------------------

    def _add(self, stream: JobStream, chunk: ReceivedChunk) -> None:
        stream.add(chunk)
        self._order.append(stream)
        self._bytes += len(chunk[2])
        self._recvs += len(chunk[5])
        self._forget()


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


# -- frames of a ComBuffer --------------------------------------------------------------------------------

MOST_ARRIVALS: Final = 4096  # of one ComBuffer that were not read yet
LOST_SHOWN: Final = 256
UNKNOWN: Final = -1
NOISE: Final = "noise before the prefix"
FRAME_NOT_KEPT: Final = "values not kept"
UNUSUAL: Final = {Ending.GAP: "ended by a gap", Ending.OVERRUN: "size reached, no suffix"}


class FrameHistory:
    """Hands each frame and each stretch of dropped bytes to `add`, with the name of its ComBuffer."""

    def __init__(
        self, bench: Bench, add: Callable[[str, ReceivedChunk], None], end_of: Callable[[str], int]
    ) -> None:
        self._bench, self._add, self._end_of = bench, add, end_of
        self._arrived: dict[str, deque[RecvSpan]] = {}  # the newest chunks of each line, in its own offsets
        self._read: dict[str, int] = {}  # the place in the ComBuffer after what the stream has
        self._arrivals: dict[str, int] = {}
        self._frames: dict[str, int] = {}  # by instance
        self._copied = self._scan = 0

        self.listeners: dict[type, Listener] = {
            BytesArrived: self._note,
            FrameEnded: self._frame,
            NoiseDropped: self._noise,
            PartialFrameDropped: self._part,
            BytesLost: self._lost,
        }

    def lose(self) -> None:
        """Forget which bytes came when: lines about them were overwritten."""
        self._arrived.clear()
        self._read = dict.fromkeys(self._read, UNKNOWN)

    def _note(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        buffer, offset, size, _ = event
        number = self._arrivals[buffer] = self._arrivals.get(buffer, 0) + 1
        known = self._arrived.setdefault(buffer, deque(maxlen=MOST_ARRIVALS))
        known.append(RecvSpan(0, size, number, scan, t_ns, offset))

    def _noise(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        instance, buffer, size, _, _ = event
        self._drop(buffer, instance, size, NOISE, self._kept(scan, instance, "noise", size), (scan, t_ns))

    def _part(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        instance, buffer, offset, size, reason = event
        self._read[buffer] = offset
        content = self._kept(scan, instance, "dropped", size)
        self._drop(buffer, instance, size, f"incomplete, {reason}", content, (scan, t_ns))

    def _lost(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        buffer, _, size, reason, _ = event
        self._drop(buffer, "", size, reason, b"", (scan, t_ns), in_line=False)

    def _frame(self, seq: int, scan: int, t_ns: int, event: FrameEnded) -> None:
        framer, content = self._framer(scan, event.instance), self._content(scan, event)
        number = self._frames[event.instance] = self._frames.get(event.instance, 0) + 1
        marks = framer.last if framer is not None else None
        reason = UNUSUAL.get(marks.ending, "") if marks is not None else ""
        position, self._read[event.buffer] = self._end_of(event.buffer), event.offset
        span = JobSpan(
            position, event.size, event.instance, number, scan, t_ns, True,
            reason if content else FRAME_NOT_KEPT, is_kept=bool(content), whole=event.size,
            prefix=marks.prefix if marks is not None else 0, suffix=marks.suffix if marks is not None else 0,
            is_frame=True,
        )  # fmt: skip
        recvs = self._taken(event.buffer, event.size, position, event.size)
        chunk = ReceivedChunk(position, span.stop, content, (event.buffer, 0), span, recvs)
        self._add(event.buffer, chunk)

    def _framer(self, scan: int, instance: str) -> FramerSnapshot | None:
        """Return the framer as the scan has left it; None: another scan has passed since."""
        return self._bench.runtime.framer(instance) if scan == self._bench.runtime.scans else None

    def _content(self, scan: int, event: FrameEnded) -> bytes:
        decl = self._bench.project.instance(event.instance)
        if scan != self._scan:
            self._scan, self._copied = scan, 0
        self._copied += event.size
        is_late = scan != self._bench.runtime.scans
        if decl is None or decl.data is None or is_late or self._copied > COPY_A_SCAN:
            return b""
        return self._bench.runtime.data(decl.data, event.size)

    def _kept(self, scan: int, instance: str, what: str, size: int) -> bytes:
        kept = getattr(self._framer(scan, instance), what, b"")
        return bytes(kept[-size:])

    def _drop(
        self,
        buffer: str,
        instance: str,
        size: int,
        reason: str,
        content: bytes,
        when: tuple[int, int],
        in_line: bool = True,
    ) -> None:
        """Take bytes that no frame has; without `in_line` they never were in the ComBuffer."""
        shown = len(content) or min(size, LOST_SHOWN)
        position = self._end_of(buffer)
        span = JobSpan(
            position, shown, instance, 0, *when, False, reason, is_kept=bool(content), whole=size,
        )  # fmt: skip
        recvs = self._taken(buffer, size, position, shown) if in_line else ()
        self._add(buffer, ReceivedChunk(position, span.stop, content, (buffer, 0), span, recvs))

    def _taken(self, buffer: str, size: int, position: int, shown: int) -> tuple[RecvSpan, ...]:
        """Return the arrivals of the next `size` bytes, the last `shown` of them from `position` on."""
        start = self._read.get(buffer, 0)
        if start == UNKNOWN:
            return ()
        stop = self._read[buffer] = start + size
        first, known = stop - shown, self._arrived.get(buffer, deque())
        found: list[RecvSpan] = []
        while known and known[0].offset < stop:
            arrival = known[0]
            begin, end = max(arrival.offset, first), min(arrival.offset + arrival.size, stop)
            if begin < end:
                place = position + begin - first
                found.append(arrival._replace(position=place, size=end - begin, offset=begin))
            if arrival.offset + arrival.size > stop:
                break
            known.popleft()
        return tuple(found)
