"""M4: how late the scans of the engine start beside the real screen, against cyclictest.

The screen runs in a terminal of its own; windows in which the engine's scans are counted alternate with
windows of cyclictest under each policy, while everything goes on. Where cyclictest is not installed, a C
program of the same semantics takes its place.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, percentile, ratios, spread
from benchmarks.scans import Scans
from benchmarks.sender import compiled
from benchmarks.terminal import TRCVTUI, Terminal
from benchmarks.traffic import project, traffic
from trcvtui.clock import now_ns
from trcvtui.engine.engine import TIMING_FILE

INSTANCES: Final = 64
CONNECTIONS: Final = 32  # a T4 has no more: two instances share each CONNECT
RECEIVING: Final = 8
MESSAGE: Final = 256
LATEST_US: Final = 200_000  # the width of cyclictest's histogram
FIRST_PICTURE: Final = ("16#70",)
CYCLES: Final = ((10_000_000, "T#10ms"), (1_000_000, "T#1ms"))
POLICIES: Final = {"SCHED_OTHER": ["--policy=other"], "SCHED_FIFO": ["-m", "-p", "80"]}


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield lateness and overruns at 10 ms and at 1 ms."""
    with tempfile.TemporaryDirectory() as folder:
        installed = shutil.which("cyclictest")
        program = Path(installed) if installed else compiled("cyclic.c", Path(folder))
        for interval_ns, literal in CYCLES:
            try:
                yield from _cycle(interval_ns, literal, program, Path(folder), effort)
            except TimeoutError as failed:
                yield Figure.missing(f"start lateness, {literal}", f"the screen did not open: {failed}")


def _cycle(
    interval_ns: int, literal: str, program: Path | None, folder: Path, effort: Effort
) -> Iterator[Figure]:
    file, timing = folder / "bench.toml", folder / "timing.json"
    windows: list[tuple[int, int]] = []
    peers: dict[str, list[float]] = {policy: [] for policy in POLICIES}
    with traffic(CONNECTIONS, RECEIVING, MESSAGE, interval_ns) as ports:
        file.write_text(project(literal, ports, INSTANCES, RECEIVING, MESSAGE))
        with Terminal([str(TRCVTUI), "run", str(file)], {TIMING_FILE: str(timing)}) as terminal:
            terminal.wait_for(FIRST_PICTURE)
            terminal.read_for(1.0)
            for _ in range(effort.rounds):
                began = now_ns()
                terminal.read_for(effort.window_s)
                windows.append((began, now_ns()))
                for policy, asked in POLICIES.items():
                    command = [str(program), "-q", "-h", str(LATEST_US), *asked]
                    command += ["-i", str(interval_ns // 1000), "-D", str(effort.window_s)]
                    if program is not None and (late := _p99(terminal, command)) is not None:
                        peers[policy].append(late)
            terminal.end("q")
        every = Scans.read(timing, interval_ns)
    in_windows = [every.between(*window) for window in windows]
    ours = [scans.late_us(0.99) for scans in in_windows]
    p50 = spread([scans.late_us(0.50) for scans in in_windows])
    words = f"p99 {spread(ours).text(0, ' us')}, p50 {p50.text(0, ' us')}, scheduling {every.mode}"
    yield from _compared(literal, ours, peers, words, program)
    yield from _late(literal, every.between(windows[0][0], windows[-1][1]))


def _compared(
    literal: str, ours: Sequence[float], peers: dict[str, list[float]], words: str, program: Path | None
) -> Iterator[Figure]:
    for policy, theirs in peers.items():
        case = f"p99 start lateness / cyclictest {policy}, {literal}"
        if len(theirs) == len(ours):
            note = f"{words}; {program.name if program else ''} {spread(theirs).text(0, ' us')}"
            yield Figure.of(case, ratios(list(zip(ours, theirs, strict=True))), 1, note=note)
        else:
            why = "cyclictest missing, and no C compiler" if program is None else f"{policy} is not allowed"
            yield Figure.missing(case, f"{why}; {words}")


def _late(literal: str, scans: Scans) -> Iterator[Figure]:
    count = max(1, len(scans.scans))
    share = 100 * scans.overruns / count
    note = f"{scans.blame()}; of {count} scans; latest start {scans.latest_us:.0f} us"
    yield Figure(f"overruns, {literal}", f"{scans.overruns} ({share:.2f} %)", share, note)
    late = scans.late_after_work
    value = f"{late} ({100 * late / count:.2f} %)"
    note = "the engine was still busy with the screen"
    yield Figure(f"scans late because of a picture, {literal}", value, late, note)


def _p99(terminal: Terminal, command: Sequence[str]) -> float | None:
    """Run cyclictest for one window; return its p99 in us, None where it may not run so."""
    with tempfile.TemporaryFile() as output:
        with subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL) as process:
            terminal.read_until(process)
        output.seek(0)
        return p99_of_histogram(output.read().decode()) if process.returncode == 0 else None


def p99_of_histogram(text: str) -> float:
    """Return the p99 in us of cyclictest's histogram: lines of `us count`, comments with #."""
    late: list[float] = []
    for line in text.splitlines():
        words = line.split()
        if len(words) == 2 and words[0].isdigit() and words[1].isdigit():
            late.extend([float(words[0])] * int(words[1]))
    return percentile(late, 0.99)
