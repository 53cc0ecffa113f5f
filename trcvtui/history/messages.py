"""One row for each message of an instance: a receive job that ended with bytes, a frame, a send job.

Rule 1: a row has no bytes of its own, only their places in a ring (net/received_ring.py).
Rule 2: a row has the STATUS after its scan. If its scan has no edge, a row has the last edge's STATUS.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Final, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import FrameEnded, SendEnded, SendStarted
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.received_streams import ReceivedStreams, find_first_pieces
from trcvtui.history.records import MAX_SCAN, Pieces, RecvSpan, join_pieces, span_at
from trcvtui.net.events import BytesSent
from trcvtui.net.received_ring import ReceivedRing, sent_ring_name
from trcvtui.plc.ledger import A_HOLE, StatusEdge

MOST_INSTANCE_ROWS: Final = 10_000  # of an instance
MOST_ROWS: Final = 100_000  # of all
ROWS_A_PICTURE: Final = 128  # more would make a scan of T#1ms late
BYTES_A_PICTURE: Final = 65_536  # of its rows; one row alone may have as many
MOST_ERRORS: Final = 1000  # whose times are kept, of an instance
MOST_PIECES: Final = 256  # of a message: the bytes of one in more are not kept
UNKNOWN_STATUS: Final = -1  # STATUS, after lines of the ledger were overwritten
HOLE_REASON: Final = "hole"


class MessageRow(NamedTuple):
    """A message. `t_ns` is the time of the last byte, `gap_ns` the time since the message before.
    `position` is in the ring `stream`, or -1 for nowhere. The values of the first `have` bytes are known.
    When the row leaves the engine, `content` is set, or None if the bytes have left the ring.
    """

    number: int
    scan: int
    t_ns: int
    gap_ns: int | None
    size: int
    status: int
    stream: str
    position: int
    reason: str = ""  # why it did not end with DONE
    have: int = 0
    content: bytes | None = None
    others: tuple[tuple[int, int], ...] = ()  # all of its pieces, where it has more than one


CONTENT_INDEX: Final = MessageRow._fields.index("content")


class MessagesDelta(Struct, frozen=True):
    """Rows from number `first` on, of `count` rows. The rows before `oldest` have lost their bytes."""

    instance: str
    first: int
    count: int
    rows: tuple[MessageRow, ...]
    oldest: int = 0
    share: float = 1.0
    are_typed: bool = True  # False: cut by pauses, their members are not known
    gaps: tuple[tuple[int, int], ...] = ()
    errors: tuple[int, ...] = ()


class _InstanceRows:
    def __init__(self) -> None:
        self.rows: deque[MessageRow] = deque()
        self.count = 0
        self.last_ns: int | None = None
        self.oldest = 0  # the first row whose bytes are kept
        self.errors = deque[int](maxlen=MOST_ERRORS)

    @property
    def first(self) -> int:
        return self.count - len(self.rows)


class NewestRows:
    """The newest rows of each instance. `received` returns the ring of a name."""

    def __init__(
        self,
        received: Callable[[str], ReceivedRing | None],
        catch_up: Callable[[], object] = int,
        after: int = 0,
    ) -> None:
        self._received, self._catch_up, self._after = received, catch_up, after
        self._by_instance: dict[str, _InstanceRows] = {}
        self._total = 0
        self._status: dict[str, int] = {}

    def make_delta(self, instance: str, since: int, until: int = MAX_SCAN) -> MessagesDelta:
        """Return rows from number `since` on up to a scan, at most as many as fit into a picture."""
        self._catch_up()
        of = self._by_instance.get(instance)
        if of is None:
            return MessagesDelta(instance, 0, 0, ())
        first = max(since, of.first)
        if 0 < since < of.first:  # they come faster than they are sent: skip to the middle
            first += len(of.rows) // 2
        found, size = list[MessageRow](), 0
        for number in range(first, min(of.count, first + ROWS_A_PICTURE)):
            row = self._add_content(of.rows[number - of.first])
            size += len(row.content or b"")
            if row.scan > until or (found and size > BYTES_A_PICTURE):
                break
            found.append(row)
        oldest, errors = self._find_oldest(of), tuple(of.errors)
        return MessagesDelta(instance, first, of.count, tuple(found), oldest, errors=errors)

    def take_rows(self) -> Iterator[tuple[str, MessageRow]]:
        """Yield all rows with their instances, and forget them."""
        self._catch_up()
        for name, of in self._by_instance.items():
            self._total -= len(of.rows)
            while of.rows:
                yield name, self._add_content(of.rows.popleft())

    def _add_content(self, row: MessageRow) -> MessageRow:
        return MessageRow._make((*row[:CONTENT_INDEX], self._read_content(row), ()))

    def _read_content(self, row: MessageRow) -> bytes | None:
        ring = self._received(row.stream) if row.position >= 0 else None
        if ring is None:
            return None if row.size else b""
        parts = row.others or ((row.position, row.size),)
        content = b"".join([ring.read(position, position + size) for position, size in parts])
        return content[: row.have] if len(content) == row.size else None

    def _find_oldest(self, of: _InstanceRows) -> int:
        """Return the number of the row after the last row that lost bytes. Empty rows lose no bytes."""
        for number in range(max(of.oldest, of.first), of.count):
            row = of.rows[number - of.first]
            ring = self._received(row.stream)
            if ring is not None and row.size and row.position >= ring.first:
                break
            if row.size:
                of.oldest = number + 1
        return of.oldest

    def add_row(
        self, instance: str, number: int, scan: int, t_ns: int, size: int,
        stream: str, pieces: Pieces, reason: str, have: int,
    ) -> None:  # fmt: skip
        of = self._by_instance.setdefault(instance, _InstanceRows())
        gap_ns = t_ns - of.last_ns if of.last_ns is not None else None
        of.last_ns = t_ns
        if scan <= self._after:
            return  # a keyframe has it; the file begins later
        is_kept = 0 < len(pieces) <= MOST_PIECES
        others = tuple(pieces) if is_kept and len(pieces) > 1 else ()
        position = pieces[0][0] if is_kept else -1
        status = self._status.get(instance, UNKNOWN_STATUS)
        of.rows.append(MessageRow(
            number, scan, t_ns, gap_ns, size, status, stream, position, reason, have, None, others
        ))  # fmt: skip
        of.count += 1
        is_full = self._total >= MOST_ROWS
        if is_full and len(of.rows) <= MOST_ROWS // len(self._by_instance):
            of = max(self._by_instance.values(), key=lambda each: len(each.rows))  # the most rows give way
        if is_full or len(of.rows) > MOST_INSTANCE_ROWS:
            of.rows.popleft()
        else:
            self._total += 1


class MessageRows(NewestRows):
    """The rows of a bench after scan `after`. A keyframe also brings older lines, which are skipped."""

    def __init__(self, bench: Bench, reader: LedgerReader, streams: ReceivedStreams, after: int = 0) -> None:
        super().__init__(bench.runtime.received_ring, reader.catch_up, after)
        self._bench, self._streams = bench, streams
        self._request: tuple[object, ...] = ()
        self._answer = MessagesDelta("", 0, 0, ())
        self._sends: dict[str, tuple[int, Pieces]] = {}  # of a running send job: time, places in the ring
        instances = [bench.runtime.instance_snapshot(declared.name) for declared in bench.project.instances]
        self._status = {each.name: each.outputs.status for each in instances if each is not None}
        index = reader.index
        index.ends[True].append(self._handle_job_end)
        index.ends[False].append(self._handle_job_end)
        index.subscribe({
            FrameEnded: self._handle_frame_end,
            SendStarted: self._handle_send_start,
            BytesSent: self._handle_bytes_sent,
            SendEnded: self._handle_send_end,
            StatusEdge: self._handle_status,
        })  # fmt: skip
        reader.on_loss.append(self._handle_loss)

    def make_delta(self, instance: str, since: int, until: int = MAX_SCAN) -> MessagesDelta:
        """Return the rows. If nothing is new, return the same object, so that it is not sent again."""
        self._catch_up()
        index, of = self._streams.index, self._by_instance.get(instance)
        state = instance, since, until, index.down_changes, of and (of.count, of.errors and of.errors[-1])
        if state != self._request or self._answer.rows:
            decl = self._bench.project.instance(instance)
            down = index.list_down_times(decl.connect) if decl is not None else ()
            self._request = state
            self._answer = replace(super().make_delta(instance, since, until), gaps=tuple(down))
        return self._answer

    def _handle_job_end(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        instance, number, connect, _, _, size, done, reason = event
        if not done and not size:
            return
        reads = (
            self._streams.index.done_reads(instance) if done else self._streams.index.undone_reads(instance)
        )
        is_known = bool(reads) and sum([recv.size for recv in reads]) >= size
        pieces = find_first_pieces(reads, size) if is_known else []
        have = self._count_before_hole(connect, reads, size) if self._streams.index.has_holes else size
        reason = reason if not done else HOLE_REASON if have < size else ""
        if reads:
            is_live = not self._streams.index.has_packets
            t_ns = reads[-1].t_ns if is_live else self._find_arrival_ns(connect, reads, size)
        self.add_row(instance, number, scan, t_ns, size, connect, pieces, reason, have)

    def _find_arrival_ns(self, connect: str, reads: Sequence[RecvSpan], size: int) -> int:
        """Return when the last byte of a message came, by its packet if known, else by its recv call."""
        last, config = reads[-1], self._bench.project.connect(connect)
        if config is not None and config.session is not None:  # packets of a session have other bytes
            return last.t_ns
        is_stream = config is not None and not config.is_datagram
        at = last.offset + size - sum([recv.size for recv in reads[:-1]]) - 1 if is_stream else last.offset
        link, datagram = (connect, last.incarnation), None if is_stream else last.number
        packet_ns = self._streams.index.find_packet_ns(link, at, datagram)
        return last.t_ns if packet_ns is None else packet_ns

    def _count_before_hole(self, connect: str, reads: Iterable[RecvSpan], size: int) -> int:
        """Return how many of the bytes come before the first byte that a capture lacks."""
        first = 0
        for recv in reads:
            link = connect, recv.incarnation
            for span in self._streams.index.find_messages_within(link, recv.offset, recv.size, first):
                if span.peer == A_HOLE:
                    return min(size, span.position)
            first += recv.size
        return size

    def _handle_frame_end(self, seq: int, scan: int, t_ns: int, event: FrameEnded) -> None:
        instance, buffer, number, size = event.instance, event.buffer, event.number, event.size
        stream = self._streams.streams[buffer]
        spans = stream.find_job_pieces(instance, number)
        last = span_at(stream.recvs, spans[-1].stop - 1) if spans else None
        pieces = join_pieces((span.position, span.size) for span in spans)
        if last is not None:
            at = last.offset + spans[-1].stop - 1 - last.position
            packet_ns = self._streams.index.find_packet_ns((buffer, 1), at)
            t_ns = last.t_ns if packet_ns is None else packet_ns
        self.add_row(instance, number, scan, t_ns, size, buffer, pieces, "", size)

    def _handle_send_start(self, seq: int, scan: int, t_ns: int, event: SendStarted) -> None:
        self._sends[event.instance] = t_ns, []

    def _handle_bytes_sent(self, seq: int, scan: int, t_ns: int, event: BytesSent) -> None:
        job = self._sends.get(event.instance)
        if job is not None:
            self._sends[event.instance] = t_ns, join_pieces([*job[1], (event.position, event.size)])

    def _handle_send_end(self, seq: int, scan: int, t_ns: int, event: SendEnded) -> None:
        """Add a row of the bytes that the stack took; the rest of a cut job is not in the message."""
        instance, number, connect, _, _, size, done, reason = event
        last_ns, pieces = self._sends.pop(instance, (t_ns, []))
        if not done and not size:
            return
        if sum([piece for _, piece in pieces]) != size:
            pieces = []  # lines were overwritten
        reason = "" if done else reason
        self.add_row(instance, number, scan, last_ns, size, sent_ring_name(connect), pieces, reason, size)

    def _handle_status(self, seq: int, scan: int, t_ns: int, event: StatusEdge) -> None:
        status = self._status[event.instance] = event.outputs.status
        of = self._by_instance.get(event.instance)
        if of is not None and event.outputs.error and not event.cause.is_expected:
            of.errors.append(t_ns)
        place = len(of.rows) - 1 if of is not None else -1
        while of is not None and place >= 0 and of.rows[place].scan == scan:
            of.rows[place] = of.rows[place]._replace(status=status)
            place -= 1

    def _handle_loss(self, seq: int, scan: int, t_ns: int) -> None:
        self._status.clear()
        self._sends.clear()
        for of in self._by_instance.values():
            of.last_ns = None
