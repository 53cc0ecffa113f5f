"""The program of a project: what the PLC writes by itself while scans pass."""

from __future__ import annotations

from pathlib import Path

import pytest

from trcvtui.bench.bench import Bench
from trcvtui.commands import words
from trcvtui.errors import UserError
from trcvtui.plc.ledger import BenchNote
from trcvtui.project.file import load_project
from trcvtui.scenario.scenario import load_bench_project

BENCH = '''
dialect = "baosky"
program = """
{program}
"""
[[data]]
name = "rx"
type = "DINT"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[peer]]
name = "P1"
active = true
remote = "@C1"
'''


def bench(folder: Path, *lines: str) -> Bench:
    path = folder / "bench.toml"
    path.write_text(BENCH.format(program="\n".join(lines)), encoding="utf-8")
    load_bench_project(path)
    return Bench(load_project(path), "sim")


def pins(bench: Bench, scans: int, pin: str) -> str:
    """Let scans pass; return an input as each of them saw it."""
    seen = ""
    for _ in range(scans):
        bench.step()
        seen += str(int(bench.runtime.inputs("X")[pin]))
    return seen


def test_it_writes_in_the_scan_that_its_steps_say(tmp_path: Path) -> None:
    on = bench(tmp_path, "set X CONT=1", "run 3", "set X EN_R=1", "run T#20ms", "set X EN_R=0")
    assert pins(on, 8, "EN_R") == "00011000"
    assert on.runtime.inputs("X")["CONT"]


def test_a_wait_ends_after_the_scan_in_which_it_holds(tmp_path: Path) -> None:
    waiting = bench(tmp_path, "set X CONT=1", "wait X STATUS=7002", "set X EN_R=1")
    assert pins(waiting, 5, "EN_R") == "00011", "0001, 7001, 7002, and then"


def test_a_wait_that_runs_out_ends_the_program_and_the_ledger_says_so(tmp_path: Path) -> None:
    over = bench(tmp_path, "wait X STATUS=7004 within T#20ms", "set X EN_R=1")
    assert pins(over, 9, "EN_R") == "0" * 9
    notes = [line.event for line in over.runtime.ledger if isinstance(line.event, BenchNote)]
    assert notes == [BenchNote("program", "gave up at `wait X STATUS=7004 within T#20ms`", "STATUS=7000")]


def test_what_is_no_program_s_to_do_is_refused_before_the_first_scan(tmp_path: Path) -> None:
    with pytest.raises(UserError) as refused:
        bench(tmp_path, "set X CONT=1", "peer P1 connect", "expect X STATUS=7000", "sett X CONT=1")
    told = "\n".join(refused.value.lines())
    assert "program: step 4" in told or "program: line 4" in told, told
    with pytest.raises(UserError) as refused:
        bench(tmp_path, "set X CONT=1", "peer P1 connect", "expect X STATUS=7000")
    told = "\n".join(refused.value.lines())
    assert "program: step 2: found 'peer P1 connect', expected set, pulse, write, run or wait" in told, told
    assert "program: step 3" in told


def test_a_step_for_an_instance_that_was_deleted_is_passed_over(tmp_path: Path) -> None:
    on = bench(tmp_path, "set X CONT=1", "run 2", "set X EN_R=1")
    on.do(words.DeleteBlock("X"))
    for _ in range(5):
        on.step()
    notes = [line.event.what for line in on.runtime.ledger if isinstance(line.event, BenchNote)]
    assert notes == ["deleted"]
