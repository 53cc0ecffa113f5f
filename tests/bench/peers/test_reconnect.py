"""How soon an active end calls again whose connection has fallen, scan by scan, simulated."""

from __future__ import annotations

import pytest

from tests.scenario.scenarios import CONFIGS
from tests.scenario.test_siemens_switches import shown
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line
from trcvtui.project.file import load_project

SENDER = "s7-sender.toml"
UP = "set TSEND_C_1 CONT=1; run 6; "
LATER, AT_ONCE = "7001 7002{101} 7004{7}", "7001 7002 7004{7}"


def test_a_connection_that_fell_before_a_byte_moved_is_called_again_after_the_pause_of_retry() -> None:
    walk = shown(SENDER, "TSEND_C_1", UP + "peer P1 close; run 110")
    assert walk == f"7001 7002{{2}} 7004{{3}} 80A3! {LATER}"


def test_the_pause_is_that_of_the_switch() -> None:
    walk = shown(SENDER, "TSEND_C_1", UP + "peer P1 rst; run 20", "options.retry=T#50ms")
    assert walk == "7001 7002{2} 7004{3} 80A3! 7001 7002{6} 7004{12}"


@pytest.mark.parametrize("moves", ["pulse TSEND_C_1 REQ", "peer P1 send hex 01"])
def test_one_byte_in_either_direction_and_it_is_called_again_at_once(moves: str) -> None:
    walk = shown(SENDER, "TSEND_C_1", UP + f"{moves}; run 4; peer P1 close; run 10")
    assert walk.endswith(f"80A3! {AT_ONCE}")


def test_cont_that_falls_and_rises_in_the_pause_calls_at_once() -> None:
    walk = shown(
        SENDER,
        "TSEND_C_1",
        UP + "peer P1 close; run 9; set TSEND_C_1 CONT=0; run 2; set TSEND_C_1 CONT=1; run 5",
    )
    assert walk.endswith("7001 7002{2} 7004{2}")


def test_a_baosky_block_calls_at_once() -> None:
    walk = shown("active.toml", "TRCV_C_1", "set TRCV_C_1 CONT=1; run 9; peer P1 close; run 10")
    assert walk == "0001 7001 7002 7004{6} 7002{2} 7004{8}"


def test_a_partner_that_takes_us_and_drops_us_at_once_is_called_once_in_each_pause() -> None:
    bench = Bench(load_project(CONFIGS / SENDER), "sim")
    calls, drops = (
        parse_line(line, bench.project, "here") for line in ("set TSEND_C_1 CONT=1", "peer P1 close")
    )
    assert calls is not None
    assert drops is not None
    bench.do(calls)
    for _ in range(800):  # 8 s
        bench.step()
        link = bench.runtime.snapshot().connections[0]
        if link.state == "connected":
            bench.do(drops)
    bench.close()
    assert (link.attempts, link.incarnation) == (8, 8)
