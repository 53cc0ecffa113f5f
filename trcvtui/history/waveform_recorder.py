"""The recorder of the timing pane: every change of every pin, kept where the scans pass.

Rule 1: it is told every line of the ledger, so no frame of the screen and no flood can lose a pulse.
Rule 2: what had to be dropped is known: the news says what every pin was before its first change.
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
from trcvtui.history.pin_waveform import NO_PINS, KnownPins, PinChange, PinValues, WaveformDelta, pins_of
from trcvtui.plc.ledger import BenchNote, InputEdge, StatusEdge
from trcvtui.project.project import InstanceDecl, Project

KEPT_CHANGES: Final = 32_768  # of one instance, where there are few: 7 MB
KEPT_IN_ALL: Final = 500_000
LEAST_KEPT: Final = 1_000
MOST_NEWS: Final = 1_000  # changes of one instance in one picture
CREATED, DELETED, DOWNLOADED = "created", "deleted", "downloaded"
NOTED: Final = frozenset({CREATED, DELETED, DOWNLOADED})


class PinRecord:
    """The changes of one instance, the oldest dropped first: what they did is in `before`."""

    def __init__(self, before: PinValues, keep: int) -> None:
        self._before = dict(before)
        self._edge: StatusEdge | None = None  # the last one that was dropped, not yet in `_before`
        self.before_at = 0, 0  # scan and time
        self.total = 0
        self._keep = keep
        self._changes: deque[PinChange] = deque()
        self.on_drop: Callable[[PinChange], None] | None = None  # told of each change that is dropped

    def add(self, change: PinChange) -> None:
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
                self.before().update(pins_of(event))
            if self.on_drop is not None:
                self.on_drop(dropped)

    def before(self) -> dict[str, int | None]:
        """Return what each pin was after the last change that was dropped."""
        if self._edge is not None:
            self._before.update(pins_of(self._edge))
            self._edge = None
        return self._before

    def pins(self) -> list[str]:
        return list(self._before)

    @property
    def kept(self) -> int:
        return len(self._changes)

    def after(self, number: int, most: int = KEPT_CHANGES) -> list[PinChange]:
        """Return the oldest `most` of the kept changes after `number`."""
        kept = len(self._changes)
        fresh = min(kept, self.total - number)
        if fresh < kept // 2:
            return [*islice(reversed(self._changes), max(0, fresh))][::-1][:most]
        return list(islice(self._changes, kept - fresh, kept - fresh + most))

    def since(self, number: int, most: int) -> tuple[int, tuple[PinChange, ...]]:
        """Return the oldest `most` changes after `number`, and the number of the first of them."""
        first = max(number, self.total - len(self._changes)) + 1
        found = self.after(number, most)
        return min(first, self.total + 1), tuple(found)


class WaveformRecorder:
    def __init__(self, bench: Bench, reader: LedgerReader) -> None:
        self._bench, self._catch_up = bench, reader.catch_up
        project = bench.project
        self._keep = max(LEAST_KEPT, min(KEPT_CHANGES, KEPT_IN_ALL // max(1, len(project.instances))))
        self.records = {
            decl.name: PinRecord(_first_pins(decl, project), self._keep) for decl in project.instances
        }
        self._renewed: dict[str, PinChange] = {}  # who was downloaded in a scan, and not called in it so far
        self._renewed_in = 0
        reader.index.listen({StatusEdge: self._change, InputEdge: self._change, BenchNote: self._note})
        reader.lost.append(self._lose)

    def _change(self, seq: int, scan: int, t_ns: int, event: StatusEdge | InputEdge) -> None:
        if self._renewed:
            self._settle(scan)
            if isinstance(event, StatusEdge):
                self._renewed.pop(event.instance, None)
        record = self.records.get(event.instance)
        if record is not None:
            record.add(PinChange(seq, scan, t_ns, event))

    def _note(self, seq: int, scan: int, t_ns: int, note: BenchNote) -> None:
        if note.what not in NOTED:
            return
        self._settle(scan)
        project = self._bench.project
        name, decl = note.subject, project.instance(note.subject)
        if note.what == CREATED and decl is not None:
            first = _first_pins(decl, project)
            record = self.records.setdefault(name, PinRecord(_unknown(dict(first)), self._keep))
            record.add(PinChange(seq, scan, t_ns, KnownPins(first)))
        elif name in self.records:
            record = self.records[name]
            if note.what == DELETED:
                record.add(PinChange(seq, scan, t_ns, KnownPins(_unknown(record.pins()))))
            else:
                dark = tuple((pin, 0) for pin in record.pins() if outcome_field(pin))
                self._renewed[name], self._renewed_in = PinChange(seq, scan, t_ns, KnownPins(dark)), scan

    def _settle(self, scan: int) -> None:
        if self._renewed and scan > self._renewed_in:
            for name, change in self._renewed.items():
                self.records[name].add(change)
            self._renewed.clear()

    def _lose(self, seq: int, scan: int, t_ns: int) -> None:
        self._renewed.clear()
        for record in self.records.values():
            record.add(PinChange(seq, scan, t_ns, KnownPins(_unknown(record.pins()))))

    def news(
        self, instance: str, number: int, now: tuple[int, int], most: int = MOST_NEWS
    ) -> WaveformDelta | None:
        """Return what is new of an instance after its change `number`; None: no such instance.

        `now` is the last scan and its time; at most `most` changes, the oldest of them, come at once.
        """
        self._catch_up()
        self._settle(now[0] + 1)
        record = self.records.get(instance)
        if record is None:
            return None
        first, changes = record.since(number, most)
        scan, t_ns, before = 0, 0, NO_PINS
        if number == 0 or first > number + 1:
            (scan, t_ns), before = record.before_at, tuple(record.before().items())
        is_all = first + len(changes) > record.total
        until = now if is_all or not changes else changes[-1][1:3]
        return WaveformDelta(instance, first, scan, t_ns, before, changes, *until)


def _first_pins(decl: InstanceDecl, project: Project) -> PinValues:
    given = dict(decl.inputs)
    pins = project.pins(decl.block)
    inputs = [(pin.name, int(given.get(pin.name, 0))) for pin in pins if pin.direction is not Direction.OUT]
    return (*inputs, *((pin.name, None) for pin in pins if pin.direction is Direction.OUT))


def _unknown(pins: Iterable[str]) -> PinValues:
    return tuple((pin, None) for pin in pins)
