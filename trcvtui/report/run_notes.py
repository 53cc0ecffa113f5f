"""The notes of a run for a report, taken scan by scan from a bench; each list is bounded.

Rule: a run may have any length. Lists keep the first and the last entries; the list of ERRORs keeps more.
When the time line is full, its columns are merged in pairs; each then covers twice the time.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterator
from typing import Final, Generic, NamedTuple, TypeVar, cast

from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import FrameEnded, PartialFrameDropped, ReceiveEnded, SendEnded, SendStarted
from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.diagnosis.advice import Advice, describe_cause
from trcvtui.diagnosis.evidence import make_current_evidence
from trcvtui.diagnosis.status_card import CardBuilder, DataContent
from trcvtui.history.link_statistics import LinkStatistics
from trcvtui.history.records import ScanStamp
from trcvtui.history.stream_index import ENDING_EVENTS, StreamIndex
from trcvtui.net.events import BytesReceived, ConnectionChanged, EventKind
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.plc.ledger import BenchNote, Event, Outputs, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot, Snapshot

T = TypeVar("T")
K = TypeVar("K")
MOST_EVENTS: Final = 150  # at each end of the list
MOST_EDGES, MOST_FRAMES = 1600, 400  # in a report, of all instances together
MOST_INSTANCE_EDGES: Final = 60  # edges of an instance at each end of the list; frames a quarter of that
MOST_LATE: Final = 5  # scans at each end
MOST_ERRORS, MOST_REMARKS = 100, 10  # different ones of an instance
FRAMES_PER_CHECK: Final = 32  # one of so many frames is examined, and both after a dropped one
MOST_BYTES, MOST_DATA = 4096, 65_536  # bytes of a frame that are kept; of DATA that are judged
_NUMBER_PATTERN: Final = re.compile(r"[\d.]+")
MOST_COLUMNS: Final = 1000  # of the time line
UP, BUSY, DONE, ERROR = 1, 2, 4, 8  # what a column has seen
UNKNOWN_CAUSE: Final = Cause(CauseKind.SEQUENCE, "")
LAMP_BITS: Final = {"": 0, "busy": BUSY, "done": DONE, "error": ERROR}


class FirstAndLast(Generic[T]):
    """Keeps the first `most` and the last `most` of many entries; `count` counts all."""

    def __init__(self, most: int) -> None:
        self.count = 0
        self._most = most
        self._first: list[tuple[int, T]] = []
        self._last: deque[tuple[int, T]] = deque(maxlen=most)

    def add(self, one: T) -> None:
        self.count += 1
        (self._first if len(self._first) < self._most else self._last).append((self.count, one))

    def __iter__(self) -> Iterator[tuple[int, T]]:
        """Yield the kept entries with their numbers; the first of all entries is 1."""
        yield from self._first
        yield from self._last


class TimeLane:
    """What one instance or connection showed over the time of a run, in columns of equal width."""

    def __init__(self, width_ns: int) -> None:
        self.columns: list[int] = []
        self.width_ns = width_ns
        self._now = 0

    def set_state(self, t_ns: int, state: int) -> None:
        self.extend_to(max(0, t_ns - 1))
        self._now = state
        self.extend_to(t_ns)
        self.columns[-1] |= state

    def extend_to(self, t_ns: int) -> None:
        while t_ns // self.width_ns >= MOST_COLUMNS:
            ends = self.columns[1::2] + [0] * (len(self.columns) % 2)
            self.columns = [one | other for one, other in zip(self.columns[::2], ends, strict=True)]
            self.width_ns *= 2
        self.columns += [self._now] * (t_ns // self.width_ns + 1 - len(self.columns))


class EdgeNote(NamedTuple):
    at: ScanStamp
    edge: StatusEdge


class FrameNote(NamedTuple):
    """The first bytes of a job or a frame. If the bytes were not delivered or sent, `reason` says why."""

    at: ScanStamp
    is_sent: bool
    job: int
    size: int
    content: bytes
    reason: str


class EventNote(NamedTuple):
    """An event outside the blocks. If `subject` is empty, the event is a command after this scan."""

    at: ScanStamp
    subject: str
    what: str
    detail: str = ""


class CauseNote(NamedTuple):
    """A cause of ERRORs, or a remark on frames: first edge, advice, how often it came, the last scan."""

    first: EdgeNote
    advice: Advice
    times: int
    last: ScanStamp


class InstanceNotes:
    def __init__(self, width_ns: int, edges: int, frames: int) -> None:
        self.edges: FirstAndLast[EdgeNote] = FirstAndLast(edges)
        self.error_edges: FirstAndLast[tuple[int, EdgeNote]] = FirstAndLast(edges)
        self.frames: FirstAndLast[FrameNote] = FirstAndLast(frames)
        self.errors: dict[tuple[int, str], CauseNote] = {}
        self.remarks: dict[str, CauseNote] = {}  # by the text without numbers
        self.delivered = self.looked_until = 0  # frames; each one up to this is examined
        self.dropped = 0  # frames that began and were never whole
        self.lane = TimeLane(width_ns)
        self.part = b""  # of the running job
        self.sends: tuple[int, bytes] = 0, b""  # the sending job and its bytes


class RunNotes:
    """Reads the ledger after each scan; `note_end` reads the bench a last time."""

    def __init__(self, bench: Bench, events: FirstAndLast[EventNote], has_payload: bool) -> None:
        self.bench, self.has_payload, self.events = bench, has_payload, events
        self.instances: dict[str, InstanceNotes] = {}
        self.links: dict[str, TimeLane] = {}
        self.snapshot: Snapshot | None = None  # after the last scan that ran again
        self.advice: dict[str, Advice] = {}  # after that scan
        self.seen = self.until = ScanStamp()  # that scan; the last one in the journal
        self.late: FirstAndLast[str] = FirstAndLast(MOST_LATE)  # scans that began late
        self.lost = 0  # lines of the ledger that were dropped before they were read
        self._seq, self._late_scans = 0, bench.late_scans
        self._card = CardBuilder()
        self._index = StreamIndex()
        self._statistics = LinkStatistics(self._index)
        self._fresh: list[EdgeNote] = []  # ERRORs of this scan
        self._receiving: set[str] = set()  # instances that received a part in this scan
        share = max(1, len(bench.project.instances))
        self._edges = max(2, min(MOST_INSTANCE_EDGES, MOST_EDGES // 4 // share))
        self._frames = max(1, min(MOST_INSTANCE_EDGES // 4, MOST_FRAMES // 2 // share))

    def add_scan(self) -> None:
        ledger = self.bench.runtime.ledger
        if self.bench.late_scans > self._late_scans:
            self._late_scans += 1
            self.late.add(f"{ledger.scan} ({self.bench.late_ns / 1e6:.1f} ms)")
        if ledger.last_seq == self._seq:
            return
        news = ledger.events_since(self._seq)
        missed, self._seq = ledger.last_seq - self._seq - len(news), ledger.last_seq
        if missed:
            self.lost += missed
            self._index.forget_streams()
            self._statistics.forget_all(self._seq, ledger.scan, ledger.t_ns)
        self._index.dispatch_events(news)
        for scan, t_ns, event in news:
            self._add_event(ScanStamp(scan, t_ns), event)
        for name in self._receiving:
            self._get(name).part = self.bench.runtime.job_bytes(name)[:MOST_BYTES]
        self._receiving.clear()
        for note in self._fresh:
            self._note_cause(note)
        self._fresh.clear()

    def note_end(self) -> None:
        """Note the state of the bench at the end of the run, or where the replay cannot continue."""
        self.add_scan()
        if self.snapshot is not None:
            return
        picture = self._picture(*(each.name for each in self.bench.project.instances))
        self.snapshot = picture.snapshot
        for instance in self.snapshot.instances:
            self.advice[instance.name] = self._make_advice(instance.name, picture)
        self.seen = self.until = ScanStamp(self.snapshot.scan, self.snapshot.t_ns)
        for lane in (*self.links.values(), *(each.lane for each in self.instances.values())):
            lane.extend_to(self.seen.t_ns)

    def add_outputs(self, at: ScanStamp, instance: str, args: tuple[object, ...]) -> None:
        """Note outputs, of unknown cause, that a journal has after the last repeated scan."""
        decl = self.bench.project.instance(instance)
        if decl is None or len(args) != len(Outputs._fields) + 1 or not isinstance(args[1], int):
            return
        if all(isinstance(each, int | None) for each in args[2:]):
            outputs = Outputs._make(cast(tuple[int, ...], args[1:]))
            self._add_edge(EdgeNote(at, StatusEdge(instance, decl.block, outputs, "", UNKNOWN_CAUSE)))
            self._fresh.clear()

    def extend_lanes_to(self, at: ScanStamp) -> None:
        """Extend the lanes of the instances to the end of the journal."""
        self.until = max(self.until, at, key=lambda moment: moment.scan)
        for each in self.instances.values():
            each.lane.extend_to(self.until.t_ns)

    def last_snapshot(self, name: str) -> InstanceSnapshot | None:
        return self.snapshot.instance(name) if self.snapshot is not None else None

    def _get(self, name: str) -> InstanceNotes:
        notes = self.instances.get(name)
        if notes is None:
            notes = InstanceNotes(self.bench.runtime.interval_ns, self._edges, self._frames)
            self.instances[name] = notes
        return notes

    # -- lines of the ledger ------------------------------------------------------------------------------

    def _add_event(self, at: ScanStamp, event: Event) -> None:
        match event:
            case StatusEdge():
                self._add_edge(EdgeNote(at, event))
            case BytesReceived():
                self._receiving.add(event.instance)
            case ReceiveEnded() | PartialFrameDropped() | FrameEnded():
                self._add_received(at, event)
            case SendStarted():
                self._get(event.instance).sends = event.job, self._read_data(event.instance, event.length)
            case SendEnded():
                job, content = self._get(event.instance).sends
                reason = "" if event.done else event.reason
                note = FrameNote(at, True, event.job, event.size, content * (job == event.job), reason)
                self._get(event.instance).frames.add(note)
            case ConnectionChanged():
                self._add_connection(at, event)
            case BenchNote():
                self.events.add(EventNote(at, event.subject, event.what, event.detail or event.end))

    def _add_edge(self, note: EdgeNote) -> None:
        notes = self._get(note.edge.instance)
        notes.edges.add(note)
        notes.lane.set_state(note.at.t_ns, LAMP_BITS[note.edge.outputs.lit_lamp])
        if note.edge.outputs.error:
            notes.error_edges.add((notes.edges.count, note))
            self._fresh.append(note)
        elif note.edge.condition == Condition.RECEIVED:
            notes.delivered += 1
            if notes.delivered <= notes.looked_until or notes.delivered % FRAMES_PER_CHECK == 1:
                self._fresh.append(note)

    def _add_received(self, at: ScanStamp, event: ReceiveEnded | FrameEnded | PartialFrameDropped) -> None:
        notes = self._get(event.instance)
        self._receiving.discard(event.instance)
        job, done, reason = 0, isinstance(event, FrameEnded), ""
        if isinstance(event, ReceiveEnded):
            job, done, reason = event.job, event.done, event.reason
        elif isinstance(event, PartialFrameDropped):
            reason = event.reason
        content, notes.part = self._read_data(event.instance, event.size) if done else notes.part, b""
        if not done and event.size:
            notes.dropped += 1
            notes.looked_until = notes.delivered + 2
        if done or event.size:
            note = FrameNote(at, False, job, event.size, content[: event.size], "" if done else reason)
            notes.frames.add(note)

    def _read_data(self, instance: str, size: int) -> bytes:
        decl = self.bench.project.instance(instance)
        name = decl.data if decl is not None else None
        return b"" if name is None else self.bench.runtime.data(name, min(size, MOST_BYTES))

    def _add_connection(self, at: ScanStamp, event: ConnectionChanged) -> None:
        if event.detail != "UDP":
            lane = self.links.setdefault(event.connection, TimeLane(self.bench.runtime.interval_ns))
            if event.what is EventKind.CONNECTED or event.what in ENDING_EVENTS:
                lane.set_state(at.t_ns, UP if event.what is EventKind.CONNECTED else 0)
        fault = f"{event.fault.call} gave {event.fault.error}" if event.fault is not None else ""
        detail = ", ".join(filter(None, (event.peer, fault, event.detail)))
        self.events.add(EventNote(at, event.connection, str(event.what), detail))

    # -- why --------------------------------------------------------------------------------------------

    def _note_cause(self, note: EdgeNote) -> None:
        notes, edge = self._get(note.edge.instance), note.edge
        if edge.outputs.error:
            key = edge.outputs.status, describe_cause(edge.cause, edge.block)
            _count_in(notes.errors, key, note, lambda: self._make_advice(edge.instance), MOST_ERRORS)
            return
        advice = self._make_advice(edge.instance)
        if advice.checks:
            words = _NUMBER_PATTERN.sub("", advice.checks[0])
            _count_in(notes.remarks, words, note, lambda: advice, MOST_REMARKS)

    def _make_advice(self, name: str, picture: BenchUpdate | None = None) -> Advice:
        picture = picture or self._picture(name)
        project, runtime = self.bench.project, self.bench.runtime
        instance, evidence = picture.snapshot.instance(name), make_current_evidence(picture, project, name)
        if instance is None or evidence is None:
            return Advice("", ())
        decl = project.data_decl(instance.data) if instance.data is not None else None
        content = runtime.data(decl.name, MOST_DATA) if decl is not None else b""
        data = DataContent(decl, content, runtime.job_bytes(name))
        reads = "read DATA with"
        return self._card.build_advice(evidence, instance, self._index, data, reads, self.has_payload)

    def _picture(self, *names: str) -> BenchUpdate:
        bench = self.bench
        declared = filter(None, map(bench.project.instance, names))
        return BenchUpdate(
            snapshot=bench.runtime.snapshot(bench.faults()),
            peers=bench.peer_snapshots(),
            kernel=bench.kernel_name,
            facts=tuple((each.name, self._statistics.facts(each.name, each.connect)) for each in declared),
        )


def _count_in(
    cards: dict[K, CauseNote], key: K, note: EdgeNote, advise: Callable[[], Advice], most: int
) -> None:
    known = cards.get(key)
    if known is not None:
        cards[key] = known._replace(times=known.times + 1, last=note.at)
    elif len(cards) < most:
        cards[key] = CauseNote(note, advise(), 1, note.at)
