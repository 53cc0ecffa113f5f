"""Processes that are asked once: the last state of a run, a verdict on it or on files.

Rule: no scan waits for an answer; it is there when the process is over. Before, a line
in its place tells how far the process is.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from trcvtui.files import unnamed
from trcvtui.recording.files import SUFFIX, RecordTo
from trcvtui.recording.writer import JUDGE_FILES, WriterProcess


class AnswerOnItsWay:
    """A process that makes something of what is put into it: an answer, when it is over."""

    def __init__(self, main: tuple[str, str]) -> None:
        self.progress = ""
        self._opened = ExitStack()
        self._file, name = self._opened.enter_context(unnamed())
        path = Path(name.replace("self", str(os.getpid()), 1) if name.startswith("/proc") else name)
        self.process = WriterProcess(path, RecordTo(path), waits=False, main=main)

    def go_on(self) -> bytes | None:
        """Let what waits cross; return the answer when the process is over, None before."""
        self.process.go_on()
        if not (self.process.is_over or self.process.trouble):
            told, line_end, _ = os.pread(self._file, 1024, 0).partition(b"\n")
            self.progress = told.decode(errors="replace") if line_end else self.progress
            return None
        content = os.pread(self._file, os.fstat(self._file).st_size, 0)
        self.close()
        return content

    def close(self) -> None:
        self.process.kill()
        self._opened.close()


def newest_in(path: Path) -> list[str]:
    files = [path] if not path.is_dir() else sorted(path.glob(f"*{SUFFIX}"), key=os.path.getmtime)
    return [str(file) for file in files[-1:]]


class ProcessJudge:
    """Judges in a process: `judged` is what that has found last, `progress` tells how far it is."""

    judged, progress = b"", ""
    _answer: AnswerOnItsWay | None = None

    @property
    def is_judging(self) -> bool:
        return self._answer is not None

    def go_on(self) -> None:
        if self._answer is not None:
            content, self.progress = self._answer.go_on(), self._answer.progress
            if content is not None:
                self.judged, self._answer = content, None

    def close(self) -> None:
        if self._answer is not None:
            self._answer.close()


class FilesJudge(ProcessJudge):
    """Judges captures and recordings: `files` gives their names when it is asked."""

    def __init__(
        self,
        files: Callable[[], Sequence[str]],
        plc: str | None = None,
        project: Path | None = None,
        looks_again: bool = False,
    ) -> None:
        self.begins_ns: int | None = None  # UTC of the run, where that is not the first packet's time
        self.looks_again = looks_again
        self._files, self._plc = files, plc
        self._project = None if project is None else str(project)

    def judge(self) -> None:
        if self._answer is None:
            self._answer = AnswerOnItsWay(JUDGE_FILES)
            asked = [*self._files()], self._plc, self._project, self.begins_ns, self.looks_again
            self._answer.process.put(json.dumps(asked).encode())
            self._answer.process.finish()
