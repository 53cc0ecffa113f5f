"""M2: the paced engine at T#10ms with 256 x 64 KiB, each connection fed as fast as its block takes it.

A scan of 7006 stands before each DONE (design 6, row 5): the ceiling is one DONE in two scans per instance.
Blocks whose EN_R rises in one scan stay in step: every other scan receives all frames at once. In turn, half
of them in this scan and half in the next, is how partners that come at any time spread.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from benchmarks import full_t4, one_scan
from benchmarks.figures import Effort, Figure
from benchmarks.paced import Count, PacedEngine
from benchmarks.paired import spread
from benchmarks.scans import Scans, overruns
from benchmarks.sender import sending

INSTANCES: Final = 256
MESSAGE: Final = 65536
INTERVAL_NS: Final = 10_000_000
SCANS_PER_DONE: Final = 2
LEAD_IN_S: Final = 1.0
PHASES: Final = {"in step": 1, "in turn": 2}  # in how many scans, one behind the other, EN_R rises
AIM: Final = 0.99


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the share of the ceiling and the overruns; what a scan costs; 32 busy connections and a 33rd."""
    for how, phases in PHASES.items():
        yield from _many(effort, how, phases)
    yield from one_scan.measure(effort, INSTANCES, MESSAGE)
    yield from full_t4.measure(effort)


def _many(effort: Effort, how: str, phases: int) -> Iterator[Figure]:
    case = f"{INSTANCES} x 64 KiB {how}"
    with tempfile.TemporaryDirectory() as folder:
        with (
            PacedEngine(Path(folder), _project(), INSTANCES) as engine,
            sending(MESSAGE, engine.ports(INSTANCES)) as language,
        ):
            engine.count_after(LEAD_IN_S)
            _receive(engine, phases)
            counts = [engine.count_after(LEAD_IN_S)]
            for _ in range(effort.rounds):
                counts.append(engine.count_after(effort.window_s))
        scans = Scans.read(engine.timing, INTERVAL_NS).between(counts[0].at_ns, counts[-1].at_ns)
    yield _share(case, counts, language)
    yield overruns(case, scans)


def _receive(engine: PacedEngine, phases: int) -> None:
    """Raise EN_R of every second, every third ... instance in scans that follow each other."""
    engine.say("hold")
    for phase in range(phases):
        engine.say(*(f"set TRCV_C_{number} EN_R=1" for number in range(phase, INSTANCES, phases)))
        engine.let_pass(1)
    engine.say("go")


def _share(case: str, counts: list[Count], language: str) -> Figure:
    """Return DONE / the ceiling of all scans that were due: what an overrun skipped counts as missed."""
    windows = list(pairwise(counts))
    due = spread([_done(a, b) / _ceiling((b.t_ns - a.t_ns) / INTERVAL_NS) for a, b in windows])
    passed = spread([_done(a, b) / _ceiling(b.scans - a.scans) for a, b in windows])
    speed = spread([1000 * _done(a, b) * MESSAGE / (b.t_ns - a.t_ns) for a, b in windows])
    note = (
        f"ceiling: one DONE in {SCANS_PER_DONE} scans (row 5), of all scans that were due; "
        f"of those that passed {passed.text(3)}; {speed.median:.0f} MB/s, sender in {language}"
    )
    return Figure(f"{case}: DONE / ceiling", due.text(3), f">= {AIM}", due.median >= AIM, note)


def _ceiling(scans: float) -> float:
    return scans * INSTANCES / SCANS_PER_DONE


def _done(before: Count, after: Count) -> int:
    return after.done - before.done


def _project() -> str:
    """Return passive CONNECTs, each with a TRCV_C that waits for EN_R."""
    parts = [
        'dialect = "baosky"',
        f"[options]\nmax_len = {MESSAGE}\nbuffers = {INSTANCES}\nqueue = {INSTANCES}",
        '[[task]]\nname = "MAIN"\ninterval = "T#10ms"',
    ]
    for number in range(INSTANCES):
        parts.append(
            f'[[data]]\nname = "rx{number}"\ntype = "ARRAY[1..{MESSAGE}] OF BYTE"\n'
            f'[[connect]]\nname = "C{number}"\nLocalAddress = "127.0.0.1"\nLocalPort = 0\n'
            f'[[instance]]\nname = "TRCV_C_{number}"\nblock = "TRCV_C"\nconnect = "C{number}"\n'
            f'data = "rx{number}"\nCONT = true'
        )
    return "\n\n".join(parts) + "\n"
