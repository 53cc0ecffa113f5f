"""Try every split: on a static job all splits end alike, ad hoc none does; what is in the way is said."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.local_driver import LocalDriver
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.split_test import trial_text
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.snapshots.scenario import SplitTestSnapshot

TRY = "peer P1 try-splits hex 01 02 03 04 05 06 07 08 on TRCV_C_1 differ=any"


@pytest.fixture
def driver() -> Iterator[LocalDriver]:
    driver = LocalDriver(fresh_bench(load_project(CONFIGS / "passive.toml"), "sim"))
    say(driver, "set TRCV_C_1 CONT=1 EN_R=1")
    driver.scan(3)
    say(driver, "peer P1 connect")
    driver.scan(3)
    yield driver
    driver.close()


def say(driver: LocalDriver, line: str) -> str:
    number = driver.submit(line)
    return next(answer.error for answer in driver.shown().answers if answer.number == number)


def tried(driver: LocalDriver) -> SplitTestSnapshot:
    trial = driver.shown().trial
    assert trial is not None
    return trial


def test_on_a_static_job_every_split_ends_as_the_whole_message_does(driver: LocalDriver) -> None:
    assert say(driver, TRY) == ""
    driver.scan(80)
    trial = tried(driver)
    assert (trial.state, trial.runs, trial.differing) == ("finished", 8, 0)
    assert trial_text(trial) == (
        "P1: 8 bytes to TRCV_C_1, every split · all 7 splits end as the whole message does\n"
        "whole  same  7008 7006, DONE 1, RCVD_LEN 8, DATA equal\n"
        "  1-7  same  7006+ 7008 7006, DONE 1, RCVD_LEN 8, DATA equal\n"
    )


def test_scans_go_on_while_it_runs_and_it_can_be_cancelled(driver: LocalDriver) -> None:
    say(driver, TRY)
    driver.scan(10)
    assert tried(driver).state == "running"
    assert "a trial is running" in say(driver, TRY)
    before = driver.shown().snapshot.scan
    assert say(driver, "peer P1 try-splits stop") == ""
    driver.scan(10)
    trial = tried(driver)
    assert trial.state == "cancelled" and 0 < trial.runs < 8
    assert driver.shown().snapshot.scan == before + 10
    say(driver, "peer P1 try-splits stop")
    assert driver.shown().trial is None


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        (["set TRCV_C_1 EN_R=0"], "EN_R of TRCV_C_1 is 0: it receives nothing"),
        (["peer P1 close"], "P1 is closed, not connected"),
        (["peer P1 send hex 01 02"], "the job of TRCV_C_1 already holds 2 bytes"),
    ],
)
def test_what_is_in_the_way_is_said(driver: LocalDriver, lines: list[str], problem: str) -> None:
    for line in lines:
        say(driver, line)
    driver.scan(2)
    say(driver, TRY)
    driver.scan(300)
    assert (tried(driver).state, tried(driver).problem) == ("failed", problem)


def test_a_message_that_leaves_a_rest_in_the_job_ends_the_trial(driver: LocalDriver) -> None:
    say(driver, "peer P1 try-splits hex 01 02 03 on TRCV_C_1")
    driver.scan(300)
    problem = "after a message of 3 bytes the job of TRCV_C_1 holds 3: it waits for more"
    assert (tried(driver).runs, tried(driver).problem) == (1, problem)


def test_two_frames_in_one_message_are_two_dones_wherever_it_is_cut(driver: LocalDriver) -> None:
    message = "01 02 03 04 05 06 07 08 11 12 13 14 15 16 17 18"
    say(driver, f"peer P1 try-splits hex {message} on TRCV_C_1")
    driver.scan(200)
    trial = tried(driver)
    assert (trial.state, trial.runs, trial.differing) == ("finished", 16, 0)
    assert {row.lengths for row in trial.rows} == {"8×2"}
    assert {row.data_equal for row in trial.rows} == {False}


def test_a_fresh_bench_forgets_the_table(driver: LocalDriver) -> None:
    say(driver, TRY)
    driver.scan(80)
    story = CONFIGS / "scenarios" / "stories" / "every-split.toml"
    assert say(driver, f"scenario load {story} sim") == ""
    assert driver.shown().trial is None
    say(driver, "scenario run")
    driver.scan(400)
    trial, player = tried(driver), driver.shown().player
    assert player is not None and not player.failed_steps and player.finished
    assert (trial.state, trial.differing) == ("finished", 7)
