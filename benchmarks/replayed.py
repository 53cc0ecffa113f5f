"""R3: a recording on the screen: how long opening takes, and going to a scan anywhere in what was seen.

And R2: how quickly a recording runs again, against the same scans on the simulated network.

A keyframe stands at each 2,000 scans however long the run is, so a part of an hour costs as the whole of it.
"""

from __future__ import annotations

import os
import random
import tempfile
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from pathlib import Path
from time import process_time
from typing import Final

from benchmarks.figures import Effort, Figure, against, alternate, ratios, spread
from trcvtui import clock
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.recording import Recording
from trcvtui.replay.command import find_difference
from trcvtui.replay.driver import WORK_SLICE_NS
from trcvtui.replay.follower import KeyframingSink
from trcvtui.replay.run_again import ReplayRun
from trcvtui.replay.time_line import ReplayNavigator
from trcvtui.scenario.command import run_files

SCANS: Final = 12_000  # and some more, until all are connected
INSTANCES: Final = 8
PLACES: Final = 12
PART: Final = """
[[data]]
name = "rx{n}"
type = "ARRAY[0..31] OF BYTE"
[[connect]]
name = "C{n}"
LocalAddress = "127.0.0.1"
[[instance]]
name = "X{n}"
block = "TRCV_C"
connect = "C{n}"
data = "rx{n}"
[[peer]]
name = "P{n}"
active = true
remote = "@C{n}"
"""
STEPS: Final = (
    "set X{n} CONT=1 EN_R=1\nrun 3",
    "peer P{n} connect",
    f"peer P{{n}} send random 32 seed={{n}} repeat={SCANS // 10} every=T#100ms",
)


def measure(_: Effort) -> Iterator[Figure]:
    """Yield what opening takes, and the longest way to one of several scans."""
    with tempfile.TemporaryDirectory() as folder:
        path = recorded(Path(folder))
        opened: list[ReplayNavigator] = []
        yield Figure.of("opening, s", spread([_cost(lambda: opened.append(_opened(path)))]))
        line = opened[0]
        seen = _cost(lambda: _work(line))
        draw = random.Random(3)
        ways = [_cost(lambda: _go(line, draw.randint(1, SCANS))) for _ in range(PLACES)]
        note = f"median {spread(ways).median:.2f}; {SCANS} scans read in {seen:.1f} s, beside the screen"
        yield Figure("to any scan that was seen, s: the longest", f"{max(ways):.2f}", max(ways), note=note)


def measure_speed(effort: Effort) -> Iterator[Figure]:
    """Yield the speed of a recording that runs again and is compared, against the run that nobody records."""
    with tempfile.TemporaryDirectory() as folder:
        path = recorded(Path(folder))

        def again() -> None:
            assert find_difference(ReplayRun(Recording(path).read_entries(), str(path))) == ""

        pairs = alternate(
            lambda: _cost(lambda: _run(Path(folder), None)), lambda: _cost(again), min(effort.pairs, 5)
        )
        note = f"{against(pairs, 2, ' s')} for {SCANS} scans of {INSTANCES} instances"
        yield Figure.of("replay / the simulated run, speed", ratios(pairs), note=note)


def recorded(folder: Path) -> Path:
    """Return a recording of instances that get ten frames a second each."""
    path = folder / "frames.pcapng"
    _run(folder, RecordTarget(path, follow=KeyframingSink))
    return path


def _run(folder: Path, record: RecordTarget | None) -> None:
    steps = (f"{step.format(n=n)}\n" for step in STEPS for n in range(INSTANCES))
    script = "".join(steps) + f"run {SCANS}"
    parts = "".join(PART.format(n=n) for n in range(INSTANCES))
    project = folder / "frames.toml"
    head = f'[scenario]\nname = "frames"\nsteps = """\n{script}\n"""\n'
    project.write_text(f'dialect = "baosky"\n{parts}{head}')
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        assert run_files([project], "sim", "text", None, (), record=record) == 0


def _opened(path: Path) -> ReplayNavigator:
    line = ReplayNavigator(Recording(path), str(path))
    while not line.controller.scans:
        line.advance(clock.now_ns() + WORK_SLICE_NS)
    line.make_picture(UpdateRequest())
    return line


def _work(line: ReplayNavigator) -> None:
    while line.advance(clock.now_ns() + WORK_SLICE_NS):
        pass


def _go(line: ReplayNavigator, scan: int) -> None:
    line.handle_line(1, f"at {scan}")
    _work(line)
    line.make_picture(UpdateRequest())
    assert line.controller.scans == scan


def _cost(act: Callable[[], None]) -> float:
    """Return the processor time of one call."""
    began = process_time()
    act()
    return process_time() - began
