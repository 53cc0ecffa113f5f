"""What was done on a bench, saved as a scenario: it runs, and it finds again what was seen."""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.local_driver import LocalDriver
from tests.properties.drawn_projects import projects
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.scenario import recorded_session as kept
from trcvtui.scenario.recorded_session import StatusPattern
from trcvtui.scenario.scenario import load_scenario
from trcvtui.snapshots.bench import LineAnswer


def say(driver: LocalDriver, *lines: str | int) -> LineAnswer:
    """Say lines, let scans pass where a number stands; return the last answer."""
    for line in lines:
        if isinstance(line, int):
            driver.scan(line)
        else:
            driver.submit(line)
    return driver.shown().answers[-1]


def steps_of(file: Path) -> list[str]:
    return [step.line for step in load_scenario(file).steps]


def test_the_scans_of_the_wire_are_any_number_whoever_numbers_them(tmp_path: Path) -> None:
    """A vendor whose blocks have tables of their own, too: one scan of 7006 may be two on real sockets."""
    file = tmp_path / "s7.toml"
    driver = LocalDriver(fresh_bench(load_project(CONFIGS / "s7-receiver.toml"), "sim"))
    say(driver, "set TRCV_C_1 CONT=1", 3, "peer P1 connect", 3, "set TRCV_C_1 EN_R=1", 1)
    say(driver, "peer P1 close", 2, f"save scenario {file}")
    driver.close()
    assert steps_of(file)[-1] == "expect TRCV_C_1 trace 7001 7002+ 7004+ 7006+ 80C5! 80C4!"


def test_a_session_becomes_a_scenario_that_finds_again_what_was_seen(
    driver: LocalDriver, tmp_path: Path
) -> None:
    file = tmp_path / "first.toml"
    answer = say(
        driver, 3, "set TRCV_C_1 CONT=1 EN_R=1", 8, "peer P1 connect", 5,
        "peer P1 send random 24 seed=1 split=7 gap=T#30ms", 10, "peer P1 rst", 4, f"save scenario {file}",
    )  # fmt: skip
    assert answer.error == ""
    assert answer.message == f"4 commands, 30 scans in {file}"
    steps = steps_of(file)
    assert steps[:-1] == [
        "run 3",
        "set TRCV_C_1 CONT=1 EN_R=1",
        "run 8",
        "peer P1 connect",
        "run 5",
        "peer P1 send random 24 seed=1 split=7 gap=T#30ms",
        "run 10",
        "peer P1 rst",
        "run 4",
    ]
    assert steps[-1].startswith(
        "expect TRCV_C_1 trace 7000+ 0001 7001 7002+ 80A1! 7002+ 7004+ 7006+ 7008 7006+"
    )
    assert main(["scenario", str(file), "--kernel", "sim"]) == 0
    assert main(["scenario", str(file), "--kernel", "live"]) == 0


def test_a_command_that_was_refused_is_not_in_it(driver: LocalDriver, tmp_path: Path) -> None:
    file = tmp_path / "first.toml"
    say(driver, "peer P1 send hex 01", "set NOBODY EN_R=1", "expect TRCV_C_1 EN_R=1", 2)
    say(driver, f"save scenario {file}")
    assert [line for line in steps_of(file) if not line.startswith("expect")] == ["run 2"]


def test_a_mark_begins_the_expectations_anew(driver: LocalDriver, tmp_path: Path) -> None:
    file = tmp_path / "late.toml"
    answer = say(driver, "set TRCV_C_1 CONT=1", 10, "mark")
    assert answer.message == "marked after scan 10"
    say(driver, 1, "mark", "peer P1 connect", 5, f"save scenario {file}")
    assert steps_of(file) == [
        "set TRCV_C_1 CONT=1",
        "run 11",
        "expect TRCV_C_1 trace ...",
        "peer P1 connect",
        "run 5",
        "expect TRCV_C_1 trace 7004+",
    ]
    assert main(["scenario", str(file)]) == 0


def test_an_instance_that_was_deleted_is_judged_before_it_goes(driver: LocalDriver, tmp_path: Path) -> None:
    file = tmp_path / "gone.toml"
    say(
        driver, "set TRCV_C_1 CONT=1", 4, "delete TRCV_C_1", 2, "create TRCV_C TRCV_C_1 connect=C1 data=rx", 3
    )
    say(driver, f"save scenario {file}")
    assert steps_of(file)[2:4] == ["expect TRCV_C_1 trace 0001 7001 7002+", "delete TRCV_C_1"]
    assert main(["scenario", str(file)]) == 0
    say(driver, "mark", 1, f"save scenario {file}")
    assert main(["scenario", str(file)]) == 0


def test_bytes_of_a_file_are_saved_as_what_they_were(driver: LocalDriver, tmp_path: Path) -> None:
    sent, file = tmp_path / "x.bin", tmp_path / "sent.toml"
    sent.write_bytes(b"\x01\x02")
    say(driver, "set TRCV_C_1 CONT=1", 4, "peer P1 connect", 4, f'peer P1 send file "{sent}"', 1)
    sent.unlink()
    assert say(driver, f"save scenario {file}").error == ""
    assert "peer P1 send hex 01 02" in steps_of(file)


def test_quotes_backslashes_and_odd_names_come_through(driver: LocalDriver, tmp_path: Path) -> None:
    line = r'peer P1 send text "a\\b\x1b \"\"\" ä"'
    file = tmp_path / 'an "odd" name.toml'
    say(driver, "set TRCV_C_1 CONT=1", 4, "peer P1 connect", 4, line, 1, f"save scenario {file}")
    assert line in steps_of(file)
    assert load_scenario(file).name == 'an "odd" name'


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("save", "prompt: found 'save ', expected save scenario FILE"),
        ("save scenario", "prompt: found 'save scenario', expected save scenario FILE"),
        ("save scenario {there}", "{there}, which is there already, expected the name of a new file"),
        ("save scenario {there}.txt", "there.toml.txt', expected a name that ends in .toml"),
        ("save scenario {there}/", "expected the name of a file"),
        ("save scenario {nowhere}", "/no, expected an existing folder"),
    ],
)
def test_a_file_that_cannot_be_written_is_told_in_one_line(
    driver: LocalDriver, tmp_path: Path, line: str, error: str
) -> None:
    there = tmp_path / "there.toml"
    there.write_text("mine")
    names = {"there": there, "nowhere": tmp_path / "no" / "where.toml"}
    assert error.format(**names) in say(driver, line.format(**names)).error
    assert there.read_text() == "mine"


def test_a_file_of_this_session_is_written_over(driver: LocalDriver, tmp_path: Path) -> None:
    file = tmp_path / "again.toml"
    say(driver, 1, f"save scenario {file}")
    assert say(driver, 1, f"save scenario {file}").error == ""
    assert steps_of(file)[0] == "run 2"


def test_a_session_too_long_to_be_kept_says_so(
    driver: LocalDriver, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "MOST_COMMANDS", 3)
    answer = say(driver, *["set TRCV_C_1 CONT=1"] * 4, f"save scenario {tmp_path / 'x.toml'}")
    assert "found 4 commands of 76 characters, expected at most 3" in answer.error


def test_a_session_with_frames_expects_each_of_them_with_its_bytes(tmp_path: Path) -> None:
    file = tmp_path / "frames.toml"
    driver = LocalDriver(fresh_bench(load_project(CONFIGS / "twincat-line.toml"), "sim"))
    say(driver, 1, "prefix RD hex 02", "suffix RD hex 03", "feed RX hex 02 40 03", 2, "mark", 1)
    say(driver, "feed RX hex 02 41 42 03 02 43 03", 3, f"save scenario {file}")
    shown = "expect RD DataReceived=1 busy=0 Error=0 RxTimeout=0 LenReceiveData="
    steps = steps_of(file)
    assert [step for step in steps if step.startswith("expect") and "trace" not in step] == [
        f"{shown}4",
        "expect rx hex 02 41 42 03",
        f"{shown}3",
        "expect rx hex 02 43 03",
    ]
    assert main(["scenario", str(file)]) == 0
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("feed RX hex 02 41 42 03", "feed RX hex 02 41 44 03"), encoding="utf-8")
    assert main(["scenario", str(file)]) == 1, "another byte is another frame"


def test_a_long_trace_keeps_its_first_and_its_newest_runs() -> None:
    seen = StatusPattern()
    for number in range(1, 1001):
        seen.add((number, False))
        if number % 2:
            seen.add((number, False))
    words = seen.format_pattern().split()
    assert words[:2] == ["0001+", "0002"]
    assert words[149:152] == ["0096", "...", "03B7+"]  # 150, 951
    assert len(words) == 201
    assert words[-1] == "03E8"


# -- any session -------------------------------------------------------------------------------------------

MOVES = st.one_of(
    st.integers(1, 30),
    st.tuples(st.sampled_from(("CONT", "EN_R", "REQ", "COM_RST", "ADHOC")), st.sampled_from("01b")),
    st.sampled_from(("connect", "close", "rst", "shutdown", "stall", "resume", "listen")),
    st.tuples(st.integers(1, 90), st.integers(1, 9), st.sampled_from((0, 10, 35))),
    st.sampled_from(("mark", "plc stop", "plc run", "fault recv ECONNRESET", "fault bind", "fault clear")),
    st.sampled_from(("delete", "download", "create", "resize", "hold", "go", "rest")),
)
SAYS = st.sampled_from(
    ({}, {"reconnect": "T#60ms"}, {"says": ["hex 01 02", "random 40 seed=2"], "every": "T#40ms"})
)


ALL_PEERS = st.lists(SAYS, min_size=4, max_size=4)
UNHURRIED = (HealthCheck.too_slow, HealthCheck.data_too_large)


@pytest.mark.slow
@settings(max_examples=30, deadline=None, suppress_health_check=UNHURRIED)
@given(projects(), ALL_PEERS, st.lists(st.tuples(st.integers(0, 9), MOVES), max_size=25))
def test_any_session_saved_runs_and_holds(
    document: dict[str, Any], says: list[dict[str, Any]], moves: list[tuple[int, Any]]
) -> None:
    for peer, more in zip(document["peer"], says, strict=False):
        peer |= more if peer["active"] else {key: more[key] for key in more if key != "reconnect"}
    with tempfile.TemporaryDirectory() as folder:
        project, file = Path(folder) / "p.toml", Path(folder) / "saved.toml"
        project.write_text(_toml(document))
        driver = LocalDriver(Bench(load_project(project), "sim"))
        for number, move in moves:
            _make(driver, number, move)
        assert say(driver, f"save scenario {file}").error == ""
        assert main(["scenario", str(file), "--out", str(Path(folder) / "out")]) == 0, file.read_text()
        driver.close()


def _make(driver: LocalDriver, number: int, move: Any) -> None:
    project = driver.console.bench.project
    names = [instance.name for instance in project.instances]
    name = names[number % len(names)] if names else "NOBODY"
    peer = project.peers[number % len(project.peers)].name
    match move:
        case int():
            driver.scan(move)
        case (str() as pin, str() as value):
            driver.submit(f"set {name} {pin}={'blink' if value == 'b' else value}")
        case (int() as size, int() as split, int() as gap):
            driver.submit(f"peer {peer} send random {size} seed={split} split={split} gap=T#{gap}ms")
        case "delete" | "download":
            driver.submit(f"{move} {name}")
        case "create":
            driver.submit(f"create TRCV_C I{number} connect={project.connects[0].name} data=D1 CONT=1 EN_R=1")
        case "resize":
            driver.submit(f"resize D{1 + number % 3} ARRAY[1..{1 + number}] OF BYTE")
        case "rest":
            driver.console.step_peers_alone()
        case "connect" | "close" | "rst" | "shutdown" | "stall" | "resume" | "listen":
            driver.submit(f"peer {peer} {move}")
        case _:
            driver.submit(move)


def _toml(document: dict[str, Any]) -> str:
    lines = [f"{key} = {json.dumps(value)}" for key, value in document.items() if isinstance(value, str)]
    for key, value in document.items():
        for table in value if isinstance(value, list) else [value] if isinstance(value, dict) else []:
            lines.append(f"[[{key}]]" if isinstance(value, list) else f"[{key}]")
            lines += [f"{name} = {json.dumps(each)}" for name, each in table.items()]
    return re.sub(r"\n+", "\n", "\n".join(lines)) + "\n"
