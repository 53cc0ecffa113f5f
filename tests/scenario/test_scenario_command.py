"""`trcvtui scenario`: what is printed, in which order, and with which exit code (contracts 4.1, 4.3, 4.4)."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.cli.main import main
from trcvtui.cli.options import KERNELS

PASSIVE = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
PULSE = "set TRCV_C_1 CONT=1 EN_R=1\nrun 4\nexpect TRCV_C_1 trace 0001 7001 7002 80A1!"


def scenario(folder: Path, steps: str, name: str = "story.toml", project: str = PASSIVE) -> str:
    file = folder / name
    file.write_text(f'{project}\n[scenario]\nname = "{name}"\nsteps = """\n{steps}\n"""\n', encoding="utf-8")
    return str(file)


def jsonl(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_each_change_is_one_object_and_the_last_line_is_the_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scenario", scenario(tmp_path, PULSE), "--format", "jsonl"]) == 0
    first, *others, last = jsonl(capsys)
    assert first == {
        "scan": 1,
        "t_ms": 0.0,
        "at": 0.0,
        "instance": "TRCV_C_1",
        "block": "TRCV_C",
        "STATUS": "0001",
        "BUSY": False,
        "DONE": False,
        "ERROR": False,
        "RCVD_LEN": 0,
    }
    assert [(r["scan"], r["t_ms"], r["STATUS"]) for r in others] == [
        (2, 10.0, "7001"),
        (3, 20.0, "7002"),
        (4, 30.0, "80A1"),
    ]
    assert last == {"scenario": "story.toml", "passed": True, "scans": 4, "failures": []}


def test_a_scan_without_a_change_gives_no_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["scenario", scenario(tmp_path, "run 50"), "--format", "jsonl"])
    assert [r.get("STATUS") for r in jsonl(capsys)] == ["7000", None]


def test_a_failed_expectation_is_recorded_and_the_run_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = (
        "run 1\nexpect TRCV_C_1 STATUS=7004\n# a comment is no step\n"
        "expect TRCV_C_1 STATUS=7000 DONE=1\nrun 1"
    )
    assert main(["scenario", scenario(tmp_path, steps), "--format", "jsonl"]) == 1
    last = jsonl(capsys)[-1]
    assert last["passed"] is False and last["scans"] == 2
    assert last["failures"] == [
        {"step": 2, "line": "expect TRCV_C_1 STATUS=7004", "found": "STATUS=7000"},
        {"step": 3, "line": "expect TRCV_C_1 STATUS=7000 DONE=1", "found": "STATUS=7000 DONE=0"},
    ]


def test_a_failed_wait_ends_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = "wait TRCV_C_1 STATUS=7004 within T#50ms\nrun 100"
    assert main(["scenario", scenario(tmp_path, steps), "--format", "jsonl"]) == 1
    assert jsonl(capsys)[-1]["scans"] == 5


def test_a_trace_takes_every_scan_since_the_one_before_whether_it_held_or_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "run 2\nexpect TRCV_C_1 trace 7004\nrun 3\nexpect TRCV_C_1 trace 7000{3}"
    assert main(["scenario", scenario(tmp_path, steps), "--format", "jsonl"]) == 1
    (failure,) = jsonl(capsys)[-1]["failures"]
    assert failure == {"step": 2, "line": "expect TRCV_C_1 trace 7004", "found": "7000{2}"}


def test_within_looks_at_the_last_scan_first_and_stops_where_it_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "run 1\nexpect TRCV_C_1 STATUS=7000 within T#1s\nset TRCV_C_1 CONT=1\nwait TRCV_C_1 STATUS=7002"
    assert main(["scenario", scenario(tmp_path, steps), "--format", "jsonl"]) == 0
    assert jsonl(capsys)[-1]["scans"] == 4


def test_of_two_sets_before_one_scan_the_last_wins_without_an_edge(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "run 1\nset TRCV_C_1 CONT=1\nset TRCV_C_1 CONT=0\nrun 2\nexpect TRCV_C_1 trace 7000{3}"
    assert main(["scenario", scenario(tmp_path, steps)]) == 0


def test_a_pulse_is_true_in_one_called_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = (
        "pulse TRCV_C_1 CONT\nrun 1\nexpect TRCV_C_1 CONT=1\nrun 1\nexpect TRCV_C_1 CONT=0\nrun 1\n"
        "expect TRCV_C_1 trace 0001 7003 7000"
    )
    assert main(["scenario", scenario(tmp_path, steps)]) == 0


def test_a_set_after_a_pulse_of_the_same_pin_wins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = "run 1\npulse TRCV_C_1 EN_R\nset TRCV_C_1 EN_R=1\nrun 3\nexpect TRCV_C_1 EN_R=1"
    assert main(["scenario", scenario(tmp_path, steps)]) == 0


def test_a_pulse_of_a_blinking_pin_is_true_in_its_scan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "set TRCV_C_1 EN_R=blink\nrun 1\npulse TRCV_C_1 EN_R\nrun 1\nexpect TRCV_C_1 EN_R=1"
    assert main(["scenario", scenario(tmp_path, steps)]) == 0


def test_an_edge_of_en_r_in_the_scan_of_a_reset_arms_80a1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = (
        "set TRCV_C_1 CONT=1\nrun 3\npeer P1 connect\nwait TRCV_C_1 STATUS=7004\nrun 1\n"
        "expect TRCV_C_1 trace 0001 7001 7002 7004{2}\nset TRCV_C_1 COM_RST=1 EN_R=1\nrun 7\n"
        "expect TRCV_C_1 trace 8000 7003 7007 7002 80A1! 7002{2}"
    )
    assert main(["scenario", scenario(tmp_path, steps)]) == 0


def test_blink_toggles_the_pin_in_every_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = "set TRCV_C_1 CONT=blink\nrun 5\nexpect TRCV_C_1 trace 0001 7003 0001 7003 0001"
    assert main(["scenario", scenario(tmp_path, steps)]) == 0


def test_stop_gives_0000_and_run_starts_fresh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = "set TRCV_C_1 CONT=1\nrun 3\nplc stop\nrun 3\nplc run\nrun 1"
    assert main(["scenario", scenario(tmp_path, steps), "--format", "jsonl"]) == 0
    records = [(r["scan"], r["STATUS"]) for r in jsonl(capsys)[:-1]]
    assert records == [(1, "0001"), (2, "7001"), (3, "7002"), (4, "0000"), (7, "0001")]


def test_stop_before_scan_1_is_no_record_because_nothing_differs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scenario", scenario(tmp_path, "plc stop\nrun 3\nplc run\nrun 1"), "--format", "jsonl"]) == 0
    assert [(r["scan"], r["STATUS"]) for r in jsonl(capsys)[:-1]] == [(4, "7000")]


def test_stop_and_run_before_one_scan_tell_the_instance_that_this_scan_does_not_call(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tasks = '[[task]]\nname = "FAST"\ninterval = "T#10ms"\n\n[[task]]\nname = "SLOW"\ninterval = "T#30ms"\n'
    project = PASSIVE.replace('connect = "C1"', 'connect = "C1"\ntask = "SLOW"')
    file = scenario(
        tmp_path,
        "run 1\nplc stop\nplc run\nrun 3",
        project=project.replace("[[data]]", tasks + "[[data]]", 1),
    )
    assert main(["scenario", file, "--format", "jsonl"]) == 0
    records = [(r["scan"], r["STATUS"]) for r in jsonl(capsys)[:-1]]
    assert records == [(1, "7000"), (2, "0000"), (4, "7000")]


def test_an_instance_of_a_slower_task_is_called_in_its_own_scans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tasks = '[[task]]\nname = "FAST"\ninterval = "T#10ms"\n\n[[task]]\nname = "SLOW"\ninterval = "T#30ms"\n'
    project = PASSIVE.replace('connect = "C1"', 'connect = "C1"\ntask = "SLOW"')
    steps = "set TRCV_C_1 CONT=1\nrun 7\nexpect TRCV_C_1 trace 0001 7001 7002"
    file = scenario(tmp_path, steps, project=project.replace("[[data]]", tasks + "\n[[data]]", 1))
    assert main(["scenario", file, "--format", "jsonl"]) == 0
    assert [r["t_ms"] for r in jsonl(capsys)[:-1]] == [0.0, 30.0, 60.0]


def test_sending_on_a_connection_that_is_not_up_is_a_failed_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scenario", scenario(tmp_path, "peer P1 send hex 01\nrun 1"), "--format", "jsonl"]) == 1
    (failure,) = jsonl(capsys)[-1]["failures"]
    assert failure["step"] == 1 and "not connected" in failure["found"]


def test_no_command_waits_for_a_partner_whose_window_is_closed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    naps: list[int] = []
    monkeypatch.setattr("trcvtui.scenario.command.clock.sleep_until", naps.append)
    steps = "set TRCV_C_1 CONT=1\nrun 3\npeer P1 connect\nrun 5\nexpect peer P1 connected\n"
    steps += "peer P1 send random 16000000 seed=1\nset TRCV_C_1 LEN=1\nset TRCV_C_1 LEN=2\nrun 2"
    file = scenario(tmp_path, steps)
    assert main(["scenario", file, "--kernel", "live", "--format", "jsonl"]) == 0
    assert len(naps) == jsonl(capsys)[-1]["scans"] == 10, "time passes with scans alone"


def test_on_a_late_live_bench_run_is_the_time_that_it_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    times = itertools.count(0, 40_000_000)  # each scan of T#10ms is 40 ms after the last, or later
    monkeypatch.setattr("trcvtui.scenario.command.clock.now_ns", lambda: next(times))
    monkeypatch.setattr("trcvtui.scenario.command.clock.sleep_until", lambda deadline: None)
    file = scenario(tmp_path, "run T#200ms")
    assert main(["scenario", file, "--kernel", "live", "--format", "jsonl"]) == 0
    assert 1 <= jsonl(capsys)[-1]["scans"] <= 5
    assert main(["scenario", file, "--kernel", "sim", "--format", "jsonl"]) == 0
    assert jsonl(capsys)[-1]["scans"] == 20


def test_json_lines_are_ascii_whatever_a_partner_sent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "write rx 'a$9B$7F$1B'\nrun 1\nexpect rx 'AÄ'"
    file = scenario(tmp_path, steps, project=PASSIVE.replace("ARRAY[0..7] OF BYTE", "STRING[9]"))
    assert main(["scenario", file, "--format", "jsonl"]) == 1
    *_, out = capsys.readouterr().out.splitlines()
    assert out.isascii() and "\x7f" not in out
    (failure,) = json.loads(out)["failures"]
    assert (failure["found"], failure["line"]) == ("a\x9b\x7f\x1b", "expect rx 'AÄ'")


@pytest.mark.parametrize("kernel", KERNELS)
def test_what_is_sent_into_a_cut_wire_comes_when_it_is_mended(
    kernel: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = (
        "set TRCV_C_1 CONT=1 EN_R=1 LEN=2\nwait TRCV_C_1 STATUS=7002\npeer P1 connect\n"
        "wait TRCV_C_1 STATUS=7006\nlink C1 down\npeer P1 send hex 01 02\nrun 10\n"
        "expect TRCV_C_1 STATUS=7006\nlink C1 up\nwait TRCV_C_1 STATUS=7008 within T#2s\nexpect rx hex 01 02"
    )
    assert main(["scenario", scenario(tmp_path, steps), "--kernel", kernel]) == 0, capsys.readouterr().out


def test_several_files_follow_each_other_and_the_worst_exit_code_wins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = scenario(tmp_path, "run 1", "good.toml")
    bad = scenario(tmp_path, "expect TRCV_C_1 STATUS=7004", "bad.toml")
    wrong = scenario(tmp_path, "wiat TRCV_C_1 STATUS=7004", "wrong.toml")
    assert main(["scenario", good, bad]) == 1
    assert main(["scenario", wrong, bad, good]) == 2
    out, err = capsys.readouterr()
    assert out.count("good.toml") == 2 and out.count("bad.toml") == 2
    assert err.count("\n") == 1 and "step 1" in err and "wiat" in err and "wait" in err


def test_a_file_that_cannot_be_loaded_has_its_json_line_as_every_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, absent = scenario(tmp_path, "run 1", "good.toml"), str(tmp_path / "absent.toml")
    wrong = scenario(tmp_path, "wiat 5\nfrob", "wrong.toml")
    assert main(["scenario", wrong, absent, good, "--format", "jsonl"]) == 2
    out, err = capsys.readouterr()
    told = [line for line in map(json.loads, out.splitlines()) if "scenario" in line]
    assert [(line["passed"], line["scans"]) for line in told] == [(False, 0), (False, 0), (True, 1)]
    assert [line["scenario"] for line in told[:2]] == [wrong, absent]
    failures = [failure for line in told[:2] for failure in line["failures"]]
    assert [failure["found"] for failure in failures] == err.splitlines() and len(failures) == 3
    assert {(failure["step"], failure["line"]) for failure in failures} == {(0, "")}


def test_mistakes_of_all_lines_are_told_together_at_most_ten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = "\n".join(f"set TRCV_C_{n} CONT=1" for n in range(2, 20))
    assert main(["scenario", scenario(tmp_path, steps)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 11
    assert err.splitlines()[-1] == "and 8 more"


def test_set_changes_the_project_for_one_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = scenario(tmp_path, "set TRCV_C_1 CONT=1 EN_R=1\nrun 4\nexpect TRCV_C_1 trace 0001 7001 7002{2}")
    assert main(["scenario", file]) == 1
    assert main(["scenario", file, "--set", "options.not_connected=never"]) == 0
    assert main(["scenario", file, "--set", "options.not_connected=sometimes"]) == 2
    assert "not_connected" in capsys.readouterr().err


def test_out_writes_the_file_and_nothing_to_stdout(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run.jsonl"
    assert main(["scenario", scenario(tmp_path, PULSE), "--format", "jsonl", "--out", str(out)]) == 0
    assert capsys.readouterr().out == ""
    assert len(out.read_text(encoding="utf-8").splitlines()) == 5


def test_a_scenario_without_steps_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "story.toml"
    file.write_text(PASSIVE + '\n[scenario]\nname = "x"\n', encoding="utf-8")
    assert main(["scenario", str(file)]) == 2
    assert "steps" in capsys.readouterr().err


def test_start_comes_before_scan_1_and_can_let_no_scan_pass(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = 'start = "set TRCV_C_1 CONT=1"\n'
    assert (
        main(["scenario", scenario(tmp_path, "run 1\nexpect TRCV_C_1 trace 0001", project=start + PASSIVE)])
        == 0
    )
    start = 'start = "run 5"\n'
    assert main(["scenario", scenario(tmp_path, "run 1", project=start + PASSIVE)]) == 2
    assert "start" in capsys.readouterr().err


@pytest.mark.parametrize("line", ["wait peer P1 closed", "expect peer P1 closed within T#1s"])
def test_start_refuses_every_command_that_lets_scans_pass(
    line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = scenario(tmp_path, "run 1", project=f'start = "{line}"\n' + PASSIVE)
    assert main(["scenario", file]) == 2
    assert capsys.readouterr().err == (
        f"{file}: start: step 1: found '{line}', expected commands that let no scan pass\n"
    )


def test_all_mistakes_of_one_file_are_told_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = 'start = "frob"\n' + PASSIVE + 'says = ["hxe 01"]\n'
    file = Path(scenario(tmp_path, "wiat 5", project=project))
    file.write_text(file.read_text(encoding="utf-8") + 'colour = "red"\n', encoding="utf-8")
    assert main(["scenario", str(file)]) == 2
    said = [line.partition(", expected")[0] for line in capsys.readouterr().err.splitlines()]
    assert said == [
        f"{file}: scenario: colour: found an unknown key",
        f"{file}: start: step 1 (frob): found 'frob'",
        f"{file}: peer P1: says #1: found 'hxe'",
        f"{file}: step 1 (wiat 5): found 'wiat'",
    ]


def test_a_failed_command_of_start_is_step_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = 'start = "set TRCV_C_1 CONT=1\\nexpect TRCV_C_1 LEN=5"\n' + PASSIVE
    file = scenario(tmp_path, "expect TRCV_C_1 LEN=6", project=project)
    assert main(["scenario", file, "--format", "jsonl"]) == 1
    failures = jsonl(capsys)[-1]["failures"]
    assert [(f["step"], f["line"]) for f in failures] == [
        (0, "expect TRCV_C_1 LEN=5"),
        (1, "expect TRCV_C_1 LEN=6"),
    ]


def test_a_file_that_a_step_sends_stands_beside_the_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "passive.toml").write_text(PASSIVE, encoding="utf-8")
    (tmp_path / "x.bin").write_bytes(b"abc")
    steps = "peer P1 send file x.bin"
    file = scenario(tmp_path, steps, project='project = "bench/passive.toml"\n')
    assert main(["scenario", file, "--format", "jsonl"]) == 1
    assert "not connected" in jsonl(capsys)[-1]["failures"][0]["found"]
