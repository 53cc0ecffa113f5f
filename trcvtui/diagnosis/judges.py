"""The doctor in another process, asked about a run or about files.

Rule: no scan waits for an answer. Until the answer comes, `progress` says how far the judging is.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from trcvtui.recording.worker_process import PendingAnswer

if TYPE_CHECKING:
    from trcvtui.recording.black_box import BlackBox

JUDGE_ENTRY: Final = ("job_facts", "judge_main")
FileNames = Callable[[], Sequence[str]]


class ProcessJudge:
    """Judges in a process. `result_json` is the last DoctorSnapshot, `progress` how far the judging is."""

    result_json, progress, looks_again = b"", "", True
    _answer: PendingAnswer | None = None

    @property
    def is_judging(self) -> bool:
        return self._answer is not None

    def start_judging(self) -> None:
        if self._answer is None:
            blocks = self._blocks()  # raises UserError before a process begins
            self._answer = PendingAnswer(JUDGE_ENTRY)
            for block in blocks:
                self._answer.process.add_block(*block)
            self._answer.process.request_finish()

    def _blocks(self) -> list[tuple[bytes, int]]:
        raise NotImplementedError

    def poll_process(self) -> None:
        if self._answer is not None:
            content, self.progress = self._answer.advance(), self._answer.progress
            if content is not None:
                self.result_json, self._answer = content, None

    def close(self) -> None:
        if self._answer is not None:
            self._answer.close()


class RunJudge(ProcessJudge):
    """Judges what a black box keeps of the present run."""

    def __init__(self, box: BlackBox) -> None:
        self._box, box.close_judge = box, self.close

    def _blocks(self) -> list[tuple[bytes, int]]:
        return [(b"null", 0), *self._box.encode_blocks()]


class FilesJudge(ProcessJudge):
    """Judges captures and recordings. `files` returns their names at each start."""

    def __init__(
        self, files: FileNames, plc: str | None = None, project: Path | None = None, looks_again: bool = False
    ) -> None:
        self.begins_ns: int | None = None  # UTC of the run, where that is not the first packet's time
        self.looks_again = looks_again
        self._files, self._plc = files, plc
        self._project = None if project is None else str(project)

    def _blocks(self) -> list[tuple[bytes, int]]:
        asked = [*self._files()], self._plc, self._project, self.begins_ns, self.looks_again
        return [(json.dumps(asked).encode(), 0)]
