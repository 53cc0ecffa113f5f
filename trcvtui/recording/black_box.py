"""Keeps the newest part of a run in memory. `record` writes this part, and what follows, into a file.

Rule 1: at most MOST_KEPT_BYTES are kept; dropped entries are counted. When half that size is new, a process
replays the kept entries. The replay's last state is the keyframe of a file that begins in the middle.
Rule 2: processes write the files. Only the end of the run waits for these processes.
Rule 3: the box gives up if it takes too much time (recorder.py), but not while it records into a file.
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
from trcvtui.recording.files import FILE_SUFFIX, OldBlock, RecordTarget
from trcvtui.recording.journal import (
    ENDED_HERE,
    STEP,
    BlockWriter,
    CallRecord,
    Entry,
    Keyframe,
    LostEntries,
    RunHeader,
    decode_value,
)
from trcvtui.recording.worker_process import PendingAnswer
from trcvtui.recording.writer import POST_INTERVAL_NS, STATE_MAIN, WriterProcess
from trcvtui.wording import size_text

MOST_KEPT_BYTES: Final = 64 << 20
END_SHOWN_NS: Final = 10_000_000_000
GAVE_UP_TEXT: Final = "no black box, as it took more than 2 % of a processor"
TRIMMED_REASON: Final = "the black box keeps the newest 64 MiB"


class BlackBox:
    """A sink that keeps the newest blocks of a run."""

    trouble = ""  # always: a file that cannot be written does not concern the run

    def __init__(self) -> None:
        import subprocess  # noqa: F401 - here no scan waits for these 10 ms

        self._end_text, self._ended_at = "", 0  # how the last file has ended
        self.file_trouble = ""  # of the last file that could not be written
        self._most = MOST_KEPT_BYTES
        self._begins: RunHeader | None = None
        self._block = BlockWriter(0)
        self._entries = self._scans = 0  # of this block
        self._kept: deque[OldBlock] = deque()
        self._size = self._passed = self._passed_scans = 0  # bytes kept; entries, scans dropped
        self._since = 0  # bytes since the last state was requested
        self._state: PendingAnswer | None = None
        self._state_from = 0  # scans that were dropped when it was requested
        self.close_judge: Callable[[], object] = lambda: None  # of the doctor
        self._frames: list[Keyframe] = []  # `steps` from the beginning of the run
        self._posted_at = 0
        self._off_reason = ""
        self._recording: WriterProcess | None = None  # into a file that gets what follows, too
        self._ending: list[WriterProcess] = []

    def give_up(self) -> None:
        """Keep nothing from now on: the box costs the scans too much time."""
        self._off_reason = GAVE_UP_TEXT
        self._kept.clear()
        self._frames.clear()
        self._size = self._since = self._scans = 0
        self._block, self._entries = BlockWriter(0), 0

    @property
    def is_recording(self) -> bool:
        return self._recording is not None

    def add_entries(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if isinstance(entry, RunHeader):  # each file begins with it
                self._begins = entry
            else:
                self._block.add_entry(entry)
                self._entries += 1
                self._scans += type(entry) is CallRecord and entry.call == STEP
        now = clock.now_ns()
        if self._block.is_full or now > self._posted_at + POST_INTERVAL_NS:
            self._posted_at = now
            self._flush_block()
        self.advance()

    def _flush_block(self) -> None:
        if not self._entries:
            return
        block = self._block.encode()
        if self._recording is not None:
            self._recording.add_block(block, self._entries)
        self._kept.append(OldBlock(self._entries, self._scans, block))
        self._size += len(block)
        self._since += len(block)
        self._block, self._entries, self._scans = BlockWriter(0), 0, 0
        if self._since > self._most // 2 and self._state is None:  # Rule 1
            self._since = 0
            self._state, self._state_from = PendingAnswer(STATE_MAIN), self._passed_scans
            self._send_blocks(self._state.process)
            self._state.process.request_finish()
        while self._size > self._most:
            oldest = self._kept.popleft()
            self._passed += oldest.entries
            self._passed_scans += oldest.scans
            self._size -= len(oldest.block)

    def advance(self) -> None:
        """Feed the writers; note how each finished writer has ended."""
        if self._recording is not None:
            self._recording.advance()
            if self._recording.trouble:
                self.file_trouble = self._recording.trouble
                self._set_end_text(self.file_trouble)
                self._recording.close()
                self._recording = None
        if self._state is not None:
            content = self._state.advance()
            if content is not None:
                if trouble := self._state.process.trouble:
                    self.file_trouble = f"no keyframe of the black box: {trouble}"
                self._frames = [one for one in self._frames if one.scan > self._passed_scans]  # of kept scans
                self._frames += self._decode_keyframe(content)
                self._state = None
        for writer in tuple(self._ending):
            writer.advance()
            if writer.is_over:
                self._ending.remove(writer)
                self.file_trouble = writer.trouble or self.file_trouble
                self._set_end_text(writer.trouble or f"{writer.path.name} is written")

    def _decode_keyframe(self, content: bytes) -> list[Keyframe]:
        with suppress(UserError):
            found = decode_value(content, "the state of the black box")
            if isinstance(found, Keyframe):
                return [found._replace(steps=found.steps + self._state_from)]  # of the whole run
        return []

    def _set_end_text(self, text: str) -> None:
        self._end_text, self._ended_at = text, clock.now_ns()

    def _start_writer(self, path: Path) -> WriterProcess:
        """Start the writer of a new file and send all kept entries to it; raise UserError."""
        if self._off_reason:
            raise mistake("prompt", self._off_reason, "`trcvtui run FILE --record`, which keeps all")
        if os.path.lexists(path):  # a broken link, too
            raise mistake("prompt", f"{path}, which is there already", "the name of a new file")
        if not path.absolute().parent.is_dir():
            raise mistake("prompt", f"{path}: no such folder", "a file in an existing folder")
        writer = WriterProcess(path, RecordTarget(path), waits=False)
        self._send_blocks(writer)
        return writer

    def _send_blocks(self, writer: WriterProcess) -> None:
        for block in self.encode_blocks():
            writer.add_block(*block)

    def encode_blocks(self) -> list[tuple[bytes, int]]:
        """Return the kept entries as blocks, each with its number of entries; raise UserError."""
        if self._off_reason:
            raise mistake("prompt", self._off_reason, "`trcvtui run FILE --record`, then `trcvtui doctor`")
        self._flush_block()
        first = BlockWriter(0)
        if self._begins is not None:
            first.add_entry(self._begins)
        if self._passed:
            first.add_entry(LostEntries(self._passed, TRIMMED_REASON))
            for frame in self._frames:
                if frame.scan > self._passed_scans:  # else its next scan is dropped
                    first.add_entry(frame._replace(steps=frame.steps - self._passed_scans))
        return [(first.encode(), 0), *((old.block, old.entries) for old in self._kept)]

    def save(self, path: Path) -> str:
        """Begin to write the kept run into a new file; return a text for the user; raise UserError."""
        self._finish_file(self._start_writer(path))
        return f"saving {size_text(self._size)} of the black box into {path.absolute()}"

    def _finish_file(self, writer: WriterProcess) -> None:
        last = BlockWriter(0)
        last.add_entry(LostEntries(0, ENDED_HERE))
        writer.add_block(last.encode())
        writer.request_finish()
        self._ending.append(writer)

    def start_recording(self, path: Path) -> str:
        """Write the kept entries and all later ones into a new file; return the answer; raise UserError."""
        if self._recording is not None:
            raise mistake("prompt", f"a recording into {self._recording.path.name}", "`record stop` first")
        self._recording = self._start_writer(path)
        return f"recording into {path.absolute()}; it begins with what the black box holds"

    def stop_recording(self) -> str:
        """End the file of `start_recording` and return the answer. Raise UserError if there is no file."""
        writer = self._recording
        if writer is None:
            raise mistake("prompt", "no recording under way", "`record [FILE]` first")
        self._flush_block()
        self._recording = None
        self._finish_file(writer)
        return f"ending {writer.path.absolute()}"

    @property
    def status_text(self) -> str:
        """Return name and size of the file that is being written, or how the last file ended."""
        writer = self._recording
        if writer is None:
            return self._end_text if clock.now_ns() < self._ended_at + END_SHOWN_NS else ""
        try:
            size = os.stat(writer.path).st_size
        except OSError:
            size = 0
        return f"{writer.path.name} {size_text(size)}"

    def close(self) -> None:
        """End all files and wait for their writers: the run is over."""
        self._flush_block()
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


def find_new_path(folder: Path, stem: str) -> Path:
    """Return the name of a new recording: STEM-1.pcapng, STEM-2.pcapng ..."""
    number = 1
    while os.path.lexists(path := folder / f"{stem}-{number}{FILE_SUFFIX}"):
        number += 1
    return path
