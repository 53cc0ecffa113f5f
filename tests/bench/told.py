"""A bench on the simulated network, and what is told of its instances: now, or of an edge of the past."""

from __future__ import annotations

import tomllib
from pathlib import Path

from tests.local_driver import LocalDriver
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import Condition
from trcvtui.diagnosis.advice import Advice, make_advice
from trcvtui.diagnosis.evidence import Evidence, make_current_evidence, make_past_evidence
from trcvtui.history.link_statistics import past_facts
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.project.file import read_project

BENCH = """
dialect = "baosky"
[sim]
addresses = ["10.0.0.1", "10.0.0.9"]
[[data]]
name = "rx"
type = "ARRAY[0..95] OF BYTE"
[[data]]
name = "big"
type = "ARRAY[0..65534] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "10.0.0.1"
[[connect]]
name = "C2"
ActiveEstablished = true
LocalAddress = "10.0.0.1"
RemoteAddress = "10.0.0.9"
RemotePort = "@P2"
[[connect]]
name = "C3"
LocalAddress = "10.0.0.1"
RemoteAddress = "10.0.0.7"
[[connect]]
name = "C4"
ActiveEstablished = true
LocalAddress = "10.0.0.1"
RemoteAddress = "10.0.0.50"
RemotePort = 2000
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[instance]]
name = "X2"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[instance]]
name = "Y"
block = "TRCV_C"
connect = "C2"
data = "rx"
[[instance]]
name = "Z"
block = "TRCV_C"
connect = "C3"
data = "rx"
[[instance]]
name = "V"
block = "TRCV_C"
connect = "C4"
data = "rx"
[[instance]]
name = "S"
block = "TSEND_C"
connect = "C1"
data = "big"
[[instance]]
name = "OPEN"
block = "TRCV_C"
connect = "C1"
[[peer]]
name = "P1"
active = true
remote = "@C1"
[[peer]]
name = "P2"
active = false
local = "10.0.0.9:0"
[[peer]]
name = "P3"
active = true
remote = "@C3"
[[peer]]
name = "P4"
active = true
remote = "@C1"
[[udp_config]]
name = "U1"
LocalAddress = "10.0.0.1"
[[addr]]
name = "A1"
[[instance]]
name = "U"
block = "URECV_C"
config = "U1"
data = "rx"
addr = "A1"
[[peer]]
name = "P5"
udp = true
local = "10.0.0.9:0"
remote = "@U1"
"""
UP = ("set X CONT=1 EN_R=1", "run 4", "peer P1 connect", "run 4")


class Told:
    """A bench on the simulated network, and what is told of its instances."""

    def __init__(self, *lines: str, options: str = "") -> None:
        project = read_project(tomllib.loads(f"{BENCH}[options]\n{options}"), "b.toml", Path("."))
        self.driver = LocalDriver(Bench(project, "sim"))
        self.lines: list[Line] = []
        self.do(*lines)

    def do(self, *lines: str) -> None:
        """Carry out bench commands; `run` lets scans pass."""
        self.driver.play(*lines)

    def picture(self, instance: str, most_lines: int = 20_000) -> BenchUpdate:
        since = self.lines[-1].seq if self.lines else 0
        picture = self.driver.shown(UpdateRequest(since, (), (instance,), most_lines))
        assert [answer.error for answer in picture.answers if answer.error] == []
        self.lines += picture.lines
        return picture

    def evidence(self, instance: str) -> Evidence:
        found = make_current_evidence(self.picture(instance), self.driver.console.bench.project, instance)
        assert found is not None
        return found

    def of(self, instance: str) -> Advice:
        return make_advice(self.evidence(instance))

    def then(self, instance: str, condition: Condition) -> Advice:
        """Return what is told of the newest edge of the past that shows a condition."""
        self.picture(instance)
        shown = [
            (line, line.event)
            for line in self.lines
            if isinstance(line.event, StatusEdge)
            and (line.event.instance, line.event.condition) == (instance, str(condition))
        ]
        line, edge = shown[-1]
        project = self.driver.console.bench.project
        decl = project.instance(instance)
        assert decl is not None
        facts, until = past_facts(self.lines, line, edge, decl.connect)
        return make_advice(make_past_evidence(line, edge, facts, until, project, 10_000_000))
