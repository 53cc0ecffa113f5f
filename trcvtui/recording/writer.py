"""The writer of a recording, a process of its own: fed by a pipe in the gaps, it never makes a scan wait.

Rule 1: what the pipe does not take now waits, at most MOST_WAITING bytes of it, of whole blocks twice as
many; what comes then is left out, and the journal says how much (`EntriesLost`).
Rule 2: without the writer the bench goes on; `trouble` says in one line why nothing is recorded any more.
Rule 3: the end of the pipe ends the writer, whatever was killed: what it has is written, the file is whole.
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
from trcvtui.recording.journal import BlockWriter, EntriesLost, Entry
from trcvtui.signals import GROUP_SIGNALS, ignore_signals

if TYPE_CHECKING:
    from subprocess import Popen

LENGTH_PREFIX: Final = struct.Struct("<I")  # before each message; its bytes
MOST_WAITING_BYTES: Final = 64 << 20  # bytes
PIPE_BYTES: Final = 1 << 20  # asked for, where a pipe can be made larger
READ_BYTES: Final = 1 << 20
WRITER_NICENESS: Final = 5  # the scans come first; 10 would starve it beside other programs
WORK_SLICE_NS: Final = 10_000_000  # of other work, between two looks at the pipe
POST_INTERVAL_NS: Final = 200_000_000  # between two blocks that cross
START_CODE: Final = "import sys; from trcvtui.replay.{} import {} as main; main(*sys.argv[1:])"
# What such a process does.
WRITER_MAIN, STATE_MAIN = ("follower", "writer_main"), ("follower", "state_main")


class WriterProcess:
    """The sink of a run that must not wait; with `waits` raise UserError where the file is refused."""

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
        self._is_told = True  # the process has said whether it can write
        refused = self._answers.readline() if waits else b"\n"
        if refused != b"\n":
            self._end_process()
            raise _parse_refusal(refused, path)
        self._is_told = waits
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
        if self._waiting_bytes > MOST_WAITING_BYTES:
            self._lost += len(list(entries))
        else:
            self._note_lost()
            for entry in entries:
                self._block.add_entry(entry)
        self.advance()

    def add_block(self, block: bytes, entries: int = 0) -> None:
        """Take a block that is made already, of so many entries; leave it out where too much waits."""
        if self.trouble:
            return
        if self._waiting_bytes > 2 * MOST_WAITING_BYTES:
            self._lost += entries
            return
        if self._note_lost():
            self.post_block()
        self._queue_block(block)

    def _note_lost(self) -> bool:
        lost, self._lost = self._lost, 0
        self._left_out += lost
        if lost:
            self._block.add_entry(EntriesLost(lost, "the writer could not follow"))
        return lost > 0

    def _queue_block(self, block: bytes) -> None:
        self._waiting += memoryview(LENGTH_PREFIX.pack(len(block))), memoryview(block)
        self._waiting_bytes += LENGTH_PREFIX.size + len(block)

    def finish(self) -> None:
        """Let the file end as soon as all has crossed; `go_on` finds out when it has."""
        self._is_finishing = True

    def advance(self) -> None:
        """Write what waits, as much as the pipe takes."""
        now = clock.now_ns()
        if not self._is_finishing and (now > self._posted_at + POST_INTERVAL_NS or self._block.is_full):
            self._posted_at = now
            self.post_block()
        self._write_pipe()
        if self._is_finishing and not self._waiting and not self.is_over:
            with suppress(OSError):
                self._stdin.close()
            if self._process.poll() is not None:
                self.is_over = True
                said = self._end_process()
                self.trouble = self.trouble or ("" if said == b"\n" else str(_parse_refusal(said, self.path)))

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
        except BlockingIOError:
            return
        except OSError:
            self._handle_writer_end()

    def post_block(self) -> None:
        block, self._block = self._block.encode(), BlockWriter(0)
        self._queue_block(block)

    def _handle_writer_end(self) -> None:
        self._waiting.clear()
        self._waiting_bytes = 0
        said = self._read_answer()  # the process has closed both pipes
        why = str(_parse_refusal(said, self.path)) if said.strip() else f"{self.path}: the writer has ended"
        self.trouble = f"{why}; nothing more is recorded"

    def close(self) -> None:
        if self.is_over:
            return
        if not self.trouble and not self._stdin.closed:
            os.set_blocking(self._pipe, True)
            self._posted_at = 0
            self.advance()
        said = self._end_process()
        if not self.trouble and said != b"\n":
            self.trouble = str(_parse_refusal(said, self.path))
        if not self.trouble and (lost := self._left_out + self._lost):
            self.trouble = f"{self.path}: {lost} entries are not recorded: the writer could not follow"

    def kill(self) -> None:
        self._process.kill()
        if not self._answers.closed:
            self._end_process()

    def _end_process(self) -> bytes:
        with suppress(OSError):
            self._stdin.close()
        with self._answers:
            said = self._read_answer()
        self._process.wait()
        return said

    def _read_answer(self) -> bytes:
        said = self._answers.readline()
        if not self._is_told and said == b"\n":
            said = self._answers.readline()
        return said


def _start_process(path: Path, record: RecordTarget, main: tuple[str, str]) -> Popen[bytes]:
    import subprocess  # a run without a recording waits for none of it

    asked = str(record.target), record.overwrite, record.has_secrets, record.limits
    words = [sys.executable, "-P", "-c", START_CODE.format(*main), str(path), json.dumps(asked)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    pipe, null = subprocess.PIPE, subprocess.DEVNULL
    return subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=null, env=environment)


def _enlarge_pipe(pipe: int) -> None:
    try:
        import fcntl

        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    except (ImportError, AttributeError, OSError):
        return  # not every system has it; a user may have only so much


def _parse_refusal(line: bytes, path: Path) -> UserError:
    where, found, expected = (*line.decode(errors="replace").rstrip("\n").split("\t"), "", "")[:3]
    if not found:
        return mistake(str(path), "no writer", "a process that writes the recording")
    return mistake(where, found, expected)


# -- the other process -------------------------------------------------------------------------------------


class BlockSink(Protocol):
    """A sink of whole blocks, with work of its own while nothing comes."""

    def add_block(self, block: bytes) -> None: ...

    def advance(self, until: int) -> bool:
        """Work until this moment of the clock; return whether there is more to do."""

    def close(self) -> None: ...


def run_writer(asked: str, sink: Callable[[RecordTarget], BlockSink], path: str) -> None:
    """Write what comes over stdin until its end; say on stdout what is wrong, an empty line for nothing."""
    ignore_signals(GROUP_SIGNALS)  # they end the run, and its pipe ends us
    target, overwrite, has_secrets, limits = json.loads(asked)
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
    except Exception as wrong:
        _write_answer(f"{one_line(path)}\t{one_line(describe_program_error(wrong))}\ta recording")


def describe_program_error(wrong: Exception) -> str:
    return f"{type(wrong).__name__}: {wrong} (an error of trcvtui)"


def _read_input(idle: Callable[[int], bool]) -> bytes:
    if sys.platform == "win32":  # a pipe of it always makes us wait
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
    """Yield what comes; while nothing does, `idle` works until a moment of the clock, if it has work."""
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
