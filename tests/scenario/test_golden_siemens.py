"""Every scenario of configs/scenarios/siemens holds, scan by scan, on the simulated and on the live kernel.

Live runs those that the network has a part in: what pins alone decide is the same code on both kernels.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import LEGACY, SIEMENS, failures, play
from trcvtui.bench.bench import Bench
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.siemens.connection_errors import LEGACY_ERRORS
from trcvtui.dialects.siemens.rules import OWN_ROWS
from trcvtui.scenario.runner import Runner, VirtualPace
from trcvtui.scenario.scenario import load_scenario

SECTIONS = {f"1-{number}" for number in range(1, 12)}
LIVE = [
    path for path in SIEMENS + LEGACY if path.stem[0] == "1" or path.stem.startswith(("80c", "udp", "iso"))
]


# How long these last is the link's business: 80A1 and 80C4 of a TRCV that waits for the connection, too.
WAITS = ("7001", "7002", "7004", "7005", "7006", "80A1", "80C4")


def walk(records: list[dict[str, object]]) -> dict[object, list[tuple[object, ...]]]:
    """Return what each instance showed, in order; what waits for the link counts once."""
    walks: dict[object, list[tuple[object, ...]]] = {}
    for record in records:
        shown = (record["STATUS"], record["BUSY"], record["DONE"], record["ERROR"], record.get("RCVD_LEN"))
        steps = walks.setdefault(record["instance"], [])
        if record["STATUS"] not in WAITS or not steps or steps[-1] != shown:
            steps.append(shown)
    return walks


def name_of(path: Path) -> str:
    return path.stem


def section_of(path: Path) -> str:
    return "-".join(path.stem.split("-")[:2])


def test_each_table_of_section_1_has_a_scenario() -> None:
    assert {section_of(path) for path in SIEMENS + LEGACY} & SECTIONS == SECTIONS


@pytest.mark.slow
@pytest.mark.parametrize("path", SIEMENS + LEGACY, ids=name_of)
def test_a_scenario_holds_on_the_simulated_kernel(path: Path) -> None:
    played = play(path, "sim")
    assert played.verdict.passed, failures(played.verdict)


@pytest.mark.slow
@pytest.mark.parametrize("path", LIVE, ids=name_of)
def test_a_scenario_holds_on_real_sockets_with_the_same_status_walk(path: Path) -> None:
    live, sim = play(path, "live"), play(path, "sim")
    assert live.verdict.passed, failures(live.verdict)
    assert walk(live.records()) == walk(sim.records())


@pytest.mark.slow
@pytest.mark.parametrize("path", SIEMENS + LEGACY, ids=name_of)
def test_sleeping_instances_show_what_called_ones_show(path: Path) -> None:
    seen = []
    for calls_all in (True, False):
        scenario = load_scenario(path)
        bench = Bench(scenario.project, "sim")
        bench.runtime.calls_all = calls_all
        runner = Runner(bench, "x", VirtualPace(), lambda scan, outputs, sent: None)
        verdict = runner.play((*scenario.start, *scenario.steps))
        seen.append((verdict.traces, verdict.failures, [line.event for line in bench.runtime.ledger]))
        bench.close()
    assert seen[0] == seen[1]


Shown = frozenset[tuple[str, int, bool]]


@pytest.fixture(scope="module")
def reached(secure_bench: Path) -> Shown:
    paths = (*SIEMENS, *secure_bench.glob("tls-*.toml"))
    return frozenset().union(*(play(path, "sim").reached() for path in paths))


@pytest.fixture(scope="module")
def reached_before_3() -> Shown:
    return frozenset().union(*(play(path, "sim").reached() for path in LEGACY))


def unseen(rows: tuple[StatusRow, ...], shown: Shown) -> list[str]:
    """Return the rows that no scenario shows on any of their blocks."""
    seen = {(block, status) for block, status, _ in shown}
    return [
        f"{row.word} {'/'.join(row.blocks)}"
        for row in rows
        if row.reach is not Reach.NEVER and not seen & {(block, row.code) for block in row.blocks}
    ]


@pytest.mark.slow
def test_every_code_that_a_condition_can_reach_has_a_scenario(reached: Shown) -> None:
    assert unseen(DIALECTS["s7-1500"].status, reached) == []


def test_what_instructions_before_3_show_otherwise_has_a_scenario(reached_before_3: Shown) -> None:
    assert unseen((*OWN_ROWS, *LEGACY_ERRORS), reached_before_3) == []


@pytest.mark.slow
def test_no_block_shows_a_status_that_its_table_does_not_list_or_calls_out_of_reach(reached: Shown) -> None:
    rows = DIALECTS["s7-1500"].status
    listed = {(b, row.code) for row in rows if row.reach is not Reach.NEVER for b in row.blocks}
    assert {f"{block} {status:04X}" for block, status, _ in reached if (block, status) not in listed} == set()


def test_a_code_that_only_a_fault_brings_about_says_so(reached: Shown) -> None:
    real = {(block, status) for block, status, injected in reached if not injected}
    rows = DIALECTS["s7-1500"].status
    only_injected = [
        row.word
        for row in rows
        if row.reach is not Reach.NEVER and not real & {(block, row.code) for block in row.blocks}
    ]
    assert only_injected == [row.word for row in rows if row.reach is Reach.INJECTED]
