"""An index of a recording: the time of each scan, edges and ERRORs, from one reading of the journal."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final, cast

from trcvtui import clock
from trcvtui.errors import mistake
from trcvtui.project.tables import quote
from trcvtui.recording.journal import CLOSE, DO, ENDED_HERE, SHOWS, SKIP, STEP, CallRecord, Entry, LostEntries
from trcvtui.recording.replay import make_early_end_error
from trcvtui.udt.literals import parse_time

END: Final = 1 << 62  # a scan that no recording has
MARK_PIECES: Final = 1000  # of the run; each has a mark if an ERROR comes in it
ENTRIES_PER_READ: Final = 256
NOTE_PREFIX: Final = "note "  # of a line with a remark on a capture
NOTES_SHOWN: Final = 2
DONE_AT, ERROR_AT = 3, 4  # among the arguments of SHOWS
PLACE_SYNTAX: Final = "a scan, T#.., end, edge +1 INSTANCE or error +1"

Search = tuple[str, int, str]  # `time`, ns; `edge` or `error`, +1 or -1, instance; FIRST_EVENT
FIRST_EVENT: Final = "first", 1, ""  # the first ERROR; without one, the first finding; else DONE


def parse_place(text: str, where: str) -> int | Search:
    """Return the scan that a text names, or the search that it asks for; raise UserError."""
    words = text.split()
    words = words[1:] if words[:1] == ["scan"] else words
    match words:
        case ["end"]:
            return END
        case [number] if number.isascii() and number.isdigit() and len(number) < len(str(END)):
            return int(number)
        case [time] if "#" in time:
            return "time", parse_time(time, where), ""
        case ["error", "+1" | "-1" as step]:
            return "error", int(step), ""
        case ["edge", "+1" | "-1" as step, name]:
            return "edge", int(step), name
    expected = f"+1, -1, {PLACE_SYNTAX}" if where == "prompt" else PLACE_SYNTAX
    raise mistake(where, quote(text) if text else "no further word", expected)


class Survey:
    """Reads the journal once, in slices: the time of each scan, where STATUS changes, where ERRORs come.

    `first` is the last scan that cannot run again, or 0; `offset` the last scan before the journal, or 0.
    """

    def __init__(self, entries: Iterator[Entry], where: str, first: int = 0, offset: int = 0) -> None:
        self.first, self.last_read_scan = first, offset  # `passed`: the last scan that was read
        self.times = array("q")  # ns, of each scan that was run
        self._scans = array("q")  # the number of each
        self.errors = array("q")  # scans in which an ERROR comes
        self.findings: dict[int, str] = {}  # of the doctor, by scan
        self.is_judged = False  # the findings are known
        self.first_done = 0  # the scan of the first DONE
        self.edges: dict[str, array[int]] = {}  # scans in which the outputs change, by instance
        self.trouble = ""  # why the recording ends before the run
        self.is_over = False
        self._entries, self._where = entries, where
        self._is_whole = False  # the run ended, or the recording was ended
        self._lost, self._left = "", 0  # which entries a gap lacks, how many scans follow it
        self._skipped = 0
        self._notes: list[tuple[int, str]] = []  # after which scan, text
        self._marks = (0, 0), b""

    @property
    def last_scan(self) -> int:
        return self._scans[-1] if self._scans else self.first

    def time_of(self, scan: int) -> int:
        """Return the time in ns of a scan, or of the nearest scan that was read."""
        if not self.times or scan <= 0:
            return 0
        scan = max(self.first + 1, min(scan, self.last_scan))
        before, ns, scans, took = self._get_stretch(bisect_left(self._scans, scan))
        return ns + (scan - before) * took // scans

    def scan_at(self, ns: int) -> int:
        """Return the first scan at this time or later, or else the number after the last scan."""
        at = bisect_left(self.times, ns)
        if at == len(self.times):
            return self.last_scan + 1
        before, began, scans, took = self._get_stretch(at)
        return before + scans if scans == 1 or not took else before - (began - ns) * scans // took

    def _get_stretch(self, at: int) -> tuple[int, int, int, int]:
        """Return scan and time at index `at` - 1, and how many scans and ns follow up to index `at`."""
        scan, ns = (self._scans[at - 1], self.times[at - 1]) if at else (self.first, 0)
        return scan, ns, self._scans[at] - scan, self.times[at] - ns

    def notes_before(self, scan: int) -> list[str]:
        before = bisect_right(self._notes, scan, key=lambda note: note[0])
        return ["scan {}: {}".format(*note) for note in self._notes[max(0, before - NOTES_SHOWN) : before]]

    def advance(self, deadline_ns: int) -> None:
        while not self.is_over and clock.now_ns() < deadline_ns:
            some = [*islice(self._entries, ENTRIES_PER_READ)]
            for entry in some:
                if self._add_entry(entry):
                    return
            if len(some) < ENTRIES_PER_READ:
                self._finish()

    def _add_entry(self, entry: Entry) -> bool:
        if self._lost:
            self._left += isinstance(entry, CallRecord) and entry.call == STEP
            return False
        if isinstance(entry, LostEntries) and (self.times or not self.first):
            self._is_whole = entry.why == ENDED_HERE
            if not self._is_whole:
                self._lost = str(entry)
                return False
            self._finish()
            return True
        if not isinstance(entry, CallRecord):
            return False
        if entry.call == STEP and isinstance(entry.answer, int):
            self._add_scan(entry.answer)
        elif entry.call == SKIP:
            self._skipped += cast(int, entry.args[0])
        elif entry.call == SHOWS and self.times:
            self.edges.setdefault(entry.owner, array("q")).append(self.last_scan)
            if entry.args[DONE_AT : DONE_AT + 1] == (True,):
                self.first_done = self.first_done or self.last_scan
            if entry.args[ERROR_AT : ERROR_AT + 1] == (True,) and self.last_scan not in self.errors[-1:]:
                self.errors.append(self.last_scan)
        elif entry.call == DO and str(entry.args[0]).startswith(NOTE_PREFIX):
            self._notes.append((self.last_scan + self._skipped, str(entry.args[0]).removeprefix(NOTE_PREFIX)))
        elif entry.call == CLOSE:
            self._is_whole = True
        return False

    def _add_scan(self, ns: int) -> None:
        self.last_read_scan += self._skipped + 1  # skipped scans have no time
        self._skipped = 0
        if self.last_read_scan > self.first:
            self.times.append(ns)
            self._scans.append(self.last_read_scan)

    def _finish(self) -> None:
        self.is_over = True
        if not self._is_whole:
            self.trouble = str(make_early_end_error(self._where, self._lost, self.last_scan, self._left))

    def end_after(self, scan: int, why: str) -> None:
        """End the run after this scan, because it cannot continue; forget the later scans."""
        known = bisect_right(self._scans, scan)
        del self.times[known:], self._scans[known:]
        for scans in (self.errors, *self.edges.values()):
            del scans[bisect_right(scans, scan) :]
        self.trouble, self.is_over = why, True

    def find_scan(self, search: Search, start: int) -> int | None:
        """Return the scan that a search from `start` finds, END for no scan, or None if not known yet."""
        kind, step, name = search
        if kind == "time":
            scan = self.scan_at(step)
            return scan if scan <= self.last_scan else self.last_scan if self.is_over else None
        is_read = self.is_over and (self.is_judged or kind == "edge")
        if search == FIRST_EVENT:
            seen = self.errors or self.findings or (self.first_done or self.first + 1,)
            return min(seen) if self.errors or is_read else None
        scans: Sequence[int] = (
            self.edges.get(name, ()) if kind == "edge" else sorted({*self.errors, *self.findings})
        )
        if step < 0 and (start <= self.last_scan or self.is_over):
            before = bisect_left(scans, start)
            return scans[before - 1] if before else END if is_read else None
        after = bisect_right(scans, start)
        if step > 0 and after < len(scans):
            return scans[after]
        return END if is_read else None

    def make_error_marks(self) -> bytes:
        """Return a byte for each piece of the run: 1 if an ERROR comes in this piece, else 0."""
        known = self.last_scan, len(self.errors)
        if known != self._marks[0]:
            marks = bytearray(MARK_PIECES)
            for scan in self.errors:
                marks[(scan - self.first - 1) * MARK_PIECES // (self.last_scan - self.first)] = 1
            self._marks = known, bytes(marks)
        return self._marks[1]
