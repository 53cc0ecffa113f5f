"""Random pins, partners and downloads under the Siemens dialects: what always holds, whatever happens."""

from __future__ import annotations

import random

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.blocks.conditions import ERROR_CONDITIONS, Condition
from trcvtui.blocks.status import Reproducibility
from trcvtui.commands.table import parse_line
from trcvtui.plc.ledger import Outputs, StatusEdge
from trcvtui.project.file import load_project

SCANS = 250
PROJECTS = ("s7-pair.toml", "s7-sender.toml", "s7-receiver.toml", "s7-single-active.toml", "s7-udp.toml")
LEGACY = ("s7-legacy-sender.toml", "s7-legacy-receiver.toml")
OPTIONS = (
    (),
    ("options.cont_mode=manual",),
    ("options.teardown_before_error=true", "options.status_0001_always=true", "options.rcv_lag=false"),
    ("options.silent_connect=true", "options.en_r_falls=drops", "options.retry=T#30ms"),
)
HELP = ("options.status_sequence=help",)
CASES = [(project, options) for project in PROJECTS for options in OPTIONS]
CASES += [(project, options) for project in LEGACY for options in ((), HELP)]


def a_line(draw: random.Random, bench: Bench) -> str:
    """Return one command at random."""
    decl = draw.choice(bench.project.instances)
    pins = [pin for pin in bench.project.pins(decl.block) if pin.name in bench.runtime.inputs(decl.name)]
    pin = draw.choice(pins)
    largest = 65535 if pin.iec_type == "UINT" else 70000  # UINT: older instructions
    value = str(draw.randint(0, 1)) if pin.is_bool else str(draw.choice((0, 0, 4, 8, 9, 65535, largest)))
    data = draw.choice(bench.project.data).name
    size = draw.randint(1, 9)
    again = "connect" if bench.project.peers[0].active else "listen"
    ends = ("close",) if bench.project.peers[0].udp else ("close", "rst")
    peer = draw.choice(("send random 4 seed=1", "send random 8 seed=2", "send random 3 seed=3", again, *ends))
    lines = [f"set {decl.name} {pin.name}={value}"] * 6 + [f"peer P1 {peer}"] * 4
    lines += [f"resize {data} ARRAY[1..{size}] OF {draw.choice(('BYTE', 'BOOL', 'INT'))}"]
    lines += [f"download {decl.name}", draw.choice(("plc stop", "plc run", "plc run"))]
    return draw.choice(lines)


def check(block: str, before: Outputs | None, now: Outputs, reachable: set[tuple[str, int]]) -> None:
    assert now.busy + now.done + now.error <= 1
    assert now.error == (now.status >= 0x8000)
    assert not now.rcvd_len or now.done
    assert not (before and before.done and now.done and block not in ("T_RESET",))
    assert (block, now.status) in reachable, f"{block} {now.status:04X}"


@pytest.mark.parametrize(("project", "options"), CASES)
def test_what_shows_is_always_in_the_table_and_one_thing_at_a_time(
    project: str, options: tuple[str, ...]
) -> None:
    for seed in range(6):
        draw = random.Random(f"{project} {options} {seed}")
        bench = Bench(load_project(CONFIGS / project, options), "sim")
        rows = bench.project.dialect.status
        reachable = {
            (b, row.code) for row in rows if row.reach is not Reproducibility.NEVER for b in row.blocks
        }
        before: dict[str, Outputs] = {}
        for _ in range(SCANS):
            for _ in range(draw.choice((0, 0, 1, 1, 2))):
                command = parse_line(a_line(draw, bench), bench.project, "random")
                assert command is not None
                bench.do(command)  # what a peer cannot do now is an answer, no failure
            bench.step()
            for decl in bench.project.instances:
                now = bench.runtime.outputs(decl.name)
                check(decl.block, before.get(decl.name), now, reachable)
                before[decl.name] = now
        edges = [line.event for line in bench.runtime.ledger if isinstance(line.event, StatusEdge)]
        assert all(edge.outputs.error == (Condition(edge.condition) in ERROR_CONDITIONS) for edge in edges)
        bench.close()
        assert bench.leaks() == ()


@pytest.mark.parametrize("project", ["s7-sender.toml", "s7-pair.toml"])
def test_by_the_manual_of_the_s7_1200_busy_lasts_from_the_edge_of_req_to_done_or_error(project: str) -> None:
    """Every edge while BUSY is 0 raises it in that scan, or is answered there; DONE or ERROR alone end it."""
    edges = done = 0
    for seed in range(8):
        draw = random.Random(f"busy {project} {seed}")
        bench = Bench(load_project(CONFIGS / project, ("options.cont_mode=manual",)), "sim")
        again = "connect" if bench.project.peers[0].active else "listen"
        pins = ["REQ=0", "REQ=1"] * 4 + ["CONT=0", "CONT=1", "COM_RST=1", "LEN=0", "LEN=9"]
        lines = [f"set TSEND_C_1 {pin}" for pin in pins] + [f"peer P1 {again}"] * 4 + ["peer P1 close"]
        if project == "s7-pair.toml":
            lines += [f"set TRCV_C_1 {pin}" for pin in ("EN_R=1", "EN_R=0", "CONT=1", "CONT=0")]
        before, req = bench.runtime.outputs("TSEND_C_1"), False
        for _ in range(4 * SCANS):
            command = parse_line(draw.choice(lines), bench.project, "random")
            assert command is not None
            bench.do(command)
            bench.step()
            now, was_req = bench.runtime.outputs("TSEND_C_1"), req
            req = bool(bench.runtime.inputs("TSEND_C_1")["REQ"])
            is_edge, is_answered = req and not was_req, now.busy or now.done or now.error
            assert is_answered or not (before.busy or is_edge)
            edges += is_edge and not before.busy
            done += now.done
            before = now
        bench.close()
    assert edges > 200
    assert done > 50
