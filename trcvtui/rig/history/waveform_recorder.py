"""The recorder of the timing pane: every change of every pin, kept where the scans pass.

Rule 1: it reads the ledger after each scan, so no frame of the screen and no flood can lose a pulse.
Rule 2: what had to be dropped is known: the news says what every pin was before its first change.
Rule 3: an instance that does not change costs nothing; a change costs about a microsecond.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import islice
from typing import Final

from trcvtui.blocks.pins import Direction
from trcvtui.blocks.table import shown_by
from trcvtui.plc.ledger import BenchNote, InputEdge, Ledger, StatusEdge
from trcvtui.project.project import InstanceDecl, Project
from trcvtui.rig.history.pin_waveform import NO_PINS, KnownPins, PinChange, PinValues, WaveformDelta, pins_of

KEPT_CHANGES: Final = 32_768  # of one instance, where there are few: 7 MB
KEPT_IN_ALL: Final = 500_000
LEAST_KEPT: Final = 1_000
MOST_NEWS: Final = 1_000  # changes of one instance in one picture
CREATED, DELETED, DOWNLOADED = "created", "deleted", "downloaded"
NOTED: Final = frozenset({CREATED, DELETED, DOWNLOADED})


class _Record:
    """The changes of one instance, the oldest dropped first: what they did stays in `before`."""

    def __init__(self, before: PinValues, keep: int) -> None:
        self.before = dict(before)
        self.before_at = 0, 0  # scan and time
        self.total = 0
        self._keep = keep
        self._changes: deque[PinChange] = deque()

    def add(self, change: PinChange) -> None:
        self.total += 1
        self._changes.append(change)
        if len(self._changes) > self._keep:
            dropped = self._changes.popleft()
            self.before.update(pins_of(dropped.event))
            self.before_at = dropped.scan, dropped.t_ns

    def pins(self) -> list[str]:
        return list(self.before)

    def since(self, number: int, most: int) -> tuple[int, tuple[PinChange, ...]]:
        """Return the oldest `most` changes after `number`, and the number of the first of them."""
        dropped = self.total - len(self._changes)
        skip = min(len(self._changes), max(0, number - dropped))
        if skip > len(self._changes) // 2:
            newest = islice(reversed(self._changes), len(self._changes) - skip)
            found = list(newest)[::-1][:most]
        else:
            found = list(islice(self._changes, skip, skip + most))
        return dropped + skip + 1, tuple(found)


class WaveformRecorder:
    """The record of each instance of one bench. `read` belongs after every scan."""

    def __init__(self, ledger: Ledger, project: Project) -> None:
        self._ledger = ledger
        self._seen = 0
        self._keep = _kept(len(project.instances))
        self._records = {
            decl.name: _Record(_first_pins(decl, project), self._keep) for decl in project.instances
        }

    def read(self, project: Project) -> None:
        """Take what the ledger has got since the last time; `project` knows the instances of now."""
        ledger, seen = self._ledger, self._seen
        if ledger.last_seq == seen:
            return
        self._seen = ledger.last_seq
        fresh = ledger.stamped_since(seen)
        if self._seen - len(fresh) > seen:
            self._lose(self._seen - len(fresh))
        renewed: dict[str, PinChange] = {}
        for number, (scan, t_ns, event) in enumerate(fresh, self._seen - len(fresh) + 1):
            kind = type(event)
            if kind is StatusEdge or kind is InputEdge:
                record = self._records.get(event.instance)  # type: ignore[union-attr]
                if record is not None:
                    record.add(PinChange(number, scan, t_ns, event))  # type: ignore[arg-type]
                    if renewed and kind is StatusEdge:
                        renewed.pop(event.instance, None)  # type: ignore[union-attr]
            elif kind is BenchNote and event.what in NOTED:  # type: ignore[union-attr]
                self._note(number, scan, t_ns, event, project, renewed)  # type: ignore[arg-type]
        for name, change in renewed.items():
            self._records[name].add(change)

    def _note(
        self,
        number: int,
        scan: int,
        t_ns: int,
        note: BenchNote,
        project: Project,
        renewed: dict[str, PinChange],
    ) -> None:
        """An instance begins, ends, or is new: no edge tells its pins, unless it is called at once."""
        name, decl = note.subject, project.instance(note.subject)
        if note.what == CREATED and decl is not None:
            first = _first_pins(decl, project)
            record = self._records.setdefault(name, _Record(_unknown(dict(first)), self._keep))
            record.add(PinChange(number, scan, t_ns, KnownPins(first)))
        elif name in self._records:
            record = self._records[name]
            if note.what == DELETED:
                record.add(PinChange(number, scan, t_ns, KnownPins(_unknown(record.pins()))))
            else:
                dark = tuple((pin, 0) for pin in record.pins() if shown_by(pin))
                renewed[name] = PinChange(number, scan, t_ns, KnownPins(dark))

    def _lose(self, seq: int) -> None:
        """More came in one scan than the ledger keeps: nobody can say what the pins did."""
        for record in self._records.values():
            unknown = KnownPins(_unknown(record.pins()))
            record.add(PinChange(seq, self._ledger.scan, self._ledger.t_ns, unknown))

    def news(
        self, instance: str, number: int, now: tuple[int, int], most: int = MOST_NEWS
    ) -> WaveformDelta | None:
        """Return what is new of an instance after its change `number`; None: no such instance.

        `now` is the last scan and its time; at most `most` changes, the oldest of them, come at once.
        """
        record = self._records.get(instance)
        if record is None:
            return None
        first, changes = record.since(number, most)
        scan, t_ns, before = 0, 0, NO_PINS
        if number == 0 or first > number + 1:
            (scan, t_ns), before = record.before_at, tuple(record.before.items())
        is_all = first + len(changes) > record.total
        last = changes[-1] if changes else None
        until = now
        if not is_all and last is not None:
            until = last.scan, last.t_ns
        return WaveformDelta(instance, first, scan, t_ns, before, changes, *until)


def _kept(instances: int) -> int:
    return max(LEAST_KEPT, min(KEPT_CHANGES, KEPT_IN_ALL // max(1, instances)))


def _first_pins(decl: InstanceDecl, project: Project) -> PinValues:
    """Return every pin of an instance before its first call: the inputs as declared, no outputs yet."""
    given = dict(decl.inputs)
    pins = project.pins(decl.block)
    inputs = [(pin.name, int(given.get(pin.name, 0))) for pin in pins if pin.direction is not Direction.OUT]
    return (*inputs, *((pin.name, None) for pin in pins if pin.direction is Direction.OUT))


def _unknown(pins: Iterable[str]) -> PinValues:
    return tuple((pin, None) for pin in pins)
