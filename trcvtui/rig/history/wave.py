"""One instance over the scans, as the screen knows it: its lanes, its STATUS edges, its gaps. No guesses."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable
from typing import Final

from trcvtui.blocks.parameters import SHOWS
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.rig.history.pin_waveform import KEPT, Column, Lane, PolledLane, Window
from trcvtui.rig.history.waveform_delta import Change, PinValues, WaveNews, pins_of

LAMPS: Final = {pin: shows for pin, shows in SHOWS.items() if shows in ("done", "error", "busy")}
WATCHED: Final = ("status", "done")  # what the ghost rows show, whatever the block calls it
MOST_GAPS: Final = 200


class Wave:
    """The pins of one instance. Scans count from 1; `until_scan` is the last one that is known."""

    def __init__(self, instance: str) -> None:
        self.instance = instance
        self.number = 0  # of the last change that is known
        self.until_scan = self.until_ns = 0
        self.interval_ns = 1
        self.lanes: dict[str, Lane] = {}
        self.edges: list[Line] = []
        self.edge_scans: list[int] = []
        self.gaps: list[tuple[int, int]] = []
        self._anchors: list[tuple[int, int]] = []  # scans whose time is known
        self._polled: dict[str, PolledLane] = {}

    # -- what comes in ------------------------------------------------------------------------------

    def take(self, news: WaveNews, interval_ns: int) -> None:
        """Append what is new; what was left out becomes a gap."""
        if news.first <= self.number:
            return
        self.interval_ns = interval_ns
        if news.first > self.number + 1:
            self._leave_a_gap(news)
        if news.before:
            self._set(news.before_scan, news.before_ns, news.before)
        for change in news.changes:
            self._set(change.scan, change.t_ns, pins_of(change.event))
            if isinstance(change.event, StatusEdge):
                self._note(change, change.event)
        self.number = news.first + len(news.changes) - 1
        self.until_scan, self.until_ns = news.until_scan, news.until_ns
        for pin in self.watched:
            self.polled(pin).follow(self.until_ns, interval_ns)

    def _leave_a_gap(self, news: WaveNews) -> None:
        first = min(self.until_scan + 1, news.before_scan)
        self.gaps.append((max(1, first), news.before_scan))
        del self.gaps[:-MOST_GAPS]
        self._set(first, self.until_ns, tuple((pin, None) for pin in self.lanes))

    def _set(self, scan: int, t_ns: int, pins: PinValues) -> None:
        for pin, value in pins:
            self.lane(pin).add(scan, t_ns, value)
        if not self._anchors or self._anchors[-1][0] < scan:
            self._anchors.append((scan, t_ns))
            if len(self._anchors) > 2 * KEPT:
                del self._anchors[:KEPT]

    def _note(self, change: Change, edge: StatusEdge) -> None:
        self.edges.append(Line(change.seq, change.scan, change.t_ns, edge))
        self.edge_scans.append(change.scan)
        if len(self.edges) > 2 * KEPT:
            del self.edges[:KEPT], self.edge_scans[:KEPT]

    # -- what is asked ------------------------------------------------------------------------------

    def lane(self, pin: str) -> Lane:
        """Return the lane of a pin."""
        if pin not in self.lanes:
            self.lanes[pin] = Lane()
        return self.lanes[pin]

    def polled(self, pin: str) -> PolledLane:
        """Return what a watch table shows of a pin."""
        if pin not in self._polled:
            self._polled[pin] = PolledLane(self.lane(pin))
        return self._polled[pin]

    def pin_that_shows(self, what: str) -> str | None:
        """Return the output that shows it, such as Error or STATUS for `status`; None: it has none."""
        return next((pin for pin in self.lanes if SHOWS.get(pin) == what), None)

    @property
    def watched(self) -> list[str]:
        """Return the pins of the ghost rows."""
        return [pin for what in WATCHED if (pin := self.pin_that_shows(what)) is not None]

    def columns(self, lane: Lane, window: Window) -> list[Column | None]:
        """Return the columns of a lane."""
        return lane.columns(window, self.until_scan)

    def is_gap(self, first: int, last: int) -> bool:
        """Return whether something in these scans is not known."""
        return any(begin <= last and first <= end for begin, end in reversed(self.gaps))

    @property
    def first_scan(self) -> int:
        """Return the first scan that anything is known of."""
        known = [lane.scans[0] for lane in self.lanes.values() if lane.scans]
        return max(1, min(known, default=1))

    def time_at(self, scan: int) -> tuple[int, bool]:
        """Return the time of a scan in ns, and whether it is exact: some scans' time was never told."""
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
        """Return the STATUS edge that is in force behind a scan."""
        place = bisect_right(self.edge_scans, scan)
        return self.edges[place - 1] if place else None

    def edges_in(self, first: int, last: int) -> list[Line]:
        """Return the STATUS edges of these scans."""
        return self.edges[bisect_left(self.edge_scans, first) : bisect_right(self.edge_scans, last)]

    def next_edge(self, scan: int, direction: int, pins: Iterable[str] = ()) -> int | None:
        """Return the nearest scan behind (or before) this one in which one of the pins changes; () is all."""
        lanes = [self.lanes[pin] for pin in (tuple(pins) or self.lanes) if pin in self.lanes]
        found = [edge for lane in lanes if (edge := lane.next_edge(scan, direction)) is not None]
        return (min if direction > 0 else max)(found, default=None)

    def next_where(self, scan: int, holds: Callable[[StatusEdge], bool]) -> int | None:
        """Return the scan of the next STATUS edge behind this scan for which it holds."""
        for line in self.edges[bisect_right(self.edge_scans, scan) :]:
            if isinstance(line.event, StatusEdge) and holds(line.event):
                return line.scan
        return None
