"""`trcvtui replay` runs a recording again, and compares both runs or prints what the first run printed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from trcvtui.errors import UserError, mistake
from trcvtui.recording.journal import SECRETS_WARNING
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.run_again import ReplayRun, guard_restored
from trcvtui.scenario.report import JsonLines
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace, count_sent_bytes

EXIT_SAME: Final = 0
EXIT_DIFFERS: Final = 1


def find_difference(run: ReplayRun) -> str:
    """Run to the end. Return a text on the first difference from the recording, or an empty text."""
    try:
        while run.scan():
            pass
        if not run.is_whole:
            raise run.make_end_error()
    except UserError as wrong:
        return str(wrong)
    return ""


def replay_to_jsonl(run: ReplayRun, write: Callable[[str], object]) -> bool:
    """Write the lines that the run printed, or would have printed. Return whether all expectations held."""
    bench, scenario = run.bench, run.scenario
    report = JsonLines(write, bench.runtime.interval_ns, bench)
    if scenario is None or bench.runtime.scans:  # in the middle of a run, nothing says which step is next
        while run.scan():
            if bench.runtime.changed:
                changed = bench.runtime.changed
                report.write_scan(bench.runtime.scans, changed, count_sent_bytes(bench, changed))
        if not run.is_whole:
            raise run.make_end_error()
        return True
    verdict = ScenarioRunner(bench, scenario.name, VirtualPace(), report.write_scan).play(
        (*scenario.start, *scenario.steps)
    )
    bench.close()
    run.replay.check_end()
    report.write_verdict(verdict)
    return verdict.has_passed


def run_what_if(
    path: Path, is_check: bool, form: str | None, sets: Sequence[str], dialect: str | None
) -> int:
    """Run a recording unchanged and with other parameters. Return 1 if the file is damaged, else 0."""
    from trcvtui.recording.recording import Recording
    from trcvtui.replay.what_if import WhatIf, print_both_runs

    if is_check:
        raise mistake("trcvtui replay", "--check with --set or --dialect", "--check alone, or no --check")
    recording = Recording(path)
    keyframes = Keyframes(recording, str(path))
    with guard_restored(keyframes.first > 0, str(path)):
        run = WhatIf(keyframes, sets, dialect)
        if form is not None:
            print_both_runs(run, sys.stdout.write)
        else:
            run.run_to_end()
            sys.stdout.writelines(f"{line}\n" for line in run.describe())
    damage = recording.find_damage()
    if damage or run.trouble:
        sys.stderr.write(f"{damage or run.trouble}\n")
    return EXIT_DIFFERS if damage else EXIT_SAME


def replay_file(path: Path, is_check: bool, form: str | None) -> int:
    """Run a recording again. Return 0 if the run is the same, 1 if it differs or its scenario failed."""
    from trcvtui.recording.recording import Recording

    if not is_check and form is None:
        raise mistake("trcvtui replay", "neither a terminal nor --check nor --format", "one of the three")
    recording = Recording(path)
    keyframes = Keyframes(recording, str(path))
    try:
        run = keyframes.start_run()
    except UserError as failed:
        if not is_check or keyframes.first:
            raise
        sys.stdout.write(f"{failed}\n")
        return EXIT_DIFFERS
    if is_check:
        wrong = recording.find_damage() or find_difference(run)
        scans = f"{run.bench.runtime.scans} scans"
        if keyframes.first:
            scans = f"scans {keyframes.first + 1} to {run.bench.runtime.scans}"
        sys.stdout.write(f"{wrong or f'{path}: {scans}, the same again'}\n")
        if recording.has_secrets:
            sys.stderr.write(f"{path} {SECRETS_WARNING}\n")
        return EXIT_DIFFERS if wrong else EXIT_SAME
    try:
        with guard_restored(run.is_restored, str(path)):
            result, wrong = EXIT_SAME if replay_to_jsonl(run, sys.stdout.write) else EXIT_DIFFERS, ""
    except UserError as failed:
        result, wrong = EXIT_DIFFERS, str(failed)
    if wrong := recording.find_damage() or wrong:
        sys.stderr.write(f"{wrong}\n")
    return EXIT_DIFFERS if wrong else result
