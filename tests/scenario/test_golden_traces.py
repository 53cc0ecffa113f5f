"""Every scenario of configs/scenarios/baosky holds, scan by scan, on the simulated and on the live kernel."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import BAOSKY, SIM_ONLY, failures, play
from trcvtui.dialects import DIALECTS
from trcvtui.scenario.scenario import load_scenario

TCP_BLOCKS = ("TRCV_C", "TSEND_C", "TCON", "TDISCON", "T_RESET", "TSEND", "TRCV")
RUNS = (0x7002, 0x7004, 0x7005, 0x7006)  # how long these last is the link's business (design section 3.4)


def name_of(path: Path) -> str:
    return path.stem


@pytest.mark.slow
@pytest.mark.parametrize("path", BAOSKY + SIM_ONLY, ids=name_of)
def test_a_scenario_holds_on_the_simulated_kernel(path: Path) -> None:
    played = play(path, "sim")
    assert played.verdict.passed, failures(played.verdict)


@pytest.mark.slow
@pytest.mark.parametrize("path", BAOSKY, ids=name_of)
def test_a_scenario_holds_on_real_sockets_with_the_same_status_walk_for_the_same_causes(path: Path) -> None:
    live, sim = play(path, "live"), play(path, "sim")
    assert live.verdict.passed, failures(live.verdict)
    assert walk(live.records()) == walk(sim.records())
    assert live.causes() == sim.causes()


def walk(records: list[dict[str, object]]) -> dict[object, list[tuple[object, ...]]]:
    """Return the outputs of each instance in order; a repeated 7002, 7004, 7005, 7006 counts once."""
    walks: dict[object, list[tuple[object, ...]]] = {}
    for record in records:
        status = int(str(record["STATUS"]), 16)
        shown = (record["STATUS"], record["BUSY"], record["DONE"], record["ERROR"], record.get("RCVD_LEN"))
        steps = walks.setdefault(record["instance"], [])
        if status not in RUNS or not steps or steps[-1] != shown:
            steps.append(shown)
    return walks


@pytest.mark.slow
def test_the_same_scenario_gives_the_same_bytes_twice() -> None:
    for path in BAOSKY + SIM_ONLY:
        assert play(path, "sim").text == play(path, "sim").text, path.name


# What no ordinary socket does, and 8086 (it would take the process's last
# descriptor): everything else that a _C block shows is brought about by its own condition.
ONLY_INJECTED = ["16#8082", "16#8084", "16#8086", "16#8087"]


@pytest.fixture(scope="module")
def reached() -> frozenset[tuple[str, int, bool]]:
    ours = [path for path in SIM_ONLY if load_scenario(path).project.dialect.name == "baosky"]
    return frozenset().union(*(play(path, "sim").reached() for path in BAOSKY + ours))


@pytest.mark.slow
@pytest.mark.parametrize("block", TCP_BLOCKS)
def test_every_status_in_the_table_of_a_block_is_reached(
    block: str, reached: frozenset[tuple[str, int, bool]]
) -> None:
    shown = {status for of, status, _ in reached if of == block}
    assert [
        row.word for row in DIALECTS["baosky"].status if block in row.blocks and row.code not in shown
    ] == []


@pytest.mark.slow
@pytest.mark.parametrize("block", TCP_BLOCKS)
def test_no_block_shows_a_status_that_its_table_does_not_list(
    block: str, reached: frozenset[tuple[str, int, bool]]
) -> None:
    listed = {row.code for row in DIALECTS["baosky"].status if block in row.blocks}
    assert {f"{status:04X}" for of, status, _ in reached if of == block and status not in listed} == set()


@pytest.mark.parametrize("block", ["TRCV_C", "TSEND_C"])
def test_only_what_no_ordinary_socket_does_is_injected(
    block: str, reached: frozenset[tuple[str, int, bool]]
) -> None:
    real = {status for of, status, injected in reached if of == block and not injected}
    rows = [row for row in DIALECTS["baosky"].status if block in row.blocks]
    assert [row.word for row in rows if row.code not in real] == ONLY_INJECTED
