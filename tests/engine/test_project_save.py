"""`save project [FILE] [!]`: what was added comes into the file; nothing else changes, nothing is lost."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.local_driver import LocalDriver
from tests.scenario.scenarios import CONFIGS, failures, play
from trcvtui.engine.controller import fresh_bench
from trcvtui.paths import demo_path
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.project.file import load_project
from trcvtui.scenario.scenario import load_bench_project

ADD = (
    "add connect C7 LocalAddress=127.0.0.1",
    "add data rx7 Weight",
    "add instance R7 block=TRCV_C connect=C7 data=rx7 CONT=1 EN_R=1",
    "add peer P7 remote=@C7 reconnect=T#100ms",
    "add message hello peer=P7 text \"hello\" split=2",
    "add sequence twice hello T#1s hello",
)  # fmt: skip


@pytest.fixture
def own(tmp_path: Path) -> Path:
    shutil.copytree(CONFIGS / "types", tmp_path / "types")
    shutil.copy(CONFIGS / "checkweigher.toml", tmp_path / "mine.toml")
    return tmp_path / "mine.toml"


@pytest.fixture
def driver(own: Path) -> Iterator[LocalDriver]:
    yield from driven(own)


def driven(path: Path) -> Iterator[LocalDriver]:
    driver = LocalDriver(fresh_bench(load_bench_project(path), "sim"))
    yield driver
    driver.close()


def say(driver: LocalDriver, *lines: str) -> BenchUpdate:
    """Say lines, a scan after each; return the last picture."""
    for line in lines:
        driver.submit(line)
        driver.scan()
    return driver.shown()


def answer(driver: LocalDriver, *lines: str) -> str:
    """Return what was told of the last line, or what was wrong with it."""
    last = say(driver, *lines).answers[-1]
    return last.error or last.message


def test_what_was_added_loads_again_and_runs(driver: LocalDriver, own: Path) -> None:
    before = own.read_text()
    assert say(driver, *ADD).unsaved == 6
    assert own.read_text() == before
    assert answer(driver, "save project") == f"the project with 6 additions in {own}"
    assert say(driver).unsaved == 0
    project = load_bench_project(own)
    assert project.instances[-1] == driver.console.bench.project.instances[-1]
    assert (project.connects, project.peers) == (
        driver.console.bench.project.connects,
        driver.console.bench.project.peers,
    )
    text = own.read_text()
    assert text.startswith(before[: before.index('[[connect]]\nname = "C1"')])
    assert before[before.index("# The device as it really is") :] in text
    assert 'split=2\'\npeer = "P7"\n' in text


def test_experiments_are_not_saved(driver: LocalDriver, own: Path) -> None:
    before = own.read_bytes()
    lines = "create TRCV_C X connect=C1", "delete TRCV_C_1", "resize report INT", "set X CONT=1"
    assert answer(driver, *lines, "save project") == f"nothing was added to {own}"
    assert own.read_bytes() == before


def test_what_the_running_program_has_lost_the_project_still_has(driver: LocalDriver) -> None:
    again = "add instance TRCV_C_1 block=TRCV_C connect=C1 data=report"
    assert "'TRCV_C_1', which an instance already has" in answer(driver, "delete TRCV_C_1", again)


def test_somebody_elses_file_is_written_over_only_when_that_is_said(driver: LocalDriver, own: Path) -> None:
    other = own.parent / "theirs.toml"
    other.write_text("# theirs\n")
    told = answer(driver, *ADD, f"save project {other}")
    assert told.startswith(f"prompt: found {other}, which is there already, expected the name of a new file")
    assert other.read_text() == "# theirs\n"
    assert answer(driver, f"save project {other} !") == f"the project with 6 additions in {other}"
    assert load_bench_project(other).connect("C7") is not None


def test_the_demo_is_saved_under_a_name_of_its_own(tmp_path: Path) -> None:
    for driver in driven(demo_path()):
        before = demo_path().read_bytes()
        told = answer(driver, "add connect C77", "save project")
        assert told.startswith("prompt: found demo.toml, which came with trcvtui, expected save project FILE")
        assert answer(driver, f"save project {demo_path()}") == told
        assert answer(driver, f"save project {tmp_path / 'd.toml'}").startswith("the project with 1 addition")
        assert load_bench_project(tmp_path / "d.toml").connect("C77") is not None
        assert demo_path().read_bytes() == before


def test_what_was_written_into_the_file_meanwhile_stays(driver: LocalDriver, own: Path) -> None:
    say(driver, *ADD)
    own.write_text(own.read_text() + "\n# written meanwhile\n[[connect]]\nname = 'C50'\n")
    assert answer(driver, "save project").startswith("the project with 6 additions")
    assert {c.name for c in load_bench_project(own).connects} == {"C1", "C7", "C50"}
    assert "# written meanwhile" in own.read_text()


TAKEN = '[[connect]]\nname = "C7"\n'
OTHER = 'dialect = "{}"\n[[connect]]\nname = "X"\n[[connect]]\nname = "Y"\n'


def loop(own: Path, by: str) -> None:
    own.unlink()
    own.symlink_to(by)
    if by != own.name:
        own.with_name(by).symlink_to(own.name)


def into_folder(own: Path) -> None:
    own.unlink()
    own.mkdir()


OUTSIDE: dict[str, tuple[Callable[[Path], object], str, bool]] = {
    "deleted": (lambda own: own.unlink(), ": found 'No such file or directory'", True),
    "renamed": (lambda own: own.rename(own.with_name("new.toml")), ": found new.toml, its new name", True),
    "broken": (lambda own: own.write_text("a = 1\n= 2\n"), ": line 2, column 1: found bad TOML", True),
    "emptied": (lambda own: own.write_bytes(b""), ": dialect: found nothing", True),
    "bytes": (lambda own: own.write_bytes(b"\xff"), ": line 1: found byte 16#FF", True),
    "with types gone": (lambda own: shutil.rmtree(own.parent / "types"), "weight.st: found 'No such", True),
    "with a name taken": (lambda own: own.write_text(own.read_text() + TAKEN), ": connect C7: name", True),
    "another": (lambda own: own.write_text(OTHER.format("baosky")), ": found another project", True),
    "of another PLC": (lambda own: own.write_text(OTHER.format("s7-1500")), ": found another project", True),
    "a link to itself": (lambda own: loop(own, own.name), ": found 'Too many levels of symbolic links", True),
    "a loop of links": (lambda own: loop(own, "b.toml"), ": found 'Too many levels of symbolic links", True),
    "a folder": (into_folder, ": found a folder", False),
    "with its folder": (lambda own: shutil.rmtree(own.parent), ": no folder ", False),
}  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="its links and messages are other ones")
@pytest.mark.parametrize(("act", "found", "can_be_written"), OUTSIDE.values(), ids=OUTSIDE)
@pytest.mark.parametrize("forced", ["", " !"], ids=["another file", "forced"])
def test_what_happens_to_the_file_outside_loses_no_addition(
    tmp_path: Path, act: Callable[[Path], object], found: str, can_be_written: bool, forced: str
) -> None:
    own, fresh = tmp_path / "mine" / "mine.toml", tmp_path / "there" / "fresh.toml"
    fresh.parent.mkdir()
    shutil.copytree(CONFIGS / "types", own.parent / "types")
    shutil.copy(CONFIGS / "checkweigher.toml", own)
    before = own.read_text()
    for driver in driven(own):
        say(driver, *ADD)
        act(own)
        told = answer(driver, "save project")
        assert found in told and str(own.parent) in told and say(driver).unsaved == 6
        path = own if forced else fresh
        told = answer(driver, f"save project{forced or f' {fresh}'}")
        if forced and not can_be_written:
            assert told.startswith("prompt: found") and say(driver).unsaved == 6
            continue
        assert told.startswith(f"the project with 6 additions in {path}, on the text that was read before (")
        assert found.removeprefix(": no folder ") in told and say(driver).unsaved == 0
        saved, bench = load_bench_project(path), driver.console.bench.project
        assert (saved.connects, saved.peers, saved.instances) == (
            bench.connects,
            bench.peers,
            bench.instances,
        )
        assert [(d.name, d.size) for d in saved.data] == [(d.name, d.size) for d in bench.data]
        assert path.read_text().startswith(before[:200]) and not list(path.parent.glob(".*"))
        assert answer(driver, "add connect C8", "save project") == f"the project with 1 addition in {path}"


def test_another_file_gets_what_the_bench_holds_and_not_what_the_old_one_says_by_now(
    driver: LocalDriver, own: Path
) -> None:
    say(driver, *ADD)
    own.write_text(own.read_text().replace("LocalPort = 0", "LocalPort = 2001"))
    changed, fresh = own.read_bytes(), own.with_name("fresh.toml")
    told = f"the project with 6 additions in {fresh}, on the text that was read before ({own} has changed)"
    assert answer(driver, f"save project {fresh}") == told
    assert [c.local.port for c in load_bench_project(fresh).connects] == [
        0,
        0,
    ] and own.read_bytes() == changed


def test_a_file_that_may_not_be_written_keeps_the_additions_on_the_bench(
    driver: LocalDriver, own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = own.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(os, "access", lambda *_: False)
        for line in ("save project", "save project !"):
            told = answer(driver, *ADD, line)
            assert told == f"prompt: found {own}: 'Permission denied', expected a file that can be written"
    assert own.read_bytes() == before and say(driver).unsaved == 6
    assert answer(driver, "save project") == f"the project with 6 additions in {own}"


@pytest.mark.skipif(sys.platform == "win32", reason="no modes there")
def test_the_file_keeps_its_mode_and_a_link_its_target(driver: LocalDriver, own: Path) -> None:
    own.chmod(0o640)
    link = own.parent / "link.toml"
    link.symlink_to(own)
    answer(driver, *ADD, f"save project {link}")
    assert link.is_symlink() and own.stat().st_mode & 0o777 == 0o640
    assert load_bench_project(own).connect("C7") is not None


def test_a_folder_that_is_not_there_is_one_line(driver: LocalDriver, own: Path) -> None:
    told = answer(driver, *ADD, f"save project {own.parent}/nowhere/x.toml")
    assert told == (
        f"prompt: found {own.parent}/nowhere/x.toml: no folder {own.parent}/nowhere, "
        "expected a file that can be written"
    )
    assert say(driver).unsaved == 6


def test_a_scenario_on_the_bench_ends_without_losing_what_was_added(driver: LocalDriver, own: Path) -> None:
    scenario = CONFIGS / "scenarios" / "baosky" / "passive-static.toml"
    scenario = scenario if scenario.exists() else next((CONFIGS / "scenarios" / "baosky").glob("*.toml"))
    say(driver, *ADD, f"scenario load {scenario} sim")
    assert "leave the scenario first" in answer(driver, "save project")
    picture = say(driver, "scenario stop")
    assert [c.name for c in picture.snapshot.connections] == ["C1", "C7"]
    assert picture.unsaved == 6
    assert answer(driver, "save project") == f"the project with 6 additions in {own}"


def test_a_session_with_additions_is_a_scenario_on_the_old_project(driver: LocalDriver, own: Path) -> None:
    file = own.parent / "session.toml"
    assert "commands" in answer(driver, *ADD, "peer P7 send message hello", f"save scenario {file}")
    played = play(file, "sim")
    assert played.verdict.has_passed, failures(played.verdict)
    late = own.parent / "late.toml"
    assert "commands" in answer(driver, "save project", f"save scenario {late}")
    assert 'project = "' not in late.read_text(), "the file says more by now than the session began with"
    again = play(late, "sim")
    assert again.verdict.has_passed, failures(again.verdict)


def test_a_session_whose_project_is_gone_is_a_scenario_with_the_project_in_it(
    driver: LocalDriver, own: Path
) -> None:
    own.unlink()
    file = own.parent / "session.toml"
    assert "commands" in answer(driver, *ADD, "peer P7 send message hello", f"save scenario {file}")
    assert 'project = "' not in file.read_text()
    played = play(file, "sim")
    assert played.verdict.has_passed, failures(played.verdict)


@pytest.mark.parametrize("name", ["passwd", "a.txt", "mine.toml.bak"])
def test_a_project_is_saved_under_the_name_that_was_given_or_not_at_all(
    driver: LocalDriver, own: Path, name: str
) -> None:
    (own.parent / "passwd").write_text("theirs")
    before = sorted(own.parent.iterdir())
    assert "expected a name that ends in .toml" in answer(driver, *ADD, f"save project {own.parent / name}")
    assert sorted(own.parent.iterdir()) == before
    assert answer(driver, "save project") == f"the project with 6 additions in {own}"


def test_a_session_of_the_demo_names_no_file_of_the_installation(tmp_path: Path) -> None:
    for driver in driven(demo_path()):
        driver.scan(60)
        assert "scans in" in answer(driver, f"save scenario {tmp_path / 'demo.toml'}")
    text = (tmp_path / "demo.toml").read_text()
    assert "project = " not in text and 'name = "Sensor"' in text
    played = play(tmp_path / "demo.toml", "sim")
    assert played.verdict.has_passed, failures(played.verdict)


def test_an_order_mark_of_windows_stays_at_the_beginning(own: Path) -> None:
    own.write_bytes(b"\xef\xbb\xbf" + own.read_bytes().replace(b"\n", b"\r\n"))
    for driver in driven(own):
        assert answer(driver, *ADD, "save project").startswith("the project with 6 additions")
    saved = own.read_bytes()
    assert saved.startswith(b"\xef\xbb\xbf# A passive TRCV_C") and saved.count(b"\n") == saved.count(b"\r\n")
    assert load_project(own).connect("C7") is not None
