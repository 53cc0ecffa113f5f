"""The screen's side of the bench: lines in, answers and pictures out, here and from the engine's process."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.local_driver import LocalDriver, wait_for
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.engine.driver import EngineDriver
from trcvtui.errors import UserError
from trcvtui.paths import demo_path
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.picture.protocol import EngineStopped
from trcvtui.project.file import load_project
from trcvtui.scenario.scenario import load_bench_project

PASSIVE = CONFIGS / "passive.toml"
S7_PROJECTS = ("s7-receiver", "s7-iso-passive", "s7-single-passive", "s7-udp", "s7-legacy-receiver")


@pytest.fixture
def local() -> Iterator[LocalDriver]:
    driver = LocalDriver(Bench(load_project(PASSIVE), "sim"))
    yield driver
    driver.close()


def statuses(picture: BenchUpdate) -> list[str]:
    return [f"{i.outputs.status:04X}" for i in picture.snapshot.instances]


def test_a_line_acts_in_the_next_scan_and_is_answered(local: LocalDriver) -> None:
    number = local.submit("set TRCV_C_1 CONT=1 EN_R=1")
    local.scan(3)
    picture = local.shown()
    assert statuses(picture) == ["7002"]
    assert [(a.number, a.error) for a in picture.answers] == [(number, "")]
    assert local.shown().answers == ()


def test_a_wrong_line_is_answered_with_one_line_and_changes_nothing(local: LocalDriver) -> None:
    local.submit("set TRCV_C_1 CUNT=1")
    local.scan()
    picture = local.shown()
    assert statuses(picture) == ["7000"]
    (answer,) = picture.answers
    assert "CUNT" in answer.error and "CONT" in answer.error and "\n" not in answer.error


def test_hold_stops_the_scans_and_run_lets_single_ones_pass(local: LocalDriver) -> None:
    local.submit("set TRCV_C_1 CONT=1")
    local.submit("hold")
    local.scan(5)
    assert local.shown().snapshot.scan == 0
    local.submit("run 1")
    local.scan(5)
    assert statuses(local.shown()) == ["0001"]
    local.submit("run 2")
    local.scan(5)
    assert statuses(local.shown()) == ["7002"]
    local.submit("go")
    local.scan(5)
    assert local.shown().snapshot.scan == 8


def test_an_expectation_on_the_prompt_says_what_was_found(local: LocalDriver) -> None:
    local.scan()
    local.submit("expect TRCV_C_1 STATUS=7004")
    local.submit("expect TRCV_C_1 STATUS=7000")
    first, second = local.shown().answers
    assert first.error == "found STATUS=7000"
    assert second.error == ""


def test_a_picture_holds_the_bytes_of_data_and_of_the_running_job(local: LocalDriver) -> None:
    local.submit("set TRCV_C_1 CONT=1 EN_R=1")
    local.scan(3)
    local.submit("peer P1 connect")
    local.scan(3)
    local.submit("peer P1 send hex 01 02 03")
    local.scan(1)
    picture = local.shown(UpdateRequest(data=("rx",), partial_of=("TRCV_C_1",)))
    assert picture.data == (("rx", bytes(8)),)
    assert picture.partial == (("TRCV_C_1", b"\x01\x02\x03"),)
    (instance,) = picture.snapshot.instances
    assert (instance.have, instance.need) == (3, 8)


def test_a_picture_brings_only_what_is_new_in_the_ledger(local: LocalDriver) -> None:
    local.scan(3)
    first = local.shown()
    assert first.lines
    local.scan(3)
    second = local.shown(UpdateRequest(since_seq=first.snapshot.ledger_seq))
    assert second.lines == () and second.lines_skipped == 0


def test_too_much_news_is_counted_and_the_newest_is_kept(local: LocalDriver) -> None:
    for value in (1, 0) * 20:
        local.submit(f"set TRCV_C_1 ADHOC={value}")
        local.scan()
    picture = local.shown(UpdateRequest(most_lines=10))
    assert len(picture.lines) == 10
    assert picture.lines[-1].seq == picture.snapshot.ledger_seq
    assert picture.lines_skipped == picture.snapshot.ledger_seq - 10


# -- the engine in its own process ---------------------------------------------------------------------


@pytest.fixture
def engine() -> Iterator[EngineDriver]:
    driver = EngineDriver(PASSIVE, "live")
    yield driver
    driver.close()


@pytest.mark.slow
def test_the_engine_scans_by_itself_and_takes_lines(engine: EngineDriver) -> None:
    engine.submit("set TRCV_C_1 CONT=1 EN_R=1")
    wait_for(engine, lambda p: statuses(p) == ["7002"])
    engine.submit("peer P1 connect")
    wait_for(engine, lambda p: statuses(p) == ["7006"])
    engine.submit("peer P1 send random 24 seed=1")
    picture = wait_for(engine, lambda p: p.snapshot.instances[0].jobs_done == 3)
    assert picture.timing.scans > 0
    assert picture.kernel == "live"


@pytest.mark.slow
@pytest.mark.parametrize("name", S7_PROJECTS)
def test_a_siemens_project_crosses_with_its_pictures(name: str) -> None:
    driver = EngineDriver(CONFIGS / f"{name}.toml", "live")
    try:
        expected = [each.name for each in load_project(CONFIGS / f"{name}.toml").instances]
        assert [each.name for each in driver.wait_for_project().instances] == expected
        picture = wait_for(driver, lambda p: p.snapshot.scan > 2)
        assert [each.name for each in picture.snapshot.instances] == expected
    finally:
        driver.close()


@pytest.mark.slow
def test_the_demo_is_alive_by_itself() -> None:
    driver = EngineDriver(demo_path(), "live")
    try:
        picture = wait_for(driver, lambda p: all(i.jobs_done >= 2 for i in p.snapshot.instances))
        assert [i.block for i in picture.snapshot.instances] == ["TRCV_C", "TRCV_C", "TSEND_C"]
        assert [i.errors for i in picture.snapshot.instances] == [0, 0, 0], "no 80A1: EN_R rises at 7004"
    finally:
        driver.close()


@pytest.mark.slow
def test_an_engine_that_was_killed_starts_anew_from_its_file() -> None:
    driver = EngineDriver(demo_path(), "live")
    try:
        names = [each.name for each in driver.wait_for_project().instances]
        first = driver.pid
        assert first is not None
        os.kill(first, signal.SIGKILL)
        with pytest.raises(EngineStopped, match="ended by SIGKILL") as stopped:
            wait_for(driver, lambda p: False)
        assert stopped.value.is_internal
        driver.close()
        with pytest.raises(EngineStopped):
            driver.submit("hold")
        driver.restart()
        picture = wait_for(driver, lambda p: p.snapshot.scan > 2)
        assert driver.pid != first
        assert [each.name for each in picture.snapshot.instances] == names
    finally:
        driver.close()


def test_the_project_crosses_from_the_engine_before_the_first_picture(engine: EngineDriver) -> None:
    ours, theirs = load_bench_project(PASSIVE), engine.wait_for_project()
    assert (theirs.path, theirs.connects, theirs.instances) == (ours.path, ours.connects, ours.instances)
    assert wait_for(engine, lambda picture: True).kernel == "live"


def test_the_mistakes_of_a_file_cross_from_the_engine_line_by_line(tmp_path: Path) -> None:
    file = tmp_path / "bench.toml"
    file.write_text(
        'colour = 1\nstart = """\nset TRCV_C_1 CONT=2\n"""\n[plc]\ninterval = "soon"\n', encoding="utf-8"
    )
    with pytest.raises(UserError) as expected:
        load_bench_project(file)
    driver = EngineDriver(file, "sim")
    with pytest.raises(UserError) as caught:
        driver.wait_for_project()
    driver.close()
    assert len(caught.value.lines()) > 1
    assert caught.value.lines() == expected.value.lines()


def test_a_mistake_in_start_is_found_when_the_bench_is_loaded(tmp_path: Path) -> None:
    file = tmp_path / "bench.toml"
    file.write_text('start = """\nset TRCV_C_1 CONT=2\nrun 5\n"""\n' + PASSIVE.read_text(), encoding="utf-8")
    with pytest.raises(UserError, match="CONT"):
        load_bench_project(file)
