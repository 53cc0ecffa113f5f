"""A recorded run once more: project and bench out of its journal, command by command, scan by scan.

Rule: nothing is read from the disk here; a name in a journal is looked up in the journal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from trcvtui.capture.journal import CLOSE, DO, REST, Entry
from trcvtui.capture.replay import Replay
from trcvtui.errors import UserError, mistake
from trcvtui.files import reading_only
from trcvtui.project.project import Project
from trcvtui.records import replace
from trcvtui.rig.bench.bench import KERNELS, Bench
from trcvtui.rig.commands.table import read_line
from trcvtui.rig.commands.words import BenchCommand
from trcvtui.rig.scenario.scenario import Scenario, load_bench, load_scenario

REST_LINE: Final = ""  # how REST stands among lines
UNTOLD: Final = ("hold", "go", "trigger")  # first words of lines that change nothing on a bench


class RunAgain:
    """The bench of a recorded run; `scenario` where it was one. `is_whole`: the run was seen to its end."""

    def __init__(
        self, entries: Iterator[Entry], where: str, replay: Replay | None = None, sets: Sequence[str] = ()
    ) -> None:
        self.replay = replay or Replay(entries, where)
        self._lines: list[str] = []
        self.is_whole = False
        self.before_close: Callable[[], None] = lambda: None  # the last look at the bench
        self._where = where
        begins = self.replay.begins
        if begins is None or begins.kernel not in KERNELS:
            raise mistake(where, "a journal without its beginning", "one that begins with a run")
        self.begins = begins
        self.scenario: Scenario | None = None
        with reading_only(self.replay.files):
            path, options = Path(begins.path), (*begins.options, *sets)
            if begins.is_scenario:
                self.scenario = load_scenario(path, options)
            project = self.scenario.project if self.scenario else load_bench(path, options)
        self.bench = Bench(self.changed(project), begins.kernel, self.replay)

    def changed(self, project: Project) -> Project:
        """Return the project that runs: the recorded one."""
        return project

    def take_lines(self) -> list[str]:
        """Return what the bench was told since this was asked."""
        lines, self._lines = self._lines, []
        return lines

    def scan(self) -> bool:
        """Do what came before the next scan, and let that pass; return False where none followed.

        Raise UserError at the first difference.
        """
        while (entry := self.replay.coming()) is not None:
            if entry.call == DO and len(entry.args) == 1:
                self._lines.append(str(entry.args[0]))
                self._do(self._lines[-1])
            elif entry.call == REST:
                self._lines.append(REST_LINE)
                self.bench.rest()
            elif entry.call == CLOSE:
                self.before_close()
                self.bench.close()
                self.replay.end()
                self.is_whole = True
                return False
            else:
                self.bench.step()
                return True
        if self.replay.is_ended:
            self.before_close()
            self.is_whole = True
        return False

    def _do(self, line: str) -> None:
        if line.partition(" ")[0] in UNTOLD:
            self.bench.told(line)
            return
        project, where = self.bench.project, f"{self._where}: scan {self.replay.scan}"
        if self.scenario is not None:  # a file named in a step stands beside the scenario
            project = replace(project, base=Path(self.begins.path).parent)
        verb, _, rest = line.partition(" ")
        with reading_only(self.replay.files):
            if verb == "udt":
                from trcvtui.rig.engine.controller import (
                    read_again,  # the only line of a screen that does this
                )

                self.bench.project = read_again(rest, project, where)[0]
                self.bench.told(line)
                return
            command = read_line(line, project, where)
        if command is not None:
            self.act(command)

    def act(self, command: BenchCommand) -> None:
        """Carry out a command."""
        self.bench.do(command)

    def differs(self) -> UserError:
        """Return what is said of a journal that ends before its run."""
        lost = self.replay.lost
        found = f"{lost or 'the end of the journal'} after {self.bench.runtime.scans} scans"
        return mistake(self._where, found, "the end of the run")
