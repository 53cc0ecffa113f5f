"""Where a byte came from: the job, the recv call, the scan and the peer's message, as the ledger tells it.

Rule: what the ledger did not tell (lines skipped, a partner that is no peer here) is left out, not guessed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final, NamedTuple, Protocol

from trcvtui.plc.ledger import Line, PeerSent

KEPT: Final = 2000
KEPT_LINKS: Final = 256
MOST_PARTS: Final = 64  # of one job; one that was cut oftener counts as never cut


class Span(NamedTuple):
    """Bytes `offset` .. `offset + size` of a stream, by which recv call or message, in which scan."""

    offset: int
    size: int
    number: int
    scan: int
    peer: str = ""
    t_ns: int = 0


Part = tuple[int, int]  # where bytes of the stream begin, how many


class OriginJob(NamedTuple):
    """A receive job: what it began or ended with. `scan` is that of its end, of a running job its start.

    `parts` are its bytes of the stream, where another job of the CONNECT has read in between.
    """

    number: int
    scan: int
    link: tuple[str, int]
    offset: int
    size: int
    parts: tuple[Part, ...] = ()

    def pieces(self) -> tuple[Part, ...]:
        """Return all that it has of the stream, in order."""
        return self.parts or ((self.offset, self.size),)

    def place(self, byte: int) -> int:
        """Return where a byte of the job lies in the stream."""
        for offset, size in self.pieces():
            if byte < size:
                return offset + byte
            byte -= size
        return self.offset + byte


class Origin(NamedTuple):
    """What is known of one byte; empty fields are not known."""

    job: OriginJob
    recv: Span | None
    message: Span | None
    message_byte: int = 0


class _Bytes(Protocol):
    """The ledger's BytesReceived, JobEnded and JobStarted in what they share."""

    @property
    def connection(self) -> str: ...
    @property
    def incarnation(self) -> int: ...
    @property
    def offset(self) -> int: ...


class _Recv(_Bytes, Protocol):
    @property
    def recv(self) -> int: ...
    @property
    def size(self) -> int: ...
    @property
    def instance(self) -> str: ...


class _BegunJob(_Bytes, Protocol):
    @property
    def instance(self) -> str: ...
    @property
    def job(self) -> int: ...
    @property
    def length(self) -> int: ...


class _Ended(_Bytes, Protocol):
    @property
    def instance(self) -> str: ...
    @property
    def job(self) -> int: ...
    @property
    def size(self) -> int: ...
    @property
    def done(self) -> bool: ...


class _Noted(Protocol):
    @property
    def connection(self) -> str: ...
    @property
    def incarnation(self) -> int: ...
    @property
    def what(self) -> str: ...
    @property
    def local(self) -> str: ...
    @property
    def peer(self) -> str: ...


class Provenance:
    """The ledger's lines about bytes, bounded. A link is (CONNECT, incarnation)."""

    def __init__(self) -> None:
        self._recvs: dict[str, tuple[int, deque[Span]]] = {}
        self._sent: dict[tuple[str, str], deque[Span]] = {}
        self._ends: dict[str, tuple[int, str, str]] = {}
        self._delivered: dict[str, OriginJob] = {}
        self._running: dict[str, OriginJob] = {}
        self._parts: dict[str, list[Part]] = {}  # of the running jobs, what came in turn as one
        # The classes live below the floors that the screen may import: they are known by name.
        self._takers: dict[str, Callable[[Line, Any], None]] = {
            "PeerSent": self._message_sent,
            "BytesReceived": self._bytes_received,
            "JobStarted": self._job_started,
            "JobEnded": self._job_ended,
            "ConnectionNote": self._connection_noted,
        }

    def note(self, line: Line) -> None:
        """Take one line of the ledger."""
        take = self._takers.get(type(line.event).__name__)
        if take is not None:
            take(line, line.event)

    def _message_sent(self, line: Line, event: PeerSent) -> None:
        ends = (event.local, event.remote)
        if ends not in self._sent and len(self._sent) >= KEPT_LINKS:
            del self._sent[next(iter(self._sent))]
        spans = self._sent.setdefault(ends, deque(maxlen=KEPT))
        spans.append(Span(event.offset, event.size, event.message, line.scan, event.peer, line.t_ns))

    def _bytes_received(self, line: Line, event: _Recv) -> None:
        span = Span(event.offset, event.size, event.recv, line.scan, t_ns=line.t_ns)
        self._recvs_of(event.connection, event.incarnation).append(span)
        parts = self._parts.get(event.instance)
        if parts is None or len(parts) > MOST_PARTS:
            return
        if parts and sum(parts[-1]) == event.offset:
            parts[-1] = parts[-1][0], parts[-1][1] + event.size
        else:
            parts.append((event.offset, event.size))

    def _job_started(self, line: Line, event: _BegunJob) -> None:
        link = (event.connection, event.incarnation)
        self._running[event.instance] = OriginJob(event.job, line.scan, link, event.offset, event.length)
        self._parts[event.instance] = []

    def _job_ended(self, line: Line, event: _Ended) -> None:
        self._running.pop(event.instance, None)
        parts = tuple(self._parts.pop(event.instance, ()))
        if event.done:
            link = (event.connection, event.incarnation)
            # Of a job whose lines were skipped in part nothing is known but where it began.
            whole = parts if _size(parts) == event.size and len(parts) <= MOST_PARTS else ()
            self._delivered[event.instance] = OriginJob(
                event.job, line.scan, link, event.offset, event.size, whole
            )

    def _connection_noted(self, line: Line, event: _Noted) -> None:
        if event.what == "connected":
            self._ends[event.connection] = (event.incarnation, event.local, event.peer)

    def _recvs_of(self, connection: str, incarnation: int) -> deque[Span]:
        if connection not in self._recvs or self._recvs[connection][0] != incarnation:
            self._recvs[connection] = (incarnation, deque(maxlen=KEPT))
        return self._recvs[connection][1]

    def origin(self, instance: str, of_job: bool, byte: int) -> Origin | None:
        """Return where byte number `byte` of DATA, or of the running job, came from."""
        job = self._job(instance, of_job)
        if job is None or not 0 <= byte < job.size:
            return None
        place = job.place(byte)
        message = self._message_at(job.link, place)
        return Origin(job, self._recv_at(job.link, place), message, place - message.offset if message else 0)

    def messages(self, instance: str, of_job: bool) -> list[Span]:
        """Return the peer's messages in DATA, or in the running job, newest first.

        Offsets count from the job's first byte: a negative one began before it.
        """
        job = self._job(instance, of_job)
        found: list[Span] = []
        if job is None:
            return found
        behind = job.size
        for offset, size in reversed(job.pieces()):
            behind -= size  # bytes of the job before this piece
            found += self._messages_in(job.link, offset, size, behind)
        return found

    def _messages_in(self, link: tuple[str, int], offset: int, size: int, before: int) -> Iterator[Span]:
        """Yield the messages of one piece of a job; what goes on from an earlier piece is told there."""
        for span in reversed(self._messages_of(link)):
            start = span.offset - offset
            if start + span.size <= 0:
                return
            if start < size and (start >= 0 or not before):
                yield span._replace(offset=before + start)

    def _job(self, instance: str, of_job: bool) -> OriginJob | None:
        if not of_job:
            return self._delivered.get(instance)
        job, parts = self._running.get(instance), self._parts.get(instance)
        if job is None or not parts or len(parts) > MOST_PARTS:
            return job
        (last, have), missing = parts[-1], job.size - _size(parts)
        return job._replace(parts=(*parts[:-1], (last, have + missing)))

    def message_starts(self, instance: str, of_job: bool) -> frozenset[int]:
        """Return the bytes of DATA, or of the running job, with which a peer's message begins."""
        return frozenset(span.offset for span in self.messages(instance, of_job) if span.offset >= 0)

    def _recv_at(self, link: tuple[str, int], place: int) -> Span | None:
        incarnation, spans = self._recvs.get(link[0], (0, _NOTHING))
        return _covering(spans, place) if incarnation == link[1] else None

    def _message_at(self, link: tuple[str, int], place: int) -> Span | None:
        return _covering(self._messages_of(link), place)

    def _messages_of(self, link: tuple[str, int]) -> deque[Span]:
        incarnation, local, peer = self._ends.get(link[0], (0, "", ""))
        return self._sent.get((peer, local), _NOTHING) if incarnation == link[1] else _NOTHING


_NOTHING: Final[deque[Span]] = deque()


def _size(parts: Iterable[Part]) -> int:
    return sum(size for _, size in parts)


def _covering(spans: deque[Span], place: int) -> Span | None:
    return next((s for s in reversed(spans) if s.offset <= place < s.offset + s.size), None)
