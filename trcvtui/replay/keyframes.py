"""Keyframes of a run: the run's whole state at some scans, from which the run can continue.

Rule: an object of the program or the project is the same object in a restored run (SharedObjects).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Final, Protocol, TypeVar, cast

from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead
from trcvtui.project.project import Project
from trcvtui.recording.journal import STEP, CallRecord, Entry, Keyframe, RunHeader
from trcvtui.recording.recording import BlockPlace
from trcvtui.recording.replay import ReplaySeam
from trcvtui.recording.state import NO_STAND_INS, SharedObjects, StandIns, decode_state, encode_state
from trcvtui.replay.run_again import ReplayRun, roots_of

OtherRun = TypeVar("OtherRun", bound=ReplayRun)
KEYFRAME_SPACING: Final = 2_000  # scans from one to the next, at first
MOST_KEYFRAME_BYTES: Final = 96 << 20  # of all keyframes; beyond that every second one is dropped


class Journal(Protocol):
    """The source of a run: the entries from a block on, the places of the blocks, and keyframes."""

    def read_entries(self, first: int = 0) -> Iterator[Entry]: ...

    def read_index(self) -> Sequence[BlockPlace]: ...

    def list_keyframes(self) -> Sequence[BlockPlace]: ...

    def read_keyframe(self, place: BlockPlace) -> Keyframe: ...


class JournalPosition:
    """A position in a journal, as in a keyframe: the scans begun, and the entries since the last scan."""

    def __init__(self) -> None:
        self.steps = self.beyond = 0

    def pass_entry(self, entry: Entry) -> bool:
        """Move past an entry; return whether the entry begins a scan."""
        if type(entry) is CallRecord and entry.call == STEP:
            self.steps, self.beyond = self.steps + 1, 0
            return True
        self.beyond += 1
        return False


class PositionedEntries(JournalPosition):
    """The entries of a journal from a position on. Raises StopIteration if there is no such position."""

    def __init__(self, journal: Journal, steps: int = 0, beyond: int = 0) -> None:
        super().__init__()
        first = 0
        if steps:  # the last block before that scan begins
            before = bisect_right(journal.read_index(), steps - 1, key=lambda row: row.scans)
            first = max(0, before - 1)
            self.steps = journal.read_index()[first].scans if first else 0
        self._entries = journal.read_entries(first)
        while self.steps < steps or self.beyond < beyond:
            next(self)

    def __iter__(self) -> PositionedEntries:
        return self

    def __next__(self) -> Entry:
        entry = next(self._entries)
        self.pass_entry(entry)
        return entry


class Keyframes:
    """The keyframes, in the journal and in memory, from which a run can continue."""

    def __init__(self, journal: Journal, where: str, project: Project | None = None) -> None:
        self._journal, self._where = journal, where
        first = ReplaySeam(journal.read_entries(), where)
        if first.begins is None:
            raise mistake(where, "a journal without its beginning", "one that begins with a run")
        self.roots = roots_of(first.begins, first.files) if project is None else (first.begins, None, project)
        self._shared = SharedObjects(self.roots)
        self._scans: list[int] = []
        self._kept: list[Keyframe] = []
        self._size = 0
        self._spacing = KEYFRAME_SPACING
        self._places = [*journal.list_keyframes()]
        self.first = 0  # the last scan that cannot run: no keyframe is before it
        self.offset = 0  # the last scan of the run before the journal begins
        if first.has_lost_entries and self._places:
            frame = journal.read_keyframe(self._places[0])
            self.first = frame.scan
            self.offset = frame.scan - (frame.steps if frame.beyond else frame.steps - 1)

    def start_run(self) -> ReplayRun:
        """Return the run before its first scan, or at the first keyframe if the file begins in the middle."""
        return self.restore_at(self.first)

    def start_other_run(self, kind: type[OtherRun], seam: ReplaySeam) -> OtherRun:
        """Return the run at the first keyframe, as an object of `kind` with this seam; raise UserError."""
        frame = self._journal.read_keyframe(self._places[0])
        instead: StandIns = {ReplayRun: lambda: kind.__new__(kind), ReplaySeam: lambda: seam}
        return cast(OtherRun, _decode_run(frame, self._shared, self._where, instead))

    def read_entries(self) -> Iterator[Entry]:
        if not self.first:
            return self._journal.read_entries()
        replay = self.start_run().replay
        return chain(() if replay.front is None else (replay.front,), replay.entries)

    def keep_if_due(self, run: ReplayRun) -> None:
        """Keep the state of a run after a scan, if a keyframe is due."""
        scan = run.bench.runtime.scans
        if scan % self._spacing == 0 and self.find_keyframe_scan(scan) + self._spacing <= scan:
            self._add_keyframe(scan, run)

    def _add_keyframe(self, scan: int, run: ReplayRun) -> None:
        entries = run.replay.entries
        assert isinstance(entries, PositionedEntries)
        state = encode_state(run, self._shared)
        frame = Keyframe.make(scan, run.bench.now, entries.steps, entries.beyond, state)
        at = bisect_right(self._scans, scan)
        self._scans.insert(at, scan)
        self._kept.insert(at, frame)
        self._size += len(frame.content)
        while self._size > MOST_KEYFRAME_BYTES and len(self._kept) > 1:
            self._spacing *= 2
            del self._scans[::2], self._kept[::2]
            self._size = sum([len(frame.content) for frame in self._kept])

    def find_keyframe_scan(self, scan: int) -> int:
        """Return the last scan up to `scan` that has a keyframe, or `first` if there is none."""
        kept = bisect_right(self._scans, scan)
        written = bisect_right(self._places, scan, key=lambda place: place.scans)
        near = self._scans[kept - 1] if kept else 0, self._places[written - 1].scans if written else 0
        return max(self.first, *near)

    def restore_at(self, scan: int) -> ReplayRun:
        """Return the run at a scan with a keyframe, or at an earlier scan if that keyframe does not fit.

        Raise UserError if no keyframe fits.
        """
        if not scan:
            return ReplayRun(PositionedEntries(self._journal), self._where, roots=self.roots)
        if scan in self._scans:
            return self._restore_run(self._kept[self._scans.index(scan)])
        at = [place.scans for place in self._places].index(scan)
        try:
            return self._restore_run(self._journal.read_keyframe(self._places[at]))
        except UserError:
            if scan <= self.first:
                raise
        del self._places[at]  # of another version, or damaged
        return self.restore_at(self.find_keyframe_scan(scan))

    def _restore_run(self, frame: Keyframe) -> ReplayRun:
        run = _decode_run(frame, self._shared, self._where)
        try:
            run.replay.entries = PositionedEntries(self._journal, frame.steps, frame.beyond)
        except StopIteration:
            where, found = f"{self._where}: keyframe of scan {frame.scan}", f"{frame.steps} scans before it"
            raise mistake(where, found, "no more than the journal has") from None
        return run


def _decode_run(
    frame: Keyframe, shared: SharedObjects, where: str, instead: StandIns = NO_STAND_INS
) -> ReplayRun:
    run = decode_state(frame.decompress_state(where), shared, where, instead)
    if not isinstance(run, ReplayRun) or run.bench.runtime.scans != frame.scan:
        raise mistake(f"{where}: keyframe of scan {frame.scan}", "another state", "that of the run")
    run.is_restored, run.where, run.replay.where = True, where, where
    return run


def restore_run(frame: Keyframe, begins: RunHeader, where: str) -> tuple[ReplayRun, SharedObjects]:
    """Return the run of a keyframe, still without entries, and its shared objects; raise UserError."""
    files = FilesRead(begins.folder, begins.files, begins.digests)
    shared = SharedObjects(roots_of(begins, files))
    return _decode_run(frame, shared, where), shared
