"""The progress of a scenario, and of a split test."""

from __future__ import annotations

from msgspec import Struct

TO_COME, NOW, DONE, HELD, FAILED = "to come", "now", "done", "held", "failed"


class StepSnapshot(Struct, frozen=True):
    """One step of a scenario. Number 0 is a command of `start`. `found` is what a failed step found."""

    number: int
    line: str
    state: str
    found: str = ""


class PlayerSnapshot(Struct, frozen=True):
    """The progress of a scenario.

    `current` is the index of the step that runs or comes next. `scans_of_step` counts the scans of this
    step. `traces` has the newest part of each instance's STATUS trace.
    """

    path: str
    steps: tuple[StepSnapshot, ...]
    current: int
    running: bool
    finished: bool
    scans_of_step: int
    traces: tuple[tuple[str, str], ...]

    @property
    def failed_steps(self) -> tuple[StepSnapshot, ...]:
        return tuple(step for step in self.steps if step.state == FAILED)


class SplitRow(Struct, frozen=True):
    """The result of cuts after byte `first` to `last` (0: no cut). If `same`, frames are as without cut.

    `walk` is the STATUS walk in the notation of a trace, `lengths` the RCVD_LEN of each DONE.
    """

    first: int
    last: int
    walk: str
    done: int
    lengths: str
    data_equal: bool
    same: bool

    def span(self) -> str:
        if not self.last:
            return "whole"
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"


class SplitTestSnapshot(Struct, frozen=True):
    """The progress of `try-splits`; `state` is running, finished, cancelled or failed."""

    peer: str
    instance: str
    payload: bytes
    state: str
    problem: str
    runs: int
    differing: int
    rows: tuple[SplitRow, ...]

    def summary(self) -> str:
        splits = max(0, self.runs - 1)
        if self.problem:
            return f"{self.state}: {self.problem}"
        if self.state == "finished" and not self.differing:
            return f"all {splits} splits end as the whole message does"
        verdict = f"{self.differing} of {splits} splits differ from the whole message"
        return verdict if self.state == "finished" else f"{self.state}, {verdict} so far"
