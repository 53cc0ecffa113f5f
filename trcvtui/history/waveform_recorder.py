"""Records every change of every pin for the timing pane, in the process of the scans.

Rule 1: the recorder reads every line of the ledger: no pulse is lost between two pictures or in a flood.
Rule 2: if changes were dropped, a delta has the value that each pin had before the delta's first change.
Rule 3: an instance that does not change costs nothing; a change costs about a microsecond.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Final

from trcvtui.bench.bench import Bench
from trcvtui.blocks.pins import Direction
from trcvtui.blocks.table import outcome_field
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.pin_waveform import NO_PINS, KnownPins, PinChange, PinValues, WaveformDelta, event_pins
from trcvtui.plc.ledger import BenchNote, InputEdge, StatusEdge
from trcvtui.project.project import InstanceDecl, Project

KEPT_CHANGES: Final = 32_768  # of one instance, where there are few: 7 MB
KEPT_IN_ALL: Final = 500_000
LEAST_CHANGES: Final = 1_000
MOST_CHANGES_SENT: Final = 1_000  # changes of one instance in one picture
CREATED_NOTE, DELETED_NOTE, DOWNLOADED_NOTE = "created", "deleted", "downloaded"
HANDLED_NOTES: Final = frozenset({CREATED_NOTE, DELETED_NOTE, DOWNLOADED_NOTE})


class PinHistory:
    """The newest changes of an instance. `get_pins_before` has the pins after the last dropped change."""

    def __init__(self, before: PinValues, keep: int) -> None:
        self._before = dict(before)
        self._edge: StatusEdge | None = None  # the last one that was dropped, not yet in `_before`
        self.before_at = 0, 0  # scan and time
        self.total = 0
        self._keep = keep
        self._changes: deque[PinChange] = deque()
        self.on_drop: Callable[[PinChange], None] | None = None  # called with each dropped change

    def add_change(self, change: PinChange) -> None:
        self.total += 1
        changes = self._changes
        changes.append(change)
        if len(changes) > self._keep:
            dropped = changes.popleft()
            _, scan, t_ns, event = dropped
            self.before_at = scan, t_ns
            if event.__class__ is StatusEdge:
                self._edge = event
            else:
                self.get_pins_before().update(event_pins(event))
            if self.on_drop is not None:
                self.on_drop(dropped)

    def get_pins_before(self) -> dict[str, int | None]:
        """Return the value of each pin after the last change that was dropped."""
        if self._edge is not None:
            self._before.update(event_pins(self._edge))
            self._edge = None
        return self._before

    def pin_names(self) -> list[str]:
        return list(self._before)

    @property
    def kept_count(self) -> int:
        return len(self._changes)

    def list_changes_after(self, number: int, most: int = KEPT_CHANGES) -> list[PinChange]:
        """Return the stored changes after `number`, at most the oldest `most` of them."""
        kept = len(self._changes)
        fresh = min(kept, self.total - number)
        if fresh < kept // 2:  # a deque is quick from the nearer end
            return [*islice(reversed(self._changes), max(0, fresh))][::-1][:most]
        return list(islice(self._changes, kept - fresh, kept - fresh + most))

    def find_changes_after(self, number: int, most: int) -> tuple[int, tuple[PinChange, ...]]:
        """Return the number of the first stored change after `number`, and at most `most` from there on."""
        first = max(number, self.total - len(self._changes)) + 1
        found = self.list_changes_after(number, most)
        return min(first, self.total + 1), tuple(found)


class WaveformRecorder:
    def __init__(self, bench: Bench, reader: LedgerReader) -> None:
        self._bench, self._catch_up = bench, reader.catch_up
        project = bench.project
        self._keep = max(LEAST_CHANGES, min(KEPT_CHANGES, KEPT_IN_ALL // max(1, len(project.instances))))
        self.records = {
            decl.name: PinHistory(_list_initial_pins(decl, project), self._keep) for decl in project.instances
        }
        self._downloads: dict[str, PinChange] = {}  # downloaded in a scan, and not called in it so far
        self._downloaded_in = 0
        reader.index.subscribe(
            {StatusEdge: self._on_edge, InputEdge: self._on_edge, BenchNote: self._on_note}
        )
        reader.on_loss.append(self._handle_loss)

    def _on_edge(self, seq: int, scan: int, t_ns: int, event: StatusEdge | InputEdge) -> None:
        if self._downloads:
            self._add_downloads(scan)
            if isinstance(event, StatusEdge):
                self._downloads.pop(event.instance, None)
        record = self.records.get(event.instance)
        if record is not None:
            record.add_change(PinChange(seq, scan, t_ns, event))

    def _on_note(self, seq: int, scan: int, t_ns: int, note: BenchNote) -> None:
        if note.what not in HANDLED_NOTES:
            return
        self._add_downloads(scan)
        project = self._bench.project
        name, decl = note.subject, project.instance(note.subject)
        if note.what == CREATED_NOTE and decl is not None:
            first = _list_initial_pins(decl, project)
            record = self.records.setdefault(name, PinHistory(_unknown_pins(dict(first)), self._keep))
            record.add_change(PinChange(seq, scan, t_ns, KnownPins(first)))
        elif name in self.records:
            record = self.records[name]
            if note.what == DELETED_NOTE:
                record.add_change(PinChange(seq, scan, t_ns, KnownPins(_unknown_pins(record.pin_names()))))
            else:
                dark = tuple((pin, 0) for pin in record.pin_names() if outcome_field(pin))
                self._downloads[name], self._downloaded_in = PinChange(seq, scan, t_ns, KnownPins(dark)), scan

    def _add_downloads(self, scan: int) -> None:
        if self._downloads and scan > self._downloaded_in:
            for name, change in self._downloads.items():
                self.records[name].add_change(change)
            self._downloads.clear()

    def _handle_loss(self, seq: int, scan: int, t_ns: int) -> None:
        self._downloads.clear()
        for record in self.records.values():
            record.add_change(PinChange(seq, scan, t_ns, KnownPins(_unknown_pins(record.pin_names()))))

    def make_delta(
        self, instance: str, number: int, now: tuple[int, int], most: int = MOST_CHANGES_SENT
    ) -> WaveformDelta | None:
        """Return the changes of an instance after its change `number`, or None for an unknown instance.

        `now` is the last scan and its time. Of more than `most` changes, return the oldest `most`.
        """
        self._catch_up()
        self._add_downloads(now[0] + 1)
        record = self.records.get(instance)
        if record is None:
            return None
        first, changes = record.find_changes_after(number, most)
        scan, t_ns, before = 0, 0, NO_PINS
        if number == 0 or first > number + 1:
            (scan, t_ns), before = record.before_at, tuple(record.get_pins_before().items())
        is_all = first + len(changes) > record.total
        until = now if is_all or not changes else changes[-1][1:3]
        return WaveformDelta(instance, first, scan, t_ns, before, changes, *until)


def _list_initial_pins(decl: InstanceDecl, project: Project) -> PinValues:
    given = dict(decl.inputs)
    pins = project.pins(decl.block)
    inputs = [(pin.name, int(given.get(pin.name, 0))) for pin in pins if pin.direction is not Direction.OUT]
    return (*inputs, *((pin.name, None) for pin in pins if pin.direction is Direction.OUT))


def _unknown_pins(pins: Iterable[str]) -> PinValues:
    return tuple((pin, None) for pin in pins)
