"""Every scenario of configs/scenarios/baosky holds, scan by scan, on the simulated and on the live kernel."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.rig.scenarios import BAOSKY, SIM_ONLY, failures, play
from trcvtui.dialects import DIALECTS

RUNS = (0x7002, 0x7004, 0x7005, 0x7006)  # how long these last is the link's business (design section 3.4)


def name_of(path: Path) -> str:
    return path.stem


@pytest.mark.parametrize("path", BAOSKY + SIM_ONLY, ids=name_of)
def test_a_scenario_holds_on_the_simulated_kernel(path: Path) -> None:
    played = play(path, "sim")
    assert played.verdict.passed, failures(played.verdict)


@pytest.mark.parametrize("path", BAOSKY, ids=name_of)
def test_a_scenario_holds_on_real_sockets_and_shows_the_same_status_walk(path: Path) -> None:
    live = play(path, "live")
    assert live.verdict.passed, failures(live.verdict)
    assert walk(live.records()) == walk(play(path, "sim").records())


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


def test_the_same_scenario_gives_the_same_bytes_twice() -> None:
    for path in BAOSKY + SIM_ONLY:
        assert play(path, "sim").text == play(path, "sim").text, path.name


def test_every_status_of_trcv_c_is_reached_and_is_labelled_for_what_it_is() -> None:
    reached: dict[int, set[str]] = {}
    for path in BAOSKY + SIM_ONLY:
        played = play(path, "sim")
        for code in played.real:
            reached.setdefault(code, set()).add("real")
        for code in played.injected:
            reached.setdefault(code, set()).add("injected")
    rows = [row for row in DIALECTS["baosky"].status if "TRCV_C" in row.blocks]
    missing = [row.word for row in rows if row.code not in reached]
    assert missing == []
    only_injected = [row.word for row in rows if reached[row.code] == {"injected"}]
    # What no ordinary socket does (status-reproduction, section 1), and 8086 (it would take
    # the process's last descriptor): everything else is brought about by its own condition.
    assert only_injected == ["16#8082", "16#8084", "16#8086", "16#8087"]
