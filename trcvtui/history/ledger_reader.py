"""Reads the ledger once for all listeners (`index.add_listeners`), a few lines at a time between scans.

Rule: if lines are overwritten unread, all listeners get a call. No listener guesses the lost content.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Final

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.history.stream_index import StreamIndex
from trcvtui.plc.ledger import StampedEvent

READER_PART: Final = "reader", "history"
LINES_A_STEP: Final = 64  # between two looks at the clock


class LedgerReader:
    """The reader of a bench's ledger. `index` gets each line before all listeners."""

    def __init__(self, bench: Bench) -> None:
        self.index = StreamIndex()
        self.on_loss: list[Callable[[int, int, int], None]] = []  # called with seq, scan, time before a loss
        self._bench = bench
        self._has_failed = False
        self._news: list[StampedEvent] = []
        self._read = 0  # how many of the news were read
        self._seq = 0  # of the last of the news
        self._at = 0, 0  # scan and time of the last line that was read

    def catch_up(self, deadline_ns: int | None = None) -> bool:
        """Read new lines until `deadline_ns`. Return whether all lines are read."""
        try:
            return self._read_lines(deadline_ns)
        except Exception as error:
            if not self._has_failed:
                self._bench.containment.record_error(READER_PART, error)
            self._has_failed = True
            self._news, self._read, self._seq = [], 0, self._bench.runtime.ledger.last_seq
            with suppress(Exception):
                self._report_loss(self._seq)
            return True

    def _read_lines(self, deadline_ns: int | None) -> bool:
        ledger, listeners = self._bench.runtime.ledger, self.index.listeners
        while True:
            if self._read == len(self._news):
                if self._seq == ledger.last_seq:
                    return True
                self._fetch_lines()
            first, stop = self._read, len(self._news)
            if deadline_ns is not None:
                stop = min(stop, first + LINES_A_STEP)
            seq = self._seq - len(self._news) + first
            for item in self._news[first:stop]:
                seq += 1
                for listener in listeners.get(item[2].__class__, ()):
                    listener(seq, *item)
            self._read, self._at = stop, self._news[stop - 1][:2]
            if deadline_ns is not None and clock.now_ns() >= deadline_ns:
                return self._read == len(self._news) and self._seq == ledger.last_seq

    def _fetch_lines(self) -> None:
        ledger, before = self._bench.runtime.ledger, self._seq
        self._news, self._read, self._seq = ledger.events_since(before), 0, ledger.last_seq
        first = self._seq - len(self._news) + 1
        if first > before + 1:
            self._report_loss(first - 1)

    def _report_loss(self, seq: int) -> None:
        self.index.forget_streams()
        for lost in self.on_loss:
            lost(seq, *self._at)
