"""Where a recording is written: one file, or numbered files (split, in a ring, or one for each trigger).

Rule 1: no file name is used twice; only files of this run are removed.
Rule 2: each file begins with `RunHeader`. If scans are missing after the header, `LostEntries` is next. A
file with missing scans is replayed from its first keyframe.
Rule 3: if a replay process makes keyframes, a file that begins in the middle gets one before it ends.
Rule 4: a file of a trigger has the journal from the beginning of the run, or the newest MOST_OLD_BYTES of
the journal. A what-if begins where this journal begins. A file of a trigger also has keyframes.
Rule 5: connections keep sequence numbers and ports from file to file, even across entries that no file has.
Bound: at most MOST_WAITING entries wait for a trigger.
"""

from __future__ import annotations

import os
import re
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from trcvtui.errors import mistake
from trcvtui.files import make_folder
from trcvtui.recording.journal import (
    DO,
    ENDED_HERE,
    REST,
    STEP,
    BlockWriter,
    CallRecord,
    Entry,
    LostEntries,
    RunHeader,
    Secrets,
    WireCall,
    decode_entries,
)
from trcvtui.wording import count

if TYPE_CHECKING:
    from trcvtui.recording.journal import Keyframe
    from trcvtui.recording.run_packets import RunPackets

FILE_SUFFIX: Final = ".pcapng"
TRIGGER_WORD: Final = "trigger"  # the first word of the command that reports one
IN_MIDDLE_REASON: Final = "this file begins in the middle of its run"
MOST_WAITING: Final = 500_000
MOST_SECRETS: Final = 1000
MOST_OLD_BYTES: Final = 64 << 20  # of a journal: a night of idle scans takes half of it
MOST_KEYFRAMES: Final = 64  # keyframes of these; beyond them every second one is dropped


class EntrySink(Protocol):
    """Writes entries. If nothing more is written, `trouble` says why."""

    @property
    def trouble(self) -> str: ...

    def add_entries(self, entries: Iterable[Entry]) -> None: ...

    def close(self) -> None:
        """Write the waiting entries and end the file."""


class FileSink(EntrySink, Protocol):
    """A sink that writes a file, with keyframes."""

    first_scan: int  # scans of the run before a file that begins in the middle
    is_followed: bool  # by a run beside, which makes keyframes
    lack: str  # when it is closed: which files begin in the middle and have no keyframe, "" for none

    def add_keyframe(self, frame: Keyframe) -> None:
        """Take the state after one of the scans so far. `steps` counts the scans since the run began."""


class NumberedFile(FileSink, Protocol):
    """A sink that writes one of several files of a run; `size` is in bytes."""

    size: int

    def continue_connections(self, packets: RunPackets, old: Iterable[Entry]) -> None:
        """Take old entries, but make no packets of them; then continue connections of earlier files."""


class OldBlock(NamedTuple):
    """An encoded block of older entries, and how many entries and scans are in it."""

    entries: int
    scans: int
    block: bytes


class FileLimits(NamedTuple):
    """Limits in bytes: a file, all files (0: none). Limits in ns: before, after a trigger (-1: none)."""

    split: int
    ring: int
    before_ns: int
    after_ns: int


class NumberedFiles:
    """A sink that opens and ends files at the beginning of a scan. `new` makes the writer of a file."""

    trouble = ""  # errors are raised
    is_followed, lack = False, ""

    def __init__(
        self,
        folder: Path,
        stem: str,
        limits: FileLimits,
        new: Callable[[Path], NumberedFile],
        packets: RunPackets,
    ) -> None:
        self._packets = packets
        self._beside = 0  # bytes of the file that are not of its own scans
        self._folder, self._stem, self._limits, self._new = folder, stem, limits, new
        self._begins: RunHeader | None = None
        self._file: NumberedFile | None = None
        self._path = Path()
        self._files: list[Path] = []
        self._lacking: list[str] = []  # names of these that have no keyframe
        self._least_ring = 0  # bytes that always hold two files
        self._secrets: deque[Secrets] = deque(maxlen=MOST_SECRETS)  # each file repeats them
        self._now = self._until = 0
        self._passed = self._passed_scans = 0  # entries, scans that are in no file or an earlier one
        self.first_scan = self._file_from = 0
        self._frames: list[Keyframe] = []  # of the old blocks
        self._scans: deque[tuple[int, list[Entry]]] = deque([(0, [])])  # waiting scans: time, entries
        self._kept = 0
        self._old: deque[OldBlock] = deque()
        self._old_size = self._in_block = self._scans_in_block = self._since_frame = 0
        self._block = BlockWriter(0)
        self._is_over = self._has_begun = False  # the run is over; peers have acted in the next scan
        self._number = next_number(folder, stem)

    def add_entries(self, entries: Iterable[Entry]) -> None:
        waits = self._limits.before_ns >= 0
        for entry in entries:
            if isinstance(entry, RunHeader):
                self._begins = entry
                if not waits:
                    self._open_file()
                continue
            if isinstance(entry, Secrets):
                self._secrets.append(entry)
            if isinstance(entry, CallRecord):
                call, args = entry.call, entry.args
                at = entry.answer if call == STEP else args[0] if call == REST and args else None
                if isinstance(at, int):
                    if not self._has_begun:  # else a REST has begun this scan
                        self._begin_scan(at)
                    self._now, self._has_begun = at, call == REST
                elif waits and call == DO and str(args[0]).startswith(TRIGGER_WORD):
                    self._until = self._now + self._limits.after_ns
                    if self._file is None:
                        self._open_file()
            self._scans[-1][1].append(entry)
            self._kept += 1
        if self._file is not None:
            self._write_waiting()

    def _begin_scan(self, now: int) -> None:
        self._now = now
        if self._file is not None:
            self._write_waiting()
        if self._file is not None and not (self.is_followed and self._file.lack):  # Rule 3
            if self._limits.before_ns >= 0:
                if now > self._until:
                    self._end_file()
            elif self._limits.split and self._is_large(self._file):
                self._end_file()
                self._open_file()
        self._scans.append((now, []))
        before = self._limits.before_ns
        while len(self._scans) > 1 and (self._kept > MOST_WAITING or self._scans[0][0] < now - before):
            some = self._scans.popleft()[1]
            self._kept -= len(some)
            if some:  # no file has them: Rule 5
                self._packets.follow_entries(some)
                self._retire_entries(some)

    def _is_large(self, file: NumberedFile) -> bool:
        """Return whether a file is full; keyframes and repeated bytes alone do not fill it."""
        split = self._limits.split
        return file.size >= max(split, self._beside + split // 4)

    def _retire_entries(self, some: list[Entry]) -> None:
        scans = sum([isinstance(entry, CallRecord) and entry.call == STEP for entry in some])
        if self._limits.before_ns < 0:  # no trigger: a file has them
            self._passed += len(some)
            self._passed_scans += scans
            return
        for entry in some:
            if not isinstance(entry, WireCall):  # old entries have no packets
                self._block.add_entry(entry)
                self._in_block += 1
        self._scans_in_block += scans
        if self._block.is_full:
            self._end_block()
        while self._old_size > MOST_OLD_BYTES:
            oldest = self._old.popleft()
            self._passed += oldest.entries
            self._passed_scans += oldest.scans
            self._old_size -= len(oldest.block)

    def _end_block(self) -> None:
        made = OldBlock(self._in_block, self._scans_in_block, self._block.encode())
        self._old.append(made)
        self._old_size += len(made.block)
        self._since_frame += len(made.block)
        if self._since_frame > MOST_OLD_BYTES // 2:  # so that the old blocks always have a keyframe
            self._since_frame = 0
            self.first_scan = self._passed_scans + sum([old.scans for old in self._old])
        self._block, self._in_block, self._scans_in_block = BlockWriter(0), 0, 0

    def add_keyframe(self, frame: Keyframe) -> None:
        if self._file is not None:
            self._file.add_keyframe(frame._replace(steps=frame.steps - self._file_from))
            self._beside += len(frame.content)
        if self._limits.before_ns >= 0:
            self._frames.append(frame)
            while self._frames and self._frames[0].scan <= self._passed_scans:
                del self._frames[0]
            if len(self._frames) > MOST_KEYFRAMES:
                del self._frames[1::2]

    def _open_file(self) -> None:
        self._path = self._folder / f"{self._stem}-{self._number:04}{FILE_SUFFIX}"
        self._number += 1
        self._file = self._new(self._path)
        self._files.append(self._path)
        lost = [LostEntries(self._passed, IN_MIDDLE_REASON)] if self._passed else []  # Rule 2
        self._file.add_entries([*([self._begins] if self._begins else []), *self._secrets, *lost])
        if self._in_block:
            self._end_block()
        blocks = [decode_entries([old.block], str(self._path)) for old in self._old]
        self._file.continue_connections(self._packets, chain.from_iterable(blocks))
        self._file_from = self._passed_scans
        if self._limits.before_ns < 0:
            self.first_scan = self._file_from
        for frame in self._frames:
            if frame.scan > self._file_from:
                self._file.add_keyframe(frame._replace(steps=frame.steps - self._file_from))
        self._beside = self._file.size
        self._remove_oldest_files()

    def _write_waiting(self) -> None:
        assert self._file is not None
        for _, some in self._scans:
            self._file.add_entries(some)
            self._retire_entries(some)
        self._scans, self._kept = deque([(self._now, [])]), 0

    def _end_file(self) -> None:
        if self._file is not None:
            if not self._is_over:  # else CLOSE is the last entry
                self._file.add_entries([LostEntries(0, ENDED_HERE)])
            self._file.close()
            if self._file.lack:
                self._lacking.append(self._path.name)
            self._file = None

    def _remove_oldest_files(self) -> None:
        sizes = [path.stat().st_size if path.exists() else 0 for path in self._files]
        ring = self._limits.ring
        if not ring or len(sizes) < 2:
            return
        more = max(self._limits.split, sizes[-2] - sizes[-1])  # bytes that the new file may get
        self._least_ring = max(self._least_ring, sum(sizes[-2:]) + more)
        while len(sizes) > 1 and sum(sizes) + more > ring:  # the new file stays
            gone = self._files.pop(0)  # of this run: Rule 1
            gone.unlink(missing_ok=True)
            self._lacking = [name for name in self._lacking if name != gone.name]
            sizes.pop(0)

    def close(self) -> None:
        self._is_over = True
        self._end_file()
        if self._lacking:
            files = count(len(self._lacking), "file")
            self.lack = f"no keyframe in {files} (the first is {self._lacking[0]})"
        elif self._least_ring > self._limits.ring:
            split, least = (f"{-(-size // 1024)}KiB" for size in (self._limits.split, self._least_ring))
            found = f"{self._limits.ring} bytes, too few for two files of this run"
            raise mistake(f"--ring of {self._folder}", found, f"{least} or more with --split {split}")


@dataclass(frozen=True, slots=True)
class RecordTarget:
    """What --record asks for. If there are several runs, each has one file in the folder `target`."""

    target: Path
    overwrite: bool = False
    has_secrets: bool = True
    limits: FileLimits | None = None  # of numbered files in the folder `target`
    follow: Callable[[FileSink, str], EntrySink] | None = None  # what makes keyframes beside a writer

    def make_paths(self, paths: Iterable[Path]) -> tuple[Path, ...]:
        """Return the file of each run; raise UserError if two runs would share one."""
        given = tuple(paths)
        if len(given) == 1 and not self.target.is_dir():
            return (self.target,)
        files = tuple([self.target / (path.stem + FILE_SUFFIX) for path in given])
        for file in files:
            if files.count(file) > 1:
                raise mistake(
                    f"--record {self.target}", f"two files for {file.name}", "files with different names"
                )
        make_folder(self.target, "--record")
        return files

    def make_sink(self, file: Path) -> EntrySink:
        """Return the sink that writes in this process; raise UserError if a file is refused."""
        sink = self.make_file_sink(file)
        return sink if self.follow is None else self.follow(sink, str(file))

    def make_file_sink(self, file: Path) -> FileSink:
        """Return the sink that writes, without the replay that makes keyframes."""
        from trcvtui.recording.recording import RecordingWriter
        from trcvtui.recording.run_packets import RunPackets

        if self.limits is None:
            return RecordingWriter(file, self.overwrite)
        return NumberedFiles(self.target, file.name, self.limits, RecordingWriter, RunPackets())


def next_number(folder: Path, stem: str) -> int:
    named = re.compile(re.escape(stem) + r"-(\d{1,9})" + re.escape(FILE_SUFFIX))
    found = [int(match[1]) for name in os.listdir(folder) if (match := named.fullmatch(name))]
    return max(found, default=0) + 1


def list_newest_file(path: Path) -> list[str]:
    files = [path] if not path.is_dir() else sorted(path.glob(f"*{FILE_SUFFIX}"), key=os.path.getmtime)
    return [str(file) for file in files[-1:]]
