"""M2: the paced engine at T#10ms with 256 x 64 KiB, each connection fed as fast as its block takes it.

A scan of 7006 stands before each DONE: the ceiling is one DONE in two scans per instance.
Blocks whose EN_R rises in one scan stay in step: every other scan receives all frames at once. In turn, half
of them in this scan and half in the next, is how partners that come at any time spread.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from benchmarks import full_t4
from benchmarks.figures import Effort, Figure, against, ratios, spread
from benchmarks.paced import Count, PacedEngine
from benchmarks.scans import Scans, overruns
from benchmarks.sender import sending
from benchmarks.throughput import one_scan

INSTANCES: Final = 256
MESSAGE: Final = 65536
INTERVAL_NS: Final = 10_000_000
SCANS_PER_DONE: Final = 2
LEAD_IN_S: Final = 1.0
# The kernel keeps twice as much, headers included: one to two messages wait at the sender, and the engine's
# recv() does not also transmit megabytes for it.
SENDER_BUFFER: Final = MESSAGE
LIMIT: Final = 0.6  # of an interval, above which the bare calls leave no room for a scan
PHASES: Final = {"in step": 1, "in turn": 2}  # in how many scans, one after the other, EN_R rises


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the share of the ceiling and the overruns; what a scan costs; 32 busy connections and a 33rd."""
    costs = one_scan(INSTANCES, MESSAGE, 2 * effort.pairs, SENDER_BUFFER)
    note = f"processor time {against(costs, 1, ' ms')}; SO_SNDBUF of the sender {SENDER_BUFFER}"
    case = f"scan that receives {INSTANCES} x {MESSAGE // 1024} KiB / bare recv_into"
    yield Figure.of(case, ratios(costs), note=note)
    bare_ms = spread([bare for _, bare in costs]).median
    for how, phases in PHASES.items():
        yield from _many(effort, how, phases, bare_ms / phases)
    yield from full_t4.measure(effort)


def _many(effort: Effort, how: str, phases: int, bare_ms: float) -> Iterator[Figure]:
    case, bare_share = f"{INSTANCES} x 64 KiB {how}", bare_ms * 1e6 / INTERVAL_NS
    with tempfile.TemporaryDirectory() as folder:
        with (
            PacedEngine(Path(folder), _project(), INSTANCES) as engine,
            sending(MESSAGE, engine.ports(INSTANCES), SENDER_BUFFER) as language,
        ):
            engine.count_after(LEAD_IN_S)
            _receive(engine, phases)
            counts = [engine.count_after(LEAD_IN_S)]
            for _ in range(effort.rounds):
                counts.append(engine.count_after(effort.window_s))
        scans = Scans.read(engine.timing, INTERVAL_NS).between(counts[0].at_ns, counts[-1].at_ns)
    windows = list(pairwise(counts))
    due = spread([_done(a, b) / _ceiling((b.t_ns - a.t_ns) / INTERVAL_NS) for a, b in windows])
    passed = spread([_done(a, b) / _ceiling(b.scans - a.scans) for a, b in windows])
    speed = spread([1000 * _done(a, b) * MESSAGE / (b.t_ns - a.t_ns) for a, b in windows])
    note = (
        f"bare recv_into calls {bare_share:.0%} of the interval; ceiling: one DONE in {SCANS_PER_DONE} due "
        f"scans; of scans that passed {passed.text(3)}; {speed.median:.0f} MB/s, sender in {language}"
    )
    at_limit = bare_share > LIMIT
    yield Figure.of(f"{case}: DONE / ceiling", due, 3, note=note, at_limit=at_limit)
    yield overruns(case, scans, at_limit)


def _receive(engine: PacedEngine, phases: int) -> None:
    """Raise EN_R of every second, every third ... instance in scans that follow each other."""
    engine.say("hold")
    for phase in range(phases):
        engine.say(*(f"set TRCV_C_{number} EN_R=1" for number in range(phase, INSTANCES, phases)))
        engine.let_pass(1)
    engine.say("go")


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
