"""Waveforms of a pin and of an instance over the scans, and the changes that the engine must send.

Rule: changes that were left out are a gap. Nothing is guessed about a gap.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.blocks.table import block_row, outcome_field
from trcvtui.plc.ledger import InputEdge, Line, StatusEdge

# -- one pin ----------------------------------------------------------------------------------------------

MOST_CHANGES: Final = 40_000  # changes of one pin on the screen's side; the oldest are forgotten by the half
POLL_NS: Final = 100_000_000  # the interval of an online watch table of an IDE

LaneValue = int | None


class ScanWindow(NamedTuple):
    """The columns that are drawn. Column n has the scans n * zoom + 1 to (n + 1) * zoom."""

    first: int
    width: int
    zoom: int

    def column_scans(self, column: int) -> tuple[int, int]:
        """Return the first and the last scan of a column, counted from the left edge."""
        begin = (self.first + column) * self.zoom + 1
        return begin, begin + self.zoom - 1

    def find_column(self, scan: int) -> int:
        """Return the column of a scan, counted from the left edge; it may lie outside the window."""
        return (scan - 1) // self.zoom - self.first


class Column(NamedTuple):
    """The least, greatest and last value in some scans, None if unknown, and the number of changes."""

    low: LaneValue
    high: LaneValue
    end: LaneValue
    changes: int

    @property
    def is_level(self) -> bool:
        return self.low == self.high


class PinWaveform:
    """The changes of one pin; BOOLs are 0 and 1, None is an unknown value."""

    def __init__(self) -> None:
        self.scans: list[int] = []
        self.times: list[int] = []
        self.values: list[LaneValue] = []
        self.forgotten = 0
        self._columns: dict[int, Column] = {}
        self._zoom = 0

    def add(self, scan: int, t_ns: int, value: LaneValue) -> None:
        """Append a change; ignore a value that is equal to the last one."""
        if self.values and self.values[-1] == value:
            return
        self.scans.append(scan)
        self.times.append(t_ns)
        self.values.append(value)
        if len(self.scans) > 2 * MOST_CHANGES:
            del self.scans[:MOST_CHANGES], self.times[:MOST_CHANGES], self.values[:MOST_CHANGES]
            self.forgotten += MOST_CHANGES
            self._columns.clear()

    def value_at(self, scan: int) -> LaneValue:
        place = bisect_right(self.scans, scan)
        return self.values[place - 1] if place else None

    def make_column(self, first: int, last: int) -> Column:
        begin, end = bisect_left(self.scans, first), bisect_right(self.scans, last)
        before = self.values[begin - 1] if begin else None
        if begin == end:
            return Column(before, before, before, 0)
        inside = self.values[begin:end] if self.scans[begin] == first else [before, *self.values[begin:end]]
        known = [value for value in inside if value is not None]
        low, high = (min(known), max(known)) if known else (None, None)
        return Column(low, high, inside[-1], end - begin)

    def list_columns(self, window: ScanWindow, until: int) -> list[Column | None]:
        """Return the columns of a window, None for those after scan `until`. Store complete columns."""
        if self._zoom != window.zoom or len(self._columns) > 8 * window.width + 1024:
            self._columns, self._zoom = {}, window.zoom
        return [self._get_column(window, number, until) for number in range(window.width)]

    def _get_column(self, window: ScanWindow, number: int, until: int) -> Column | None:
        key = window.first + number
        if (known := self._columns.get(key)) is not None:
            return known
        first, last = window.column_scans(number)
        if first > until or last < 1:
            return None
        column = self.make_column(first, min(last, until))
        if last < until:
            self._columns[key] = column
        return column

    def find_next_edge(self, scan: int, direction: int) -> int | None:
        """Return the scan of the next change after a scan, or of the last change before that scan.

        A value that only becomes known or unknown is no change.
        """
        place = bisect_right(self.scans, scan) if direction > 0 else bisect_left(self.scans, scan) - 1
        while 0 < place < len(self.scans):
            if self.values[place] is not None and self.values[place - 1] is not None:
                return self.scans[place]
            place += direction
        return None

    def count_rises(self, first: int, last: int) -> int:
        begin, end = bisect_left(self.scans, first), bisect_right(self.scans, last)
        return sum(1 for value in self.values[begin:end] if value)


class PolledWaveform(PinWaveform):
    """A pin as a watch table shows it: the table polls every 100 ms and misses the changes in between."""

    def __init__(self, source: PinWaveform) -> None:
        super().__init__()
        self._source = source
        self._next = 0

    def poll_until(self, until_ns: int, interval_ns: int) -> None:
        source = self._source
        place = max(0, self._next - source.forgotten)
        while place < len(source.times):
            t_ns, is_last = source.times[place], place + 1 == len(source.times)
            poll = -(-t_ns // POLL_NS) * POLL_NS
            if poll <= until_ns if is_last else poll < source.times[place + 1]:
                scan = source.scans[place] + (poll - t_ns) // max(1, interval_ns)
                limit = scan if is_last else max(source.scans[place], source.scans[place + 1] - 1)
                self.add(min(scan, limit), poll, source.values[place])
            if is_last:
                break
            place += 1
        self._next = place + source.forgotten


# -- changes from the engine ------------------------------------------------------------------------------


PinValues = tuple[tuple[str, int | None], ...]
NO_PINS: Final[PinValues] = ()


class KnownPins(Struct, frozen=True):
    """Values that some pins have from now on, without an edge. None means that the value is unknown."""

    values: PinValues


class PinChange(NamedTuple):
    """A change in a scan, with the ledger number `seq`. Of several changes in one scan the last counts."""

    seq: int
    scan: int
    t_ns: int
    event: StatusEdge | InputEdge | KnownPins


class WaveformDelta(Struct, frozen=True):
    """The changes of one instance in order. `first` is the number of the first change, counted from 1.

    `before` has the pin values from `before_scan` to the first change. The changes reach to `until_scan`.
    """

    instance: str
    first: int
    before_scan: int
    before_ns: int
    before: PinValues
    changes: tuple[PinChange, ...]
    until_scan: int
    until_ns: int


def cut_delta(news: WaveformDelta, scan: int, t_ns: int) -> WaveformDelta | None:
    """Return the changes up to a past scan, or None if the known changes begin after that scan."""
    if news.before and news.before_scan > scan:
        return None
    changes = tuple(change for change in news.changes if change.scan <= scan)
    if len(changes) == len(news.changes) and news.until_scan <= scan:
        return news
    return replace(news, changes=changes, until_scan=scan, until_ns=t_ns)


def event_pins(event: StatusEdge | InputEdge | KnownPins) -> PinValues:
    """Return the pins in an event, BOOLs as 0 and 1."""
    if isinstance(event, InputEdge):
        return ((event.pin, int(event.value)),)
    if isinstance(event, KnownPins):
        return event.values
    shown = ((pin.name, getattr(event.outputs, pin.shows)) for pin in block_row(event.block).outputs)
    return tuple((pin, int(value)) for pin, value in shown if value is not None)


# -- one instance -----------------------------------------------------------------------------------------

LAMP_FIELDS: Final = frozenset({"done", "error", "busy"})
WATCHED_FIELDS: Final = ("status", "done")  # shown as a watch table would, under any name
MOST_GAPS: Final = 200


def find_lamp(pin: str) -> str:
    """Return which of done, error and busy a pin shows, whatever the pin's name; "" if it shows none."""
    shows = outcome_field(pin)
    return shows if shows in LAMP_FIELDS else ""


class Waveform:
    """The pins of one instance. Scans count from 1. The last known scan is `until_scan`."""

    def __init__(self, instance: str) -> None:
        self.instance = instance
        self.number = 0  # of the last change that is known
        self.until_scan = self.until_ns = 0
        self.interval_ns = 1
        self.lanes = defaultdict[str, PinWaveform](PinWaveform)
        self.edges: list[Line] = []
        self.edge_scans: list[int] = []
        self.gaps: list[tuple[int, int]] = []
        self._anchors: list[tuple[int, int]] = []  # scans whose time is known
        self._polled: dict[str, PolledWaveform] = {}

    # -- input --------------------------------------------------------------------------------------

    def add_delta(self, news: WaveformDelta, interval_ns: int) -> None:
        """Append the changes that are new. Changes that the engine left out become a gap."""
        if news.first <= self.number:
            return
        self.interval_ns = interval_ns
        if news.first > self.number + 1:
            self._add_gap(news)
        if news.before:
            self._set_pins(news.before_scan, news.before_ns, news.before)
        for change in news.changes:
            self._set_pins(change.scan, change.t_ns, event_pins(change.event))
            if isinstance(change.event, StatusEdge):
                self._add_edge(change, change.event)
        self.number = news.first + len(news.changes) - 1
        self.until_scan, self.until_ns = news.until_scan, news.until_ns
        for pin in self.watched_pins:
            self.get_polled(pin).poll_until(self.until_ns, interval_ns)

    def _add_gap(self, news: WaveformDelta) -> None:
        first = min(self.until_scan + 1, news.before_scan)
        self.gaps.append((max(1, first), news.before_scan))
        del self.gaps[:-MOST_GAPS]
        self._set_pins(first, self.until_ns, tuple((pin, None) for pin in self.lanes))

    def _set_pins(self, scan: int, t_ns: int, pins: PinValues) -> None:
        for pin, value in pins:
            self.lanes[pin].add(scan, t_ns, value)
        if not self._anchors or self._anchors[-1][0] < scan:
            self._anchors.append((scan, t_ns))
            if len(self._anchors) > 2 * MOST_CHANGES:
                del self._anchors[:MOST_CHANGES]

    def _add_edge(self, change: PinChange, edge: StatusEdge) -> None:
        self.edges.append(Line(change.seq, change.scan, change.t_ns, edge))
        self.edge_scans.append(change.scan)
        if len(self.edges) > 2 * MOST_CHANGES:
            del self.edges[:MOST_CHANGES], self.edge_scans[:MOST_CHANGES]

    # -- questions ----------------------------------------------------------------------------------

    def get_polled(self, pin: str) -> PolledWaveform:
        if pin not in self._polled:
            self._polled[pin] = PolledWaveform(self.lanes[pin])
        return self._polled[pin]

    def find_pin(self, what: str) -> str | None:
        """Return the output pin for a field such as `status`, or None if the block has no such pin."""
        return next((pin for pin in self.lanes if outcome_field(pin) == what), None)

    @property
    def watched_pins(self) -> list[str]:
        return [pin for what in WATCHED_FIELDS if (pin := self.find_pin(what)) is not None]

    def list_columns(self, lane: PinWaveform, window: ScanWindow) -> list[Column | None]:
        return lane.list_columns(window, self.until_scan)

    def is_gap(self, first: int, last: int) -> bool:
        place = bisect_right(self.gaps, (last, 1 << 62))
        return place > 0 and first <= self.gaps[place - 1][1]

    @property
    def first_scan(self) -> int:
        """Return the first scan with a known pin."""
        known = [lane.scans[0] for lane in self.lanes.values() if lane.scans]
        return max(1, min(known, default=1))

    def time_at(self, scan: int) -> tuple[int, bool]:
        """Return the time of a scan in ns, and whether it is exact: the engine sends only some times."""
        place = bisect_right(self._anchors, (scan, 1 << 62))
        if place and self._anchors[place - 1][0] == scan:
            return self._anchors[place - 1][1], True
        before = self._anchors[place - 1] if place else (1, 0)
        after = self._anchors[place] if place < len(self._anchors) else (self.until_scan, self.until_ns)
        scans, ns = after[0] - before[0], after[1] - before[1]
        if scans <= 0:
            return after[1], after[0] == scan
        t_ns = before[1] + ns * (scan - before[0]) // scans
        return t_ns, scan == after[0] or ns == scans * self.interval_ns

    def edge_at(self, scan: int) -> Line | None:
        """Return the STATUS edge that is in force after a scan."""
        place = bisect_right(self.edge_scans, scan)
        return self.edges[place - 1] if place else None

    def list_edges(self, first: int, last: int) -> list[Line]:
        return self.edges[bisect_left(self.edge_scans, first) : bisect_right(self.edge_scans, last)]

    def find_next_edge(self, scan: int, direction: int) -> int | None:
        """Return the nearest scan in which a pin changes, after or before this scan."""
        lanes = self.lanes.values()
        found = [edge for lane in lanes if (edge := lane.find_next_edge(scan, direction)) is not None]
        return (min if direction > 0 else max)(found, default=None)

    def find_next_where(self, scan: int, holds: Callable[[StatusEdge], bool]) -> int | None:
        for line in self.edges[bisect_right(self.edge_scans, scan) :]:
            if isinstance(line.event, StatusEdge) and holds(line.event):
                return line.scan
        return None


# -- the waves of the screen ------------------------------------------------------------------------------

MOST_WAVES: Final = 16  # instances that the screen remembers


class WaveformCache:
    """The waves of the instances that were shown last."""

    def __init__(self) -> None:
        self._waves: dict[str, Waveform] = {}
        self.too_late: set[str] = set()  # requested up to a scan of which nothing is kept

    def get_wave(self, instance: str) -> Waveform:
        wave = self._waves.pop(instance, None) or Waveform(instance)
        self._waves[instance] = wave
        if len(self._waves) > MOST_WAVES:
            del self._waves[next(iter(self._waves))]
        return wave

    def make_requests(self, instances: Iterable[str], scan: int | None = None) -> tuple[tuple[str, int], ...]:
        """Return the instances to request from the engine, each with the number of its last known change.

        With `scan`, leave out instances whose changes up to that scan are known or no longer stored.
        """
        known = self._waves
        wanted = instances if scan is None else [name for name in instances if self._is_missing(name, scan)]
        return tuple((name, known[name].number if name in known else 0) for name in wanted)

    def _is_missing(self, name: str, scan: int) -> bool:
        wave = self._waves.get(name)
        return name not in self.too_late and (wave is None or wave.until_scan < scan)

    def add_deltas(self, news: Iterable[WaveformDelta], interval_ns: int) -> None:
        self.too_late.clear()
        for fresh in news:
            self.get_wave(fresh.instance).add_delta(fresh, interval_ns)

    def add_deltas_up_to(self, news: Iterable[WaveformDelta], interval_ns: int, scan: int, t_ns: int) -> None:
        """Append the new changes up to a scan."""
        for fresh in news:
            then = cut_delta(fresh, scan, t_ns)
            if then is None:
                self.too_late.add(fresh.instance)
            else:
                self.get_wave(fresh.instance).add_delta(then, interval_ns)
