"""What a recording is written to: one file, or numbered ones: a ring, or one for what surrounds a trigger.

Rule 1: a name is never used again; only files of this run are removed.
Rule 2: each file begins with the beginning of the run. Where scans lie between, `EntriesLost` says so: such
a file opens in Wireshark, and a replay of it alone says what it lacks.
Rule 3: a file of a trigger has the run from its beginning, as far as MOST_OLD_BYTES of its journal go: it
runs again.
Bound: MOST_KEPT entries wait for a trigger.
"""

from __future__ import annotations

import os
import re
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, Protocol

from trcvtui.capture.journal import (
    DO,
    ENDED_HERE,
    STEP,
    Answered,
    BlockWriter,
    EntriesLost,
    Entry,
    RunBegins,
    Secrets,
    WireCall,
    entries_of,
)
from trcvtui.capture.wire import WITH_BYTES
from trcvtui.errors import mistake
from trcvtui.records import NamedTuple, dataclass

SUFFIX: Final = ".pcapng"
TRIGGER: Final = "trigger"  # the first word of the line that tells of one
ELSEWHERE: Final = "this file begins in the middle of its run"
MOST_KEPT: Final = 500_000
MOST_SECRETS: Final = 1000
MOST_OLD_BYTES: Final = 64 << 20  # of a journal: a night of scans in which nothing happens takes half of it


class Sink(Protocol):
    """Who writes entries; `trouble`: why nothing more is written, or ""."""

    @property
    def trouble(self) -> str:
        """Return it."""
        ...

    def take(self, entries: Iterable[Entry]) -> None:
        """Take entries in their order."""
        ...

    def close(self) -> None:
        """Write what is left, and end the file."""
        ...


class FileLimits(NamedTuple):
    """Bytes of a file and of all of them, 0: no limit; ns before and after a trigger, -1: all is kept."""

    split: int
    ring: int
    before_ns: int
    after_ns: int


class NumberedFiles:
    """A sink that opens and ends files at the beginning of a scan; `new` makes the writer of one."""

    trouble = ""  # what goes wrong is raised

    def __init__(self, folder: Path, stem: str, limits: FileLimits, new: Callable[[Path], Sink]) -> None:
        self._folder, self._stem, self._limits, self._new = folder, stem, limits, new
        self._begins: RunBegins | None = None
        self._file: Sink | None = None
        self._path = Path()
        self._files: list[Path] = []
        self._secrets: deque[Secrets] = deque(maxlen=MOST_SECRETS)  # each file repeats them
        self._now = self._until = 0
        self._passed = 0  # entries that stand in no file, or in one before this
        self._scans: deque[tuple[int, list[Entry]]] = deque([(0, [])])  # that wait, by their time
        self._kept = 0
        self._old: deque[tuple[int, bytes]] = deque()  # entries of a block, its bytes: before those that wait
        self._old_size = self._in_block = 0
        self._block = BlockWriter(0)
        self._is_over = False
        self._number = next_number(folder, stem)

    def take(self, entries: Iterable[Entry]) -> None:
        """Take entries in their order."""
        waits = self._limits.before_ns >= 0
        for entry in entries:
            if isinstance(entry, RunBegins):
                self._begins = entry
                if not waits:
                    self._open()
                continue
            if isinstance(entry, Secrets):
                self._secrets.append(entry)
            if isinstance(entry, Answered):
                if entry.call == STEP and isinstance(entry.answer, int):
                    self._begin_scan(entry.answer)
                elif waits and entry.call == DO and str(entry.args[0]).startswith(TRIGGER):
                    self._until = self._now + self._limits.after_ns
                    if self._file is None:
                        self._open()
            self._scans[-1][1].append(entry)
            self._kept += 1
        if self._file is not None:
            self._write()

    def _begin_scan(self, now: int) -> None:
        self._now = now
        if self._file is not None:
            self._write()
            if self._limits.before_ns >= 0:
                if now > self._until:
                    self._end()
            elif self._limits.split and os.stat(self._path).st_size >= self._limits.split:
                self._end()
                self._open()
        self._scans.append((now, []))
        before = self._limits.before_ns
        while len(self._scans) > 1 and (self._kept > MOST_KEPT or self._scans[0][0] < now - before):
            some = self._scans.popleft()[1]
            self._kept -= len(some)
            self._remember(some)

    def _remember(self, some: list[Entry]) -> None:
        """Keep what stands before those that wait; what is too old is counted alone."""
        if self._limits.before_ns < 0:
            self._passed += len(some)
            return
        for entry in some:
            if not (isinstance(entry, WireCall) and entry.call in WITH_BYTES):  # no packets of so long ago
                self._block.take(entry)
                self._in_block += 1
        if self._block.is_full:
            self._end_block()
        while self._old_size > MOST_OLD_BYTES:
            count, block = self._old.popleft()
            self._passed += count
            self._old_size -= len(block)

    def _end_block(self) -> None:
        block = self._block.block()
        self._old.append((self._in_block, block))
        self._old_size += len(block)
        self._block, self._in_block = BlockWriter(0), 0

    def _open(self) -> None:
        self._path = self._folder / f"{self._stem}-{self._number:04}{SUFFIX}"
        self._number += 1
        self._file = self._new(self._path)
        self._files.append(self._path)
        lost = [EntriesLost(self._passed, ELSEWHERE)] if self._passed else []
        self._file.take([*([self._begins] if self._begins else []), *self._secrets, *lost])
        if self._in_block:
            self._end_block()
        for _, block in self._old:
            self._file.take(entries_of([block], str(self._path)))
        self._remove_the_oldest()

    def _write(self) -> None:
        """Hand over what waits; it is then in this file."""
        assert self._file is not None
        for _, some in self._scans:
            self._file.take(some)
            self._remember(some)
        self._scans, self._kept = deque([(self._now, [])]), 0

    def _end(self) -> None:
        if self._file is not None:
            if not self._is_over:
                self._file.take([EntriesLost(0, ENDED_HERE)])
            self._file.close()
            self._file = None

    def _remove_the_oldest(self) -> None:
        sizes = [path.stat().st_size if path.exists() else 0 for path in self._files]
        room = self._limits.ring - self._limits.split
        while self._limits.ring and len(self._files) > 1 and sum(sizes) > room:
            self._files.pop(0).unlink(missing_ok=True)
            sizes.pop(0)

    def close(self) -> None:
        """End the file that is written: the run is over."""
        self._is_over = True
        self._end()


@dataclass(frozen=True, slots=True)
class RecordTo:
    """What is asked for; of several runs each has a file of its own in the folder `target`."""

    target: Path
    overwrite: bool = False
    has_secrets: bool = True
    limits: FileLimits | None = None  # of numbered files in the folder `target`

    def files(self, paths: Iterable[Path]) -> tuple[Path, ...]:
        """Return the file of each run; raise UserError where two would be one."""
        given = tuple(paths)
        if len(given) == 1 and not self.target.is_dir():
            return (self.target,)
        files = tuple([self.target / (path.stem + SUFFIX) for path in given])
        for file in files:
            if files.count(file) > 1:
                raise mistake(
                    f"--record {self.target}", f"two files for {file.name}", "files of unlike names"
                )
        self.target.mkdir(exist_ok=True)
        return files

    def sink(self, file: Path) -> Sink:
        """Return what writes in this process; raise UserError where a file is refused."""
        from trcvtui.capture.recording import RecordingWriter

        if self.limits is None:
            return RecordingWriter(file, self.overwrite)
        return NumberedFiles(self.target, file.name, self.limits, RecordingWriter)


def next_number(folder: Path, stem: str) -> int:
    """Return the number after those of all files there."""
    named = re.compile(re.escape(stem) + r"-(\d{1,9})" + re.escape(SUFFIX))
    found = [int(match[1]) for name in os.listdir(folder) if (match := named.fullmatch(name))]
    return max(found, default=0) + 1
