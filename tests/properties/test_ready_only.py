"""Sleeping instances are no visible matter: a PLC that calls them all writes the same history."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

import pytest

from tests.properties.drawn_projects import Document
from tests.properties.shared_machine import SharedMachine, run_machine
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line
from trcvtui.plc.instance import Instance
from trcvtui.project.file import read_project

# How many scans they make depends on the modules that are loaded: Hypothesis draws their constants.
EXAMPLES = 250 if "TRCVTUI_SOAK" in os.environ else 24
LEAST_SCANS = 5_000
IDLE = """
dialect = "baosky"
options = { retry = "T#50ms" }
data = [{ name = "rx", type = "ARRAY[1..64] OF BYTE" }]
instance = [
    { name = "A", block = "TRCV_C", connect = "C1", data = "rx" },
    { name = "B", block = "TRCV_C", connect = "C1", data = "rx" },
    { name = "C", block = "TRCV_C", connect = "C2", data = "rx" },
]
peer = [{ name = "P2", active = false }]
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
[[connect]]
name = "C2"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "127.0.0.1"
RemotePort = "@P2"
"""


class TwinMachine(SharedMachine):
    """Two benches with the same history; one calls every instance in each scan, the other lets them sleep."""

    def begin(self, document: Document) -> None:
        super().begin(document)
        self.twin = Bench(read_project(document, "twin", Path()), "sim")
        self.twin.runtime.calls_all = True

    def teardown(self) -> None:
        super().teardown()
        if hasattr(self, "twin"):
            self.twin.close()
            assert self.twin.leaks() == ()

    def do(self, line: str) -> str:
        answer = super().do(line)
        assert say(self.twin, line) == answer
        return answer

    def check_scan(self) -> None:
        self.twin.step()
        ours, theirs = self.bench.runtime, self.twin.runtime
        assert ours.due_edges == theirs.due_edges
        assert ours.changed == theirs.changed
        assert ours.ledger.lines_since(self.seq) == theirs.ledger.lines_since(self.seq)
        self.picture = ours.snapshot()
        assert self.picture == theirs.snapshot()
        self.seq = ours.ledger.last_seq


@pytest.mark.timeout(300)  # of processor time it takes a tenth
def test_letting_idle_instances_sleep_changes_no_scan() -> None:
    run_machine(TwinMachine, EXAMPLES)
    assert SharedMachine.scans >= LEAST_SCANS


def test_an_idle_instance_is_not_called(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(read_project(tomllib.loads(IDLE), "idle", Path()), "sim")
    for line in ("set A CONT=1", "set C CONT=1 EN_R=1"):  # A listens, B has no job, C receives
        assert say(bench, line) == ""
    called: list[str] = []
    scan = Instance.call_block

    def counted(instance: Instance) -> bool:
        called.append(instance.name)
        return scan(instance)

    monkeypatch.setattr(Instance, "call_block", counted)
    for _ in range(10):
        bench.step()
    assert [bench.runtime.outputs(name).status for name in "ABC"] == [0x7002, 0x7000, 0x7006]
    called.clear()
    for _ in range(10):
        bench.step()
    assert called == []
    assert say(bench, "peer P2 send hex 01 02 03") == ""
    bench.step()
    assert called == ["C"]
    assert [out.instance for out in bench.runtime.due_edges] == list("ABC")


def say(bench: Bench, line: str) -> str:
    """Carry out one bench command; return what is wrong, or ""."""
    command = parse_line(line, bench.project, "test")
    assert command is not None
    return bench.do(command)
