"""A run on record while it runs: its seam, its first entry, and who gets the entries.

Rule: a scan only appends to a list; in the gap after it the list is handed over.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, Protocol

from trcvtui import __version__
from trcvtui.capture.journal import READ, SIM_WALL_NS, Answered, Entry, RunBegins, SeamRecorder
from trcvtui.errors import mistake, one_line
from trcvtui.files import FilesRead
from trcvtui.records import dataclass
from trcvtui.rig import clock
from trcvtui.rig.bench.bench import Bench

SAMPLE_NS: Final = 1_000_000_000  # between two looks at what each connection's stack says
AT_ONCE: Final = 10_000  # entries that wait at most where no time passes
SUFFIX: Final = ".pcapng"


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


class RunRecorder:
    """What is recorded of one run. Note the `reads` of the project; inside it make the bench on `seam`."""

    def __init__(self, sink: Callable[[], Sink]) -> None:
        self._new_sink = sink
        self._sink: Sink | None = None
        self.trouble = ""
        self._entries: list[Entry] = []
        self._sample_at = 0
        self._least = 1
        self.seam = SeamRecorder(self._entries.append)
        self.reads = FilesRead()

    def __enter__(self) -> RunRecorder:
        """Open the file, when the project has been read; raise UserError where it is refused."""
        self._sink = self._new_sink()
        return self

    def begin(self, bench: Bench, path: Path, options: Iterable[str], is_scenario: bool) -> None:
        """Tell what the run begins with; time 0 of a live run is now."""
        read, is_live = self.reads, bench.kernel_name == "live"
        begins = RunBegins(
            __version__,
            bench.kernel_name,
            bench.project.sim.seed,
            clock.wall_ns() if is_live else SIM_WALL_NS,
            is_scenario,
            str(path),
            tuple(options),
            read.folder,
            tuple(read.contents.items()),
            tuple(read.digests.items()),
        )
        self._entries.insert(0, begins)
        self._least = 1 if is_live else AT_ONCE
        read.told = lambda name, content: self._entries.append(Answered("files", READ, (name,), content))

    def gap(self, bench: Bench) -> None:
        """Look at the connections when a second has passed; hand over what the scan has brought."""
        if bench.now >= self._sample_at:
            self._sample_at = bench.now + SAMPLE_NS
            bench.runtime.sample()
        self.hand_over(self._least)

    def hand_over(self, least: int = 1) -> None:
        """Let the entries be written, where there are so many."""
        if len(self._entries) >= least and self._sink is not None:
            some = self._entries[:]
            self._entries.clear()
            self._write(lambda sink: sink.take(some))

    def _write(self, act: Callable[[Sink], None]) -> None:
        """Let the sink do it; without a file to write to, the run goes on."""
        sink = self._sink
        if sink is None:
            return
        try:
            act(sink)
            self.trouble = sink.trouble
        except OSError as failed:
            self.trouble = f"{failed.strerror}; nothing more is recorded"
        if self.trouble:
            self._sink = None
            sys.stderr.write(f"recording: {one_line(self.trouble)}\n")

    def __exit__(self, *_: object) -> None:
        """End the recording."""
        self.hand_over()
        self._write(lambda sink: sink.close())


@dataclass(frozen=True, slots=True)
class RecordTo:
    """What `--record` asks for; of several runs each has a file of its own in the folder `target`."""

    target: Path
    overwrite: bool = False
    has_secrets: bool = True

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

    def recorder(self, file: Path, kernel: str) -> RunRecorder:
        """Return what records a run into a file."""

        def sink() -> Sink:
            if kernel == "live":
                from trcvtui.rig.recording.writer import WriterProcess

                return WriterProcess(file, self.overwrite, self.has_secrets)
            from trcvtui.capture.recording import RecordingWriter

            return RecordingWriter(file, self.overwrite)

        return RunRecorder(sink)
