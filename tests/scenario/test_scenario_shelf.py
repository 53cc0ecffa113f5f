"""Which codes a scenario shows is read from its own lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import BAOSKY
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.status_report import add_card_scenarios, add_scenarios, as_text, find_explanations
from trcvtui.scenario.scenario_index import find_scenarios, read_shown_codes


def test_the_shelf_names_the_files_by_code_and_block_as_seen_from_the_source() -> None:
    shelf = find_scenarios("baosky")
    assert "configs/scenarios/baosky/80c5-partner-closes.toml" in shelf[0x80C5, "TRCV_C"]
    assert list(shelf) == sorted(shelf)
    assert {file for files in shelf.values() for file in files} <= {
        f"configs/scenarios/baosky/{path.name}" for path in BAOSKY
    }


@pytest.mark.parametrize(
    ("steps", "codes"),
    [
        ("wait X STATUS=7004 within T#2s", {0x7004}),
        ("create TRCV_C Y connect=C1\nwait Y STATUS=7002", {0x7002}),
        ("wait Z STATUS=7002", set()),
        ("expect X DONE=1 STATUS=16#7008 RCVD_LEN=4", {0x7008}),
        ("  expect X trace 0001 7002* 80A1!+ ... 7004{3}  # 80C5", {0x0001, 0x80A1, 0x7004}),
        ("# wait X STATUS=7004\nset X LEN=7004\nrun 7006\npeer P1 send text STATUS=7005", set()),
        ("expect rx hex 7004\nwait peer P1 closed\nexpect", set()),
    ],
)
def test_codes_stand_in_wait_and_expect_lines_alone(steps: str, codes: set[int], tmp_path: Path) -> None:
    instance = '[[instance]]\nname = "X"\nblock = "TRCV_C"\n'
    scenario = f"[scenario]\nsteps = '''\n{steps}\n'''\n"
    (tmp_path / "bench.toml").write_text(instance, encoding="utf-8")
    file = tmp_path / "x.toml"
    for project in (instance, 'project = "bench.toml"\n'):
        file.write_text(project + scenario, encoding="utf-8")
        assert read_shown_codes(file) == {(code, "TRCV_C") for code in codes}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[scenario",
        "scenario = 1",
        "[scenario]\nsteps = 5",
        "[scenario]\nsteps = 'wait X STATUS=7004'",
        "project = 'nix.toml'\n[scenario]\nsteps = 'wait X STATUS=7004'",
        "instance = 5\n[scenario]\nsteps = 'wait X STATUS=7004'",
        "instance = [5, {}]\n[scenario]\nsteps = 'wait X STATUS=7004'",
        "[[instance]]\nname = 'X'\n[scenario]\nsteps = 'wait X STATUS=x'",
    ],
)
def test_a_file_that_is_wrong_shows_nothing(text: str, tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text(text, encoding="utf-8")
    assert read_shown_codes(file) == frozenset()


def test_without_configs_the_shelf_is_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trcvtui.scenario.scenario_index.SOURCE_ROOT", tmp_path)
    assert find_scenarios("baosky") == {}


@pytest.mark.slow
def test_of_one_code_the_shelf_holds_what_the_whole_shelf_holds_of_it() -> None:
    whole = find_scenarios("baosky")
    for code in (0x7006, 0x80A7, 0x80C5):
        of_code = {shown: files for shown, files in whole.items() if shown[0] == code}
        found = find_scenarios("baosky", [code])
        assert of_code
        assert {shown: files for shown, files in found.items() if shown[0] == code} == of_code


@pytest.mark.slow
@pytest.mark.parametrize("code", [0x7006, 0x7002, 0x80A7, 0x80C5])
def test_a_card_names_the_same_scenarios_when_only_those_that_it_may_name_are_read(code: int) -> None:
    found = find_explanations(tuple(DIALECTS.values()), code, None)
    card = as_text(add_scenarios(found, {name: find_scenarios(name) for name in DIALECTS}))
    assert "to see it" in card
    assert (
        as_text(add_card_scenarios(found, lambda name, wanted: find_scenarios(name, [code], wanted))) == card
    )
