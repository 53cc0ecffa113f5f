"""The writer of a recording is another process, which gets entries by a pipe between scans: no scan waits.

Rule 1: bytes wait if the pipe does not take them at once. While more than MOST_WAITING_BYTES wait, new
entries are skipped. While more than twice MOST_WAITING_BYTES wait, whole blocks are skipped, too.
`LostEntries` counts the lost entries.
Rule 2: without the writer the bench continues. `trouble` says in one line why nothing more is recorded.
Rule 3: when the pipe ends, even by a kill of the run, the writer writes what it has and ends the file.
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from trcvtui import clock
from trcvtui.errors import UserError, mistake, one_line
from trcvtui.recording.files import FileLimits, RecordTarget
from trcvtui.recording.journal import BlockWriter, Entry, LostEntries
from trcvtui.signals import GROUP_SIGNALS, ignore_signals

if TYPE_CHECKING:
    from subprocess import Popen

LENGTH_PREFIX: Final = struct.Struct("<I")  # before each message; its bytes
MOST_WAITING_BYTES: Final = 64 << 20
PIPE_BYTES: Final = 1 << 20  # asked of a system that can enlarge a pipe
READ_BYTES: Final = 1 << 20
WRITER_NICENESS: Final = 5  # the scans come first; 10 would starve it beside other programs
WORK_SLICE_NS: Final = 10_000_000  # of other work, between two reads of the pipe
POST_INTERVAL_NS: Final = 200_000_000  # between two blocks that cross
START_CODE: Final = "import sys; from trcvtui.replay.{} import {} as main; main(*sys.argv[1:])"
# Module and function of such a process.
WRITER_MAIN, STATE_MAIN = ("follower", "writer_main"), ("follower", "state_main")


class WriterProcess:
    """The sink of a run that must not wait. If `waits`, begin once the writer can write, else UserError."""

    def __init__(
        self, path: Path, record: RecordTarget, waits: bool = True, main: tuple[str, str] = WRITER_MAIN
    ) -> None:
        self.trouble = ""
        self.path = path
        self.is_over = False  # after `finish`: the file is whole, or `trouble` says why not
        self._is_finishing = False
        self._block = BlockWriter(0)
        self._waiting: deque[memoryview] = deque()
        self._waiting_bytes = self._lost = self._left_out = 0
        self._posted_at = clock.now_ns()
        self._process = _start_process(path, record, main)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._stdin, self._answers = self._process.stdin, self._process.stdout
        self._has_reported = True  # the process has said whether it can write
        refused = self._answers.readline() if waits else b"\n"
        if refused != b"\n":
            self._end_process()
            raise _parse_refusal(refused, path)
        self._has_reported = waits
        self._pipe = self._stdin.fileno()
        _enlarge_pipe(self._pipe)
        if sys.platform != "win32":
            os.set_blocking(self._pipe, False)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def is_behind(self) -> bool:
        return bool(self._waiting)

    def add_entries(self, entries: Iterable[Entry]) -> None:
        """Take entries in their order; write as much as the pipe takes at once."""
        if self.trouble:
            return
        if self._waiting_bytes > MOST_WAITING_BYTES:  # Rule 1
            self._lost += len(list(entries))
        else:
            self._add_lost_entries()
            for entry in entries:
                self._block.add_entry(entry)
        self.advance()

    def add_block(self, block: bytes, entries: int = 0) -> None:
        """Take an encoded block with this number of entries; leave the block out if too many bytes wait."""
        if self.trouble:
            return
        if self._waiting_bytes > 2 * MOST_WAITING_BYTES:
            self._lost += entries
            return
        if self._add_lost_entries():
            self.queue_own_block()
        self._queue_block(block)

    def _add_lost_entries(self) -> bool:
        lost, self._lost = self._lost, 0
        self._left_out += lost
        if lost:
            self._block.add_entry(LostEntries(lost, "the writer was too slow"))  # Rule 1
        return lost > 0

    def _queue_block(self, block: bytes) -> None:
        self._waiting += memoryview(LENGTH_PREFIX.pack(len(block))), memoryview(block)
        self._waiting_bytes += LENGTH_PREFIX.size + len(block)

    def request_finish(self) -> None:
        """Let the file end as soon as all bytes are sent. `advance` notices the end of the file."""
        self._is_finishing = True

    def advance(self) -> None:
        """Write as many of the waiting bytes as the pipe takes."""
        now = clock.now_ns()
        if not self._is_finishing and (now > self._posted_at + POST_INTERVAL_NS or self._block.is_full):
            self._posted_at = now
            self.queue_own_block()
        self._write_pipe()
        if self._is_finishing and not self._waiting and not self.is_over:
            with suppress(OSError):
                self._stdin.close()
            if self._process.poll() is not None:
                self.is_over = True
                line = self._end_process()
                self.trouble = self.trouble or ("" if line == b"\n" else str(_parse_refusal(line, self.path)))

    def _write_pipe(self) -> None:
        try:
            while self._waiting:
                first = self._waiting[0]
                written = os.write(self._pipe, first)
                self._waiting_bytes -= written
                if written < len(first):
                    self._waiting[0] = first[written:]
                else:
                    self._waiting.popleft()
        except BlockingIOError:  # the pipe is full
            return
        except OSError:
            self._handle_writer_end()

    def queue_own_block(self) -> None:
        block, self._block = self._block.encode(), BlockWriter(0)
        self._queue_block(block)

    def _handle_writer_end(self) -> None:
        self._waiting.clear()
        self._waiting_bytes = 0
        line = self._read_answer()  # the process has closed both pipes: this does not wait
        why = str(_parse_refusal(line, self.path)) if line.strip() else f"{self.path}: the writer has ended"
        self.trouble = f"{why}; nothing more is recorded"

    def close(self) -> None:
        if self.is_over:
            return
        if not self.trouble and not self._stdin.closed:
            os.set_blocking(self._pipe, True)  # the run is over: this may wait
            self._posted_at = 0
            self.advance()
        line = self._end_process()
        if not self.trouble and line != b"\n":
            self.trouble = str(_parse_refusal(line, self.path))
        if not self.trouble and (lost := self._left_out + self._lost):
            self.trouble = f"{self.path}: {lost} entries are not recorded: the writer was too slow"

    def kill(self) -> None:
        self._process.kill()
        if not self._answers.closed:
            self._end_process()

    def _end_process(self) -> bytes:
        with suppress(OSError):
            self._stdin.close()
        with self._answers:
            line = self._read_answer()
        self._process.wait()
        return line

    def _read_answer(self) -> bytes:
        line = self._answers.readline()
        if not self._has_reported and line == b"\n":
            line = self._answers.readline()
        return line


def _start_process(path: Path, record: RecordTarget, main: tuple[str, str]) -> Popen[bytes]:
    import subprocess  # here: a run without a recording does not wait for it

    settings = str(record.target), record.overwrite, record.has_secrets, record.limits
    words = [sys.executable, "-P", "-c", START_CODE.format(*main), str(path), json.dumps(settings)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    pipe, null = subprocess.PIPE, subprocess.DEVNULL
    return subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=null, env=environment)


def _enlarge_pipe(pipe: int) -> None:
    try:
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    except (ImportError, AttributeError, OSError):
        return  # only Linux has it, and limits it for each user


def _parse_refusal(line: bytes, path: Path) -> UserError:
    where, found, expected = (*line.decode(errors="replace").rstrip("\n").split("\t"), "", "")[:3]
    if not found:
        return mistake(str(path), "no writer", "a process that writes the recording")
    return mistake(where, found, expected)


# -- the other process -------------------------------------------------------------------------------------


class BlockSink(Protocol):
    """A sink of whole blocks; while no block comes, `advance` does other work of the sink."""

    def add_block(self, block: bytes) -> None: ...

    def advance(self, deadline_ns: int) -> bool:
        """Work until this moment of the clock; return whether there is more to do."""

    def close(self) -> None: ...


def run_writer(settings: str, sink: Callable[[RecordTarget], BlockSink], path: str) -> None:
    """Write the blocks from stdin until stdin ends. Write an error, or an empty line, to stdout."""
    ignore_signals(GROUP_SIGNALS)  # Rule 3: they end the run, and its pipe ends us
    target, overwrite, has_secrets, limits = json.loads(settings)
    with suppress(AttributeError, OSError):
        os.nice(WRITER_NICENESS)
    try:
        record = RecordTarget(Path(target), overwrite, has_secrets, FileLimits(*limits) if limits else None)
        writer = sink(record)
        _write_answer("")
        try:
            for message in _read_messages(writer.advance):
                writer.add_block(message)
        finally:
            writer.close()
        _write_answer("")
    except UserError as wrong:
        problem = wrong.problems[0]
        _write_answer("\t".join(map(one_line, (problem.where, problem.found, problem.expected))))
    except OSError as failed:
        _write_answer(f"{one_line(path)}\t{failed.strerror}\troom for the recording")
    except Exception as wrong:  # the run has to learn of it
        _write_answer(f"{one_line(path)}\t{one_line(describe_program_error(wrong))}\ta recording")


def describe_program_error(wrong: Exception) -> str:
    return f"{type(wrong).__name__}: {wrong} (an error of trcvtui)"


def _read_input(idle: Callable[[int], bool]) -> bytes:
    if sys.platform == "win32":  # its pipes always block
        idle(clock.now_ns() + WORK_SLICE_NS)
        return os.read(0, READ_BYTES)
    os.set_blocking(0, False)
    try:
        while True:
            with suppress(BlockingIOError):
                return os.read(0, READ_BYTES)
            if not idle(clock.now_ns() + WORK_SLICE_NS):
                break
    finally:
        os.set_blocking(0, True)
    return os.read(0, READ_BYTES)


def _write_answer(line: str) -> None:
    try:
        os.write(1, f"{line}\n".encode())
    except OSError:
        return  # the bench is gone


def _read_messages(idle: Callable[[int], bool]) -> Iterator[bytes]:
    """Yield messages; while no message comes, call `idle` with the deadline of its work."""
    waiting = bytearray()
    while read := _read_input(idle):
        waiting += read
        at = 0
        while len(waiting) >= at + LENGTH_PREFIX.size:
            end = at + LENGTH_PREFIX.size + LENGTH_PREFIX.unpack_from(waiting, at)[0]
            if len(waiting) < end:
                break
            yield bytes(waiting[at + LENGTH_PREFIX.size : end])
            at = end
        del waiting[:at]
