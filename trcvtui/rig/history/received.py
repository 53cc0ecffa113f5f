"""The bytes received so far, 16 MiB of them: each with its job or frame, recv call, message and scan.

Rule 1: only what the ledger tells is kept; DATA is read after the scan in which a job has written it.
Rule 2: after one scan at most COPY_A_SCAN bytes are copied, and those of the CONNECT that is looked at; of
more the labels are kept without the values. A flood costs the next scan nothing that it would miss.
Rule 3: a block on a ComBuffer delivers one frame a scan at most, so after each scan its framer and its data
still hold the bytes that the lines of the ledger are about.
Rule 4: all of it is bounded: bytes, jobs and recv calls; the oldest job goes first, whoever's it was.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

from trcvtui.blocks.environment import (
    BytesArrived,
    BytesLost,
    FrameEnded,
    JobEnded,
    NoiseDropped,
    PartDropped,
)
from trcvtui.blocks.framing import Ending
from trcvtui.net.events import BytesDropped
from trcvtui.plc.ledger import Event
from trcvtui.project.project import Project
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.history.records import JobSpan, Moment, RecvSpan
from trcvtui.rig.history.stream_index import JobRecord, StreamIndex

_STOP = attrgetter("span.stop")
_START = attrgetter("span.position")
_COMPACT: Final = 1024  # forgotten chunks that stay in the list until it is cut
_MOST_STEPS: Final = 256  # back to the job before: one instance among very many on a CONNECT


@dataclass(frozen=True, slots=True)
class ReceivedChunk:
    """One job, or one stretch of dropped bytes. `content` is empty where the values are not kept."""

    span: JobSpan
    connect: str
    incarnation: int
    content: bytes
    recvs: tuple[RecvSpan, ...]


class JobStream:
    """Chunks by position; the oldest are forgotten first."""

    def __init__(self) -> None:
        self.end = 0
        self._chunks: list[ReceivedChunk] = []
        self._first = 0

    @property
    def begin(self) -> int:
        """Return the position of the oldest byte that is kept."""
        return self._chunks[self._first].span.position if self._first < len(self._chunks) else self.end

    def add(self, chunk: ReceivedChunk) -> None:
        """Append a chunk at the end."""
        self._chunks.append(chunk)
        self.end = chunk.span.stop

    def forget_oldest(self) -> ReceivedChunk:
        """Drop the oldest chunk."""
        oldest = self._chunks[self._first]
        self._first += 1
        if self._first >= _COMPACT:
            del self._chunks[: self._first]
            self._first = 0
        return oldest

    def from_position(self, position: int) -> Iterator[ReceivedChunk]:
        """Return the chunk that holds a position and those after it."""
        place = bisect_right(self._chunks, position, lo=self._first, key=_STOP)
        for number in range(place, len(self._chunks)):
            yield self._chunks[number]

    def at(self, position: int) -> ReceivedChunk | None:
        """Return the chunk that holds a position."""
        chunk = next(self.from_position(position), None)
        return chunk if chunk is not None and chunk.span.position <= position else None

    def newest_first(self, position: int) -> Iterator[ReceivedChunk]:
        """Return the chunks that begin before a position, the newest first."""
        place = bisect_left(self._chunks, position, lo=self._first, key=_START)
        for number in range(place - 1, self._first - 1, -1):
            yield self._chunks[number]

    def job_before(self, position: int, instance: str) -> ReceivedChunk | None:
        """Return the job of an instance that ended with DONE before the chunk at `position`."""
        for steps, chunk in enumerate(self.newest_first(position)):
            if chunk.span.done and chunk.span.instance == instance:
                return chunk
            if steps > _MOST_STEPS:
                break
        return None

    def done(self, position: int, is_forward: bool, is_done: bool = True) -> int | None:
        """Return where the next job that ended with DONE begins, or the one that began before.

        Without `is_done`: the next bytes that were dropped.
        """
        chunks = self.from_position(position) if is_forward else self.newest_first(position)
        for chunk in chunks:
            if chunk.span.done is is_done and (not is_forward or chunk.span.position > position):
                return chunk.span.position
        return None

    def runs(self, start: int, stop: int) -> list[tuple[int, bytes]]:
        """Return the bytes from `start` to `stop`, put together as far as no byte is missing between them."""
        found: list[tuple[int, list[bytes]]] = []
        reached = -1
        for chunk in self.from_position(start):
            begin = chunk.span.position
            if begin >= stop:
                break
            if not chunk.content:
                continue
            if begin != reached:
                found.append((max(begin, start), []))
            found[-1][1].append(chunk.content[max(0, start - begin) : stop - begin])
            reached = chunk.span.stop
        return [(place, b"".join(parts)) for place, parts in found]


MOST_BYTES: Final = 16 * 1024 * 1024
MOST_JOBS: Final = 100_000
MOST_RECVS: Final = 200_000
COPY_A_SCAN: Final = 512 * 1024
DROPPED_SHOWN: Final = 256  # of many dropped bytes so many stand in the stream
NOT_KEPT: Final = "values not kept: more than 512 KiB in one scan"
OVERWRITTEN: Final = "values not kept: overwritten in the same scan by"


class JobHistory:
    """Reads the ledger after each scan. One stream a CONNECT."""

    def __init__(self, bench: Bench, index: StreamIndex) -> None:
        self.index = index
        self.streams: dict[str, JobStream] = {}
        self.watched = ""  # the CONNECT whose bytes are always kept
        self._bench = bench
        self._seq = 0
        self._order: deque[JobStream] = deque()
        self._bytes = self._recvs = 0
        self._drops: dict[str, list[BytesDropped]] = {}  # by instance: what its running job has to drop
        self._project: Project | None = None
        self._data: dict[str, str] = {}
        self._copied = 0
        self._last: dict[str, JobEnded] = {}  # of this scan: by DATA, whose bytes stand there
        index.listen({BytesDropped: self._dropped, JobEnded: self._job_ended})
        self._frames = FrameHistory(bench, lambda name, chunk: self._add(self._stream(name), chunk))

    def scanned(self) -> None:
        """Take what the scan that has just passed has written into the ledger, and the DATA of its jobs."""
        ledger = self._bench.runtime.ledger
        if ledger.last_seq == self._seq:
            return
        written = ledger.stamped_since(self._seq)
        self._seq, self._copied = ledger.last_seq, 0
        self._note_last(event for _, _, event in written)
        self.index.take(written)
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

    def _dropped(self, scan: int, t_ns: int, event: BytesDropped) -> None:
        """Take bytes that never reach DATA; those of a running job stand after what it delivers."""
        reader = self.index.reader_of((event.connection, event.incarnation), event.offset)
        if reader is not None:
            self._drops.setdefault(reader, []).append(event)
        else:
            self._add_drop(event, Moment(scan, t_ns))

    def _job_ended(self, scan: int, t_ns: int, event: JobEnded) -> None:
        job = self.index.ended(event.instance)
        if event.done:
            self._deliver(event, job)
        for drop in self._drops.pop(event.instance, ()):
            self._add_drop(drop, job.at, event.instance, event.job, job.recvs)

    def _deliver(self, event: JobEnded, job: JobRecord) -> None:
        stream = self._stream(event.connection)
        content, reason = self._content(event)
        span = JobSpan(
            stream.end, event.size, event.instance, event.job, job.at.scan, job.at.t_ns, True, reason,
            is_kept=not reason, whole=event.size,
        )  # fmt: skip
        self._add(stream, ReceivedChunk(span, *job.link, content, _placed(job.recvs, span)))

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

    def _add_drop(
        self,
        event: BytesDropped,
        at: Moment,
        instance: str = "",
        job: int = 0,
        recvs: Sequence[RecvSpan] = (),
    ) -> None:
        stream = self._stream(event.connection)
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
        self._add(stream, ReceivedChunk(span, event.connection, event.incarnation, b"", parts or unread))

    def _end_of(self, name: str) -> int:
        return self._stream(name).end

    # -- keeping and forgetting ------------------------------------------------------------------------

    def _stream(self, connect: str) -> JobStream:
        return self.streams.setdefault(connect, JobStream())

    def _add(self, stream: JobStream, chunk: ReceivedChunk) -> None:
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


# -- frames of a ComBuffer --------------------------------------------------------------------------------

MOST_ARRIVALS: Final = 4096  # of one ComBuffer that were not read yet
LOST_SHOWN: Final = 256
NOISE: Final = "noise before the prefix"
FRAME_NOT_KEPT: Final = "values not kept"
UNUSUAL: Final = {Ending.GAP: "ended by a gap", Ending.OVERRUN: "size reached, no suffix"}
NOTES: Final = (BytesArrived, FrameEnded, NoiseDropped, PartDropped, BytesLost)


class FrameHistory:
    """Hands each frame and each stretch of dropped bytes to `add`, with the name of its ComBuffer."""

    def __init__(self, bench: Bench, add: Callable[[str, ReceivedChunk], None]) -> None:
        self._bench = bench
        self._add = add
        self._arrived: dict[str, deque[RecvSpan]] = {}  # the newest chunks of each line, in its own offsets
        self._read: dict[str, int] = {}  # the place in the ComBuffer after what the stream has
        self._arrivals: dict[str, int] = {}
        self._frames: dict[str, int] = {}  # by instance
        self._copied = 0
        self._end_of: Callable[[str], int] = lambda name: 0

    def scanned(self, written: Iterable[tuple[int, int, Event]], end_of: Callable[[str], int]) -> None:
        """Take the ledger's lines of a scan; `end_of` tells where a stream ends."""
        self._copied, self._end_of = 0, end_of
        for scan, t_ns, event in written:
            match event:
                case BytesArrived():
                    self._note(event, scan, t_ns)
                case FrameEnded():
                    self._frame(event, scan, t_ns)
                case NoiseDropped(instance, buffer, size, _):
                    content = self._kept(instance, "noise", size)
                    self._drop(buffer, instance, size, NOISE, content, (scan, t_ns))
                case PartDropped(instance, buffer, offset, size, reason):
                    self._read[buffer] = offset
                    content = self._kept(instance, "dropped", size)
                    self._drop(buffer, instance, size, f"incomplete, {reason}", content, (scan, t_ns))
                case BytesLost(buffer, _, size, reason):
                    self._drop(buffer, "", size, reason, b"", (scan, t_ns), in_line=False)

    def _note(self, event: BytesArrived, scan: int, t_ns: int) -> None:
        number = self._arrivals[event.buffer] = self._arrivals.get(event.buffer, 0) + 1
        known = self._arrived.setdefault(event.buffer, deque(maxlen=MOST_ARRIVALS))
        known.append(RecvSpan(0, event.size, number, scan, t_ns, event.offset))

    def _frame(self, event: FrameEnded, scan: int, t_ns: int) -> None:
        framer, content = self._bench.runtime.framer(event.instance), self._content(event)
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
        self._add(event.buffer, ReceivedChunk(span, event.buffer, 0, content, recvs))

    def _content(self, event: FrameEnded) -> bytes:
        decl = self._bench.project.instance(event.instance)
        self._copied += event.size
        if decl is None or decl.data is None or self._copied > COPY_A_SCAN:
            return b""
        return self._bench.runtime.data(decl.data, event.size)

    def _kept(self, instance: str, what: str, size: int) -> bytes:
        framer = self._bench.runtime.framer(instance)
        kept = getattr(framer, what, b"")
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
        self._add(buffer, ReceivedChunk(span, buffer, 0, content, recvs))

    def _taken(self, buffer: str, size: int, position: int, shown: int) -> tuple[RecvSpan, ...]:
        """Return the arrivals of the next `size` bytes, the last `shown` of them from `position` on."""
        start = self._read.get(buffer, 0)
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
