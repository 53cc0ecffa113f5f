"""Who asks the doctor in a process beside, about a run or about files; `judged` is what that has found.

Rule: no scan waits for an answer; before it is there, `progress` tells how far the process is.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from trcvtui.recording.worker_process import AnswerOnItsWay

if TYPE_CHECKING:
    from trcvtui.recording.black_box import BlackBox

JUDGE_RUN: Final = ("doctor_mains", "run_main")
JUDGE_FILES: Final = ("doctor_mains", "files_main")


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


class RunJudge(ProcessJudge):
    """Judges what a black box keeps of a run that goes on."""

    looks_again = True

    def __init__(self, box: BlackBox) -> None:
        self.box = box

    def judge(self) -> None:
        if self._answer is None:
            self._answer = self.box.answer_of(JUDGE_RUN)


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
