"""Finds the recv call, and the job or frame, of each byte in a ring, or why the byte was dropped.

Rule 1: only facts of the ledger are stored. Bytes whose line was overwritten unread have no known job.
Rule 2: the bytes stay in the ring (net/received_ring.py); no byte is copied here.
Rule 3: the number of spans is bounded. More streams mean fewer spans each. The oldest spans are forgotten.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict, deque
from collections.abc import Iterator
from typing import Final

from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import (
    BufferBytesLost,
    BytesBuffered,
    FrameEnded,
    NoiseDropped,
    PartialFrameDropped,
    ReceiveEnded,
)
from trcvtui.blocks.framing import FrameEnding
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.records import BY_POSITION, MAX_SCAN, JobSpan, Pieces, RecvSpan, join_pieces
from trcvtui.net.events import BytesDropped, BytesReceived
from trcvtui.net.received_ring import MOST_SKIPPED

MOST_SPANS_KEPT: Final = 200_000  # of all streams: jobs, and as many recv calls
LEAST_SPANS_KEPT: Final = 1000  # of each stream
SLACK: Final = 1024  # spans that are forgotten at once
MOST_STEPS: Final = 256  # to another part of a job, or to the job before: many jobs may share a CONNECT
MOST_ARRIVALS: Final = 65_536  # recv calls of one ComBuffer with untaken bytes: as many as it has bytes
WAIT_REASON: Final = "of a frame without its end, or not read yet"
NOISE_REASON: Final = "noise before the prefix"
UNUSUAL: Final = {str(FrameEnding.GAP): "ended by a gap", str(FrameEnding.OVERRUN): "size reached, no suffix"}


class ReceivedStream:
    """The spans of one ring by position."""

    def __init__(self) -> None:
        self.begin = 0  # before it, spans are forgotten
        self.looked_at = SLACK  # with so many spans, forget_oldest is due
        self.jobs: list[JobSpan] = []
        self.recvs: list[RecvSpan] = []
        self.cut: BytesReceived | None = None  # the last recv call, if its datagram had no room
        self.blanks: list[JobSpan] = []  # of the jobs: places without values
        self.arrivals: deque[RecvSpan] = deque(maxlen=MOST_ARRIVALS)  # of a ComBuffer: untaken

    def add(self, *spans: JobSpan) -> None:
        """Insert a job's pieces by position, as the later of two jobs that read in turns may end first."""
        place = len(self.jobs)
        if spans and place and self.jobs[-1].position > spans[0].position:
            place = bisect_right(self.jobs, spans[0].position, key=BY_POSITION)
        self.jobs[place:] = sorted([*self.jobs[place:], *spans], key=BY_POSITION)
        self.blanks += [span for span in spans if not span.is_kept]

    def add_pieces(self, span: JobSpan, pieces: Pieces) -> None:
        """Add a job, or dropped bytes, with a span for each of its pieces."""
        first, spans = 0, list[JobSpan]()
        for position, size in pieces:
            rest = span.whole - first - size
            spans.append(span._replace(
                position=position, size=size, first=first,
                prefix=min(size, max(0, span.prefix - first)), suffix=min(size, max(0, span.suffix - rest)),
            ))  # fmt: skip
            first += size
        self.add(*spans)

    def forget_oldest(self, most: int, begin: int) -> None:
        """Forget the oldest spans if there are too many, and the spans whose bytes are gone."""
        for spans in (self.jobs, self.recvs, self.blanks):
            if len(spans) > most + SLACK or (len(spans) > SLACK and spans[SLACK].stop <= begin):
                del spans[:SLACK]
                self.begin = max(self.begin, spans[0].position)
        self.looked_at = len(self.recvs) + len(self.jobs) + SLACK

    def find_pieces(self, incarnation: int, offset: int, size: int) -> Pieces:
        """Return the known pieces of the ring that hold the `size` bytes at `offset` of a connection."""
        found: Pieces = []
        begin, end = (incarnation, offset), (incarnation, offset + size)
        place = bisect_right(self.recvs, begin, key=lambda recv: (recv.incarnation, recv.offset + recv.size))
        stop = bisect_left(self.recvs, end, place, key=lambda recv: (recv.incarnation, recv.offset))
        for recv in self.recvs[place:stop]:
            first, last = max(recv.offset, offset), min(recv.offset + recv.size, offset + size)
            if first < last:
                found.append((recv.position + first - recv.offset, last - first))
        return join_pieces(found)

    def take_last(self, stop: int, size: int) -> Pieces:
        """Take the last `size` untaken bytes of a ComBuffer before `stop`. Return [] if any are unknown."""
        held: list[RecvSpan] = []
        while self.arrivals and self.arrivals[0].offset < stop:
            recv = self.arrivals.popleft()
            if recv.offset + recv.size > stop:
                self.arrivals.appendleft(_cut_recv(recv, stop - recv.offset, recv.size))
                recv = _cut_recv(recv, 0, stop - recv.offset)
            held.append(recv)
        found: Pieces = []
        while held and size:
            recv = held.pop()
            if recv.size > size:
                held.append(_cut_recv(recv, 0, recv.size - size))
                recv = _cut_recv(recv, recv.size - size, recv.size)
            found.append((recv.position, recv.size))
            size -= recv.size
        self.arrivals.extendleft(reversed(held))
        return [] if size else join_pieces(reversed(found))

    # -- searches ---------------------------------------------------------------------------------------

    def list_pieces(self, place: int) -> list[JobSpan]:
        """Return all pieces of the job, or of the dropped bytes, at this index of `jobs`."""
        job = self.jobs[place]
        near = self.jobs[max(0, place - MOST_STEPS) : place + MOST_STEPS] if job.size < job.whole else [job]
        return [one for one in near if (*one[2:8], one.whole) == (*job[2:8], job.whole)]

    def find_job_before(self, position: int, instance: str, scan: int = MAX_SCAN) -> list[JobSpan]:
        """Return the pieces of the last job that began before `position` and had DONE up to `scan`."""
        last = bisect_left(self.jobs, position, key=BY_POSITION) - 1
        for place in range(last, max(-1, last - MOST_STEPS), -1):
            job = self.jobs[place]
            if job.done and job.instance == instance and not job.first and job.scan <= scan:
                return self.list_pieces(place)
        return []

    def find_job_pieces(self, instance: str, number: int) -> list[JobSpan]:
        """Return the pieces of this job or frame, or [] if it has no DONE or is not among the newest."""
        for place in range(len(self.jobs) - 1, max(-1, len(self.jobs) - MOST_STEPS), -1):
            job = self.jobs[place]
            if job.done and job.number == number and job.instance == instance:
                return self.list_pieces(place)
        return []

    def find_job_position(self, instance: str, number: int) -> int | None:
        """Return where the newest job or frame with this number and DONE begins, or None if unknown."""
        found = (
            job.position for job in reversed(self.jobs)
            if job.done and job.number == number and job.instance == instance and not job.first
        )  # fmt: skip
        return next(found, None)

    def find_next_ended(self, position: int, is_forward: bool, is_done: bool = True) -> int | None:
        """Return where the next or the previous job that ended with DONE begins.

        Without `is_done`, return where the next or the previous dropped bytes begin.
        """
        place = (bisect_right if is_forward else bisect_left)(self.jobs, position, key=BY_POSITION)
        numbers = range(place, len(self.jobs)) if is_forward else range(place - 1, -1, -1)
        jobs = (self.jobs[number] for number in numbers)
        return next((job.position for job in jobs if job.done is is_done and not job.first), None)


class ReceivedStreams:
    """The streams of a bench: one for each CONNECT, UDP_CONFIG or ComBuffer."""

    def __init__(self, bench: Bench, reader: LedgerReader) -> None:
        self.index = reader.index
        self.streams: defaultdict[str, ReceivedStream] = defaultdict(ReceivedStream)
        self._bench = bench
        self._arrivals: dict[str, int] = {}
        self.index.subscribe({
            BytesReceived: self._handle_received,
            BytesDropped: self._handle_dropped,
            BytesBuffered: self._handle_arrived,
            FrameEnded: self._handle_frame,
            NoiseDropped: self._add_cleared,
            PartialFrameDropped: self._add_cleared,
            BufferBytesLost: self._handle_bytes_lost,
        })  # fmt: skip
        self.index.ends[True].append(self._handle_job_end)
        reader.on_loss.append(self._handle_loss)

    def _handle_loss(self, seq: int, scan: int, t_ns: int) -> None:
        for stream in self.streams.values():
            stream.arrivals.clear()  # the lines that were overwritten may have taken them (Rule 1)

    def _get_stream(self, name: str) -> ReceivedStream:
        """Return a stream that has room for one more span."""
        stream = self.streams[name]
        if len(stream.recvs) + len(stream.jobs) > stream.looked_at:
            ring = self._bench.runtime.received_ring(name)
            most = max(LEAST_SPANS_KEPT, MOST_SPANS_KEPT // len(self.streams))
            stream.forget_oldest(most, ring.first if ring is not None else 0)
        return stream

    # -- a CONNECT ---------------------------------------------------------------------------------------

    def _handle_received(self, seq: int, scan: int, t_ns: int, event: BytesReceived) -> None:
        stream = self._get_stream(event.connection)
        stream.recvs.append(self.index.get_newest_recv(event.instance))
        stream.cut = event if event.cut else None

    def _handle_job_end(self, seq: int, scan: int, t_ns: int, event: ReceiveEnded) -> None:
        instance, number, connect, _, _, size, _, _ = event
        reads = self.index.done_reads(instance)
        if len(reads) == 1 and reads[0].size >= size:
            span = JobSpan(reads[0].position, size, instance, number, scan, t_ns, True, "", True, size)
            self._get_stream(connect).add(span)
        elif sum([recv.size for recv in reads]) >= size and reads:
            span = JobSpan(0, 0, instance, number, scan, t_ns, True, whole=size)
            self._get_stream(connect).add_pieces(span, find_first_pieces(reads, size))

    def _handle_dropped(self, seq: int, scan: int, t_ns: int, event: BytesDropped) -> None:
        stream, size = self._get_stream(event.connection), event.size
        span = JobSpan(0, 0, "", 0, scan, t_ns, False, event.reason, whole=size)
        if event.offset < 0:
            stream.add(span._replace(position=event.position, size=min(size, MOST_SKIPPED), is_kept=False))
            return
        cut = stream.cut
        is_cut = cut is not None and event.offset + size == cut.offset + cut.size
        link = event.connection, event.incarnation
        reader = (
            cut.instance if cut is not None and is_cut else self.index.find_running_reader(link, event.offset)
        )
        if reader is not None and (job := self.index.find_newest_job(reader)) is not None:
            span = span._replace(instance=reader, number=job.number)
        stream.add_pieces(span, stream.find_pieces(event.incarnation, event.offset, size))
        if cut is not None and is_cut:
            first, shown = size - cut.cut, min(cut.cut, MOST_SKIPPED)
            place = cut.position + cut.size - cut.cut
            stream.add(span._replace(position=place, size=shown, first=first, is_kept=False))

    # -- a ComBuffer -------------------------------------------------------------------------------------

    def _handle_arrived(self, seq: int, scan: int, t_ns: int, event: BytesBuffered) -> None:
        buffer, offset, size, position = event
        if position >= 0:
            number = self._arrivals[buffer] = self._arrivals.get(buffer, 0) + 1
            stream = self._get_stream(buffer)
            stream.recvs.append(RecvSpan(position, size, number, scan, t_ns, offset))
            stream.arrivals.append(stream.recvs[-1])

    def _handle_frame(self, seq: int, scan: int, t_ns: int, event: FrameEnded) -> None:
        instance, buffer, offset, size, ending, prefix, suffix, number = event
        self._add_buffer_bytes(buffer, offset, JobSpan(
            0, 0, instance, number, scan, t_ns, True, UNUSUAL.get(ending, ""), whole=size,
            prefix=prefix, suffix=suffix, is_frame=True,
        ))  # fmt: skip

    def _add_cleared(self, seq: int, scan: int, t_ns: int, event: NoiseDropped | PartialFrameDropped) -> None:
        reason = NOISE_REASON if isinstance(event, NoiseDropped) else f"incomplete, {event.reason}"
        span = JobSpan(0, 0, event.instance, 0, scan, t_ns, False, reason, whole=event.size)
        self._add_buffer_bytes(event.buffer, event.offset, span)

    def _handle_bytes_lost(self, seq: int, scan: int, t_ns: int, event: BufferBytesLost) -> None:
        buffer, offset, size, reason, position = event
        span = JobSpan(max(0, position), size, "", 0, scan, t_ns, False, reason, whole=size)
        if position < 0:
            self._add_buffer_bytes(buffer, offset - size, span)
        else:
            self._get_stream(buffer).add(span)

    def _add_buffer_bytes(self, buffer: str, offset: int, span: JobSpan) -> None:
        """Add the bytes of a frame, or dropped bytes, from `offset` of a ComBuffer on."""
        stream = self._get_stream(buffer)
        stream.add_pieces(span, stream.take_last(offset + span.whole, span.whole))

    # -- jobs without an end -----------------------------------------------------------------------------

    def list_open_spans(self, name: str, start: int, stop: int) -> Iterator[JobSpan]:
        """Yield the spans of running jobs, and of frames without their end, between two positions."""
        waiting = self.streams[name].arrivals
        running = self.index.list_running(name)
        jobs = [(_runs(job.number), instance, job.number, reads) for instance, job, reads in running]
        for reason, instance, number, reads in [*jobs, (WAIT_REASON, "", 0, list(waiting))]:
            if not reads:
                continue
            at, whole, first = reads[-1], sum([recv.size for recv in reads]), 0
            for position, size in find_first_pieces(reads, whole):
                if position < stop and position + size > start:
                    yield JobSpan(
                        position, size, instance, number, at.scan, at.t_ns, False, reason,
                        whole=whole, first=first, is_open=True,
                    )  # fmt: skip
                first += size


def as_running(span: JobSpan) -> JobSpan:
    """Return a span as it was before its job or frame ended, or before it was dropped."""
    if span.is_frame or not span.number:
        span = span._replace(instance="", number=0, prefix=0, suffix=0, is_frame=False)
    return span._replace(done=False, reason=_runs(span.number) if span.number else WAIT_REASON, is_open=True)


def _runs(number: int) -> str:
    return f"job {number} runs"


def find_first_pieces(reads: list[RecvSpan], size: int) -> Pieces:
    """Return where the first `size` bytes of some recv calls are."""
    if reads[-1].stop - reads[0].position == sum([recv.size for recv in reads]):
        return [(reads[0].position, size)]  # no other bytes lie between them
    parts: Pieces = []
    for recv in reads:
        if size or not parts:
            parts.append((recv.position, min(size, recv.size)))
            size -= parts[-1][1]
    return join_pieces(parts)


def _cut_recv(recv: RecvSpan, first: int, stop: int) -> RecvSpan:
    return recv._replace(position=recv.position + first, offset=recv.offset + first, size=stop - first)
