"""`trcvtui record` records a bench without a screen, until a signal or the end of the duration."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.bench.conditions import holds
from trcvtui.commands import words
from trcvtui.commands.table import parse_line
from trcvtui.errors import mistake
from trcvtui.files import make_folder_or_undo, record_reads
from trcvtui.project.project import Project
from trcvtui.recording.files import FILE_SUFFIX, TRIGGER_WORD, EntrySink, FileLimits, FileSink, RecordTarget
from trcvtui.recording.recorder import make_recorder
from trcvtui.scenario.command import LivePace, RecordedPace
from trcvtui.scenario.runner import Pace, VirtualPace
from trcvtui.scenario.scenario import load_bench_project, read_start_steps
from trcvtui.udt.literals import parse_time
from trcvtui.wording import count, parse_size, size_text

NEVER: Final = 1 << 62
PROGRESS_NS: Final = 1_000_000_000
LEAST_SPLIT: Final = 1 << 16


def read_size(text: str | None, where: str) -> int:
    """Return the bytes of a size such as `32MiB`, or 0 for None; raise UserError."""
    if text is None:
        return 0
    size = parse_size(text) or 0
    if size < LEAST_SPLIT:
        raise mistake(where, f"'{text}'", "a size of 64KiB or more, such as 32MiB")
    return size


def read_limits(
    ring: str | None, split: str | None, on: str | None, before: str | None, after: str | None
) -> FileLimits:
    """Return the limits of these options; raise UserError if the options do not fit together."""
    if on is None and (before is not None or after is not None):
        raise mistake("--before, --after", "no --on", "--on: they are times before and after it")
    whole = read_size(ring, "--ring")
    part = read_size(split, "--split") or whole // 8
    if whole and whole < 2 * part:
        raise mistake("--ring", f"{whole} bytes", f"two files of {part} bytes or more")
    if on is None:
        return FileLimits(part, whole, -1, -1)
    before_ns, after_ns = parse_time(before or "T#30s", "--before"), parse_time(after or "T#10s", "--after")
    return FileLimits(part, whole, before_ns, after_ns)


def record(
    path: Path,
    out: Path,
    kernel: str,
    limits: FileLimits,
    on: str | None,
    duration: str | None,
    has_secrets: bool,
    follow: Callable[[FileSink, str], EntrySink],
    is_kept: bool = True,
) -> int:
    """Record until the duration is over or a signal comes. Return 1 if the disk refuses a write, else 0.

    If `is_kept` is False, the folder is temporary, so a report of an internal error is written elsewhere.
    """
    until = NEVER if duration is None else parse_time(duration, "--duration")
    target = RecordTarget(out, False, has_secrets, limits, follow)
    recorder = make_recorder(target, out / path.stem, waits=kernel == "sim")
    with ExitStack() as opened:
        opened.enter_context(make_folder_or_undo(out, "--out"))
        opened.enter_context(record_reads(recorder.reads))
        project = load_bench_project(path)
        condition = None if on is None else _parse_trigger(on, project)
        signals: list[int] = []  # signals to end: looked at after a scan, never in the middle of one
        for number in _ending_signals():
            before = signal.signal(number, lambda came, _: signals.append(came))
            opened.callback(signal.signal, number, before)
        opened.enter_context(recorder)
        bench = Bench(project, kernel, recorder.seam)
        opened.callback(bench.close)
        for step in read_start_steps(project):
            bench.do(step.command)
        recorder.add_header(bench, path, (), is_scenario=False)
        bench.reports = bench.reports if is_kept else None
        pace = RecordedPace(LivePace() if kernel == "live" else VirtualPace(), recorder)
        _run(bench, pace, until, lambda: bool(signals or recorder.trouble), condition, on or "", out)
    messages = bench.containment.take_messages()
    lines = recorder.list_remarks() if is_kept else [recorder.trouble] * bool(recorder.trouble)
    _write_stderr("".join(f"{line}\n" for line in (*[messages] * bool(messages), *lines)))
    return 1 if recorder.trouble else 0


def _ending_signals() -> list[signal.Signals]:
    ends = [signal.SIGTERM, signal.SIGINT]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as with nohup
        ends.append(signal.SIGHUP)
    return ends


def _parse_trigger(on: str, project: Project) -> words.Condition:
    command = parse_line(f"expect {on}", project, "--on")
    if not isinstance(command, words.Expect) or command.within_ns is not None:
        raise mistake("--on", f"'{on}'", "a condition such as TRCV_C_1 STATUS=80C5")
    return command.condition


def _run(
    bench: Bench,
    pace: Pace,
    until: int,
    is_over: Callable[[], bool],
    condition: words.Condition | None,
    on: str,
    out: Path,
) -> None:
    triggers, held, shown_at = 0, False, clock.now_ns()
    shows = sys.stderr.isatty()
    while bench.now < until and not is_over():
        pace.next_scan(bench)
        if condition is not None:
            holds_now = holds(bench, condition)
            if holds_now and not held:  # a rising edge: a condition that stays true is one trigger
                triggers += 1
                bench.record_line(f"{TRIGGER_WORD} {on}")
            held = holds_now
        if shows and clock.now_ns() > shown_at + PROGRESS_NS:
            shown_at = clock.now_ns()
            size = sum(each.stat().st_size for each in os.scandir(out) if each.name.endswith(FILE_SUFFIX))
            seconds = bench.now // clock.NS_PER_S
            elapsed = f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}"
            _write_stderr(f"\r{elapsed}  {size_text(size)}  {count(triggers, 'trigger')}  ")
    if shows:
        _write_stderr("\n")


def _write_stderr(text: str) -> None:
    with suppress(OSError):  # the recording continues if its terminal is closed
        sys.stderr.write(text)
        sys.stderr.flush()
