"""`trcvtui scenario`: what is printed, in which order, and with which exit code (contracts 4.1, 4.3, 4.4)."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.cli.main import main

PASSIVE = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
TASKS = '[[task]]\nname = "FAST"\ninterval = "T#10ms"\n\n[[task]]\nname = "SLOW"\ninterval = "T#30ms"\n\n'
SLOW = PASSIVE.replace('connect = "C1"', 'connect = "C1"\ntask = "SLOW"').replace(
    "[[data]]", f"{TASKS}[[data]]", 1
)
PULSE = "set TRCV_C_1 CONT=1 EN_R=1\nrun 4\nexpect TRCV_C_1 trace 0001 7001 7002 80A1!"


def scenario(folder: Path, steps: str, name: str = "story.toml", project: str = PASSIVE) -> str:
    file = folder / name
    file.write_text(f'{project}\n[scenario]\nname = "{name}"\nsteps = """\n{steps}\n"""\n', encoding="utf-8")
    return str(file)


class Run:
    """What `trcvtui scenario` answers: its code, the lines of stdout, those of stderr."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err.splitlines()

    @property
    def records(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.out.splitlines()]

    @property
    def shown(self) -> str:
        return ", ".join(f"{record['scan']} {record['STATUS']}" for record in self.records[:-1])

    @property
    def failures(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self.records[-1]["failures"]
        return found


Play = Callable[..., Run]


@pytest.fixture
def play(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Play:

    def run(steps: str, *argv: str, project: str = PASSIVE) -> Run:
        files = steps.split() if ".toml" in steps else [scenario(tmp_path, steps, project=project)]
        code = main(["scenario", *files, "--format", "jsonl", *argv])
        return Run(code, *capsys.readouterr())

    return run


def test_each_change_is_one_object_and_the_last_line_is_the_scenario(play: Play) -> None:
    run = play(PULSE)
    first, second, *_, last = run.records
    assert (run.code, run.shown) == (0, "1 0001, 2 7001, 3 7002, 4 80A1")
    assert first == {
        "scan": 1, "t_ms": 0.0, "at": 0.0, "instance": "TRCV_C_1", "block": "TRCV_C", "STATUS": "0001",
        "BUSY": False, "DONE": False, "ERROR": False, "RCVD_LEN": 0,
    }  # fmt: skip
    assert second["t_ms"] == 10.0
    assert last == {"scenario": "story.toml", "passed": True, "scans": 4, "failures": []}


# What steps show: each record of the instance, its scan and STATUS.
SHOWN = {
    "a scan without a change gives no record": ("run 50", "1 7000"),
    "STOP before scan 1 is no record because nothing differs": (
        "plc stop\nrun 3\nplc run\nrun 1",
        "4 7000",
    ),
    "SLOW: an instance of a slower task is called in its own scans": (
        "set TRCV_C_1 CONT=1\nrun 7\nexpect TRCV_C_1 trace 0001 7001 7002",
        "1 0001, 4 7001, 7 7002",
    ),
    "SLOW: a scan after STOP and RUN that does not call it is told": (
        "run 1\nplc stop\nplc run\nrun 3",
        "1 7000, 2 0000, 4 7000",
    ),
}


@pytest.mark.parametrize("name", SHOWN)
def test_steps_show(name: str, play: Play) -> None:
    steps, shown = SHOWN[name]
    run = play(steps, project=SLOW if name.startswith("SLOW") else PASSIVE)
    assert (run.shown, run.failures, run.code) == (shown, [], 0)


# What fails: the step, its line, what was found in it; and in how many scans the file ended.
FAILING = {
    "a failed expectation is recorded and the run goes on": (
        "run 1\nexpect TRCV_C_1 STATUS=7004\n# no step\nexpect TRCV_C_1 STATUS=7000 DONE=1\nrun 1",
        [
            (2, "expect TRCV_C_1 STATUS=7004", "STATUS=7000"),
            (3, "expect TRCV_C_1 STATUS=7000 DONE=1", "STATUS=7000 DONE=0"),
        ],
        2,
    ),
    "a failed wait ends the file": (
        "wait TRCV_C_1 STATUS=7004 within T#50ms\nrun 100",
        [(1, "wait TRCV_C_1 STATUS=7004 within T#50ms", "STATUS=7000")],
        5,
    ),
    "a trace takes every scan since the one before, whether that held or not": (
        "run 2\nexpect TRCV_C_1 trace 7004\nrun 3\nexpect TRCV_C_1 trace 7000{3}",
        [(2, "expect TRCV_C_1 trace 7004", "7000{2}")],
        5,
    ),
    "sending on a connection that is not up": (
        "peer P1 send hex 01\nrun 1",
        [(1, "peer P1 send hex 01", "not connected")],
        1,
    ),
}


@pytest.mark.parametrize(("steps", "failures", "scans"), FAILING.values(), ids=FAILING)
def test_what_fails(steps: str, failures: list[tuple[int, str, str]], scans: int, play: Play) -> None:
    run = play(steps)
    assert (run.code, run.records[-1]["passed"], run.records[-1]["scans"]) == (1, False, scans)
    assert [(one["step"], one["line"]) for one in run.failures] == [failure[:2] for failure in failures]
    assert all(one[2] in failure["found"] for one, failure in zip(failures, run.failures, strict=True))


def test_no_command_waits_for_a_partner_whose_window_is_closed(
    play: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    naps: list[int] = []
    monkeypatch.setattr("trcvtui.scenario.command.clock.sleep_until", naps.append)
    steps = "set TRCV_C_1 CONT=1\nrun 3\npeer P1 connect\nrun 5\nexpect peer P1 connected\n"
    steps += "peer P1 send random 16000000 seed=1\nset TRCV_C_1 LEN=1\nset TRCV_C_1 LEN=2\nrun 2"
    run = play(steps, "--kernel", "live")
    assert run.code == 0
    assert len(naps) == run.records[-1]["scans"] == 10, "time passes with scans alone"


def test_on_a_late_live_bench_run_is_the_time_that_it_says(
    play: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = itertools.count(0, 40_000_000)  # each scan of T#10ms is 40 ms after the last, or later
    monkeypatch.setattr("trcvtui.scenario.command.clock.now_ns", lambda: next(times))
    monkeypatch.setattr("trcvtui.scenario.command.clock.sleep_until", lambda deadline: None)
    assert 1 <= play("run T#200ms", "--kernel", "live").records[-1]["scans"] <= 5
    assert play("run T#200ms", "--kernel", "sim").records[-1]["scans"] == 20


def test_json_lines_are_ascii_whatever_a_partner_sent(play: Play) -> None:
    steps = "write rx 'a$9B$7F$1B'\nrun 1\nexpect rx 'AÄ'"
    run = play(steps, project=PASSIVE.replace("ARRAY[0..7] OF BYTE", "STRING[9]"))
    assert run.code == 1 and run.out.isascii() and "\x7f" not in run.out
    (failure,) = run.failures
    assert (failure["found"], failure["line"]) == ("a\x9b\x7f\x1b", "expect rx 'AÄ'")


def test_files_follow_each_other_the_worst_exit_code_wins_and_a_wrong_one_has_its_line(
    tmp_path: Path, play: Play
) -> None:
    good = scenario(tmp_path, "run 1", "good.toml")
    bad = scenario(tmp_path, "expect TRCV_C_1 STATUS=7004", "bad.toml")
    wrong = scenario(tmp_path, "wiat 5\nfrob", "wrong.toml")
    absent = str(tmp_path / "absent.toml")
    assert play(f"{good} {bad}").code == 1
    run = play(f"{wrong} {absent} {bad} {good}")
    ends = [record for record in run.records if "scenario" in record]
    assert run.code == 2
    assert [(end["scenario"], end["passed"], end["scans"]) for end in ends] == [
        (wrong, False, 0),
        (absent, False, 0),
        ("bad.toml", False, 0),
        ("good.toml", True, 1),
    ]
    failures = [failure for end in ends[:2] for failure in end["failures"]]
    assert [failure["found"] for failure in failures] == run.err and len(failures) == 3
    assert {(failure["step"], failure["line"]) for failure in failures} == {(0, "")}


def test_set_changes_the_project_for_one_run(play: Play) -> None:
    steps = "set TRCV_C_1 CONT=1 EN_R=1\nrun 4\nexpect TRCV_C_1 trace 0001 7001 7002{2}"
    assert play(steps).code == 1
    assert play(steps, "--set", "options.not_connected=never").code == 0
    run = play(steps, "--set", "options.not_connected=sometimes")
    assert run.code == 2 and "not_connected" in run.err[0]


def test_out_writes_the_file_and_nothing_to_stdout(tmp_path: Path, play: Play) -> None:
    out = tmp_path / "run.jsonl"
    run = play(PULSE, "--out", str(out))
    assert (run.code, run.out) == (0, "")
    assert len(out.read_text(encoding="utf-8").splitlines()) == 5


def test_start_comes_before_scan_1_and_is_step_0(play: Play) -> None:
    start = 'start = "set TRCV_C_1 CONT=1\\nexpect TRCV_C_1 LEN=5"\n'
    run = play("run 1\nexpect TRCV_C_1 trace 0001\nexpect TRCV_C_1 LEN=6", project=start + PASSIVE)
    assert [(one["step"], one["line"]) for one in run.failures] == [
        (0, "expect TRCV_C_1 LEN=5"),
        (3, "expect TRCV_C_1 LEN=6"),
    ]


@pytest.mark.parametrize("line", ["run 5", "wait peer P1 closed", "expect peer P1 closed within T#1s"])
def test_start_refuses_every_command_that_lets_scans_pass(line: str, play: Play) -> None:
    run = play("run 1", project=f'start = "{line}"\n' + PASSIVE)
    (said,) = run.err
    assert run.code == 2 and f"start: step 1: found '{line}'" in said


def test_all_mistakes_of_one_file_are_told_together(tmp_path: Path, play: Play) -> None:
    project = 'start = "frob"\n' + PASSIVE + 'says = ["hxe 01"]\n'
    file = Path(scenario(tmp_path, "wiat 5", project=project))
    file.write_text(file.read_text(encoding="utf-8") + 'colour = "red"\n', encoding="utf-8")
    run = play(str(file))
    assert [line.partition(", expected")[0] for line in run.err] == [
        f"{file}: scenario: colour: found an unknown key",
        f"{file}: start: step 1 (frob): found 'frob'",
        f"{file}: peer P1: says #1: found 'hxe'",
        f"{file}: step 1 (wiat 5): found 'wiat'",
    ]


def test_a_file_that_a_step_sends_stands_beside_the_scenario(tmp_path: Path, play: Play) -> None:
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "passive.toml").write_text(PASSIVE, encoding="utf-8")
    (tmp_path / "x.bin").write_bytes(b"abc")
    run = play("peer P1 send file x.bin", project='project = "bench/passive.toml"\n')
    assert run.code == 1 and "not connected" in run.failures[0]["found"]
