"""A scenario step by step: the same judgement as the runner's, and what the screen is told of it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.local_driver import LocalDriver, wait_for
from tests.scenario.scenarios import CONFIGS, PASSIVE
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.engine.driver import EngineDriver
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import load_project
from trcvtui.scenario.player import MOST_STEPS
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.snapshots.bench import EngineTiming, LineAnswer
from trcvtui.snapshots.scenario import DONE, FAILED, HELD, NOW, TO_COME, PlayerSnapshot

FIN = CONFIGS / "scenarios" / "baosky" / "80a6-fin-mid-frame.toml"
STEPS = (
    "set TRCV_C_1 CONT=1",
    "# the listener is up",
    "wait TRCV_C_1 STATUS=7002",
    "",
    "expect TRCV_C_1 STATUS=7004",
    "run 5",
    "expect TRCV_C_1 trace 0001 7001 7002{6}",
)


def scenario(folder: Path, *steps: str, start: str = "", name: str = "story.toml") -> Path:
    file = folder / name
    text = "\n".join(steps)
    head = f'start = "{start}"\n' * bool(start) + PASSIVE.read_text(encoding="utf-8")
    file.write_text(
        f'{head}\n[scenario]\nname = "a story"\nabout = "why"\nsteps = """\n{text}\n"""\n', encoding="utf-8"
    )
    return file


def player_of(driver: LocalDriver) -> PlayerSnapshot:
    player = driver.shown().player
    assert player is not None
    return player


def answer_to(driver: LocalDriver, line: str) -> str:
    number = driver.submit(line)
    (answer,) = [answer for answer in driver.shown().answers if answer.number == number]
    assert isinstance(answer, LineAnswer)
    return answer.error


def states(player: PlayerSnapshot) -> list[str]:
    return [step.state for step in player.steps]


# -- step by step --------------------------------------------------------------------------------------


def test_steps_asked_for_while_one_is_under_way_come_after_it(driver: LocalDriver, tmp_path: Path) -> None:
    driver.submit(f"scenario load {scenario(tmp_path, *STEPS)} sim")
    for _ in range(4):
        driver.submit("scenario step")
    driver.scan(1)
    assert states(player_of(driver)) == [DONE, NOW, TO_COME, TO_COME, TO_COME]
    driver.scan(20)
    assert states(player_of(driver)) == [DONE, HELD, FAILED, DONE, TO_COME]
    assert driver.shown().snapshot.scan == 8, "after the fourth step no scan passes"


def test_a_run_to_the_end_takes_what_is_left(driver: LocalDriver, tmp_path: Path) -> None:
    driver.submit(f"scenario load {scenario(tmp_path, *STEPS)} sim")
    driver.submit("scenario step")
    driver.submit("scenario run")
    driver.scan(8)
    player = player_of(driver)
    assert states(player) == [DONE, HELD, FAILED, DONE, HELD]
    assert (player.finished, player.current) == (True, 5)
    assert [step.number for step in player.failed_steps] == [3]
    assert answer_to(driver, "scenario step") == "the scenario is over; loading it again begins anew"
    driver.scan(5)
    assert driver.shown().snapshot.scan == 8, "no scan passes after the last step"


def test_a_step_asked_for_during_a_run_stops_it_after_the_running_one(
    driver: LocalDriver, tmp_path: Path
) -> None:
    driver.submit(f"scenario load {scenario(tmp_path, *STEPS)} sim")
    driver.submit("scenario run")
    driver.scan(1)
    driver.submit("scenario step")
    driver.scan(20)
    assert states(player_of(driver)) == [DONE, HELD, TO_COME, TO_COME, TO_COME]


def test_the_commands_of_start_are_taken_when_the_scenario_is_loaded(
    driver: LocalDriver, tmp_path: Path
) -> None:
    file = scenario(tmp_path, "run 1", start="set TRCV_C_1 CONT=1\\nexpect TRCV_C_1 STATUS=7004")
    driver.submit(f"scenario load {file} sim")
    player = player_of(driver)
    assert [(step.number, step.state) for step in player.steps] == [(0, DONE), (0, FAILED), (1, TO_COME)]
    assert player.current == 2


# -- one bench in place of the other -------------------------------------------------------------------


def test_a_scenario_has_a_bench_and_a_project_of_its_own(driver: LocalDriver, tmp_path: Path) -> None:
    driver.submit("set TRCV_C_1 CONT=1")
    driver.scan(20)
    home = driver.shown()
    assert home.project is None, "the screen has read it itself"
    driver.submit(f"scenario load {CONFIGS / 'scenarios' / 'baosky' / 'shared-close.toml'} sim")
    away = driver.shown(UpdateRequest(since_seq=10_000, bench=home.bench, project=home.project_number))
    assert away.bench != home.bench
    assert away.project is not None
    assert [decl.name for decl in away.project.instances] == ["TRCV_C_1", "TRCV_C_2"]
    assert (away.snapshot.scan, away.holding, away.kernel) == (0, True, "sim")
    known = UpdateRequest(bench=away.bench, project=away.project_number)
    assert driver.shown(known).project is None


def test_leaving_brings_the_opened_project_back_fresh(driver: LocalDriver, tmp_path: Path) -> None:
    driver.scan(20)
    driver.submit(f"scenario load {scenario(tmp_path, *STEPS)} sim")
    away = driver.shown()
    driver.submit("scenario stop")
    picture = driver.shown(UpdateRequest(bench=away.bench, project=away.project_number))
    assert picture.player is None
    assert picture.project is not None and picture.project.path == PASSIVE
    assert (picture.snapshot.scan, picture.holding) == (0, False)
    driver.scan(3)
    assert driver.shown().snapshot.scan == 3
    assert answer_to(driver, "scenario step").startswith("no scenario is loaded")


def test_the_commands_of_start_act_again_when_the_project_comes_back(tmp_path: Path) -> None:
    home = scenario(tmp_path, "run 1", start="set TRCV_C_1 CONT=1", name="home.toml")
    home.write_text(home.read_text(encoding="utf-8").partition("[scenario]")[0], encoding="utf-8")
    driver = LocalDriver(fresh_bench(load_bench_project(home), "sim"))
    driver.submit(f"scenario load {FIN} sim")
    driver.submit("scenario stop")
    driver.scan(1)
    assert driver.shown().snapshot.instances[0].pin("CONT") is True
    driver.close()


@pytest.mark.parametrize(
    ("steps", "kernel", "found"),
    [
        (("sett TRCV_C_1 CONT=1",), "sim", "'sett'"),
        (("set TRCV_C_1 CUNT=1",), "sim", "'CUNT'"),
        (("run 1",) * (MOST_STEPS + 1), "sim", f"{MOST_STEPS + 1} steps"),
        (("run 1",), "real", "'scenario load"),
    ],
)
def test_a_wrong_file_is_one_line_and_the_present_bench_stays(
    driver: LocalDriver, tmp_path: Path, steps: tuple[str, ...], kernel: str, found: str
) -> None:
    driver.scan(4)
    error = answer_to(driver, f"scenario load {scenario(tmp_path, *steps)} {kernel}")
    assert found in error and "\n" not in error
    picture = driver.shown()
    assert (picture.snapshot.scan, picture.player, picture.bench) == (4, None, 0)


def test_a_peer_without_a_free_port_brings_the_opened_project_back(tmp_path: Path) -> None:
    first = Controller(fresh_bench(load_project(PASSIVE), "live"))
    second = Controller(fresh_bench(load_project(PASSIVE), "live"))
    try:
        free = scenario(tmp_path, "run 1")
        text = free.read_text(encoding="utf-8")
        peer = '[[peer]]\nname = "P2"\nactive = false\nlocal = "127.0.0.1:{}"\n\n[scenario]'
        free.write_text(text.replace("[scenario]", peer.format(0)), encoding="utf-8")
        first.handle_line(1, f"scenario load {free} live")
        taken = first.bench.peers["P2"].transport.last_port
        free.write_text(text.replace("[scenario]", peer.format(taken)), encoding="utf-8")
        second.handle_line(1, f"scenario load {free} live")
        (answer,) = second.picture(UpdateRequest(), EngineTiming(), 10).answers
        assert "peer P2" in answer.error
        assert second.player is None
        assert second.scan(), "the bench that was opened scans again"
    finally:
        first.bench.close()
        second.bench.close()


def test_a_bench_that_is_left_after_keeps_no_socket() -> None:
    console = Controller(fresh_bench(load_project(PASSIVE), "live"))
    left = [console.bench]
    for line in (f"scenario load {FIN} live", f"scenario load {FIN} live", "scenario stop"):
        console.handle_line(1, line)
        left.append(console.bench)
        console.handle_line(2, "set TRCV_C_1 CONT=1")
        console.handle_line(3, "scenario step")
        console.handle_line(4, "scenario step")
        for _ in range(5):
            console.scan()
        assert console.bench.leaks(), "it listens"
    console.bench.close()
    assert [bench.leaks() for bench in left] == [()] * 4


# -- in the engine's process ---------------------------------------------------------------------------


@pytest.fixture
def engine() -> Iterator[EngineDriver]:
    driver = EngineDriver(PASSIVE, "live")
    yield driver
    driver.close()


@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_the_engine_plays_step_by_step_to_the_end_and_goes_home(engine: EngineDriver, kernel: str) -> None:
    engine.submit("set TRCV_C_1 CONT=1")
    wait_for(engine, lambda p: p.snapshot.instances[0].since_scan > 1)
    engine.submit(f"scenario load {FIN} {kernel}")
    picture = wait_for(engine, lambda p: p.player is not None)
    assert picture.kernel == kernel
    engine.submit("scenario step")
    engine.submit("scenario step")
    wait_for(engine, lambda p: p.player is not None and states(p.player)[:2] == [DONE, HELD])
    engine.submit("scenario run")
    picture = wait_for(engine, lambda p: p.player is not None and p.player.finished)
    assert picture.player is not None
    assert FAILED not in states(picture.player)
    assert picture.player.traces[0][1].endswith("7006{3} 80A6! 80C5! 7002{3}")
    engine.submit("scenario stop")
    picture = wait_for(engine, lambda p: p.player is None and p.snapshot.scan > 5)
    assert (picture.kernel, picture.holding) == ("live", False)
    assert picture.snapshot.instances[0].pin("CONT") is False, "a fresh bench"


@pytest.mark.slow
def test_a_long_simulated_scenario_is_played_to_its_end_faster_than_the_clock(
    engine: EngineDriver, tmp_path: Path
) -> None:
    began = os.times().elapsed
    engine.submit(f"scenario load {scenario(tmp_path, 'run T#1m', 'expect TRCV_C_1 STATUS=7000')} sim")
    engine.submit("scenario run")
    picture = wait_for(engine, lambda p: p.player is not None and p.player.finished)
    assert picture.snapshot.scan == 6000
    assert os.times().elapsed - began < 30
