"""Run scenario files inside the test process, as `trcvtui scenario` does."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.commands.words import SetLink
from trcvtui.files import record_reads
from trcvtui.plc.ledger import StatusEdge
from trcvtui.recording.journal import Entry, Keyframe
from trcvtui.recording.recorder import RunRecorder
from trcvtui.scenario.command import LivePace, RecordedPace
from trcvtui.scenario.report import JsonLines
from trcvtui.scenario.runner import Pace, ScenarioRunner, Verdict, VirtualPace
from trcvtui.scenario.scenario import load_scenario

CONFIGS = Path(__file__).parents[2] / "configs"
PASSIVE = CONFIGS / "passive.toml"
BAOSKY, SIEMENS, LEGACY, TWINCAT, SIM_ONLY, STORIES = (
    sorted((CONFIGS / "scenarios" / folder).glob("*.toml"))
    for folder in ("baosky", "siemens", "siemens-legacy", "twincat", "sim", "stories")
)
SCENARIOS = [*BAOSKY, *SIEMENS, *LEGACY, *SIM_ONLY, *STORIES, *TWINCAT]


@dataclass(frozen=True)
class Played:
    """What one run gave: the verdict, the jsonl text, each event of its ledger, its journal if it has one."""

    verdict: Verdict
    text: str
    events: tuple[object, ...]
    entries: tuple[Entry, ...] = ()

    @property
    def edges(self) -> list[StatusEdge]:
        return [event for event in self.events if isinstance(event, StatusEdge)]

    def reached(self) -> frozenset[tuple[str, int, bool]]:
        """Return (block, STATUS, whether a planned fault answered) for everything that showed."""
        return frozenset((edge.block, edge.outputs.status, edge.cause.injected) for edge in self.edges)

    def causes(self) -> dict[str, list[tuple[str, str]]]:
        """Return what each instance showed, in order, and the name of the cause of each edge."""
        seen: dict[str, list[tuple[str, str]]] = {}
        for edge in self.edges:
            seen.setdefault(edge.instance, []).append((f"{edge.outputs.status:04X}", edge.cause.name))
        return seen

    def records(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.text.splitlines()][:-1]


class Kept:
    """A sink that keeps the entries."""

    trouble = ""
    first_scan = 0

    def __init__(self) -> None:
        self.entries: list[Entry] = []

    def keyframe(self, frame: Keyframe) -> None:
        """Do nothing: the entries are enough."""

    def add_entries(self, entries: Iterable[Entry]) -> None:
        self.entries += entries

    def close(self) -> None:
        """Do nothing."""


class PatientPace:
    """Real time passes between the scans, and each scan is on time: a late machine makes no gap shorter.

    With the true clock, two chunks of a partner meet in one scan when that scan is late.
    """

    def next_scan(self, bench: Bench) -> None:
        """Sleep for one interval, then let one scan pass."""
        clock.sleep_until(clock.now_ns() + bench.runtime.interval_ns)
        bench.step()


def play(
    path: Path, kernel: str, *overrides: str, is_recorded: bool = False, calls_all: bool = False
) -> Played:
    """Run one scenario; every handle must be free afterwards. `overrides` are those of `--set`."""
    kept = Kept()
    recorder = RunRecorder(lambda: kept, waits=kernel == "sim") if is_recorded else None
    with record_reads(recorder.reads) if recorder is not None else nullcontext():
        scenario = load_scenario(path, overrides)
    with recorder or nullcontext():
        bench = Bench(scenario.project, kernel, recorder.seam if recorder is not None else None)
        bench.runtime.calls_all = calls_all
        out = io.StringIO()
        report = JsonLines(out.write, bench.runtime.interval_ns, bench)
        steps = *scenario.start, *scenario.steps
        pace: Pace = PatientPace() if kernel == "live" else VirtualPace()
        if kernel == "live" and any(isinstance(step.command, SetLink) for step in steps):
            pace = LivePace()  # the stack finds a cut wire by the clock: scans have its time, too
        if recorder is not None:
            recorder.add_header(bench, path, overrides, is_scenario=True)
            pace = RecordedPace(pace, recorder)
        verdict = ScenarioRunner(bench, scenario.name, pace, report.write_scan).play(steps)
        report.write_verdict(verdict)
        bench.close()
    events = tuple(line.event for line in bench.runtime.ledger)
    assert bench.leaks() == ()
    return Played(verdict, out.getvalue(), events, tuple(kept.entries))


@cache
def played(path: Path) -> Played:
    """Return the run of a scenario on the simulated network; it is played once for all tests of a worker."""
    return play(path, "sim", is_recorded=True)


def failures(verdict: Verdict) -> str:
    return "\n".join(f"step {f.step}: {f.line}\n    found {f.found}" for f in verdict.failures)
