"""The messages of the selected instance as the screen knows them: a copy of the engine's newest rows."""

from __future__ import annotations

from bisect import bisect_right
from typing import Final

from trcvtui.history.messages import MOST_INSTANCE_ROWS, MessageRow, MessagesDelta
from trcvtui.history.records import MAX_SCAN

SLACK_ROWS: Final = 256  # rows that are forgotten at once


class KnownMessages:
    """`rows` are those from number `first` on, the oldest first; another instance begins anew.

    A row that is not here any more has no index; one without `content` has no values any more.
    """

    def __init__(self) -> None:
        self.instance = ""
        self.first = self.count = 0  # number of rows[0] among all of the instance; how many it has had
        self.rows: list[MessageRow] = []
        self.left_out = 0  # that came faster than they can cross to the screen
        self.share = 1.0  # of a recording that has been read for them
        self.are_typed = True
        self.gaps: tuple[tuple[int, int], ...] = ()  # without a connection, in ns
        self.errors: tuple[int, ...] = ()  # when one came
        self.is_behind = False  # more rows wait than came with the last picture
        self._emptied = 0  # up to this number, content was forgotten

    @property
    def stop(self) -> int:
        return self.first + len(self.rows)

    def stop_at(self, scan: int) -> int:
        """Return the number after the last row up to a scan."""
        return self.first + bisect_right(self.rows, scan, key=lambda row: row.scan)

    @property
    def oldest(self) -> int:
        """Return the number of the first row with values."""
        return max(self.first, self._emptied)

    def describe_rows(self) -> list[str]:
        """Return what is to be known of the rows as a whole."""
        with_values = self.rows[self.oldest - self.first :][:1]
        begin = f"values from {with_values[0].number} on" if with_values else "all values gone"
        reading, left_out = f"reading … {self.share:.0%}", f"{self.left_out} left out"
        said = (begin, self.oldest > self.first), (left_out, self.left_out), (reading, self.share < 1)
        return [text for text, is_so in said if is_so]

    def make_request(self, instance: str) -> tuple[str, int]:
        """Return what to ask the engine for: the rows of an instance after those that are known."""
        if instance != self.instance:
            self.__init__()  # type: ignore[misc]
            self.instance = instance
        return instance, self.stop

    def accept_rows(self, news: MessagesDelta | None, until: int) -> None:
        """Take the next rows, of a frozen view those up to its scan."""
        if news is None or news.instance != self.instance or news.first + len(news.rows) < self.stop:
            return
        self.count, self.share, self.are_typed = news.count, news.share, news.are_typed
        self.gaps, self.errors = news.gaps, news.errors
        self.is_behind = bool(news.rows) and news.first + len(news.rows) < news.count
        rows = [row for row in news.rows[max(0, self.stop - news.first) :] if row.scan <= until]
        if news.first > self.stop:
            self.left_out += (news.first - self.stop) * bool(self.rows)
            self.first, self.rows = news.first, []
        self.rows += rows
        if until == MAX_SCAN:  # a frozen view keeps what it shows
            self._forget(news.oldest)

    def _forget(self, oldest: int) -> None:
        for at in range(max(0, self._emptied - self.first), min(oldest, self.stop) - self.first):
            row = self.rows[at]
            self.rows[at] = row._replace(content=None) if row.size else row
        self._emptied = max(self._emptied, min(oldest, self.stop))
        if len(self.rows) > MOST_INSTANCE_ROWS + SLACK_ROWS:
            self.first += len(self.rows) - MOST_INSTANCE_ROWS
            del self.rows[:-MOST_INSTANCE_ROWS]
