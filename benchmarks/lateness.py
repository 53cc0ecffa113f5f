"""M4: how late the scans of the engine start beside the real screen, against cyclictest on the same machine.

The screen runs in a terminal of its own; windows in which the engine's scans are counted alternate with
windows of cyclictest, while everything goes on.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from benchmarks import wired
from benchmarks.figures import Effort, Figure
from benchmarks.paired import Spread, percentile, ratios, spread
from benchmarks.scans import Scans
from benchmarks.terminal import Terminal
from benchmarks.traffic import traffic
from trcvtui.rig.clock import now_ns
from trcvtui.rig.engine.engine import TIMING_FILE

INSTANCES: Final = 64
CONNECTIONS: Final = 32  # a T4 has no more: two instances share each CONNECT
RECEIVING: Final = 8
MESSAGE: Final = 256
LATEST_US: Final = 200_000  # the width of cyclictest's histogram
FIRST_PICTURE: Final = ("16#70",)
CYCLES: Final = ((10_000_000, "T#10ms", 0.0), (1_000_000, "T#1ms", 0.001))
AIM: Final = 2.0


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield lateness and overruns at 10 ms and at 1 ms."""
    for interval_ns, literal, most_overruns in CYCLES:
        try:
            yield from _cycle(interval_ns, literal, most_overruns, effort)
        except TimeoutError as failed:
            yield Figure(literal, "not measured", note=f"the screen did not open: {failed}")


def _cycle(interval_ns: int, literal: str, most_overruns: float, effort: Effort) -> Iterator[Figure]:
    latest = _cyclictest_command(interval_ns, effort.window_s)
    with (
        tempfile.TemporaryDirectory() as folder,
        traffic(CONNECTIONS, RECEIVING, MESSAGE, interval_ns) as ports,
    ):
        project, timing = Path(folder) / "bench.toml", Path(folder) / "timing.json"
        project.write_text(wired.project(literal, ports, INSTANCES, RECEIVING, MESSAGE))
        with Terminal(_screen(project), {TIMING_FILE: str(timing)}) as terminal:
            terminal.wait_for(FIRST_PICTURE)
            terminal.read_for(1.0)
            windows, references = [], []
            for _ in range(effort.rounds):
                began = now_ns()
                terminal.read_for(effort.window_s)
                windows.append((began, now_ns()))
                if latest is not None:
                    references.append(_cyclictest(terminal, latest))
            terminal.end("q")
        scans = Scans.read(timing, interval_ns)
    yield _lateness(literal, scans, windows, references, latest)
    yield _overruns(literal, scans, most_overruns)


def _screen(project: Path) -> list[str]:
    return [str(Path(sys.executable).with_name("trcvtui")), "run", str(project)]


def _lateness(
    literal: str,
    scans: Scans,
    windows: list[tuple[int, int]],
    references: list[float],
    command: list[str] | None,
) -> Figure:
    p99 = [scans.between(*window).late_us(0.99) for window in windows]
    p50 = [scans.between(*window).late_us(0.50) for window in windows]
    own = f"p99 {_us(spread(p99))}, p50 {_us(spread(p50))}, scheduling {scans.mode}"
    if command is None:
        return Figure(f"start lateness, {literal}", f"p99 {_us(spread(p99))}", note=f"{own}; {ABSENT}")
    share = ratios(list(zip(p99, references, strict=True)))
    note = f"{own}; cyclictest {_policy(command)} p99 {_us(spread(references))}"
    held = share.median <= AIM
    return Figure(f"p99 start lateness / cyclictest, {literal}", share.text(1), f"<= {AIM}", held, note)


def _overruns(literal: str, scans: Scans, most: float) -> Figure:
    count = len(scans.scans)
    share = scans.overruns / max(1, count)
    aim = f"<= {most:.1%}" if most else "0"
    note = f"{scans.blame()}; {count} scans from start to end; latest start {scans.latest_us:.0f} us"
    return Figure(f"overruns, {literal}", f"{scans.overruns} ({share:.2%})", aim, share <= most, note)


def _us(figures: Spread) -> str:
    return figures.text(0, " us")


# -- cyclictest -------------------------------------------------------------------------------------------

ABSENT: Final = "cyclictest is not installed: nothing to compare with"


def _cyclictest_command(interval_ns: int, seconds: int) -> list[str] | None:
    """Return the command for one window, SCHED_FIFO where that is allowed; None when it is not installed."""
    program = shutil.which("cyclictest")
    if program is None:
        return None
    common = [program, "-q", "-h", str(LATEST_US), "-i", str(interval_ns // 1000), "-D", str(seconds)]
    fifo = [*common, "-m", "-p", "80"]
    return fifo if _may_be_fifo() else [*common, "--policy=other"]


def _may_be_fifo() -> bool:
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:
        return False
    os.sched_setscheduler(0, *before)
    return True


def _policy(command: list[str]) -> str:
    return "SCHED_OTHER (SCHED_FIFO is not allowed here)" if "--policy=other" in command else "SCHED_FIFO"


def _cyclictest(terminal: Terminal, command: list[str]) -> float:
    """Run cyclictest for one window; return its p99 in us."""
    with tempfile.TemporaryFile() as output:
        with subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL) as process:
            terminal.read_until(process)
        output.seek(0)
        return p99_of_histogram(output.read().decode())


def p99_of_histogram(text: str) -> float:
    """Return the p99 in us of cyclictest's histogram: lines of `us count`, comments with #."""
    late: list[float] = []
    for line in text.splitlines():
        words = line.split()
        if len(words) == 2 and words[0].isdigit() and words[1].isdigit():
            late.extend([float(words[0])] * int(words[1]))
    return percentile(late, 0.99)
