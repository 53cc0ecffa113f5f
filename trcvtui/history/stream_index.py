"""Finds the message, recv call, job and scan of a byte in a received stream. All readers share one index.

The index gets each line of the ledger before the other listeners (`subscribe`).
For each line the index notes only the fields. Records are made when they are requested.
Rule 1: what the ledger lacks (lines skipped, a partner that is no peer here) is left out, not guessed.
Rule 2: two ends can connect again later. The peer's stream then begins with byte 0 again.
Each incarnation of the CONNECT has the messages of its own connection only.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, Final, NamedTuple

from trcvtui.blocks.environment import ModeChanged, ReceiveEnded, ReceiveStarted
from trcvtui.history.records import (
    MAX_SCAN,
    PAUSE_SCANS,
    MessageSpan,
    RecvSpan,
    ScanStamp,
    Sizes,
    join_pieces,
)
from trcvtui.net.events import BytesReceived, ConnectionChanged, EventKind
from trcvtui.plc.ledger import A_HOLE, A_PACKET, NO_END, PeerSent, StampedEvent

KEPT_MESSAGES: Final = 20_000  # of one connection; beyond them the older half is forgotten
KEPT_RECVS: Final = 65_536  # of one job: as many as it can have bytes
KEPT_STREAMS: Final = 256  # of peers
KEPT_LINKS: Final = 1024
KEPT_SIZES: Final = 40
KEPT_GAPS: Final = 8
KEPT_DOWN_TIMES: Final = 1000  # times of one CONNECT
ENDING_EVENTS: Final = frozenset(
    {
        EventKind.PARTNER_CLOSED,
        EventKind.LOST,
        EventKind.DISCONNECTED,
        EventKind.RESET,
        EventKind.STOPPED,
        EventKind.REPLACED,
    }
)

Listener = Callable[[int, int, int, Any], None]  # seq, scan, time in ns, the event
Ends = tuple[str, str]  # the peer's, then that of the CONNECT
LinkKey = tuple[str, int]  # CONNECT, incarnation
_SentMessage = tuple[int, int, int, str, int]  # offset, size, number, peer, when
_JobBegin = tuple[int, int, tuple[Any, ...]]  # scan, time, the fields of ReceiveStarted
_JobEnd = tuple[int, int, tuple[Any, ...], "_JobBegin | None", list[RecvSpan]]  # end, beginning, reads
_AFTER_OFFSET: Final = (1 << 62, 0, "")
BY_OFFSET: Final = attrgetter("offset")


class _SentMessages:
    """The messages of one peer on one connection, by the offset of their first byte."""

    def __init__(self) -> None:
        self.messages: list[_SentMessage] = []
        self.forgotten = 0

    def add(self, message: _SentMessage, keep: int) -> None:
        self.messages.append(message)
        if len(self.messages) > keep:
            del self.messages[: keep // 2]
            self.forgotten += keep // 2


class StreamBursts:
    """What arrived on one connection between two pauses, from any sender."""

    def __init__(self) -> None:
        self.count = self.size = self.scan = self.t_ns = 0
        self.last: deque[int] = deque(maxlen=KEPT_SIZES)
        self.gaps: deque[int] = deque(maxlen=KEPT_GAPS)

    def add_bytes(self, scan: int, t_ns: int, size: int) -> bool:
        """Take bytes that arrived. Return whether a pause preceded these bytes."""
        if self.scan == scan:
            self.size += size
            return False
        is_after_pause = not self.size or scan - self.scan > PAUSE_SCANS
        if not is_after_pause:
            self.size += size
        else:
            if self.size:
                self.last.append(self.size)
                self.gaps.append(t_ns - self.t_ns)
            self.count, self.size = self.count + 1, size
        self.scan, self.t_ns = scan, t_ns
        return is_after_pause

    @property
    def sizes(self) -> Sizes:
        last = (*self.last, self.size) if self.size else ()
        return Sizes(self.count, last[-KEPT_SIZES:])


def find_bursts(recvs: Iterable[RecvSpan], is_over: bool) -> list[range]:
    """Return where bytes between two pauses are. Leave out bytes without a known beginning or end.

    If `is_over`, a pause has followed the last recv call.
    """
    bursts, found, start = StreamBursts(), list[range](), -1  # no beginning is known
    last: RecvSpan | None = None
    for recv in recvs:
        is_after_pause = bursts.add_bytes(recv.scan, recv.t_ns, recv.size)
        follows = last is not None and (last.stop, last.offset + last.size) == (recv.position, recv.offset)
        if recv.offset == 0 or (is_after_pause and follows):
            found += [range(start, last.stop)] if last is not None and start >= 0 else []
            start = recv.position
        elif not follows:  # recv calls between are not known
            start = -1
        last = recv
    return found + ([range(start, last.stop)] if is_over and last is not None and start >= 0 else [])


class JobRecord(NamedTuple):
    """A receive job. `at` is the scan of the job's end, or of its start while the job runs.

    `recvs` are the recv calls of the job.
    """

    number: int
    link: LinkKey
    offset: int
    size: int
    adhoc: bool
    began: ScanStamp
    at: ScanStamp
    recvs: Sequence[RecvSpan] = ()

    def list_pieces(self, is_running: bool) -> list[tuple[int, int]]:
        """Return (offset, size) of each piece of the job: another job may have read in between."""
        found = join_pieces((recv.offset, recv.size) for recv in self.recvs)
        missing = self.size - sum(size for _, size in found)
        if found and missing and is_running:
            return [*found[:-1], (found[-1][0], found[-1][1] + missing)]
        return found if found and not missing else [(self.offset, self.size)]  # lines of it were skipped


class _InstanceReads:
    """What one instance has read: its running job, and the job whose bytes DATA has."""

    __slots__ = ("began", "cut", "delivered", "link", "reads", "runs")

    def __init__(self) -> None:
        self.began: _JobBegin | None = None
        self.runs = False
        self.reads: list[RecvSpan] = []  # of the running job
        self.link: LinkKey = "", 0  # of these reads
        self.delivered: _JobEnd | None = None
        self.cut: list[RecvSpan] = []  # of the newest job that ended without DONE


class _ReceivedBytes:
    """What a connection has received: the offset of the next byte, and the bytes between pauses."""

    __slots__ = ("bursts", "incarnation", "offset")

    def __init__(self) -> None:
        self.bursts = StreamBursts()
        self.incarnation = self.offset = 0


class ByteOrigin(NamedTuple):
    """The origin of one byte; None: unknown. `message.first` is the byte's place in the message."""

    job: JobRecord
    recv: RecvSpan | None
    message: MessageSpan | None


class StreamIndex:
    def __init__(self, kept_messages: int = KEPT_MESSAGES, kept_recvs: int = KEPT_RECVS) -> None:
        self._kept_messages, self._kept_recvs = kept_messages, kept_recvs
        self._sent: dict[tuple[Ends, int], _SentMessages] = {}
        self._newest: dict[Ends, int] = {}  # which connection of these ends is the newest
        self._claimed: dict[Ends, int] = {}
        self._links: dict[LinkKey, tuple[Ends, int]] = {}
        self._incarnations: dict[str, int] = {}
        self._down: dict[str, deque[tuple[int, int]]] = {}
        self.down_changes = 0
        self.packet_times: Callable[[Ends, int, int], int | None] | None = None  # of a recording: by offset
        self.has_holes = self._are_packets = False  # in a capture, bytes may be missing
        self._received: defaultdict[str, _ReceivedBytes] = defaultdict(_ReceivedBytes)  # by CONNECT
        self._readings: defaultdict[str, _InstanceReads] = defaultdict(_InstanceReads)  # by instance
        self.listeners: dict[type, list[Listener]] = {
            PeerSent: [self._handle_message_sent],
            BytesReceived: [self._handle_received],
            ReceiveStarted: [self._handle_job_start],
            ModeChanged: [self._handle_job_mode],
            ReceiveEnded: [self._handle_job_end],
            ConnectionChanged: [self._handle_connection],
        }
        self.ends: dict[bool, list[Listener]] = {True: [], False: []}  # called with ReceiveEnded, by DONE

    def subscribe(self, listeners: Mapping[type, Listener]) -> None:
        """From now on call each listener with the events of its type, after the index has read them."""
        for kind, listener in listeners.items():
            self.listeners.setdefault(kind, []).append(listener)

    # -- from the ledger --------------------------------------------------------------------------------

    def dispatch_events(self, stamped: Iterable[StampedEvent]) -> None:
        listeners = self.listeners
        for scan, t_ns, event in stamped:
            for listener in listeners.get(type(event), ()):
                listener(0, scan, t_ns, event)

    def forget_streams(self) -> None:
        """Forget all streams, as skipped lines of the ledger may have changed them (Rule 1)."""
        self._received.clear()
        self._readings.clear()
        self._sent.clear()
        self._links.clear()
        self._incarnations.clear()
        self._claimed = dict(self._newest)  # ends that meet again begin a new stream

    def _handle_message_sent(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        peer, message, local, remote, offset, size, ns = event
        t_ns = t_ns if ns < 0 else ns
        self.has_holes = self.has_holes or peer == A_HOLE
        self._are_packets = self._are_packets or peer == A_PACKET
        ends = local, remote
        turn = self._newest.get(ends, 0)
        sent = self._sent.get((ends, turn))
        if sent and offset <= sent.messages[-1][0] and local != NO_END:  # a new connection: Rule 2
            turn += 1
            sent = None
        if sent is None:
            turn = max(turn, self._claimed.get(ends, 0))
            if len(self._sent) >= KEPT_STREAMS:
                del self._sent[next(iter(self._sent))]
            self._newest[ends] = turn
            sent = self._sent.setdefault((ends, turn), _SentMessages())
        sent.add((offset, size, message, peer, t_ns), self._kept_messages)

    def _handle_connection(self, seq: int, scan: int, t_ns: int, event: ConnectionChanged) -> None:
        down = self._down.setdefault(event.connection, deque(maxlen=KEPT_DOWN_TIMES))
        self.down_changes += 1
        if event.what in ENDING_EVENTS and (not down or down[-1][1] < MAX_SCAN):
            down.append((t_ns, MAX_SCAN))
        elif down and (event.what is EventKind.CONNECTED or event.detail == "UDP"):
            down[-1] = down[-1][0], min(t_ns, down[-1][1])
        if event.what is not EventKind.CONNECTED:
            return
        ends = event.peer, event.local
        newest, claimed = self._newest.get(ends, 0), self._claimed.get(ends, -1)
        turn = newest if newest > claimed else claimed + 1  # Rule 2
        self._claimed[ends] = turn
        self._links[event.connection, event.incarnation] = ends, turn
        if len(self._links) > KEPT_LINKS:
            del self._links[next(iter(self._links))]
        self._incarnations[event.connection] = event.incarnation
        self._received[event.connection].bursts = StreamBursts()

    def _handle_received(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        connection, incarnation, recv, offset, size, instance, position, cut = event
        link = self._received[connection]
        link.incarnation, link.offset = incarnation, offset + size
        link.bursts.add_bytes(scan, t_ns, size)
        reading = self._readings[instance]
        reading.link = connection, incarnation
        reads = reading.reads
        reads.append(RecvSpan(position, size - cut, recv, scan, t_ns, offset, incarnation))
        if len(reads) > self._kept_recvs:
            del reads[0]

    def _handle_job_start(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        reading = self._readings[event[0]]
        reading.began = scan, t_ns, tuple(event)
        reading.runs = True
        reading.reads = []

    def _handle_job_mode(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        reading = self._readings.get(event[0])
        if reading is not None and reading.began is not None:
            begun, at, fields = reading.began
            reading.began = begun, at, (*fields[:-1], event[-1])

    def _handle_job_end(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        instance, _, _, _, _, _, done, _ = event
        reading = self._readings[instance]
        begun = reading.began if reading.runs else None
        if done:
            reading.delivered = scan, t_ns, tuple(event), begun, reading.reads
        else:
            reading.cut = reading.reads if begun is not None else []
        reading.runs, reading.reads = False, []
        for listener in self.ends[done]:
            listener(seq, scan, t_ns, event)

    # -- the message of a byte --------------------------------------------------------------------------

    def _find_sent(self, link: LinkKey) -> _SentMessages | None:
        key = self._links.get(link) or ((NO_END, link[0]), link[1] - 1)
        return self._sent.get(key)

    def find_messages_within(self, link: LinkKey, offset: int, size: int, position: int) -> list[MessageSpan]:
        """Return messages in `size` bytes from `offset` of a connection. Byte `offset` is at `position`."""
        sent = self._find_sent(link)
        found: list[MessageSpan] = []
        if sent is None:
            return found
        place = max(0, bisect_right(sent.messages, (offset, *_AFTER_OFFSET)) - 1)
        while place < len(sent.messages) and sent.messages[place][0] < offset + size:
            begin, length, number, peer, _ = sent.messages[place]
            first = max(begin, offset)
            part = min(begin + length, offset + size) - first
            if part > 0:
                found.append(
                    MessageSpan(position + first - offset, part, peer, number, first - begin, length)
                )
            place += 1
        return found

    @property
    def has_packets(self) -> bool:
        return self._are_packets or self.packet_times is not None

    def find_packet_ns(self, link: LinkKey, offset: int, datagram: int | None = None) -> int | None:
        """Return the time of the captured packet with this byte, or of the datagram with this number."""
        if self.packet_times is not None and link in self._links:
            return self.packet_times(*self._links[link], offset)
        sent = self._find_sent(link)
        place = bisect_right(sent.messages, (offset, *_AFTER_OFFSET)) - 1 if sent is not None else -1
        while sent is not None and place >= 0:
            begin, size, number, peer, t_ns = sent.messages[place]
            if peer == A_PACKET and (offset < begin + size if datagram is None else number == datagram):
                return t_ns
            if datagram is None or number < datagram:
                break
            place -= 1
        return None

    def find_message(self, link: LinkKey, offset: int, position: int = 0) -> MessageSpan | None:
        """Return the message that has a byte of a connection, None if it is not known."""
        return next(iter(self.find_messages_within(link, offset, 1, position)), None)

    def find_sender(self, link: LinkKey) -> tuple[str, Sizes]:
        """Return which peer sends on a connection, and the sizes of its messages."""
        sent = self._find_sent(link)
        if sent is None:
            return "", Sizes()
        sizes = tuple([message[1] for message in sent.messages[-KEPT_SIZES:]])
        return sent.messages[-1][3], Sizes(sent.forgotten + len(sent.messages), sizes)

    # -- what a connection has received -----------------------------------------------------------------

    def next_offset(self, connect: str, incarnation: int) -> int:
        """Return the offset of the next byte to be received; 0 if this incarnation has received none."""
        link = self._received.get(connect)
        return link.offset if link is not None and link.incarnation == incarnation else 0

    def get_bursts(self, connect: str) -> StreamBursts:
        link = self._received.get(connect)
        return link.bursts if link is not None else StreamBursts()

    # -- jobs -------------------------------------------------------------------------------------------

    def find_newest_job(self, instance: str) -> JobRecord | None:
        """Return the job that an instance began last, even if the job has ended."""
        reading = self._readings.get(instance)
        return _make_begun_job(reading.began) if reading is not None and reading.began is not None else None

    def done_reads(self, instance: str) -> list[RecvSpan]:
        """Return the recv calls of the newest job with DONE; none if not all of them are known."""
        delivered = self._readings[instance].delivered
        return delivered[4] if delivered is not None and delivered[3] is not None else []

    def list_down_times(self, connect: str) -> list[tuple[int, int]]:
        """Return begin and end, in ns, of each time a CONNECT was down; end MAX_SCAN: it is still down."""
        return [*self._down.get(connect, ())]

    def undone_reads(self, instance: str) -> list[RecvSpan]:
        """Return the recv calls of the newest job without DONE; none if not all of them are known."""
        return self._readings[instance].cut

    def get_newest_recv(self, instance: str) -> RecvSpan:
        """Return the newest recv call of the running job."""
        return self._readings[instance].reads[-1]

    def list_running(self, connect: str) -> Iterator[tuple[str, JobRecord, list[RecvSpan]]]:
        """Yield the instances whose running job has read on a CONNECT, with the job and its recv calls."""
        for instance, reading in self._readings.items():
            if reading.runs and reading.reads and reading.began and reading.link[0] == connect:
                yield instance, _make_begun_job(reading.began), reading.reads

    def find_running_reader(self, link: LinkKey, offset: int) -> str | None:
        """Return the instance whose running job has a byte of a connection."""
        for instance, reading in self._readings.items():
            if reading.link == link and _find_covering(reading.reads, offset) is not None:
                return instance
        return None

    def _find_job_pieces(self, instance: str, of_job: bool) -> tuple[JobRecord, list[tuple[int, int]]] | None:
        reading = self._readings.get(instance)
        if reading is None:
            return None
        if of_job and reading.runs and reading.began is not None:
            job = _make_begun_job(reading.began)._replace(recvs=reading.reads)
        elif not of_job and reading.delivered is not None:
            job = _make_ended_job(reading.delivered)
        else:
            return None
        is_known = len(job.recvs) < self._kept_recvs
        return job, job.list_pieces(of_job) if is_known else [(job.offset, job.size)]

    def find_origin(self, instance: str, of_job: bool, byte: int) -> ByteOrigin | None:
        """Return where byte number `byte` of DATA, or of the running job, came from."""
        known = self._find_job_pieces(instance, of_job)
        if known is None or not 0 <= byte < known[0].size:
            return None
        job, pieces = known
        place = _find_offset(pieces, byte)
        if not self._is_current_link(job.link):
            return ByteOrigin(job, None, None)
        return ByteOrigin(job, _find_covering(job.recvs, place), self.find_message(job.link, place, byte))

    def list_messages(self, instance: str, of_job: bool) -> list[MessageSpan]:
        """Return the peer's messages in DATA, or in the running job; position 0 is the job's first byte.

        A message that continues in a later piece of the job is listed once, where it begins.
        """
        known = self._find_job_pieces(instance, of_job)
        first = known[1][0][1] if known is not None and known[1] else 0
        return [span for span in self._spans(instance, of_job) if span.begins or span.position < first]

    def _spans(self, instance: str, of_job: bool) -> Iterator[MessageSpan]:
        known = self._find_job_pieces(instance, of_job)
        if known is not None and self._is_current_link(known[0].link):
            before = 0  # bytes of the job before this piece
            for offset, size in known[1]:
                yield from self.find_messages_within(known[0].link, offset, size, before)
                before += size

    def list_message_starts(self, instance: str, of_job: bool) -> frozenset[int]:
        return frozenset(span.position for span in self.list_messages(instance, of_job) if span.begins)

    def list_missing(self, instance: str, of_job: bool) -> tuple[range, ...]:
        """Return the bytes of DATA, or of the running job, that a capture lacks."""
        return tuple(
            [range(span.position, span.stop) for span in self._spans(instance, of_job) if span.peer == A_HOLE]
        )

    def _is_current_link(self, link: LinkKey) -> bool:
        return self._incarnations.get(link[0]) == link[1]


def _make_ended_job(ended: _JobEnd) -> JobRecord:
    scan, t_ns, (_, number, connection, incarnation, offset, size, _, _), began, reads = ended
    begun, at = _make_begun_job(began) if began is not None else None, ScanStamp(scan, t_ns)
    return JobRecord(
        number, (connection, incarnation), offset, size,
        begun.adhoc if begun else False, begun.began if begun else at, at, reads,
    )  # fmt: skip


def _make_begun_job(began: _JobBegin) -> JobRecord:
    scan, t_ns, (_, number, connection, incarnation, offset, length, adhoc) = began
    at = ScanStamp(scan, t_ns)
    return JobRecord(number, (connection, incarnation), offset, length, adhoc, at, at)


def _find_covering(recvs: Sequence[RecvSpan], offset: int) -> RecvSpan | None:
    place = bisect_right(recvs, offset, key=BY_OFFSET) - 1
    return recvs[place] if place >= 0 and offset < recvs[place].offset + recvs[place].size else None


def _find_offset(pieces: Iterable[tuple[int, int]], byte: int) -> int:
    place = 0
    for offset, size in pieces:
        if byte < size:
            return offset + byte
        byte -= size
        place = offset + size
    return place + byte
