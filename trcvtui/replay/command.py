"""`trcvtui replay`: a recording run again, and compared or printed as the run was."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from trcvtui.errors import UserError, mistake
from trcvtui.recording.journal import HOLDS_SECRETS
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.run_again import ReplayRun, restored_state
from trcvtui.scenario.report import JsonLines
from trcvtui.scenario.runner import Runner, VirtualPace, deliveries

SAME: Final = 0
DIFFERS: Final = 1


def check(run: ReplayRun) -> str:
    """Run to the end; return what is different, "" where nothing is."""
    try:
        while run.scan():
            pass
        if not run.is_whole:
            raise run.differs()
    except UserError as told:
        return str(told)
    return ""


def print_jsonl(run: ReplayRun, write: Callable[[str], object]) -> bool:
    """Write what the run has printed, or would have; return whether all expectations held."""
    bench, scenario = run.bench, run.scenario
    report = JsonLines(write, bench.runtime.interval_ns, bench)
    if scenario is None or bench.runtime.scans:  # of one that begins in the middle the steps are gone
        while run.scan():
            if bench.runtime.changed:
                changed = bench.runtime.changed
                report.scan(bench.runtime.scans, changed, deliveries(bench, changed))
        if not run.is_whole:
            raise run.differs()
        return True
    verdict = Runner(bench, scenario.name, VirtualPace(), report.scan).play(
        (*scenario.start, *scenario.steps)
    )
    bench.close()
    run.replay.check_end()
    report.verdict(verdict)
    return verdict.passed


def what_if_file(
    path: Path, is_check: bool, form: str | None, sets: Sequence[str], dialect: str | None
) -> int:
    """Run a recording again beside itself with other parameters; return 0 whether they part or not.

    1: the file is not as it was written.
    """
    from trcvtui.recording.recording import Recording
    from trcvtui.replay.what_if import WhatIf, print_both

    if is_check:
        raise mistake("trcvtui replay", "--check with --set or --dialect", "one of them")
    recording = Recording(path)
    keyframes = Keyframes(recording, str(path))
    with restored_state(keyframes.first > 0, str(path)):
        run = WhatIf(keyframes, sets, dialect)
        if form is not None:
            print_both(run, sys.stdout.write)
        else:
            run.play()
            sys.stdout.writelines(f"{line}\n" for line in run.summary())
    damage = recording.find_damage()
    if damage or run.trouble:
        sys.stderr.write(f"{damage or run.trouble}\n")
    return DIFFERS if damage else SAME


def replay_file(path: Path, is_check: bool, form: str | None) -> int:
    """Run a recording again; return 0 the same, 1 it differs, or an expectation of it failed."""
    from trcvtui.recording.recording import Recording

    if not is_check and form is None:
        raise mistake("trcvtui replay", "no terminal, neither --check nor --format", "one of them")
    recording = Recording(path)
    keyframes = Keyframes(recording, str(path))
    try:
        run = keyframes.begin()
    except UserError as told:
        if not is_check or keyframes.first:
            raise
        sys.stdout.write(f"{told}\n")
        return DIFFERS
    if is_check:
        wrong = recording.find_damage() or check(run)
        scans = f"{run.bench.runtime.scans} scans"
        if keyframes.first:
            scans = f"scans {keyframes.first + 1} to {run.bench.runtime.scans}"
        sys.stdout.write(f"{wrong or f'{path}: {scans}, the same again'}\n")
        if recording.has_secrets:
            sys.stderr.write(f"{path} {HOLDS_SECRETS}\n")
        return DIFFERS if wrong else SAME
    try:
        with restored_state(run.is_restored, str(path)):
            result, wrong = SAME if print_jsonl(run, sys.stdout.write) else DIFFERS, ""
    except UserError as told:
        result, wrong = DIFFERS, str(told)
    if wrong := recording.find_damage() or wrong:
        sys.stderr.write(f"{wrong}\n")
    return DIFFERS if wrong else result
