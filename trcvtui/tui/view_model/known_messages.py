"""The messages of the selected instance as the screen knows them: a copy of the engine's newest rows."""

from __future__ import annotations

from bisect import bisect_right
from typing import Final

from trcvtui.history.messages import MOST_INSTANCE_ROWS, MessageRow, MessagesDelta
from trcvtui.history.records import MAX_SCAN

SLACK_ROWS: Final = 256  # rows that are dropped in one go


class KnownMessages:
    """The newest rows of one instance at a time, oldest first, from row `first` on.

    A dropped row is no longer in `rows`. A row without `content` has lost its values.
    """

    def __init__(self) -> None:
        self.instance = ""
        self.first = self.count = 0  # number of rows[0] among all of the instance; how many it has had
        self.rows: list[MessageRow] = []
        self.left_out = 0  # rows that came too fast for the screen
        self.share = 1.0  # of a recording, read so far
        self.are_typed = True
        self.gaps: tuple[tuple[int, int], ...] = ()  # from, to without a connection, in ns
        self.errors: tuple[int, ...] = ()  # times of an ERROR, in ns
        self.is_behind = False  # more rows wait than came with the last picture
        self._emptied = 0  # rows before this number have lost their content

    @property
    def next_number(self) -> int:
        return self.first + len(self.rows)

    def number_after(self, scan: int) -> int:
        """Return the number of the first row after a scan, which may be the next row to come."""
        return self.first + bisect_right(self.rows, scan, key=lambda row: row.scan)

    @property
    def first_full(self) -> int:
        """Return the number of the first row with values."""
        return max(self.first, self._emptied)

    def list_remarks(self) -> list[str]:
        """Return remarks on the rows as a whole: missing values, rows left out, progress of reading."""
        with_values = self.rows[self.first_full - self.first :][:1]
        begin = f"values from {with_values[0].number} on" if with_values else "no values kept"
        reading, left_out = f"reading … {self.share:.0%}", f"{self.left_out} left out"
        remarks = (begin, self.first_full > self.first), (left_out, self.left_out), (reading, self.share < 1)
        return [text for text, is_so in remarks if is_so]

    def make_request(self, instance: str) -> tuple[str, int]:
        """Return the request for the next rows: the instance, and the number of the first row wanted."""
        if instance != self.instance:
            self.__init__()  # type: ignore[misc]
            self.instance = instance
        return instance, self.next_number

    def accept_rows(self, news: MessagesDelta | None, until: int) -> None:
        """Add the next rows; a frozen view gets only rows up to its scan."""
        if news is None or news.instance != self.instance or news.first + len(news.rows) < self.next_number:
            return  # of another instance, or late
        self.count, self.share, self.are_typed = news.count, news.share, news.are_typed
        self.gaps, self.errors = news.gaps, news.errors
        self.is_behind = bool(news.rows) and news.first + len(news.rows) < news.count
        rows = [row for row in news.rows[max(0, self.next_number - news.first) :] if row.scan <= until]
        if news.first > self.next_number:  # the rows between came too fast
            self.left_out += (news.first - self.next_number) * bool(self.rows)
            self.first, self.rows = news.first, []
        self.rows += rows
        if until == MAX_SCAN:  # a frozen view keeps what it shows
            self._drop_values(news.oldest)

    def _drop_values(self, oldest: int) -> None:
        for at in range(max(0, self._emptied - self.first), min(oldest, self.next_number) - self.first):
            row = self.rows[at]
            self.rows[at] = row._replace(content=None) if row.size else row
        self._emptied = max(self._emptied, min(oldest, self.next_number))
        if len(self.rows) > MOST_INSTANCE_ROWS + SLACK_ROWS:
            self.first += len(self.rows) - MOST_INSTANCE_ROWS
            del self.rows[:-MOST_INSTANCE_ROWS]
