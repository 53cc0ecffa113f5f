"""A run beside a writer replays the entries as they come. The states of this run are the keyframes.

Rule 1: entries are written first. A run that cannot follow is ended, and then only keyframes are missing.
Rule 2: a keyframe is due every SPACING_NS of the run, and at the start of a file that begins in the middle.
Bound: at most MOST_WAITING_BYTES of blocks wait for the run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from trcvtui import clock
from trcvtui.errors import UserError, mistake
from trcvtui.recording.files import FileSink
from trcvtui.recording.journal import (
    STEP,
    CallRecord,
    Entry,
    Keyframe,
    NonJournalEntry,
    RunHeader,
    decode_entries,
    encode_value,
)
from trcvtui.recording.state import SharedObjects, encode_state
from trcvtui.recording.writer import describe_program_error, run_writer
from trcvtui.replay.keyframes import JournalPosition, restore_run
from trcvtui.replay.run_again import ReplayRun

SPACING_NS: Final = 30_000_000_000
MOST_WAITING_BYTES: Final = 64 << 20
MOST_LAZY: Final = 100_000  # entries that wait before a short run is followed
NO_DEADLINE: Final = 1 << 62
PATIENCE_NS: Final = 10_000_000_000  # for the first keyframe of a file that is to be closed


class _IncomingEntries(JournalPosition):
    def __init__(self) -> None:
        super().__init__()
        self._waiting: deque[Entry] = deque()
        self.steps_ahead = self.now = 0
        self.begins: RunHeader | None = None
        self._has_begun = False
        self.frame: Keyframe | None = None  # the start of a journal that begins in the middle

    def add_entries(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if isinstance(entry, Keyframe) and self.begins is not None and not self.steps_ahead:
                self.frame = entry
                self._waiting.clear()
                self.beyond = 0
            elif isinstance(entry, NonJournalEntry) or self._pass_before_frame(entry):
                continue
            else:
                if isinstance(entry, RunHeader):
                    self.begins = entry
                self._waiting.append(entry)
                if type(entry) is CallRecord and entry.call == STEP and isinstance(entry.answer, int):
                    self.steps_ahead += 1
                    self.now = entry.answer

    def _pass_before_frame(self, entry: Entry) -> bool:
        if self.frame is None or self._has_begun:  # the run needs all entries
            return False
        if (self.steps, self.beyond) == (self.frame.steps, self.frame.beyond):
            self._has_begun = True
            return False
        self.pass_entry(entry)
        return True

    def __len__(self) -> int:
        return len(self._waiting)

    def __iter__(self) -> Iterator[Entry]:
        return self

    def __next__(self) -> Entry:
        if not self._waiting:
            raise StopIteration
        entry = self._waiting.popleft()
        self.steps_ahead -= self.pass_entry(entry)
        return entry


class KeyframingSink:
    """A sink that also replays its entries. `advance` continues the replay while entries and time allow."""

    def __init__(self, sink: FileSink, where: str) -> None:
        self._sink, self._where = sink, where
        sink.is_followed = True
        self._off_reason = self._fault = ""  # the second: an error of the program
        self._coming = _IncomingEntries()
        self._blocks: deque[bytes] = deque()  # not decoded yet
        self._waiting = 0
        self._run: ReplayRun | None = None
        self._shared: SharedObjects | None = None
        self._is_off = self._has_all = self._no_secrets = False  # the last: only to be looked at
        self._kept_at = self._file = 0  # time of the newest keyframe; the first scan of its file

    @property
    def trouble(self) -> str:
        """Return why nothing more is written, or ""."""
        return self._sink.trouble

    def add_block(self, block: bytes) -> None:
        """Write the entries of a block at once; the run replays them later."""
        self._sink.add_entries(decode_entries([block], self._where))  # Rule 1
        if not self._is_off:
            self._blocks.append(block)
            self._waiting += len(block)
            if self._waiting > MOST_WAITING_BYTES:
                self._give_up("the run that makes keyframes was more than 64 MiB late")

    def add_entries(self, entries: Iterable[Entry]) -> None:
        """Write entries; let the run follow only when a keyframe may be due: a short run needs none."""
        some = [*entries]
        steps = [at for at, one in enumerate(some) if type(one) is CallRecord and one.call == STEP]
        for begin, end in pairwise([0, *steps, len(some)]):  # a file that ends among them has its keyframe
            self._sink.add_entries(some[begin:end])
            if not self._is_off:
                self._coming.add_entries(some[begin:end])
                if self._coming.now >= SPACING_NS or self._sink.first_scan or len(self._coming) > MOST_LAZY:
                    self.advance(NO_DEADLINE)

    def close(self) -> None:
        """End the file after any due keyframe. Raise UserError if a file lacks its first keyframe."""
        self._has_all, until = True, clock.now_ns() + PATIENCE_NS
        while self._sink.first_scan != self._file and clock.now_ns() < until and self.advance(0):
            pass
        self._give_up("the run that makes keyframes was too late")
        self._sink.close()
        lack = self._fault or (self._sink.lack and f"{self._sink.lack}: {self._off_reason}")
        if lack and not self._no_secrets:
            raise mistake(self._where, lack, "a keyframe in each file: a file without one cannot be replayed")

    def _give_up(self, why: str) -> None:
        self._off_reason = self._off_reason or why
        self._is_off, self._sink.is_followed = True, False
        self._blocks.clear()
        self._run, self._coming = None, _IncomingEntries()

    def advance(self, deadline_ns: int) -> bool:
        """Let the run replay entries until this moment of the clock; return whether there is more to do."""
        while not self._is_off:
            if self._coming.steps_ahead < 2 and (self._blocks or not self._has_all):  # a scan needs the next
                if not self._blocks:
                    return False
                block = self._blocks.popleft()
                self._waiting -= len(block)
                self._coming.add_entries(decode_entries([block], self._where))
                continue
            self._run_next_scan()
            if deadline_ns < NO_DEADLINE and clock.now_ns() >= deadline_ns:
                return True
        return False

    def _run_next_scan(self) -> None:
        try:
            run = self._run or self._start_run()
            if not run.scan():
                self._no_secrets = bool(run.replay.gap_text) and not run.replay.has_lost_entries
                self._give_up(run.replay.gap_text or "the run that makes keyframes has ended")
                return
            self._write_due_keyframe(run)
        except UserError as wrong:  # a replay of the file will show it
            self._give_up(str(wrong))
        except Exception as wrong:
            self._fault = describe_program_error(wrong)
            self._give_up(self._fault)

    def _start_run(self) -> ReplayRun:
        frame, begins = self._coming.frame, self._coming.begins
        if frame is None or begins is None:
            self._run = ReplayRun(self._coming, self._where)
            self._shared = SharedObjects(self._run.roots)
        else:
            self._run, self._shared = restore_run(frame, begins, self._where)
            self._run.replay.entries = self._coming
        return self._run

    def _write_due_keyframe(self, run: ReplayRun) -> None:
        scan, ns, first = run.bench.runtime.scans, run.bench.now, self._sink.first_scan
        is_new = first != self._file
        if scan < first or not (is_new or ns >= self._kept_at + SPACING_NS):
            return
        run.replay.peek_call()
        if scan == first and self._coming.beyond:  # the next entry is in the file before
            return
        self._kept_at, self._file = ns, first
        self._write_keyframe(run)

    def _write_keyframe(self, run: ReplayRun) -> None:
        assert self._shared is not None
        place = self._coming.steps, self._coming.beyond
        state = encode_state(run, self._shared)
        self._sink.add_keyframe(Keyframe.make(run.bench.runtime.scans, run.bench.now, *place, state))


class LastKeyframeSink:
    """A sink that writes only the last keyframe that it gets into its file."""

    trouble = lack = ""
    first_scan, is_followed = 0, False

    def __init__(self, path: str) -> None:
        self._path = path
        self._frame: Keyframe | None = None

    def add_entries(self, entries: Iterable[Entry]) -> None:
        """Do nothing: the run beside the sink takes the entries."""

    def add_keyframe(self, frame: Keyframe) -> None:
        self._frame = frame

    def close(self) -> None:
        if self._frame is not None:
            with open(self._path, "wb") as file:
                file.write(encode_value(self._frame))


class _LastStateSink(KeyframingSink):
    """A run that follows the entries to the end, and then writes its last state."""

    def close(self) -> None:
        self.advance(NO_DEADLINE)
        if self._run is not None:
            self._write_keyframe(self._run)
        super().close()


def writer_main(path: str, asked: str) -> None:
    """Run as the process that writes a recording (recording/writer.py)."""
    run_writer(asked, lambda record: KeyframingSink(record.make_file_sink(Path(path)), path), path)


def state_main(path: str, asked: str) -> None:
    run_writer(asked, lambda _: _LastStateSink(LastKeyframeSink(path), path), path)
