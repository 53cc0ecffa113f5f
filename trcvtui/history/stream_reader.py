"""Reads windows out of the received streams for the screen; searches them stretch by stretch."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from trcvtui.bench.bench import Bench
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.received_streams import ReceivedStream, ReceivedStreams, as_running
from trcvtui.history.records import (
    AT_END,
    BY_POSITION,
    BY_SCAN,
    BY_STOP,
    MAX_SCAN,
    MOST_SPANS,
    MOST_WINDOW,
    HistoryRequest,
    HistoryWindow,
    JobSpan,
    MessageSpan,
    PreviousJobBytes,
    RecvSpan,
    SeekRequest,
    SeekResult,
    find_spans,
)
from trcvtui.net.received_ring import ReceivedRing
from trcvtui.udt.byte_text import MOST_BYTES_COUNTED, describe_hit, find_first, find_last

STRETCH_BYTES: Final = 512 * 1024  # searched for one picture, all patterns together
MOST_SEARCHES: Final = 8  # of several screens
MOST_JOB_BYTES: Final = 65_536  # bytes of one job in a picture: as many as a job can have
ByteRuns = list[tuple[int, bytes]]  # position, bytes
LOST_REASON: Final = "of an unknown job: lines of the ledger were overwritten before they were read"


class _StreamAtScan:
    """One stream with its ring as it was after a scan, for one picture."""

    def __init__(self, name: str, ring: ReceivedRing, stream: ReceivedStream, scan: int) -> None:
        self.name, self.ring, self.stream, self.scan = name, ring, stream, scan
        self.begin = max(ring.first, min(stream.begin, ring.end))
        self.end = max(self.begin, min(ring.end, _end_at(scan, stream.recvs), _end_at(scan, stream.blanks)))

    @property
    def lack_reason(self) -> str:
        return (
            self.ring.missing_reason if self.begin == self.ring.first else "older than the jobs that are kept"
        )

    def read_runs(self, start: int, stop: int) -> ByteRuns:
        """Return the bytes from `start` to `stop`. A new run begins after missing bytes."""
        start, stop = max(start, self.begin), min(stop, self.end)
        found: ByteRuns = []
        for blank in find_spans(self.stream.blanks, start, stop):
            if blank.position > start:
                found.append((start, self.ring.read(start, blank.position)))
            start = blank.stop
        return [*found, (start, self.ring.read(start, stop))] if start < stop else found

    def list_jobs(self, start: int, stop: int) -> list[JobSpan]:
        """Return the spans of jobs between two positions; a job that ended later counts as running."""
        spans = find_spans(self.stream.jobs, start, stop)[: MOST_SPANS + 1]
        return [span if span.scan <= self.scan or not span.is_kept else as_running(span) for span in spans]

    def read_job(self, pieces: list[JobSpan], first: int = 0, size: int = MOST_JOB_BYTES) -> bytes:
        """Return `size` bytes of a job from byte `first` on, or b"" if any byte of the job is missing."""
        whole = pieces[0].whole if pieces else 0
        parts = [self.ring.read(piece.position, piece.stop) for piece in pieces if piece.is_kept]
        content = b"".join(parts)
        return content[first : first + size] if len(content) == whole else b""


class StreamReader:
    """Answers requests, and remembers how far each of the newest searches has come."""

    def __init__(self, bench: Bench, reader: LedgerReader) -> None:
        self.streams = ReceivedStreams(bench, reader)
        self._bench, self._catch_up = bench, reader.catch_up
        self._searches: dict[SeekRequest, tuple[int, SeekResult | None]] = {}
        self._reached = 0

    def read_window(self, request: HistoryRequest) -> HistoryWindow:
        """Return the requested window, moved or cut so that it lies within the stored bytes."""
        self._catch_up()
        ring = self._bench.runtime.received_ring(request.connect)
        if ring is None:
            return HistoryWindow(request.connect, 0, 0)
        of = _StreamAtScan(request.connect, ring, self.streams.streams[request.connect], request.scan)
        size = max(0, min(request.size, MOST_WINDOW))
        start = of.end - size if request.start == AT_END else request.start
        start = max(of.begin, min(start, of.end))
        jobs, recvs, messages, stop = self._collect_spans(of, start, min(start + size, of.end))
        return HistoryWindow(
            request.connect, of.begin, of.end, start, ring.read(start, stop),
            jobs, recvs, tuple(messages),
            tuple(_read_previous(of, jobs, start, stop)) if request.before else (),
            self._continue_seek(of, request.seek), self._read_job_at(of, request.job_at),
            _read_previous_data(of, request.data), of.lack_reason,
        )  # fmt: skip

    def _collect_spans(
        self, of: _StreamAtScan, start: int, stop: int
    ) -> tuple[tuple[JobSpan, ...], tuple[RecvSpan, ...], list[MessageSpan], int]:
        ended = of.list_jobs(start, stop)
        recvs = find_spans(of.stream.recvs, start, stop)[: MOST_SPANS + 1]
        running = self.streams.list_open_spans(of.name, start, stop)
        jobs = [*_fill_gaps(sorted([*ended, *running], key=BY_POSITION), start, stop)]
        stop = min(
            [stop, *(spans[MOST_SPANS].position for spans in (jobs, recvs) if len(spans) > MOST_SPANS)]
        )
        messages: list[MessageSpan] = []
        for recv in recvs[:MOST_SPANS]:
            if len(messages) >= MOST_SPANS:
                stop = min(stop, recv.position)
                break
            self._add_messages(messages, of.name, recv, (start, stop))
        return tuple(find_spans(jobs, start, stop)), tuple(find_spans(recvs, start, stop)), messages, stop

    def _add_messages(
        self, messages: list[MessageSpan], name: str, recv: RecvSpan, window: tuple[int, int]
    ) -> None:
        position = max(recv.position, window[0])
        offset = recv.offset + position - recv.position
        size = min(recv.stop, window[1]) - position
        link = name, recv.incarnation
        for found in self.streams.index.find_messages_within(link, offset, size, position):
            last = messages[-1] if messages else None
            if last is not None and _is_continued_by(last, found):
                messages[-1] = last._replace(size=last.size + found.size)
            else:
                messages.append(found)

    @staticmethod
    def _read_job_at(of: _StreamAtScan, position: int | None) -> tuple[int, bytes] | None:
        """Return where the job, or job piece, at a position begins, and all bytes of the job."""
        if position is None:
            return None
        jobs = of.stream.jobs
        place = bisect_right(jobs, position, key=BY_STOP)
        is_here = place < len(jobs) and jobs[place].position <= position
        return (jobs[place].position, of.read_job(of.stream.list_pieces(place))) if is_here else None

    # -- searches ----------------------------------------------------------------------------------------

    def _continue_seek(self, of: _StreamAtScan, seek: SeekRequest | None) -> SeekResult | None:
        if seek is None:
            return None
        is_new, found = seek not in self._searches, None
        self._reached, answer = self._searches.pop(seek, (seek.start, None))
        if is_new:
            if seek.job is not None:
                found = of.stream.find_job_position(*seek.job)
            elif not seek.patterns:
                found = of.stream.find_next_ended(seek.start, seek.is_forward, not seek.dropped)
            if not seek.patterns or seek.job is not None:
                is_kept = found is not None and of.begin <= found <= of.end
                answer = SeekResult(seek.number, found if is_kept else None)
        if answer is None or answer.share < 1:
            answer = self._search_stretch(of, seek)
        self._searches[seek] = self._reached, answer
        if len(self._searches) > MOST_SEARCHES:
            del self._searches[next(iter(self._searches))]
        return answer

    def _search_stretch(self, of: _StreamAtScan, seek: SeekRequest) -> SeekResult:
        """Search one more stretch. Stretches overlap, so that nothing on their border is missed."""
        size = max(1, STRETCH_BYTES // len(seek.patterns))
        more = max(map(len, seek.patterns)) - 1
        if seek.is_forward:
            start = max(self._reached, of.begin)
            found = _find_first(of.read_runs(start, start + size + more), seek.patterns)
            self._reached = start + size
            is_over = self._reached >= of.end
            done, whole = self._reached - seek.start, of.end - seek.start
        else:
            stop = min(self._reached, of.end)
            found = _find_last(of.read_runs(stop - size, stop + more), seek.patterns, stop)
            self._reached = stop - size
            is_over = self._reached <= of.begin
            done, whole = seek.start - self._reached, seek.start - of.begin
        if found is not None:
            few = of.read_runs(of.begin, min(of.end, of.begin + MOST_BYTES_COUNTED + 1))
            return SeekResult(seek.number, found, hit=describe_hit(few, seek.patterns, found))
        if is_over:
            return SeekResult(seek.number, None)
        return SeekResult(seek.number, None, min(0.99, done / max(1, whole)))


def _end_at(scan: int, spans: Sequence[RecvSpan | JobSpan]) -> int:
    """Return the position of the first bytes that came after a scan."""
    place = bisect_right(spans, scan, key=BY_SCAN)
    return spans[place].position if place < len(spans) else MAX_SCAN


def _fill_gaps(jobs: list[JobSpan], start: int, stop: int) -> Iterator[JobSpan]:
    """Yield the jobs, and between them the bytes without a known job."""
    reached = start
    for job in jobs:
        if job.position > reached:
            yield _make_unknown_span(reached, job.position)
        yield job
        reached = max(reached, job.stop)
    if reached < stop:
        yield _make_unknown_span(reached, stop)


def _make_unknown_span(start: int, stop: int) -> JobSpan:
    return JobSpan(start, stop - start, "", 0, 0, 0, False, LOST_REASON, whole=stop - start, is_open=True)


def _is_continued_by(last: MessageSpan, found: MessageSpan) -> bool:
    return (
        (last.peer, last.number, last.stop) == (found.peer, found.number, found.position)
        and last.first + last.size == found.first
    )  # fmt: skip


def _find_first(runs: ByteRuns, patterns: tuple[bytes, ...]) -> int | None:
    found = ((place, find_first(part, patterns)) for place, part in runs)
    return next((place + at for place, at in found if at is not None), None)


def _find_last(runs: ByteRuns, patterns: tuple[bytes, ...], before: int) -> int | None:
    found = ((place, find_last(part, patterns, before - place)) for place, part in reversed(runs))
    return next((place + at for place, at in found if at is not None), None)


def _read_previous(
    of: _StreamAtScan, jobs: Iterable[JobSpan], start: int, stop: int
) -> Iterator[PreviousJobBytes]:
    """Yield, for each job of the window, the bytes at the same places in the job before."""
    for job in jobs:
        earlier = of.stream.find_job_before(job.position, job.instance) if job.done and not job.first else []
        if earlier:
            at = max(start, job.position)
            content = of.read_job(earlier, at - job.position, min(stop, job.stop) - at)
            if content:
                yield PreviousJobBytes(at, content, earlier[0].number)


def _read_previous_data(of: _StreamAtScan, request: tuple[str, int, int] | None) -> PreviousJobBytes | None:
    """Return the bytes, from the previous job, that DATA held before the newest job of an instance."""
    if request is None:
        return None
    instance, first, size = request
    newest = of.stream.find_job_before(of.end + 1, instance, of.scan)
    earlier = of.stream.find_job_before(newest[0].position, instance) if newest else []
    content = of.read_job(earlier, first, min(size, MOST_WINDOW))
    return PreviousJobBytes(first, content, earlier[0].number) if content else None
