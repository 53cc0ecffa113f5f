"""A scenario step by step for a screen: the state of each step, and which one is next.

Rule: the StepRunner is the same as in `trcvtui scenario`. If `wants_scan`, the caller lets a scan pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.commands import words
from trcvtui.errors import mistake
from trcvtui.scenario.scenario import START_STEP, Scenario, cut_text
from trcvtui.scenario.step_runner import StepRunner
from trcvtui.snapshots.scenario import (
    DONE,
    FAILED,
    HELD,
    NOW,
    TO_COME,
    PlayerSnapshot,
    SplitTestSnapshot,
    StepSnapshot,
)

MOST_STEPS: Final = 1000  # all of them are in each picture
MOST_RUNS: Final = 120  # of each instance's trace, in a picture
JUDGED_COMMANDS: Final = (words.Wait, words.Expect, words.ExpectTrace, words.TrySplits)


class Player:
    """One scenario on one bench. If `is_to_end`, the next step begins by itself after each step."""

    def __init__(self, path: str, scenario: Scenario, bench: Bench) -> None:
        self.is_to_end = False
        self._path = path
        self._scenario = scenario
        self._stage = StepRunner(bench)
        self._steps = (*scenario.start, *scenario.steps)
        self._snapshots = tuple([StepSnapshot(s.number, cut_text(s.line), TO_COME) for s in self._steps])
        self._current = 0
        self._under_way: Iterator[None] | None = None
        self._scans = 0  # that have passed in the running step
        self._wanted = 0  # further steps that the user wants
        while not self.is_finished and self._steps[self._current].number == START_STEP:
            self.request_step()

    @property
    def is_finished(self) -> bool:
        return self._current == len(self._steps) or self._stage.is_over

    def find_trial(self) -> SplitTestSnapshot | None:
        return self._stage.trial.snapshot() if self._stage.trial is not None else None

    @property
    def wants_scan(self) -> bool:
        return self._under_way is not None

    def request_step(self) -> None:
        """Begin the next step after the running step. A run to the end stops after the running step."""
        if not self.is_to_end and not self.is_finished:
            self._wanted += 1
        self.is_to_end = False
        if self._under_way is None:
            self._advance()

    def start_to_end(self) -> None:
        self.is_to_end, self._wanted = True, 0
        if self._under_way is None:
            self._advance()

    def handle_scan(self) -> None:
        """Observe the scan that has just passed, and continue the step that asked for it."""
        self._stage.note_scan()
        if self._under_way is not None:
            self._scans += 1
            self._advance()

    def _advance(self) -> None:
        while True:
            if self._under_way is None:
                if self.is_finished or not (self.is_to_end or self._wanted):
                    return
                self._wanted -= 1 if self._wanted else 0
                self._begin_step()
            for _ in self._under_way or ():
                return  # one scan has to pass
            self._end_step()

    def _begin_step(self) -> None:
        self._scans = 0
        self._under_way = self._stage.run_step(self._steps[self._current])
        self._set_state(NOW)

    def _end_step(self) -> None:
        self._under_way = None
        failure = self._stage.failure
        if failure is not None:
            self._set_state(FAILED, cut_text(failure.found))
        else:
            self._set_state(HELD if isinstance(self._steps[self._current].command, JUDGED_COMMANDS) else DONE)
        self._current += 1

    def _set_state(self, state: str, found: str = "") -> None:
        at, steps = self._current, self._snapshots
        self._snapshots = (*steps[:at], replace(steps[at], state=state, found=found), *steps[at + 1 :])

    def snapshot(self) -> PlayerSnapshot:
        return PlayerSnapshot(
            path=self._path,
            steps=self._snapshots,
            current=self._current,
            running=self.wants_scan,
            finished=self.is_finished,
            scans_of_step=self._scans,
            traces=tuple((name, trace.newest_text(MOST_RUNS)) for name, trace in self._stage.traces.items()),
        )


def refuse_too_many_steps(path: str, scenario: Scenario) -> None:
    count = len(scenario.start) + len(scenario.steps)
    if count > MOST_STEPS:
        expected = f"at most {MOST_STEPS} on the screen; `trcvtui scenario` runs them all"
        raise mistake(f"{path}: steps", f"{count} steps", expected)
