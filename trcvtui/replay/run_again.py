"""Repeats a recorded run. The journal gives project and bench, and its entries are followed one by one.

Rule: nothing is read from the disk here. A journal contains the files that it names.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, cast

from msgspec.structs import replace

from trcvtui.bench.bench import KERNEL_NAMES, Bench
from trcvtui.commands.table import parse_unbounded_line
from trcvtui.commands.words import BenchCommand
from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead, substitute_disk
from trcvtui.project.project import Project
from trcvtui.recording.journal import CLOSE, DO, REST, SKIP, Entry, RunHeader
from trcvtui.recording.replay import ReplaySeam, make_early_end_error
from trcvtui.scenario.scenario import Scenario, load_bench_project, load_scenario

RunRoots = tuple[RunHeader, Scenario | None, Project]
NO_LIMIT: Final = 1 << 62
MOST_LINES: Final = 10_000  # that wait for take_lines
REST_LINE: Final = ""  # REST among lines
IDLE_VERBS: Final = ("hold", "go", "trigger", "note")  # first words of lines that change nothing on a bench


def _do_nothing() -> None:
    """Do nothing."""


def roots_of(begins: RunHeader, files: FilesRead, sets: Sequence[str] = ()) -> RunRoots:
    """Return the header, the scenario or None, and the project of a recorded run; raise UserError."""
    path, options = Path(begins.path), (*begins.options, *sets)
    with substitute_disk(files):
        if not begins.is_scenario:
            return begins, None, load_bench_project(path, options)
        scenario = load_scenario(path, options)
        return begins, scenario, scenario.project


@contextmanager
def guard_restored(is_restored: bool, where: str) -> Iterator[None]:
    """Turn exceptions of a run restored from a keyframe into UserError: the file may cause all of them."""
    try:
        yield
    except (UserError, OSError):
        raise
    except Exception as wrong:
        if not is_restored:
            raise
        raise mistake(where, f"{type(wrong).__name__} {wrong}"[:120], "a keyframe of this run") from None


class ReplayRun:
    """The bench of a recorded run, and its `scenario` or None. If `is_whole`, the run is at its end."""

    def __init__(
        self,
        entries: Iterator[Entry],
        where: str,
        replay: ReplaySeam | None = None,
        roots: RunRoots | None = None,
    ) -> None:
        self.replay = replay or ReplaySeam(entries, where)
        self._lines: deque[str] = deque(maxlen=MOST_LINES)
        self.is_whole = self.is_restored = False
        self.limit = NO_LIMIT  # the scan up to which skipped scans are counted
        self._skipped = 0  # scans of the present SKIP that are counted
        self.before_close: Callable[[], None] = _do_nothing  # the last look at the bench
        self.where = where
        begins = self.replay.begins
        if begins is None or begins.kernel not in KERNEL_NAMES:
            raise mistake(where, "a journal without its beginning", "one that begins with a run")
        self.begins = begins
        self.roots = roots or roots_of(begins, self.replay.files)
        _, self.scenario, project = self.roots
        self.bench = Bench(project, begins.kernel, self.replay)

    def __getstate__(self) -> dict[str, object]:
        """Return what a keyframe keeps: no file name, as the file may be renamed."""
        return self.__dict__ | {"where": ""}

    def take_lines(self) -> list[str]:
        lines = [*self._lines]
        self._lines.clear()
        return lines

    def scan(self) -> bool:
        """Run the commands before the next scan, then the scan. Return False if there is no next scan.

        Raise UserError at the first difference.
        """
        with guard_restored(self.is_restored, self.where):
            return self._scan()

    def _scan(self) -> bool:
        while (entry := self.replay.peek_call()) is not None:
            if entry.call == DO and len(entry.args) == 1:
                self._lines.append(str(entry.args[0]))
                self._run_line(self._lines[-1])
            elif entry.call == REST and not entry.args:  # with a time: a part of the next step
                self._lines.append(REST_LINE)
                self.bench.step_peers_alone()
            elif entry.call == SKIP:
                if not self._skip(cast(int, entry.args[0])):
                    return True
            elif entry.call == CLOSE:
                self.before_close()
                self.bench.close()
                self.replay.check_end()
                self.is_whole = True
                return False
            else:
                self.bench.step()
                return True
        if self.replay.is_ended:
            self.before_close()
            self.is_whole = True
        return False

    def _skip(self, scans: int) -> bool:
        """Count skipped scans up to scan `limit`. Return whether all of them end before scan `limit`."""
        runtime = self.bench.runtime
        room = self.limit - runtime.scans
        if room < scans - self._skipped:
            runtime.skip(room)
            self._skipped += room
            return False
        runtime.skip(-self._skipped)  # the bench compares the whole SKIP with the journal
        self._skipped = 0
        self.bench.skip(scans)
        return runtime.scans < self.limit

    def _run_line(self, line: str) -> None:
        if line.partition(" ")[0] in IDLE_VERBS:
            self.bench.record_line(line)
            return
        project, where = self.bench.project, f"{self.where}: scan {self.replay.scan}"
        if self.scenario is not None:  # a step names files from the scenario's folder
            project = replace(project, base=Path(self.begins.path).parent)
        verb, _, rest = line.partition(" ")
        with substitute_disk(self.replay.files):
            if verb == "udt":
                from trcvtui.engine.controller import reload_types  # here: only this line needs it

                self.bench.project = reload_types(rest, project, where)[0]
                self.bench.record_line(line)
                return
            command = parse_unbounded_line(line, project, where)
        if command is not None:
            self.run_command(command)

    def run_command(self, command: BenchCommand) -> None:
        self.bench.do(command)

    def make_end_error(self) -> UserError:
        """Return the error for a journal that ends before the run did."""
        left = self.replay.count_scans_left() if self.replay.gap_text else 0
        return make_early_end_error(self.where, self.replay.gap_text, self.bench.runtime.scans, left)
