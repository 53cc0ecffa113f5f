"""Each vector V01 to V40 as a scenario file: the same lines that a person would write."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.blocks.framing_vectors import VECTORS, Vector
from tests.scenario.scenarios import failures
from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import FrameEnded, NoiseDropped
from trcvtui.cli.main import main
from trcvtui.scenario.runner import ScenarioRunner, VirtualPace
from trcvtui.scenario.scenario import load_scenario

MS = 1_000_000
OFTEN = ("V03", "V17", "V20", "V26")


def scenario_of(vector: Vector) -> str:
    """Return the file: a project of its own, then a line for each thing that arrives or is expected."""
    steps: list[str] = []
    before = -1
    for ms in range(0, vector.last_ms, vector.cycle):
        steps += [*_given(vector, before, ms), "run 1", *_expected(vector, ms)]
        before = ms
    steps.append(f"expect RD busy={int(vector.busy)}")
    return "\n".join([*_project(vector), "[scenario]", f'name = "{vector.id}"', "steps = '''", *steps, "'''"])


def _project(vector: Vector) -> list[str]:
    suffix = vector.suffix_at(0)
    lines = [
        'dialect = "twincat"',
        *("[[task]]", 'name = "MAIN"', f'interval = "T#{vector.cycle}ms"'),
        *("[[combuffer]]", 'name = "RX"'),
        *_data("rx", max(vector.size, 1)),
        *_data("pre", vector.len_prefix),
        *_data("suf", len(suffix)),
        *("[[instance]]", 'name = "RD"', 'block = "ReceiveData"', 'RxBuffer = "RX"'),
        f"SizeReceiveData = {vector.size}",
        f'Timeout = "T#{vector.timeout}ms"',
        f"LenPrefix = {vector.len_prefix}",
        f"LenSuffix = {len(suffix)}",
    ]
    lines += ['data = "rx"'] if vector.has_target else []
    lines += ['pPrefix = "pre"'] if vector.prefix else []
    return lines + (['pSuffix = "suf"'] if suffix else [])


def _data(name: str, size: int) -> list[str]:
    return ["[[data]]", f'name = "{name}"', f'type = "ARRAY[0..{max(size, 1) - 1}] OF BYTE"']


def _given(vector: Vector, before: int, ms: int) -> list[str]:
    lines = []
    if ms == 0 and vector.prefix:
        lines.append(f"write pre hex {vector.prefix.hex(' ')}")
    if vector.suffix_at(ms) and (ms == 0 or vector.suffix_at(ms) != vector.suffix_at(before)):
        lines.append(f"write suf hex {vector.suffix_at(ms).hex(' ')}")
    if vector.reset_at is not None:
        lines.append(f"set RD Reset={int(ms == vector.reset_at)}")
    arrived = vector.arrived(before, ms)
    return lines + ([f"feed RX hex {arrived.hex(' ')}"] if arrived else [])


def _expected(vector: Vector, ms: int) -> list[str]:
    call = next((call for call in vector.calls if call.ms == ms), None)
    if call is None:
        return ["expect RD DataReceived=0"]
    if not call.done:
        return [f"expect RD DataReceived=0 Error={call.error} busy=0"]
    size = f"RxTimeout={int(call.timeout)} LenReceiveData={len(call.data)}"
    return [
        f"expect RD DataReceived=1 Error={call.error} {size}",
        f"expect rx hex {call.data.hex(' ')}",
    ]


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: f"{v.id} {v.case}")
def test_a_vector_as_a_scenario_leaves_what_the_table_says(vector: Vector, tmp_path: Path) -> None:
    path = tmp_path / "vector.toml"
    path.write_text(scenario_of(vector), encoding="utf-8")
    scenario = load_scenario(path)
    bench = Bench(scenario.project, "sim")
    verdict = ScenarioRunner(bench, "x", VirtualPace(), lambda scan, outputs, sent: None).play(scenario.steps)
    assert verdict.has_passed, failures(verdict)
    frames = [line.t_ns // MS for line in bench.runtime.ledger if isinstance(line.event, FrameEnded)]
    noise = [e.size for line in bench.runtime.ledger if isinstance(e := line.event, NoiseDropped)]
    assert frames == [call.ms for call in vector.calls if call.done]
    assert bench.runtime.job_bytes("RD") == vector.part
    assert sum(noise) == vector.discarded
    assert bench.runtime.snapshot().combuffers[0].count == len(vector.left)
    bench.close()


def test_a_wrong_expectation_fails(tmp_path: Path) -> None:
    path = tmp_path / "vector.toml"
    for vector in VECTORS:
        if vector.id in OFTEN:
            wrong = scenario_of(vector).replace("LenReceiveData=2", "LenReceiveData=5")
            path.write_text(wrong.replace("LenReceiveData=4", "LenReceiveData=5"), encoding="utf-8")
            assert main(["scenario", str(path)]) == 1
