"""`trcvtui scenario` runs files one after the other, and reports their results."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from trcvtui import clock
from trcvtui.bench.bench import Bench, enter_own_network
from trcvtui.commands.words import AskDoctor
from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead, record_reads, refuse_overwriting_input, replace_file
from trcvtui.scenario.report import FORMATS, Report
from trcvtui.scenario.runner import Pace, ScenarioRunner, VirtualPace
from trcvtui.scenario.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from trcvtui.bench.doctor_requests import Judge
    from trcvtui.recording.files import RecordTarget
    from trcvtui.recording.recorder import RunRecorder


class LivePace:
    """Scans at the pace of the monotonic clock."""

    def __init__(self) -> None:
        self._start = clock.now_ns()
        self._deadline = self._start

    def next_scan(self, bench: Bench) -> None:
        clock.sleep_until(self._deadline)
        now = clock.now_ns()
        bench.step(now - self._start)
        interval = bench.runtime.interval_ns
        self._deadline += interval
        if self._deadline < now:  # too late: skip the missed scans, do not hurry after them
            self._deadline = now + interval


class RecordedPace:
    """Scans at the pace of `inner`, and records each scan."""

    def __init__(self, inner: Pace, recorder: RunRecorder) -> None:
        self._inner, self._recorder = inner, recorder

    def next_scan(self, bench: Bench) -> None:
        self._inner.next_scan(bench)
        self._recorder.finish_scan(bench)


EXIT_HELD, EXIT_FAILED, EXIT_WRONG_FILE = 0, 1, 2


def run_files(
    paths: Sequence[Path],
    kernel: str,
    form: str,
    out: Path | None,
    overrides: Sequence[str],
    netns: bool = False,
    record: RecordTarget | None = None,
    dialects: Sequence[str] = (),
) -> int:
    """Run scenario files. Return the worst result: 0 all held, 1 an expectation failed, 2 a file is wrong.

    With `netns` each file runs in a new network of this process. With `dialects` it runs in each dialect.
    """
    if dialects and record is not None:
        raise mistake("--record", "--dialect beside it", "one of the two")
    if netns:
        enter_own_network(kernel)
    run = partial(_run_all, paths, kernel, form, overrides, record, dialects)
    if out is None:
        return run(sys.stdout.write, lambda: None)
    where = f"--out {out}"
    refuse_overwriting_input(out, where, paths)
    with replace_file(out, where) as file:
        return run(lambda text: file.write(text.encode()), partial(refuse_overwriting_input, out, where))


def _run_all(
    paths: Sequence[Path],
    kernel: str,
    form: str,
    overrides: Sequence[str],
    record: RecordTarget | None,
    dialects: Sequence[str],
    write: Callable[[str], object],
    loaded: Callable[[], None],
) -> int:
    report = _make_report(form, dialects, write)
    worst = EXIT_HELD
    files = record.make_paths(paths) if record is not None else ()
    for number, path in enumerate(paths):
        recorder, reads = None, FilesRead()
        if record is not None:
            from trcvtui.recording.recorder import make_recorder

            recorder = make_recorder(record, files[number], waits=kernel == "sim")
        try:
            with record_reads(recorder.reads if recorder is not None else reads):
                scenario = load_scenario(path, overrides)
                each = _list_scenarios(dialects, scenario, path)
        except UserError as error:
            worst = _report_error(report, path, error)
            continue
        loaded()  # raises if this file is the target; ends the call, as later files cannot make that right
        try:
            judge = None
            if any(isinstance(step.command, AskDoctor) for step in (*scenario.start, *scenario.steps)):
                from trcvtui.diagnosis.judges import RunJudge
                from trcvtui.recording.recorder import attach_black_box

                recorder, box = attach_black_box(recorder, reads)
                judge = RunJudge(box)
            for one in each:
                held = _run_one(path, one, kernel, report, overrides, recorder, judge)
                worst = max(worst, EXIT_HELD if held else EXIT_FAILED)
        except UserError as error:
            worst = _report_error(report, path, error)
    report.end()
    return worst


def _make_report(form: str, dialects: Sequence[str], write: Callable[[str], object]) -> Report:
    if not dialects:
        return FORMATS[form](write)
    from trcvtui.scenario.dialects import DialectReport  # here: without --dialect the start is faster

    return DialectReport(write, form, len(dialects))


def _list_scenarios(dialects: Sequence[str], scenario: Scenario, path: Path) -> Sequence[Scenario]:
    if not dialects:
        return (scenario,)
    from trcvtui.scenario.dialects import convert_scenario

    return convert_scenario(dialects, scenario, path)


def _report_error(report: Report, path: Path, error: UserError) -> int:
    report.write_error(path, error)
    sys.stderr.write("".join(line + "\n" for line in error.lines()))
    return EXIT_WRONG_FILE


def _run_one(
    path: Path,
    scenario: Scenario,
    kernel: str,
    report: Report,
    overrides: Sequence[str],
    recorder: RunRecorder | None,
    judge: Judge | None,
) -> bool:
    if kernel == "live":
        from trcvtui.net.os.network import has_own_network

        if has_own_network():
            enter_own_network(kernel, scenario.project.sim)
    with recorder or nullcontext():  # first: if its file is refused, no bench is started
        bench = Bench(scenario.project, kernel, recorder.seam if recorder is not None else None)
        report.begin_file(path, scenario, bench)
        pace: Pace = LivePace() if kernel == "live" else VirtualPace()
        if recorder is not None:
            recorder.add_header(bench, path, overrides, is_scenario=True)
            pace = RecordedPace(pace, recorder)
        try:
            runner = ScenarioRunner(bench, scenario.name, pace, report.write_scan, judge)
            verdict = runner.play((*scenario.start, *scenario.steps))
        finally:
            bench.close()
    for line in recorder.list_remarks() if recorder is not None else ():
        sys.stderr.write(f"{line}\n")
    report.write_verdict(verdict)
    return verdict.has_passed
