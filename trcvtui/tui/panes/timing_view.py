"""Which scans the timing pane shows: zoom, left edge, cursor, two markers, following or not. No drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from trcvtui.rig.history.pin_waveform import Window

ZOOMS: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
NAME: Final = 12  # columns of a row's name, where none is longer
LABEL: Final = 20  # columns: mark, name, value under the cursor
MARGIN: Final = 4  # columns between the cursor and the edge, where there is room


class TimingView:
    """`cursor` None is the present. Scans count from 1."""

    def __init__(self) -> None:
        self.cursor: int | None = None
        self.follows = True
        self.markers: list[int] = []
        self._level = 0
        self._first = 0
        self._count = 1

    @property
    def zoom(self) -> int:
        """Return how many scans stand in a column."""
        return ZOOMS[self._level]

    def window(self, count: int, until: int) -> Window:
        """Return the columns to draw in a pane of this width; `until` is the newest scan."""
        from trcvtui.rig.history.pin_waveform import Window  # read when first drawn

        self._count = max(1, count)
        if self.follows:
            self._first = max(0, self._column(until) - self._count + 1)
        return Window(self._first, self._count, self.zoom)

    def _column(self, scan: int) -> int:
        return max(0, scan - 1) // self.zoom

    def zoom_by(self, steps: int, until: int) -> None:
        """Take more or fewer scans into a column; what is under the cursor stays where it is."""
        if steps > 0 and self._count * self.zoom >= until:
            return  # the whole run is in view already
        anchor = until if self.cursor is None else self.cursor
        place = self._column(anchor) - self._first
        self._level = max(0, min(len(ZOOMS) - 1, self._level + steps))
        self._first = max(0, self._column(anchor) - place)

    def go_to(self, scan: int, until: int) -> None:
        """Put the cursor into a scan and have it in view; what comes in no longer moves the view."""
        self.cursor, self.follows = max(1, min(scan, max(1, until))), False
        margin = min(MARGIN, (self._count - 1) // 2)
        column = self._column(self.cursor)
        if column < self._first + margin:
            self._first = max(0, column - margin)
        elif column > self._first + self._count - 1 - margin:
            self._first = column - self._count + 1 + margin

    def page(self, pages: int, until: int) -> None:
        """Go a whole view on or back."""
        here = until if self.cursor is None else self.cursor
        self.go_to(here + pages * self._count * self.zoom, until)

    def now(self) -> None:
        """Go back to the present, and follow it."""
        self.cursor, self.follows = None, True

    def follow(self) -> None:
        """Follow the newest scan, or let the view stand; the cursor keeps its scan."""
        self.follows = not self.follows

    def mark(self, until: int) -> None:
        """Set the first marker, then the second; a third one begins anew."""
        here = until if self.cursor is None else self.cursor
        self.markers = [*self.markers, here] if len(self.markers) < 2 else [here]

    @property
    def stretch(self) -> tuple[int, int] | None:
        """Return the scans between two markers, or between the one and the cursor."""
        ends = self.markers if len(self.markers) == 2 else [*self.markers, self.cursor or 0]
        if not self.markers or not ends[1]:
            return None
        return ends[0], ends[1]
