"""Who reads the ledger late, and a few lines at a time, tells what one tells who reads after each scan.

Where it was too late it says so: a value that is told is never another one.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from itertools import groupby
from operator import attrgetter, itemgetter

import pytest

from tests.history.waveform_runs import LINES, MENDED, RECEIVER, SENDER
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.commands.patterns import ANY_SCANS, ScanRun, TracePattern, matches, parse_pattern
from trcvtui.commands.table import parse_line
from trcvtui.engine.controller import Controller
from trcvtui.history import ledger_reader
from trcvtui.history.pin_waveform import Waveform
from trcvtui.history.records import HistoryRequest
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.plc.ledger import Ledger
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import EngineTiming

SCANS = 240
TRAFFIC = "peer P1 send random 8 seed=1", "peer P1 send random 3 seed=2", "pulse TSEND_C_1 REQ"
MORE = "mark", "delete TRCV_C_1", "create TRCV_C TRCV_C_1 connect=C1 data=rx"
ALL_BYTES = UpdateRequest(
    partial_of=(RECEIVER, SENDER),
    waves=((RECEIVER, 0), (SENDER, 0)),
    history=HistoryRequest("C1", 0, 8192),
)


def controller(kept: int = 20_000) -> Controller:
    """Return a controller of a simulated bench whose ledger keeps so many lines."""
    bench = Bench(load_project(CONFIGS / "duplex.toml"), "sim")
    Ledger.__init__(bench.runtime.ledger, kept)
    return Controller(bench)


def lines(draw: random.Random, every: float, also: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    for scan in range(SCANS):
        if scan % 80 < len(MENDED):
            yield MENDED[scan % 80], "set TRCV_C_1 CONT=1 EN_R=1", "set TSEND_C_1 CONT=1"
        elif draw.random() < every:
            yield (draw.choice(LINES + also),)
        else:
            yield ()


def prompt_and_late(
    seed: int, kept: int, every: float, also: tuple[str, ...] = ()
) -> tuple[Controller, Controller, dict[str, list[ScanRun]]]:
    """Return two controllers after the same run, read after each scan, and now and then; what was shown."""
    draw = random.Random(seed)
    prompt, late = controller(), controller(kept)
    shown: dict[str, list[ScanRun]] = {RECEIVER: [], SENDER: []}
    for given in lines(draw, every, also):
        for number, line in enumerate(given):
            prompt.handle_line(number, line)
            late.handle_line(number, line)
        for each in (prompt, late) if draw.random() < 0.6 else ():  # nobody is asked to read before these
            for line in TRAFFIC:
                command = parse_line(line, each.bench.project, "test")
                assert command is not None
                each.bench.do(command)
        prompt.scan()
        late.step()
        for edge in late.bench.runtime.due_edges:
            shown[edge.instance].append(((edge.outputs.status, edge.outputs.error), 1))
        if draw.random() < 0.3:
            late.catch_up(0)  # the time is up: one step
        if draw.random() < 0.03:
            late.catch_up()
    return prompt, late, {name: joined(runs) for name, runs in shown.items()}


def joined(runs: list[ScanRun]) -> list[ScanRun]:
    """Return equal scans that follow each other as one run."""
    return [(scan, sum(count for _, count in same)) for scan, same in groupby(runs, itemgetter(0))]


def told(of: Controller) -> BenchUpdate:
    return of.picture(ALL_BYTES, EngineTiming(), 0)


def waves(of: BenchUpdate) -> dict[str, Waveform]:
    found = {}
    for news in of.waves:
        found[news.instance] = Waveform(news.instance)
        found[news.instance].add_delta(news, 10_000_000)
    return found


@pytest.mark.parametrize("seed", range(8))
def test_who_reads_late_tells_the_same(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger_reader, "LINES_A_STEP", 1 + seed)
    prompt, late, _ = prompt_and_late(seed, 20_000, 0.1, MORE)
    expected, found = told(prompt), told(late)
    assert (found.waves, found.facts, found.history) == (expected.waves, expected.facts, expected.history)
    assert list(late.session.steps()) == list(prompt.session.steps())
    assert found.history is not None and found.history.jobs


@pytest.mark.parametrize("seed", range(8))
def test_what_the_ledger_has_overwritten_is_not_known_and_never_wrong(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ledger_reader, "LINES_A_STEP", 1 + seed)
    prompt, late, shown = prompt_and_late(seed, 24, 0.03)
    expected, found = told(prompt), told(late)
    for name, wave in waves(expected).items():
        for pin, lane in waves(found)[name].lanes.items():
            values = [(lane.value_at(scan), wave.lanes[pin].value_at(scan)) for scan in range(1, SCANS + 1)]
            assert all(value in (None, real) for value, real in values)
    assert expected.history is not None and found.history is not None
    real = {(j.instance, j.number, j.scan): j for j in expected.history.jobs}
    for job in filter(attrgetter("done"), found.history.jobs):
        known = real[job.instance, job.number, job.scan]
        assert job.size == known.size
        if job.is_kept:
            content = expected.history.content[known.position : known.stop]
            assert found.history.content[job.position : job.stop] == content
    for (_, facts), (_, known_facts) in zip(found.facts, expected.facts, strict=True):
        assert facts.job_offset in (None, known_facts.job_offset)
        assert facts.begins_in in (None, known_facts.begins_in)
        assert facts.up_since in (None, known_facts.up_since)
    for name, pattern in traces(late).items():
        assert matches(pattern, shown[name])
        assert ANY_SCANS in pattern.atoms, "something was overwritten"


def traces(of: Controller) -> dict[str, TracePattern]:
    told = [line.split(maxsplit=3) for line in of.session.steps() if " trace " in line]
    return {name: parse_pattern(pattern, "test") for _, name, _, pattern in told}
