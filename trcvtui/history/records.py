"""The records of the past: windows on a stream of received bytes, and the facts of one CONNECT.

Rule: facts are only what was seen. An empty field or None is unknown, and must not be guessed.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from operator import attrgetter
from typing import Final, NamedTuple, TypeVar

from msgspec import Struct

from trcvtui.blocks.outcome import Cause
from trcvtui.plc.ledger import A_HOLE

# -- windows ----------------------------------------------------------------------------------------------

# A stream is the ring of one CONNECT, UDP_CONFIG or ComBuffer (net/received_ring.py): its bytes as they came.
# A position counts them from the start of the PLC, even if older ones are gone.

BY_POSITION: Final = attrgetter("position")
BY_STOP: Final = attrgetter("stop")
BY_SCAN: Final = attrgetter("scan")
MOST_WINDOW: Final = 8192  # bytes in a picture
MOST_SPANS: Final = 512  # jobs, recv calls or messages in a picture: with smaller ones it covers fewer bytes
AT_END: Final = -1  # a window that ends with the newest byte
MAX_SCAN: Final = 1 << 62  # after every scan


class JobSpan(NamedTuple):
    """Bytes of one receive job, or bytes that were dropped, at `position` of the stream.

    `reason` says why bytes never reached DATA. If `is_kept` is False, the PLC never had the bytes.
    `whole` is the size of the job. If another job read in between, each piece of the job has its own span.
    `first` is the piece's first byte in the job. `prefix` and `suffix` are the sizes of a frame's marks.
    With `is_open`, the job or frame has not ended yet, or is unknown.
    """

    position: int
    size: int
    instance: str
    number: int
    scan: int
    t_ns: int
    done: bool
    reason: str = ""
    is_kept: bool = True
    whole: int = 0
    prefix: int = 0
    suffix: int = 0
    is_frame: bool = False  # of a block on a ComBuffer
    first: int = 0
    is_open: bool = False

    @property
    def stop(self) -> int:
        return self.position + self.size


class RecvSpan(NamedTuple):
    """The bytes of one recv call, from byte `offset` of the connection on."""

    position: int
    size: int
    number: int
    scan: int
    t_ns: int
    offset: int
    incarnation: int = 0

    @property
    def stop(self) -> int:
        return self.position + self.size


class MessageSpan(NamedTuple):
    """Bytes of a peer's message of `whole` bytes, from its byte `first` on."""

    position: int
    size: int
    peer: str
    number: int
    first: int
    whole: int

    @property
    def stop(self) -> int:
        return self.position + self.size

    @property
    def begins(self) -> bool:
        return self.first == 0

    @property
    def ends(self) -> bool:
        return self.first + self.size >= self.whole


Span = TypeVar("Span", JobSpan, RecvSpan, MessageSpan)


def find_spans(spans: Sequence[Span], start: int, stop: int) -> Sequence[Span]:
    first = bisect_right(spans, start, key=BY_STOP)
    return spans[first : bisect_left(spans, stop, lo=first, key=BY_POSITION)]


Pieces = list[tuple[int, int]]  # position and size of the bytes of one job; another may read in between


def join_pieces(parts: Iterable[tuple[int, int]]) -> Pieces:
    """Join pieces that follow each other without a hole, and return all pieces."""
    found: Pieces = []
    for position, size in parts:
        if found and sum(found[-1]) == position:
            found[-1] = found[-1][0], found[-1][1] + size
        else:
            found.append((position, size))
    return found


def span_at(spans: Sequence[Span], position: int) -> Span | None:
    return next(iter(find_spans(spans, position, position + 1)), None)


class SeekRequest(Struct, frozen=True):
    """A search from position `start` on for a DONE, for one of the `patterns`, or for `dropped` bytes.

    With `job`, search everywhere for the job with this instance and number.
    """

    number: int
    start: int
    is_forward: bool
    patterns: tuple[bytes, ...] = ()
    dropped: bool = False
    job: tuple[str, int] | None = None


class SeekResult(Struct, frozen=True):
    """The position that a SeekRequest has found, or None. `share` is the searched part, 1.0 for all."""

    number: int
    position: int | None
    share: float = 1.0
    hit: str = ""  # which one of how many, where they were counted


class HistoryRequest(Struct, frozen=True):
    """A request for a part of a CONNECT's stream. With `before`, add the bytes of the job before each job.

    With `job_at`, add all bytes of the job at this position. With `data` (instance, first byte, size), add
    the bytes that DATA held before its newest job. The answer shows the state after `scan`.
    """

    connect: str
    start: int = AT_END
    size: int = 0
    before: bool = False
    seek: SeekRequest | None = None
    job_at: int | None = None
    data: tuple[str, int, int] | None = None
    scan: int = MAX_SCAN


class PreviousJobBytes(Struct, frozen=True):
    """Bytes of the previous job, to compare with bytes of the stream or of DATA from `position` on."""

    position: int
    content: bytes
    job: int


class HistoryWindow(Struct, frozen=True):
    """A part of a stream from `start` on. The stream is stored from `begin` to `end`. Missing bytes are 0.

    A span that crosses an edge of the window is not cut.
    """

    connect: str
    begin: int
    end: int
    start: int = 0
    content: bytes = b""
    jobs: tuple[JobSpan, ...] = ()
    recvs: tuple[RecvSpan, ...] = ()
    messages: tuple[MessageSpan, ...] = ()
    before: tuple[PreviousJobBytes, ...] = ()
    sought: SeekResult | None = None
    job: tuple[int, bytes] | None = None
    data: PreviousJobBytes | None = None
    lack: str = ""  # why nothing before `begin` is kept

    @property
    def stop(self) -> int:
        return self.start + len(self.content)

    def part(self, positions: range) -> bytes:
        return self.content[positions.start - self.start : positions.stop - self.start]

    def has_values(self, positions: range) -> bool:
        """Return whether the window has the value of each byte at these positions."""
        first, stop = positions.start, positions.stop
        is_kept = all(job.is_kept for job in find_spans(self.jobs, first, stop))
        holes = [span for span in find_spans(self.messages, first, stop) if span.peer == A_HOLE]
        return self.start <= first < stop <= self.stop and is_kept and not holes


# -- facts ------------------------------------------------------------------------------------------------

SETUP_CALLS: Final = frozenset({"description", "identity"})  # attempts that fail in these have no socket yet
PAUSE_SCANS: Final = 5  # after so many without a byte a new burst begins


class ScanStamp(Struct, frozen=True):
    """A scan and its time in ns of the run."""

    scan: int = 0
    t_ns: int = 0


class Sizes(Struct, frozen=True):
    """Sizes in bytes. `last` has the newest sizes, the oldest first. `count` counts all sizes."""

    count: int = 0
    last: tuple[int, ...] = ()

    @property
    def common_size(self) -> int | None:
        """Return the one size that all of `last` have, or None if they differ or `last` is empty."""
        return self.last[0] if self.last and min(self.last) == max(self.last) else None


class DroppedJob(Struct, frozen=True):
    """A job that ended within a frame, and lost `have` of `need` bytes, up to byte `end` of the stream."""

    at: ScanStamp
    instance: str
    reason: str
    have: int
    need: int
    end: int


class FailureCount(Struct, frozen=True):
    """Attempts that failed with the same call and errno since the connection was last up."""

    call: str
    error: str
    count: int
    last: ScanStamp
    injected: bool = False
    peer: str = ""


class FailedAttempt(Struct, frozen=True):
    """The last attempt that failed since the connection was last up, or since it began to listen.

    `status` and `condition` are what the instance showed of the attempt, 0 and "" if it showed nothing.
    `said` has what the partner or the session said, in words.
    """

    at: ScanStamp
    cause: Cause
    status: int = 0
    condition: str = ""
    said: str = ""


class DroppedClient(Struct, frozen=True):
    """A client that was dropped before it was a partner: its handshake was wrong or named another TSAP."""

    at: ScanStamp
    peer: str
    why: str


class RejectedClients(Struct, frozen=True):
    """Clients that were reset at once, as wrong partners or second clients. `peer` is the last client."""

    count: int
    peer: str
    last: ScanStamp


class LastLoss(Struct, frozen=True):
    """The last end of a connection. `what` is the name of the ledger event. `peer` is the partner."""

    at: ScanStamp
    what: str
    peer: str = ""
    error: str = ""
    injected: bool = False
    up_ns: int | None = None  # how long it was up


class ConnectFacts(Struct, frozen=True):
    """The known facts of one CONNECT and one of its instances, even from overwritten ledger lines."""

    sender: str = ""
    messages: Sizes = Sizes()
    begins_in: MessageSpan | None = None  # the message that holds the first byte of the running job
    bursts: Sizes = Sizes()
    longest_gap_ns: int = 0  # between the last bursts
    received: int = 0  # bytes of the stream so far
    job_offset: int | None = None
    job_began: ScanStamp | None = None
    job_adhoc: bool = False
    drop: DroppedJob | None = None
    drop_cuts: bool | None = None  # whether the last drop cut a message in two
    after_drop: MessageSpan | None = None  # the message that holds the first byte after it
    up_since: ScanStamp | None = None
    down_since: ScanStamp | None = None
    failures: tuple[FailureCount, ...] = ()
    attempt: FailedAttempt | None = None
    dropped: DroppedClient | None = None
    wrong_partner: RejectedClients | None = None
    second_client: RejectedClients | None = None
    loss: LastLoss | None = None
    losses: int = 0
    datagrams: Sizes = Sizes()  # of a UDP socket, from any sender, with their sizes on the wire
    open_since: ScanStamp | None = None  # of that socket
