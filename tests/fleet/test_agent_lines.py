"""Lines of an agent that are no bench: shadows of a capture program; what the doctor finds."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.diagnosis.truth.cases import plc, receiver
from tests.local_driver import LocalDriver, wait_for
from trcvtui.cli.main import main
from trcvtui.engine.controller import fresh_bench
from trcvtui.engine.driver import ProcessDriver
from trcvtui.fleet.agent import Agent, AgentSettings
from trcvtui.fleet.lines import AgentBench
from trcvtui.line.live_screen import capture_main
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.snapshots.doctor import DoctorSnapshot, Finding, Remedy

LINE = plc('LocalAddress = "127.0.0.1"\nLocalPort = 2000\n', receiver("TRCV_C", 4, ""))
PEER = 'CONT = true\nEN_R = true\n[[peer]]\nname = "P1"\nactive = true\nremote = "@C1"\n'
TAP = '[[tap]]\nname = "T"\nlisten = "127.0.0.1:0"\nto = "127.0.0.1:{port}"\nconnect = "C1"\n'
WATCH = '[[watch]]\nname = "press"\nplc = "127.0.0.1:2000"\nconnect = "C1"\n'
HEX = "0E CE 98 07"


def written(folder: Path, text: str, name: str = "line.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def found(cause: str, instance: str = "", connect: str = "C1") -> Finding:
    mend = (Remedy("LEN 8", "set R LEN=8", "instance.R.LEN=8"),)
    evidence = (f"before it: {HEX}",)
    return Finding(0.9, evidence, instance=instance, mend=mend, cause=cause, scan=7, connect=connect)


# -- findings --------------------------------------------------------------------------------------------


def test_a_cause_is_one_event_of_each_instance_until_it_is_gone(tmp_path: Path) -> None:
    project = load_bench_project(written(tmp_path, LINE + PEER))
    driver = LocalDriver(fresh_bench(project, "sim"))
    seen = AgentBench("b00", project.dialect.label)
    seen.handle_update(driver.shown(), 1000.0)

    def told(looks: int, *findings: Finding, with_payload: bool = False) -> list[dict[str, object]]:
        some = seen.make_finding_events(DoctorSnapshot(looks, 100, 1, findings), 1000.0, with_payload)
        return [{"kind": event.kind, **event.cause} for _, event in some]

    first = {"kind": "finding", "cause": "frame-short", "confidence": 0.9, "text": "90% sure; LEN 8"}
    assert told(1, found("frame-short", "R")) == [first | {"command": "set R LEN=8", "scan": 7}]
    assert told(1, found("shifted", "R")) == []  # it has not looked again
    assert told(2, found("frame-short", "R")) == []  # it is known
    assert told(3) == []
    again = told(4, found("frame-short", "R"), found("loss"), found("loss", "OTHER", "C2"))
    assert [one["cause"] for one in again] == ["frame-short", "loss"]
    assert "evidence" not in told(5, found("padding"))[0]
    assert told(6, found("header"), with_payload=True)[0]["evidence"] == f"before it: {HEX}"


def test_a_line_of_a_watch_or_tap_row_has_the_name_of_the_row(tmp_path: Path) -> None:
    project = load_bench_project(written(tmp_path, LINE + PEER))
    driver = LocalDriver(fresh_bench(project, "sim"))
    watched = load_bench_project(
        written(tmp_path, LINE + WATCH + WATCH.replace("press", "mill"), "watch.toml")
    )
    of_rows = Agent(AgentSettings(tmp_path, "sim", "s", "n", None, None, None), watched).seen
    assert of_rows._names == {"C1": "press, mill"}  # one CONNECT is one line
    seen = AgentBench("b00", project.dialect.label, names={"C1": "press"})
    seen.handle_update(driver.shown(), 1000.0)
    assert [*seen.lines] == ["press"] and seen.instances["R"].line == "press"
    [(instance, _)] = seen.make_finding_events(DoctorSnapshot(1, 100, 1, (found("loss"),)), 1000.0, False)
    assert instance.line == "press" and instance.finding == "loss"


@pytest.mark.parametrize("option", ["--site", "--name"])
def test_an_empty_name_is_a_mistake(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["agent", "configs/active.toml", "--metrics", "127.0.0.1:9", option, ""]) == 2
    assert f"{option}: found an empty name" in capsys.readouterr().err


# -- a capture program -------------------------------------------------------------------------------------


def recording(folder: Path) -> Path:
    begin = "run 5\npeer P1 connect\nwait R STATUS=7004\nset R EN_R=1\nrun 5\n"
    steps = f"{begin}peer P1 send hex 01 02 03 04 05 06 07 08 09 0A 0B 0C\nrun 20\n"
    project = written(folder, LINE + PEER.replace("EN_R = true", ""))
    text = f'project = "{project}"\n[scenario]\nname = "s"\nsteps = """\n{steps}"""\n'
    path = folder / "run.pcapng"
    main(["scenario", str(written(folder, text, "s.toml")), "--record", str(path)])
    return path


@pytest.mark.live
def test_shadows_show_what_a_capture_program_writes_and_say_when_it_has_ended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capture = recording(tmp_path)
    copy = f"import shutil, sys; shutil.copyfileobj(open({str(capture)!r}, 'rb'), sys.stdout.buffer)"
    driver = ProcessDriver(
        capture_main, [sys.executable, "-c", copy], (written(tmp_path, LINE + WATCH, "w.toml"), None, None)
    )
    try:
        last = wait_for(driver, lambda picture: bool(picture.over))
        assert last.snapshot.instances[0].jobs_done == 3
        assert last.over == "the packets have ended"
    finally:
        driver.close()


@pytest.mark.parametrize(
    ("text", "words", "wrong"),
    [
        (LINE + WATCH, "", "[[watch]]: found no packets, expected --packets"),
        (LINE + WATCH, "--packets nothere", "--packets: found no program 'nothere'"),
        (LINE + WATCH, "--packets sh --record runs", "--record: found --packets beside it"),
        (LINE, "--packets sh", "--packets: found no [[watch]]"),
        (LINE + TAP.format(port=9), "--record runs", "--record: found [[tap]] beside it"),
        (LINE + WATCH + TAP.format(port=9), "--packets sh", "found [[watch]] beside [[tap]]"),
    ],
)
def test_what_an_agent_cannot_run_is_one_line(
    text: str,
    words: str,
    wrong: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["agent", str(written(tmp_path, text)), "--metrics", "127.0.0.1:9", *words.split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert wrong in line
