"""One pin over the scans: its changes in order, least and greatest value of any stretch of scans."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import Final, NamedTuple

KEPT: Final = 40_000  # changes of one pin on the screen's side; the oldest are forgotten by the half
POLL_NS: Final = 100_000_000  # what an online watch table of an IDE asks by

Value = int | None


class Window(NamedTuple):
    """The columns that are drawn: column n is the scans n * zoom + 1 to (n + 1) * zoom."""

    first: int
    width: int
    zoom: int

    def scans_of(self, column: int) -> tuple[int, int]:
        """Return the first and the last scan of a column, counted from the left edge."""
        begin = (self.first + column) * self.zoom + 1
        return begin, begin + self.zoom - 1

    def column_of(self, scan: int) -> int:
        """Return the column of a scan, counted from the left edge; it may lie outside."""
        return (scan - 1) // self.zoom - self.first


class Column(NamedTuple):
    """A stretch of scans: least and greatest value (None: not known), the last one, how many changes.

    `is_entry` says that its only change is at its very beginning: nothing happens inside.
    """

    low: Value
    high: Value
    end: Value
    changes: int
    is_entry: bool = False

    @property
    def is_level(self) -> bool:
        """Return whether the value is the same in all its scans."""
        return self.low == self.high


class Lane:
    """The changes of one pin; BOOLs are 0 and 1, None is a value that nobody knows."""

    def __init__(self) -> None:
        self.scans: list[int] = []
        self.times: list[int] = []
        self.values: list[Value] = []
        self.forgotten = 0
        self._columns: dict[int, Column] = {}
        self._zoom = 0

    def add(self, scan: int, t_ns: int, value: Value) -> None:
        """Append a change; a value that has not changed is none."""
        if self.values and self.values[-1] == value:
            return
        self.scans.append(scan)
        self.times.append(t_ns)
        self.values.append(value)
        if len(self.scans) > 2 * KEPT:
            del self.scans[:KEPT], self.times[:KEPT], self.values[:KEPT]
            self.forgotten += KEPT
            self._columns.clear()

    def at(self, scan: int) -> Value:
        """Return the value behind a scan."""
        place = bisect_right(self.scans, scan)
        return self.values[place - 1] if place else None

    def between(self, first: int, last: int) -> Column:
        """Return what the pin was from the first to the last of these scans."""
        begin, end = bisect_left(self.scans, first), bisect_right(self.scans, last)
        before = self.values[begin - 1] if begin else None
        if begin == end:
            return Column(before, before, before, 0)
        is_entry = self.scans[begin] == first
        inside = self.values[begin:end] if is_entry else [before, *self.values[begin:end]]
        known = [value for value in inside if value is not None]
        low, high = (min(known), max(known)) if known else (None, None)
        return Column(low, high, inside[-1], end - begin, is_entry and end - begin == 1)

    def columns(self, window: Window, until: int) -> list[Column | None]:
        """Return the columns of a window, None for those behind scan `until`; what is over is found once."""
        if self._zoom != window.zoom or len(self._columns) > 8 * window.width + 1024:
            self._columns, self._zoom = {}, window.zoom
        return [self._column(window, number, until) for number in range(window.width)]

    def _column(self, window: Window, number: int, until: int) -> Column | None:
        key = window.first + number
        if (known := self._columns.get(key)) is not None:
            return known
        first, last = window.scans_of(number)
        if first > until or last < 1:
            return None
        column = self.between(first, min(last, until))
        if last < until:
            self._columns[key] = column
        return column

    def next_edge(self, scan: int, direction: int) -> int | None:
        """Return the scan of the next change behind a scan, or of the last one before it.

        What merely becomes known, or is no longer known, is no change.
        """
        place = bisect_right(self.scans, scan) if direction > 0 else bisect_left(self.scans, scan) - 1
        while 0 < place < len(self.scans):
            if self.values[place] is not None and self.values[place - 1] is not None:
                return self.scans[place]
            place += direction
        return None

    def rises(self, first: int, last: int) -> int:
        """Return how often the pin became TRUE in these scans."""
        begin, end = bisect_left(self.scans, first), bisect_right(self.scans, last)
        return sum(1 for value in self.values[begin:end] if value)


class PolledLane(Lane):
    """What a watch table shows of a pin that asks every 100 ms and knows nothing of what was in between."""

    def __init__(self, source: Lane) -> None:
        super().__init__()
        self._source = source
        self._next = 0

    def follow(self, until_ns: int, interval_ns: int) -> None:
        """Poll as far as the source is known."""
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
