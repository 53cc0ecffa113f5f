"""Reads windows out of the history for the screen, and looks for bytes in it a stretch at a time."""

from __future__ import annotations

from bisect import bisect_right
from operator import attrgetter
from typing import Final

from trcvtui.history.received import JobHistory, JobStream, ReceivedChunk
from trcvtui.history.records import (
    END,
    MOST_SPANS,
    MOST_WINDOW,
    HistoryRequest,
    HistoryWindow,
    JobSpan,
    MessageSpan,
    PreviousJobBytes,
    RecvSpan,
    Seek,
    SeekResult,
)
from trcvtui.udt.byte_text import MOST_COUNTED, first_in, hit_of, last_in

STRETCH: Final = 512 * 1024  # searched for one picture, all patterns together
MOST_JOB: Final = 65_536  # bytes of one job in a picture: as much as a job can write
_NOTHING: Final = JobStream()
_STOP: Final = attrgetter("stop")


class HistoryReader:
    """Answers requests. Of a search only the place is remembered up to which it has come."""

    def __init__(self, history: JobHistory) -> None:
        self._history = history
        self._seek: Seek | None = None
        self._reached = 0
        self._answer: SeekResult | None = None

    def window(self, request: HistoryRequest) -> HistoryWindow:
        """Return the window that is asked for; one outside is moved to what is kept."""
        self._history.catch_up()
        self._history.watched = request.connect
        stream = self._history.streams.get(request.connect, _NOTHING)
        size = max(0, min(request.size, MOST_WINDOW))
        start = stream.end - size if request.start == END else request.start
        start = max(stream.begin, min(start, stream.end))
        jobs, recvs, messages, stop = self._spans(stream, start, min(start + size, stream.end))
        return HistoryWindow(
            request.connect, stream.begin, stream.end, start, _content(stream, start, stop),
            tuple(jobs), tuple(recvs), tuple(messages),
            tuple(_before(stream, jobs, start, stop)) if request.before else (),
            self._sought(stream, request.seek), _job_at(stream, request.job_at),
            _before_data(stream, request.data),
        )  # fmt: skip

    def _spans(
        self, stream: JobStream, start: int, stop: int
    ) -> tuple[list[JobSpan], list[RecvSpan], list[MessageSpan], int]:
        jobs: list[JobSpan] = []
        recvs: list[RecvSpan] = []
        messages: list[MessageSpan] = []
        for chunk in stream.from_position(start):
            if chunk.position >= stop:
                break
            if len(jobs) >= MOST_SPANS:
                return jobs, recvs, messages, chunk.position
            jobs.append(chunk.span)
            known = chunk.recvs
            place = bisect_right(known, start, key=_STOP)
            while place < len(known) and (recv := known[place]).position < stop:
                if max(len(recvs), len(messages)) >= MOST_SPANS:
                    return jobs, recvs, messages, recv.position
                _append(recvs, recv)
                self._add_messages(messages, chunk, recv, (start, stop))
                place += 1
        return jobs, recvs, messages, stop

    def _add_messages(
        self, messages: list[MessageSpan], chunk: ReceivedChunk, recv: RecvSpan, window: tuple[int, int]
    ) -> None:
        position = max(recv.position, window[0])
        offset = recv.offset + position - recv.position
        size = min(recv.stop, window[1]) - position
        for found in self._history.index.messages_within(chunk.link, offset, size, position):
            last = messages[-1] if messages else None
            if last is not None and _goes_on(last, found):
                messages[-1] = last._replace(size=last.size + found.size)
            else:
                messages.append(found)

    # -- looking for a place -----------------------------------------------------------------------------

    def _sought(self, stream: JobStream, seek: Seek | None) -> SeekResult | None:
        if seek is None:
            return None
        if self._seek != seek:
            self._seek, self._answer, self._reached = seek, None, seek.start
            if seek.job is not None:
                self._answer = SeekResult(seek.number, stream.job(*seek.job))
            elif not seek.patterns:
                self._answer = SeekResult(
                    seek.number, stream.done(seek.start, seek.is_forward, not seek.dropped)
                )
        if self._answer is None or self._answer.share < 1:
            self._answer = self._search(stream, seek)
        return self._answer

    def _search(self, stream: JobStream, seek: Seek) -> SeekResult:
        """Search one stretch more; stretches overlap, so that nothing on their border is missed."""
        size = max(1, STRETCH // len(seek.patterns))
        more = max(map(len, seek.patterns)) - 1
        if seek.is_forward:
            start = max(self._reached, stream.begin)
            found = _first(stream.runs(start, start + size + more), seek.patterns)
            self._reached = start + size
            is_over = self._reached >= stream.end
            done, whole = self._reached - seek.start, stream.end - seek.start
        else:
            stop = min(self._reached, stream.end)
            found = _last(stream.runs(stop - size, stop + more), seek.patterns, stop)
            self._reached = stop - size
            is_over = self._reached <= stream.begin
            done, whole = seek.start - self._reached, seek.start - stream.begin
        if found is not None:
            few = stream.runs(stream.begin, min(stream.end, stream.begin + MOST_COUNTED + 1))
            return SeekResult(seek.number, found, hit=hit_of(few, seek.patterns, found))
        if is_over:
            return SeekResult(seek.number, None)
        return SeekResult(seek.number, None, min(0.99, done / max(1, whole)))


def _append(recvs: list[RecvSpan], recv: RecvSpan) -> None:
    """Append a recv call; the bytes of one go on in the job, or frame, that comes next."""
    last = recvs[-1] if recvs else recv
    before = last.number, last.scan, last.stop, last.offset + last.size
    if before == (recv.number, recv.scan, recv.position, recv.offset):
        recvs[-1] = last._replace(size=last.size + recv.size)
    else:
        recvs.append(recv)


def _goes_on(last: MessageSpan, found: MessageSpan) -> bool:
    return (
        (last.peer, last.number, last.stop) == (found.peer, found.number, found.position)
        and last.first + last.size == found.first
    )  # fmt: skip


def _content(stream: JobStream, start: int, stop: int) -> bytes:
    content = bytearray(stop - start)
    for place, part in stream.runs(start, stop):
        content[place - start : place - start + len(part)] = part
    return bytes(content)


def _first(runs: list[tuple[int, bytes]], patterns: tuple[bytes, ...]) -> int | None:
    for place, part in runs:
        found = first_in(part, patterns)
        if found is not None:
            return place + found
    return None


def _last(runs: list[tuple[int, bytes]], patterns: tuple[bytes, ...], before: int) -> int | None:
    for place, part in reversed(runs):
        found = last_in(part, patterns, before - place)
        if found is not None:
            return place + found
    return None


def _before(stream: JobStream, jobs: list[JobSpan], start: int, stop: int) -> list[PreviousJobBytes]:
    """Return, for each job of the window, the bytes of the job before it at the same places."""
    found: list[PreviousJobBytes] = []
    for job in jobs:
        earlier = stream.job_before(job.position, job.instance) if job.done else None
        if earlier is not None and earlier.content:
            first = max(start, job.position)
            content = earlier.content[first - job.position : min(stop, job.stop) - job.position]
            found.append(PreviousJobBytes(first, content, earlier.span.number))
    return found


def _job_at(stream: JobStream, position: int | None) -> tuple[int, bytes] | None:
    chunk = stream.at(position) if position is not None else None
    return (chunk.position, chunk.content[:MOST_JOB]) if chunk is not None else None


def _before_data(stream: JobStream, asked: tuple[str, int, int] | None) -> PreviousJobBytes | None:
    """Return bytes of the job before the newest one of an instance: what DATA held before."""
    if asked is None:
        return None
    instance, first, size = asked
    newest = stream.job_before(stream.end + 1, instance)
    earlier = stream.job_before(newest.span.position, instance) if newest is not None else None
    if earlier is None or not earlier.span.is_kept:
        return None
    return PreviousJobBytes(
        first, earlier.content[first : first + min(size, MOST_WINDOW)], earlier.span.number
    )
