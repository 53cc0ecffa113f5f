"""What the screen knows: the newest picture, the lines of the ledger so far, and the selection.

Rule: each picture goes through `accept_picture`. Nothing else changes what the screen shows of the bench.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.diagnosis.evidence import make_current_evidence
from trcvtui.diagnosis.stream_messages import StreamMessage, find_whole_messages
from trcvtui.history.pin_waveform import WaveformCache
from trcvtui.history.records import MAX_SCAN, HistoryRequest, HistoryWindow
from trcvtui.history.stream_index import StreamIndex
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.plc.containment import Containment, ExceptionNote
from trcvtui.plc.ledger import BenchNote, Line, StatusEdge
from trcvtui.plc.snapshot import ConnectionSnapshot, InstanceSnapshot, Snapshot
from trcvtui.project.project import DataDecl, Project
from trcvtui.snapshots.bench import LineAnswer, PeerSnapshot, TriggerEvent
from trcvtui.snapshots.conversations import ConversationSnapshot
from trcvtui.snapshots.replay import WHAT_IF, ReplayPosition
from trcvtui.tui.formatting import SECOND
from trcvtui.tui.view_model.known_messages import KnownMessages

GLOW_NS: Final = SECOND
DONE, ERROR = "DONE", "ERROR"


@dataclass(frozen=True, slots=True)
class PinPulse:
    """A lamp was lit in `scan` at `t_ns` with this STATUS. `rcvd_len` is in bytes, or None."""

    scan: int
    t_ns: int
    status: int
    rcvd_len: int | None


class Afterglow:
    """The newest pulse of each lamp of each instance. A glow does not fade in a held PLC."""

    def __init__(self) -> None:
        self._pulses: dict[tuple[str, str], PinPulse] = {}

    def add_pulses(self, scan: int, t_ns: int, edge: StatusEdge) -> None:
        pulse = PinPulse(scan, t_ns, edge.outputs.status, edge.outputs.rcvd_len)
        if edge.outputs.done:
            self._pulses[edge.instance, DONE] = pulse
        if edge.outputs.error and not edge.cause.is_expected:
            self._pulses[edge.instance, ERROR] = pulse

    def drop_pulses(self, instance: str) -> None:
        """Drop the pulses of an instance, since another instance may get its name."""
        for lamp in (DONE, ERROR):
            self._pulses.pop((instance, lamp), None)

    def add_skipped(self, instance: InstanceSnapshot, t_ns: int) -> None:
        """Add pulses whose ledger lines were skipped; the pulses get the time of the picture."""
        self._add_pulse(instance.name, DONE, instance.last_done_scan, t_ns, None, instance.last_rcvd_len)
        if not instance.last_is_expected:
            scan, status = instance.last_error_scan, instance.last_error_status
            self._add_pulse(instance.name, ERROR, scan, t_ns, status, None)

    def _add_pulse(
        self, name: str, lamp: str, scan: int | None, t_ns: int, status: int | None, length: int | None
    ) -> None:
        known = self._pulses.get((name, lamp))
        if scan is None:
            self._pulses.pop((name, lamp), None)  # of an older instance with this name
        elif known is None or known.scan < scan:
            self._pulses[name, lamp] = PinPulse(scan, t_ns, status or 0, length)

    def find_pulse(self, instance: str, lamp: str, t_ns: int) -> PinPulse | None:
        pulse = self._pulses.get((instance, lamp))
        return pulse if pulse is not None and t_ns - pulse.t_ns < GLOW_NS else None


KEPT_EDGES: Final = 1000


class EdgeHistory:
    """STATUS edges by instance. `skipped` counts ledger lines that never came to the screen."""

    def __init__(self) -> None:
        self._edges: defaultdict[str, deque[Line]] = defaultdict(lambda: deque(maxlen=KEPT_EDGES))
        self.skipped = 0

    def add_edge(self, line: Line, edge: StatusEdge) -> None:
        self._edges[edge.instance].append(line)

    def list_edges(self, instance: str) -> deque[Line]:
        return self._edges.get(instance) or deque()


MOST_PICTURE_LINES: Final = 1000  # in a picture; with 8 pictures a second, 8000 a second
NO_BENCH: Final = -1  # a number that no bench and no project has
MOST_DRAWN_INSTANCES: Final = 8  # instances drawn over time at once
MOST_THAW_LINES: Final = 4000  # in the picture after a frozen view, for the missed lines
KEPT_LINES: Final = 5000  # of the ledger, to explain the past
MOST_OTHERS: Final = 16  # other instances whose bytes come along, so that a frozen view has them too
REMOVAL_NOTES: Final = frozenset(("deleted", "downloaded"))  # ledger notes that end the glow of an instance
MOST_OTHER_BYTES: Final = 8192  # of their DATA in all: larger ones do not come along


INDEX_PART: Final = "reader", "index of the screen"
MOST_INDEXED: Final = 2000  # messages of a connection, recv calls of a job


def new_index() -> StreamIndex:
    """Return a new index, smaller than the engine's but large enough for the newest bytes."""
    return StreamIndex(MOST_INDEXED, MOST_INDEXED)


class Index(NamedTuple):
    """The instances and the CONNECTs of a snapshot by name: every pane looks up some of them."""

    snapshot: Snapshot | None
    instances: dict[str, InstanceSnapshot]
    connections: dict[str, ConnectionSnapshot]


def index_of(snapshot: Snapshot | None) -> Index:
    instances, connections = (snapshot.instances, snapshot.connections) if snapshot else ((), ())
    return Index(snapshot, {each.name: each for each in instances}, {each.name: each for each in connections})


class ViewModel:
    """The bench as the screen knows it. Sizes are in bytes, times are in ns of the run."""

    def __init__(self, project: Project) -> None:
        self._home = project
        self.picture: BenchUpdate | None = None
        self._indexed = index_of(None)
        self.history = EdgeHistory()
        self.afterglow = Afterglow()
        self.stream_index = new_index()
        self._containment = Containment(
            lambda part, report: None, self._report, lambda note: None, None, lambda do: do()
        )
        self.waves = WaveformCache()
        self.known_messages = KnownMessages()
        self.draws_neighbours = False  # also draw the other instances of its CONNECT over time
        self.selected = self.peer = ""
        self.is_frozen = False
        self._accept_project(project)
        self.answers: dict[int, LineAnswer] = {}
        self.live: BenchUpdate | None = None  # the newest picture, also while an older one is shown
        self.fired: TriggerEvent | None = None  # the trigger that froze the view
        self.lines: deque[Line] = deque(maxlen=KEPT_LINES)
        self.bench = 0  # the number of the bench that is shown
        self._left_bench: int | None = None
        self._project_number = 0
        self._seq = 0
        self.past_wanted: HistoryRequest | None = None  # of the bytes received so far
        self.recordings_wanted: tuple[str, ...] = ()  # of ComBuffers, once
        self.doctor_wanted = False
        self._messages: tuple[HistoryWindow | None, list[StreamMessage]] | None = None
        self._thawing = 0  # coming pictures that may have been requested before the thaw

    # -- what comes in ------------------------------------------------------------------------------

    def accept_picture(self, picture: BenchUpdate) -> None:
        """Make this the newest picture; for a new bench, forget all that was known of the old bench."""
        if picture.bench == self._left_bench:  # late, from a scenario that was left
            return
        if picture.bench != self.bench:
            self._reset(picture.bench)
        if picture.fired is not None:  # the picture of the trigger's scan, not the newest one
            self.is_frozen, self.fired, self.picture = True, picture.fired, picture
        if picture.project is not None:
            self._accept_project(picture.project)
        self._project_number = picture.project_number
        self.live = picture
        self.known_messages.accept_rows(picture.messages, self._last_message_scan)
        self.answers = {answer.number: answer for answer in picture.answers}
        if picture.fired is None and (self.is_frozen or self._discard_early(picture)):
            self._accept_waves(picture)
            return
        self._show_picture(picture)

    def _discard_early(self, picture: BenchUpdate) -> bool:
        self._thawing -= 1 if self._thawing else 0
        return bool(self._thawing and picture.lines_skipped)  # requested before the thaw: the next has more

    def _show_picture(self, picture: BenchUpdate) -> None:
        self.picture, self._thawing = picture, 0
        self._accept_waves(picture)
        if picture.lines_skipped and picture.lines:
            self._add_skipped_edges(picture.lines[0].seq)
        self.lines.extend(picture.lines)
        self._index_lines(picture.lines)
        for line in picture.lines:
            if isinstance(line.event, StatusEdge):
                self.history.add_edge(line, line.event)
                self.afterglow.add_pulses(line.scan, line.t_ns, line.event)
            elif isinstance(line.event, BenchNote) and line.event.what in REMOVAL_NOTES:
                self.afterglow.drop_pulses(line.event.subject)
        if picture.lines:
            self._seq = picture.lines[-1].seq
        if picture.lines_skipped:
            self.history.skipped += picture.lines_skipped
            for instance in picture.snapshot.instances:
                self.afterglow.add_skipped(instance, picture.snapshot.t_ns)

    def _index_lines(self, lines: Sequence[Line]) -> None:
        stamped = [(line.scan, line.t_ns, line.event) for line in lines]
        self._containment.attempt_unless_out(INDEX_PART, partial(self.stream_index.dispatch_events, stamped))
        if INDEX_PART in self._containment.out:
            self.stream_index = new_index()
        internal = self._containment.take_messages()
        if internal:
            self.answers[0] = LineAnswer(0, "", internal)

    def _report(self, error: BaseException) -> ExceptionNote:
        from trcvtui.bench.error_report import report_error  # imported with the first internal error

        return report_error(error, self.project, [*self.lines], None)

    def _accept_waves(self, picture: BenchUpdate) -> None:
        interval_ns = picture.snapshot.interval_ns
        if self.is_frozen and self.snapshot is not None:
            self.waves.add_deltas_up_to(picture.waves, interval_ns, self.snapshot.scan, self.snapshot.t_ns)
        else:
            self.waves.add_deltas(picture.waves, interval_ns)

    def _add_skipped_edges(self, first: int) -> None:
        """Add the STATUS edges of missing ledger lines before line `first`, taken from the waves."""
        for name in self.drawn_instances:
            known = self.history.list_edges(name)
            last = known[-1].seq if known else 0
            newest = takewhile(lambda line: line.seq > last, reversed(self.waves.get_wave(name).edges))  # noqa: B023
            for line in reversed([line for line in newest if line.seq < first]):
                assert isinstance(line.event, StatusEdge)
                self.history.add_edge(line, line.event)

    def _reset(self, bench: int) -> None:
        self.bench, self._seq = bench, 0
        self.lines.clear()
        self.waves = WaveformCache()
        if self.position is None:  # a replay has the messages of all its benches
            self.known_messages = KnownMessages()
        self.thaw()
        self.history, self.afterglow, self.stream_index = EdgeHistory(), Afterglow(), new_index()

    def _accept_project(self, project: Project) -> None:
        self.project = project
        self._sizes = {decl.name: decl.size for decl in project.data}
        self._repair_selection()
        self.peer = _name_or_first(self.peer, [peer.name for peer in project.peers])

    def _repair_selection(self) -> None:
        shown = self.instances if self.is_frozen else self.project.instances
        self.selected = _name_or_first(self.selected, [instance.name for instance in shown])

    def leave_scenario(self) -> None:
        """Go back to the opened project, and ignore later pictures of the scenario's bench."""
        self._left_bench, self.picture = self.bench, None
        self.thaw()
        self._accept_project(self._home)

    def forget_all(self) -> None:
        """Forget everything, because the engine was restarted. The first new picture brings the project."""
        self.leave_scenario()
        self.live, self._left_bench = None, None
        self._reset(NO_BENCH)
        self._project_number = NO_BENCH

    def freeze(self) -> None:
        self.is_frozen = self.picture is not None

    def thaw(self) -> None:
        self._thawing = 2 if self.is_frozen else 0
        self.is_frozen, self.fired = False, None
        self._repair_selection()

    def make_request(self) -> UpdateRequest:
        """Return the next request: new lines of the ledger, bytes of the selected instance and of others.

        The request includes a few bytes of other instances, as you may select them after the key `F`.
        """
        instance = self.instance
        shown = (instance, *self._other_instances(instance)) if instance else ()
        data = tuple(dict.fromkeys(each.data for each in shown if each.data))
        partial = tuple(each.name for each in shown)
        most = MOST_THAW_LINES if self._thawing else MOST_PICTURE_LINES
        waves = self.waves.make_requests(self.drawn_waves, self.frozen_scan)
        numbers = self.bench, self._project_number
        past, recordings = self.past_wanted, self.recordings_wanted
        until = MAX_SCAN if self.frozen_scan is None else self.frozen_scan
        past = replace(past, scan=until) if past is not None else None
        messages = *self.known_messages.make_request(self.selected), self._last_message_scan
        return UpdateRequest(
            self._seq, data, partial, most, *numbers, waves, past, recordings, self.doctor_wanted, messages
        )

    def _other_instances(self, selected: InstanceSnapshot) -> Iterator[InstanceSnapshot]:
        left, found = MOST_OTHER_BYTES, 0
        for each in self.instances:
            size = self._sizes.get(each.data or "", 0)
            if each is not selected and found < MOST_OTHERS and size <= left:
                left, found = left - size, found + 1
                yield each

    # -- what is shown ------------------------------------------------------------------------------

    @property
    def snapshot(self) -> Snapshot | None:
        return self.picture.snapshot if self.picture else None

    @property
    def frozen_scan(self) -> int | None:
        return self.picture.snapshot.scan if self.is_frozen and self.picture else None

    @property
    def unsaved_count(self) -> int:
        return self.live.unsaved if self.live else 0

    @property
    def _last_message_scan(self) -> int:
        return MAX_SCAN if self.frozen_scan is None or self.position is not None else self.frozen_scan

    @property
    def position(self) -> ReplayPosition | None:
        return self.live.position if self.live is not None else None

    @property
    def past_window(self) -> HistoryWindow | None:
        newest = self.live or self.picture
        return newest.history if newest else None

    @property
    def messages(self) -> list[StreamMessage]:
        """Return the complete messages in the newest `past_window`."""
        newest, window = self.live or self.picture, self.past_window
        if self._messages is None or self._messages[0] is not window:
            evidence = make_current_evidence(newest, self.project, self.selected) if newest else None
            found = (
                find_whole_messages(window, evidence) if window is not None and evidence is not None else []
            )
            self._messages = window, found
        return self._messages[1]

    @property
    def instances(self) -> tuple[InstanceSnapshot, ...]:
        return self.picture.snapshot.instances if self.picture else ()

    @property
    def shadows(self) -> frozenset[str]:
        return self.live.shadows if self.live is not None else frozenset()

    @property
    def conversations(self) -> tuple[ConversationSnapshot, ...]:
        return self.live.talks if self.live is not None else ()

    @property
    def t_ns(self) -> int:
        return self.picture.snapshot.t_ns if self.picture else 0

    @property
    def instance(self) -> InstanceSnapshot | None:
        return self._index().instances.get(self.selected)

    @property
    def drawn_instances(self) -> tuple[str, ...]:
        """Return the selected instance and, if `draws_neighbours`, other instances on its CONNECT."""
        instance = self.instance
        if instance is None or not self.draws_neighbours:
            return (self.selected,) if self.selected else ()
        others = (i.name for i in self.instances if i.connect == instance.connect and i is not instance)
        return (self.selected, *others)[:MOST_DRAWN_INSTANCES]

    @property
    def drawn_waves(self) -> tuple[str, ...]:
        """Return `drawn_instances`, and the selected instance of the what-if run if there is one."""
        beside = (WHAT_IF + self.selected,) if self.position is not None and self.position.what_if else ()
        return (*self.drawn_instances[:1], *beside, *self.drawn_instances[1:])

    @property
    def connection(self) -> ConnectionSnapshot | None:
        instance = self.instance
        return self.connection_of(instance) if instance else None

    def connection_of(self, instance: InstanceSnapshot) -> ConnectionSnapshot | None:
        return self._index().connections.get(instance.connect)

    def list_listen_ends(self) -> dict[str, str]:
        """Return the local ends of open passive CONNECTs by name; a port 0 is replaced by the real one."""
        known = self._index().connections.values()
        return {each.name: each.local for each in known if not each.active and each.state != "closed"}

    def _index(self) -> Index:
        if self._indexed.snapshot is not self.snapshot:
            self._indexed = index_of(self.snapshot)
        return self._indexed

    @property
    def peers(self) -> tuple[PeerSnapshot, ...]:
        return self.picture.peers if self.picture else ()

    @property
    def peer_snapshot(self) -> PeerSnapshot | None:
        return next((peer for peer in self.peers if peer.name == self.peer), None)

    @property
    def declaration(self) -> DataDecl | None:
        instance = self.instance
        return self.project.data_decl(instance.data) if instance and instance.data else None

    @property
    def message_type(self) -> DataDecl | None:
        known, selected = self.known_messages, self.selected
        is_typed = known.are_typed or known.instance != selected
        return self.project.received_data(selected) if is_typed else None

    @property
    def data(self) -> bytes:
        instance = self.instance
        return self._find_bytes(self.picture.data, instance.data) if self.picture and instance else b""

    @property
    def job_bytes(self) -> bytes:
        return self._find_bytes(self.picture.partial, self.selected) if self.picture else b""

    @property
    def lacks_bytes(self) -> bool:
        """Return whether the view is frozen on a picture without bytes of the selected instance."""
        partial = self.picture.partial if self.picture is not None else ()
        return self.is_frozen and all(name != self.selected for name, _ in partial)

    @staticmethod
    def _find_bytes(pairs: tuple[tuple[str, bytes], ...], name: str | None) -> bytes:
        return next((payload for key, payload in pairs if key == name), b"")


def _name_or_first(name: str, names: list[str]) -> str:
    """Return the name if the list has it, else the first name of the list, else ""."""
    return name if name in names else next(iter(names), "")
