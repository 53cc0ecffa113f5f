"""The recorder of a running bench: its seam, its first entry, and the sinks of its entries.

Rule: a scan only appends to a list. In the gap after the scan, the sinks get the list.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from trcvtui import __version__, clock
from trcvtui.errors import UserError, one_line
from trcvtui.files import FilesRead, open_private_file
from trcvtui.recording.files import EntrySink, RecordTarget
from trcvtui.recording.journal import (
    FILE_READ,
    SECRETS_WARNING,
    SIM_WALL_NS,
    CallRecord,
    Entry,
    LostEntries,
    RunHeader,
    Secrets,
)
from trcvtui.recording.seam import SeamRecorder
from trcvtui.wording import size_text

if TYPE_CHECKING:
    from trcvtui.plc.containment import Containment
    from trcvtui.plc.runtime import Runtime
    from trcvtui.project.project import Project
    from trcvtui.recording.black_box import BlackBox

SAMPLE_INTERVAL_NS: Final = 1_000_000_000  # between two samples of each connection's stack
COST_CHECK_NS: Final = 5_000_000_000  # between two checks of what the black box costs
MOST_BOX_PERCENT: Final = 2  # of the time; a black box that takes more gives up
ENTRIES_PER_FLUSH: Final = 10_000  # a run that may wait hands over so many at a time
TLS_MODULE: Final = "trcvtui.net.layers.tls"


class RecordedBench(Protocol):
    """The part of a bench (trcvtui.bench) that a recorder uses."""

    kernel_name: str
    reports: Path | None  # where reports of internal errors go

    @property
    def now(self) -> int: ...
    @property
    def project(self) -> Project: ...
    @property
    def runtime(self) -> Runtime: ...
    @property
    def containment(self) -> Containment: ...
    def record_outputs(self) -> None: ...


class RunRecorder:
    """Records one run. Read the project into `reads`, enter the recorder, then make the bench on `seam`."""

    def __init__(
        self, sink: Callable[[], EntrySink], file: Path = Path(), waits: bool = True, secrets: bool = True
    ) -> None:
        self.holds_secrets = False  # of TLS sessions; only if `secrets` allows it
        self._may_hold = secrets
        self._key_log = -1  # the descriptor of the TLS key log; -1: none
        self._opened = ExitStack()
        self._hidden: frozenset[str] = frozenset()  # CONNECTs and peers whose bytes are not recorded
        self.trouble = ""  # why nothing more is recorded
        self.size = 0  # bytes of the file, up to a second old
        self.file = file
        self.box: BlackBox | None = None  # if it is the sink
        self._spent = self._looked_at = 0  # ns of gaps since the last check of the cost; its time
        self._time_of = clock.now_ns  # the clock that measures gaps
        self.reads = FilesRead()
        self._new_sink = sink
        self._sink: EntrySink | None = None
        self._other: EntrySink | None = None
        self._least = ENTRIES_PER_FLUSH if waits else 1
        self._entries: list[Entry] = []
        self._sample_at = 0
        self.seam = SeamRecorder(self._entries.append)

    def add_sink(self, other: EntrySink) -> None:
        """After each scan, also give all entries to a second sink, whose `trouble` is not checked."""
        self._other, self._least = other, 1

    def __enter__(self) -> RunRecorder:
        """Open the file, after the project was read; raise UserError if the file is refused."""
        self._sink = self._new_sink()
        if TLS_MODULE in sys.modules and self._may_hold:  # a project without TLS has not loaded it
            from trcvtui.net.layers.tls import set_key_log

            self._key_log, name = self._opened.enter_context(open_private_file())
            set_key_log(name)
            self._opened.callback(set_key_log, "")
        return self

    def add_header(self, bench: RecordedBench, path: Path, options: Iterable[str], is_scenario: bool) -> None:
        """Write the first entry, RunHeader; for a live run, time 0 is now."""
        read, is_live = self.reads, bench.kernel_name == "live"
        if self.file.name:
            bench.reports = self.file.absolute().parent  # of internal errors: beside the recording
        begins = RunHeader(
            __version__,
            bench.kernel_name,
            bench.project.sim.seed,
            clock.utc_ns() if is_live else SIM_WALL_NS,
            is_scenario,
            str(path),
            tuple(options),
            read.folder,
            tuple(read.contents.items()),
            tuple(read.digests.items()),
        )
        first: list[Entry] = [begins]
        if TLS_MODULE in sys.modules and not self._may_hold:
            from trcvtui.net.layers.tls import TlsSettings

            project = bench.project
            sessions = [(each.name, each.session) for each in project.connects]
            sessions += [(each.name, each.session) for each in project.peers]
            self._hidden = frozenset([name for name, one in sessions if isinstance(one, TlsSettings)])
        if self._hidden:
            first.append(LostEntries(0, "--no-secrets: it can be viewed, not replayed"))
        self._entries[:0] = first  # before the calls that made the bench
        if is_live:
            self.seam.clock = clock.now_ns
        read.sink = lambda name, content: self._entries.append(
            CallRecord("files", FILE_READ, (name,), content)
        )

    def finish_scan(self, bench: RecordedBench) -> None:
        """Record changed outputs and, once a second, samples of the stacks; hand the entries to the sinks."""
        if self.box is None:
            self._record_scan(bench)
            return
        began = self._time_of()
        self._record_scan(bench)
        self._spent += self._time_of() - began
        now = clock.now_ns()
        if now > self._looked_at + COST_CHECK_NS:
            is_costly = self._looked_at and self._spent > COST_CHECK_NS * MOST_BOX_PERCENT // 100
            if is_costly and self._time_of is clock.thread_cpu_ns and not self.box.is_recording:
                self.box.give_up()
                self.seam.stop_recording()
            # Elapsed time counts other programs, too; CPU time is dearer to ask, and decides.
            self._time_of = clock.thread_cpu_ns if is_costly else clock.now_ns
            self._spent, self._looked_at = 0, now

    def _record_scan(self, bench: RecordedBench) -> None:
        bench.record_outputs()
        if bench.now >= self._sample_at:
            bench.containment.attempt_unless_out(("reader", "samples"), bench.runtime.sample_stack)
            self._sample_at = bench.now + SAMPLE_INTERVAL_NS
            with suppress(OSError):
                self.size = os.stat(self.file).st_size
        if self._key_log >= 0:
            self._log_secrets()
        if len(self._entries) >= self._least:
            self._flush_entries()

    def _log_secrets(self) -> None:
        size = os.fstat(self._key_log).st_size
        if size:
            self._entries.append(Secrets(os.pread(self._key_log, size, 0)))
            os.ftruncate(self._key_log, 0)
            self.holds_secrets = True

    def _blank_bytes(self, entry: Entry) -> Entry:
        if not isinstance(entry, CallRecord) or entry.owner not in self._hidden or entry.call != "recv":
            return entry
        got = entry.answer[0] if isinstance(entry.answer, tuple) else 0
        return entry._replace(answer=(got, bytes(got) if isinstance(got, int) else b""))  # zeros, as many

    def _flush_entries(self) -> None:
        some = self._entries[:]
        if self._hidden:
            some = [self._blank_bytes(entry) for entry in some]
        self._entries.clear()
        self._call_own_sink(lambda sink: sink.add_entries(some))
        if self._other is not None:
            self._other.add_entries(some)

    def _call_own_sink(self, act: Callable[[EntrySink], None]) -> None:
        if self._sink is None:
            return
        try:
            act(self._sink)
            self.trouble = self._sink.trouble
        except UserError as wrong:  # such as a full disk
            self.trouble = str(wrong)
        except OSError as failed:
            self.trouble = f"{self.file}: {failed.strerror}; nothing more is recorded"
        if self.trouble:  # the run continues, unrecorded
            self._sink = None

    def close(self) -> None:
        if self._key_log >= 0:
            self._log_secrets()
        self._flush_entries()
        self._call_own_sink(lambda sink: sink.close())
        if self._other is not None:
            self._other.close()
        self._sink = self._other = None
        self._key_log = -1
        self._opened.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def list_remarks(self) -> list[str]:
        secrets = f"{self.file} {SECRETS_WARNING}" if self.holds_secrets and self.file.name else ""
        return [one_line(line) for line in (secrets, self.trouble) if line]

    @property
    def last_error(self) -> str:
        """Return the last error of the run's file, or else of the `record` command's file, if any."""
        return self.trouble or (self.box.file_trouble if self.box is not None else "")

    def describe_status(self) -> str:
        """Return the name of the file and its size, or why nothing is written any more."""
        if self.box is not None:
            return self.trouble or self.box.status_text
        secrets = ", with TLS secrets" if self.holds_secrets else ""
        return self.trouble or f"{self.file.name} {size_text(self.size)}{secrets}"


def attach_black_box(recorder: RunRecorder | None, reads: FilesRead) -> tuple[RunRecorder, BlackBox]:
    """Return `recorder`, or a new recorder with `reads`, and a black box that gets all of its entries."""
    from trcvtui.recording.black_box import BlackBox

    box = BlackBox()
    if recorder is None:
        recorder = RunRecorder(lambda: box, waits=False)
        recorder.reads = reads
    else:
        recorder.add_sink(box)
    return recorder, box


def make_recorder(record: RecordTarget, file: Path, waits: bool) -> RunRecorder:
    """Return a recorder of a file. If `waits`, this process writes the file, else another process."""

    def make_sink() -> EntrySink:
        if waits:
            return record.make_sink(file)
        from trcvtui.recording.writer import WriterProcess

        return WriterProcess(file, record)

    return RunRecorder(make_sink, file, waits, record.has_secrets)
