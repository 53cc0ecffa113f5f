"""Sleeping instances are no visible matter: a PLC that calls them all writes the same history."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, rule, run_state_machine_as_test

from tests.properties.bench_machine import DOCUMENT, INSTANCES, BenchMachine
from trcvtui.plc.commands import BlinkInput
from trcvtui.plc.instance import Instance
from trcvtui.plc.project_file import read_project
from trcvtui.rig.assembly import Bench
from trcvtui.rig.bench import parse_line

EXAMPLES = 250
LEAST_SCANS = 20_000

TASKS = [
    {"name": "MAIN", "interval": "T#10ms", "priority": 2},
    {"name": "SLOW", "interval": "T#25ms", "priority": 1},
]
OTHERS = [
    {"name": "D", "block": "TRCV_C", "connect": "C2", "data": "rx_b", "task": "SLOW"},
    {"name": "E", "block": "TRCV_C", "connect": "C1", "data": "rx_a", "CONT": True},
]
SWITCHES = {
    "not_connected": st.sampled_from(("pulse", "hold", "never")),
    "second_client": st.sampled_from(("reject", "replace", "queue")),
}


class TwinMachine(BenchMachine):
    """Two benches with the same history; one calls every instance in each scan, the other lets them sleep."""

    @initialize(seed=st.integers(0, 3), fragment=st.booleans(), options=st.fixed_dictionaries(SWITCHES))
    def start(self, seed: int, fragment: bool, options: dict[str, str] | None = None) -> None:
        instances = DOCUMENT["instance"]
        assert isinstance(instances, list)
        document = DOCUMENT | {
            "sim": {"seed": seed, "fragment": fragment},
            "options": {"retry": "T#50ms", "attempt_limit": "T#200ms", "buffers": 2, **(options or {})},
            "task": TASKS,
            "instance": [*instances, *OTHERS],
        }
        self.bench, self.twin = (Bench(read_project(document, "twins", Path()), "sim") for _ in range(2))
        self.twin.runtime.calls_all = True
        self.seq = self.number = 0
        self.sent = {}

    def teardown(self) -> None:
        if hasattr(self, "twin"):
            self.twin.close()
        super().teardown()

    def do(self, line: str) -> str:
        answer = super().do(line)
        ours, self.bench = self.bench, self.twin
        assert super().do(line) == answer
        self.bench = ours
        return answer

    @rule(name=st.sampled_from(INSTANCES), pin=st.sampled_from(("EN_R", "CONT")))
    def blink(self, name: str, pin: str) -> None:
        for bench in (self.bench, self.twin):
            bench.runtime.submit(BlinkInput(name, pin))

    def check_scan(self) -> None:
        self.twin.step()
        ours, theirs = self.bench.runtime, self.twin.runtime
        assert ours.called == theirs.called
        assert ours.changed == theirs.changed
        assert ours.ledger.since(self.seq) == theirs.ledger.since(self.seq)
        assert ours.snapshot() == theirs.snapshot()
        self.seq = ours.ledger.last_seq


def test_letting_idle_instances_sleep_changes_no_scan() -> None:
    BenchMachine.scans = 0
    many = settings(
        max_examples=EXAMPLES,
        stateful_step_count=50,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    run_state_machine_as_test(TwinMachine, settings=many)
    assert BenchMachine.scans >= LEAST_SCANS


def test_an_idle_instance_is_not_called(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(read_project(DOCUMENT, "idle", Path()), "sim")
    for line in ("set A CONT=1", "set C CONT=1 EN_R=1"):  # A listens, B has no job, C receives
        assert say(bench, line) == ""
    called: list[str] = []
    scan = Instance.scan

    def counted(instance: Instance) -> bool:
        called.append(instance.name)
        return scan(instance)

    monkeypatch.setattr(Instance, "scan", counted)
    for _ in range(10):
        bench.step()
    assert [bench.runtime.outputs(name).status for name in INSTANCES] == [0x7002, 0x7000, 0x7006]
    called.clear()
    for _ in range(10):
        bench.step()
    assert called == []
    assert say(bench, "peer P2 send hex 01 02 03") == ""
    bench.step()
    assert called == ["C"]
    assert [out.instance for out in bench.runtime.called] == list(INSTANCES)


def say(bench: Bench, line: str) -> str:
    """Carry out one bench command; return what is wrong, or ""."""
    command = parse_line(line, bench.project, "test")
    assert command is not None
    return bench.do(command)
