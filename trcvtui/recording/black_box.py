"""The newest of a run, always kept in memory: a file gets it, and what follows, when it is asked for.

Rule 1: at most MOST_BYTES are kept; what goes is counted. Each time half as much has come, a process runs
again what is kept and gives the last state: a file that begins in the middle has it as its keyframe.
Rule 2: a process writes the files; until the run is over nothing waits for it.
Rule 3: a box that takes too much of the time gives up (recorder.py), unless a file gets what follows.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from trcvtui import clock
from trcvtui.errors import UserError, mistake
from trcvtui.recording.files import SUFFIX, OldBlock, RecordTo
from trcvtui.recording.journal import (
    ENDED_HERE,
    STEP,
    Answered,
    BlockWriter,
    EntriesLost,
    Entry,
    Keyframe,
    RunBegins,
    value_of,
)
from trcvtui.recording.worker_process import AnswerOnItsWay
from trcvtui.recording.writer import POST_NS, STATE, WriterProcess
from trcvtui.wording import size_text

MOST_BYTES: Final = 64 << 20
TOLD_NS: Final = 10_000_000_000
GAVE_UP: Final = "no black box: it would have taken more than 2 % of the time"
BEGINS_LATER: Final = "the black box keeps the newest 64 MiB"


class BlackBox:
    """A sink that keeps the newest blocks of a run."""

    trouble = ""  # of a run; a file that cannot be written leaves the run alone

    def __init__(self) -> None:
        import subprocess  # noqa: F401 - here, where no scan waits: 10 ms, which the first process would take

        self._told, self._told_at = "", 0  # how the last file has ended
        self.file_trouble = ""  # why the last file that went wrong did
        self._most = MOST_BYTES
        self._begins: RunBegins | None = None
        self._block = BlockWriter(0)
        self._entries = self._scans = 0  # of it
        self._kept: deque[OldBlock] = deque()
        self._size = self._passed = self._passed_scans = 0
        self._since = 0  # bytes that have come since the last state was asked for
        self._state: AnswerOnItsWay | None = None
        self._state_from = 0  # scans before those of which it is
        self.close_judge: Callable[[], object] = lambda: None
        self._frames: list[Keyframe] = []  # `steps` from the beginning of the run
        self._posted_at = 0
        self._why_off = ""
        self._recording: WriterProcess | None = None  # gets what follows, too
        self._ending: list[WriterProcess] = []

    def give_up(self) -> None:
        """Keep nothing any more: it would cost the scans too much."""
        self._why_off = GAVE_UP
        self._kept.clear()
        self._frames.clear()
        self._size = self._since = self._scans = 0
        self._block, self._entries = BlockWriter(0), 0

    @property
    def is_recording(self) -> bool:
        return self._recording is not None

    def take(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if isinstance(entry, RunBegins):
                self._begins = entry
            else:
                self._block.take(entry)
                self._entries += 1
                self._scans += type(entry) is Answered and entry.call == STEP
        now = clock.now_ns()
        if self._block.is_full or now > self._posted_at + POST_NS:
            self._posted_at = now
            self._post()
        self.go_on()

    def _post(self) -> None:
        if not self._entries:
            return
        block = self._block.block()
        if self._recording is not None:
            self._recording.put(block, self._entries)
        self._kept.append(OldBlock(self._entries, self._scans, block))
        self._size += len(block)
        self._since += len(block)
        self._block, self._entries, self._scans = BlockWriter(0), 0, 0
        if self._since > self._most // 2 and self._state is None:
            self._since = 0
            self._state, self._state_from = AnswerOnItsWay(STATE), self._passed_scans
            self._put_all(self._state.process)
            self._state.process.finish()
        while self._size > self._most:
            oldest = self._kept.popleft()
            self._passed += oldest.entries
            self._passed_scans += oldest.scans
            self._size -= len(oldest.block)

    def go_on(self) -> None:
        """Let the writers take what waits; find out how those have ended that are done."""
        if self._recording is not None:
            self._recording.go_on()
            if self._recording.trouble:
                self.file_trouble = self._recording.trouble
                self._tell(self.file_trouble)
                self._recording.close()
                self._recording = None
        if self._state is not None:
            content = self._state.go_on()
            if content is not None:
                if trouble := self._state.process.trouble:
                    self.file_trouble = f"no keyframe of the black box: {trouble}"
                self._frames = [one for one in self._frames if one.scan > self._passed_scans]
                self._frames += self._frame_of(content)
                self._state = None
        for writer in tuple(self._ending):
            writer.go_on()
            if writer.is_over:
                self._ending.remove(writer)
                self.file_trouble = writer.trouble or self.file_trouble
                self._tell(writer.trouble or f"{writer.path.name} is written")

    def _frame_of(self, content: bytes) -> list[Keyframe]:
        with suppress(UserError):
            found = value_of(content, "the state of the black box")
            if isinstance(found, Keyframe):
                return [found._replace(steps=found.steps + self._state_from)]
        return []

    def _tell(self, text: str) -> None:
        self._told, self._told_at = text, clock.now_ns()

    def _writer(self, path: Path) -> WriterProcess:
        """Return the writer of a new file, which gets all that is kept; raise UserError."""
        if self._why_off:
            raise mistake("prompt", self._why_off, "`trcvtui run FILE --record`, which keeps all")
        if os.path.lexists(path):
            raise mistake("prompt", f"{path}, which is there already", "the name of a new file")
        if not path.absolute().parent.is_dir():
            raise mistake("prompt", f"{path}: no such folder", "a file in a folder that is there")
        writer = WriterProcess(path, RecordTo(path), waits=False)
        self._put_all(writer)
        return writer

    def _put_all(self, writer: WriterProcess) -> None:
        for block in self.blocks():
            writer.put(*block)

    def blocks(self) -> list[tuple[bytes, int]]:
        """Return all that is kept as blocks, each with the number of its entries; raise UserError."""
        if self._why_off:
            raise mistake("prompt", self._why_off, "`trcvtui run FILE --record`, then `trcvtui doctor`")
        self._post()
        first = BlockWriter(0)
        if self._begins is not None:
            first.take(self._begins)
        if self._passed:
            first.take(EntriesLost(self._passed, BEGINS_LATER))
            for frame in self._frames:
                if frame.scan > self._passed_scans:
                    first.take(frame._replace(steps=frame.steps - self._passed_scans))
        return [(first.block(), 0), *((old.block, old.entries) for old in self._kept)]

    def save(self, path: Path) -> str:
        """Write what is kept into a new file; return what to tell; raise UserError."""
        self._finish(self._writer(path))
        return f"the recording, {size_text(self._size)} of the black box, into {path.absolute()}"

    def _finish(self, writer: WriterProcess) -> None:
        last = BlockWriter(0)
        last.take(EntriesLost(0, ENDED_HERE))
        writer.put(last.block())
        writer.finish()
        self._ending.append(writer)

    def record(self, path: Path) -> str:
        """Write what is kept, and what follows, into a new file; return what to tell; raise UserError."""
        if self._recording is not None:
            raise mistake("prompt", f"{self._recording.path.name}, which is recorded", "`record stop` first")
        self._recording = self._writer(path)
        return f"recording into {path.absolute()}, from the beginning of the run as far as it is kept"

    def stop(self) -> str:
        """End the file that gets what follows; return what to tell; raise UserError where there is none."""
        writer = self._recording
        if writer is None:
            raise mistake("prompt", "no recording under way", "`record [FILE]` first")
        self._post()
        self._recording = None
        self._finish(writer)
        return f"{writer.path.absolute()} is being ended"

    @property
    def text(self) -> str:
        """Return the name of the file under way and its size, or how the last one has ended."""
        writer = self._recording
        if writer is None:
            return self._told if clock.now_ns() < self._told_at + TOLD_NS else ""
        try:
            size = os.stat(writer.path).st_size
        except OSError:
            size = 0
        return f"{writer.path.name} {size_text(size)}"

    def close(self) -> None:
        """End all files, and wait for that: the run is over."""
        self._post()
        if self._recording is not None:
            self._ending.append(self._recording)
            self._recording = None
        for writer in self._ending:
            writer.close()
        if self._state is not None:
            self._state.close()
        self.close_judge()
        self._ending.clear()
        self._kept.clear()


def new_name(folder: Path, stem: str) -> Path:
    """Return the name of a new recording: STEM-1.pcapng, STEM-2.pcapng ..."""
    number = 1
    while os.path.lexists(path := folder / f"{stem}-{number}{SUFFIX}"):
        number += 1
    return path
