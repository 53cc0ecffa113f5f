"""`trcvtui replay`: a recording run again, and compared or printed as the run was."""

from __future__ import annotations

from collections.abc import Callable

from trcvtui.errors import UserError
from trcvtui.rig.replay.run_again import RunAgain
from trcvtui.rig.scenario.report import JsonLines
from trcvtui.rig.scenario.runner import Runner, VirtualPace, deliveries


def check(run: RunAgain) -> str:
    """Run to the end; return what is different, "" where nothing is."""
    try:
        while run.scan():
            pass
        if not run.is_whole:
            raise run.differs()
    except UserError as told:
        return str(told)
    return ""


def print_jsonl(run: RunAgain, write: Callable[[str], object]) -> bool:
    """Write what the run has printed, or would have; return whether all expectations held."""
    bench, scenario = run.bench, run.scenario
    report = JsonLines(write, bench.runtime.interval_ns)
    if scenario is None:
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
    run.replay.end()
    report.verdict(verdict)
    return verdict.passed
