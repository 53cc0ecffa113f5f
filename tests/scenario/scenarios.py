"""Run scenario files inside the test process, as `trcvtui scenario` does."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.commands.words import Link
from trcvtui.plc.ledger import StatusEdge
from trcvtui.scenario.command import LivePace
from trcvtui.scenario.report import JsonLines
from trcvtui.scenario.runner import Pace, Runner, Verdict, VirtualPace
from trcvtui.scenario.scenario import load_scenario

CONFIGS = Path(__file__).parents[2] / "configs"
BAOSKY = sorted((CONFIGS / "scenarios" / "baosky").glob("*.toml"))
SIEMENS = sorted((CONFIGS / "scenarios" / "siemens").glob("*.toml"))
LEGACY = sorted((CONFIGS / "scenarios" / "siemens-legacy").glob("*.toml"))
TWINCAT = sorted((CONFIGS / "scenarios" / "twincat").glob("*.toml"))
SIM_ONLY = sorted((CONFIGS / "scenarios" / "sim").glob("*.toml"))


@dataclass(frozen=True)
class Played:
    """What one run gave: the verdict, the jsonl text, the ledger's words."""

    verdict: Verdict
    text: str
    edges: tuple[StatusEdge, ...]

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
        """Return the jsonl records without the scenario's own line."""
        return [json.loads(line) for line in self.text.splitlines()][:-1]


class PatientPace:
    """Real time passes between the scans, and each scan is on time: a late machine makes no gap shorter.

    With the true clock, two chunks of a partner meet in one scan when that scan is late.
    """

    def next_scan(self, bench: Bench) -> None:
        """Sleep for one interval, then let one scan pass."""
        clock.sleep_until(clock.now_ns() + bench.runtime.interval_ns)
        bench.step()


def play(path: Path, kernel: str, *overrides: str) -> Played:
    """Run one scenario; every handle must be free afterwards. `overrides` are those of `--set`."""
    scenario = load_scenario(path, overrides)
    bench = Bench(scenario.project, kernel)
    out = io.StringIO()
    report = JsonLines(out.write, bench.runtime.interval_ns, bench)
    steps = *scenario.start, *scenario.steps
    pace: Pace = PatientPace() if kernel == "live" else VirtualPace()
    if kernel == "live" and any(isinstance(step.command, Link) for step in steps):
        pace = LivePace()  # the stack finds a cut wire by the clock: scans have its time, too
    verdict = Runner(bench, scenario.name, pace, report.scan).play(steps)
    report.verdict(verdict)
    edges = tuple(line.event for line in bench.runtime.ledger if isinstance(line.event, StatusEdge))
    bench.close()
    assert bench.leaks() == ()
    return Played(verdict, out.getvalue(), edges)


def failures(verdict: Verdict) -> str:
    """Return what failed, one line each."""
    return "\n".join(f"step {f.step}: {f.line}\n    found {f.found}" for f in verdict.failures)
