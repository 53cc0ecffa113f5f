"""`trcvtui scenario --format junit`: one document a call, as Jenkins and GitLab read it."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from tests.scenario.scenarios import BAOSKY
from tests.scenario.test_scenario_command import PASSIVE, PULSE, scenario
from trcvtui.cli.main import main
from trcvtui.errors import mistake
from trcvtui.scenario.report import Junit

Capture = pytest.CaptureFixture[str]

# jenkins-junit.xsd: the children of an element, in order, and its attributes; `!` stands for required.
COUNTS = ("tests", "failures", "errors", "skipped", "disabled")
CHILDREN = {
    "testsuites": ("testsuite",),
    "testsuite": ("properties", "testcase", "system-out", "system-err"),
    "testcase": ("skipped", "error", "failure", "system-out", "system-err"),
}
ATTRIBUTES = {
    "testsuites": {"name", "time", *COUNTS},
    "testsuite": {"name!", "time", "timestamp", "hostname", "id", "package", "tests!", *COUNTS[1:]},
    "testcase": {"name!", "classname", "time", "assertions", "status"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
    "skipped": {"type", "message"},
}


def assert_fits_the_schema(element: Element) -> None:
    known = ATTRIBUTES.get(element.tag, set())
    assert set(element.attrib) <= {name.rstrip("!") for name in known}, element.tag
    assert {name[:-1] for name in known if name.endswith("!")} <= set(element.attrib), element.tag
    assert all(value.isdigit() for name, value in element.attrib.items() if name in COUNTS)
    assert re.fullmatch(r"[0-9]+\.[0-9]{3}", element.get("time", "0.000"))
    order = [CHILDREN.get(element.tag, ()).index(child.tag) for child in element]
    assert order == sorted(order), element.tag
    for child in element:
        assert_fits_the_schema(child)


def assert_the_sums_are_right(root: Element) -> None:
    for level in (root, *root.findall("testsuite")):
        outcomes = {"tests": "testcase", "failures": "failure", "errors": "error", "skipped": "skipped"}
        for name, tag in outcomes.items():
            assert int(level.get(name, "-1")) == len(level.findall(f".//{tag}")), (level.tag, name)
        times = [float(case.get("time", "nan")) for case in level.iter("testcase")]
        assert float(level.get("time", "nan")) == pytest.approx(sum(times), abs=0.001 * len(times))


def document(capsys: Capture, *argv: str) -> tuple[int, Element, str]:
    code = main(["scenario", "--format", "junit", *argv])
    out, err = capsys.readouterr()
    root = ElementTree.fromstring(out)
    assert_fits_the_schema(root)
    assert_the_sums_are_right(root)
    return code, root, err


def cases(root: Element) -> list[str]:
    """Return a line a test case: its time, its name, its outcome with message and text."""
    lines = []
    for case in root.iter("testcase"):
        ended = [f"{child.tag} {child.get('message')}: {child.text}" for child in case]
        lines.append(" | ".join((case.get("time", ""), case.get("name", ""), *ended)))
    return lines


NOT_REACHED = "skipped not reached: an earlier wait failed: None"
WHOLE = "the scenario runs to its end"
CASES = {
    "each expectation": (
        f"{PULSE}\nexpect TRCV_C_1 STATUS=80A1",
        ["0.040 | 003 expect TRCV_C_1 trace 0001 7001 7002 80A1!", "0.000 | 004 expect TRCV_C_1 STATUS=80A1"],
    ),
    "a failure holds the line and what was found": (
        "run 1\nexpect TRCV_C_1 STATUS=7004\nrun 9",
        [
            "0.010 | 002 expect TRCV_C_1 STATUS=7004 | failure found: STATUS=7000: "
            "step 2: expect TRCV_C_1 STATUS=7004\nfound: STATUS=7000",
            f"0.090 | {WHOLE}",
        ],
    ),
    "after a failed wait the expectations are skipped": (
        "wait TRCV_C_1 STATUS=7004 within T#20ms\nrun 5\nexpect TRCV_C_1 LEN=1\nexpect peer P1 closed",
        [
            "0.020 | 001 wait TRCV_C_1 STATUS=7004 within T#20ms | failure found: STATUS=7000: "
            "step 1: wait TRCV_C_1 STATUS=7004 within T#20ms\nfound: STATUS=7000",
            f"0.000 | 003 expect TRCV_C_1 LEN=1 | {NOT_REACHED}",
            f"0.000 | 004 expect peer P1 closed | {NOT_REACHED}",
        ],
    ),
    "without an expectation one": ("run 3", [f"0.030 | {WHOLE}"]),
}


@pytest.mark.parametrize(("steps", "expected"), CASES.values(), ids=CASES)
def test_the_test_cases_of_a_scenario(
    steps: str, expected: list[str], tmp_path: Path, capsys: Capture
) -> None:
    code, root, _ = document(capsys, scenario(tmp_path, steps))
    (suite,) = root.findall("testsuite")
    assert (suite.get("name"), code) == (str(tmp_path / "story.toml"), int("failure" in "".join(expected)))
    assert {case.get("classname") for case in suite.iter("testcase")} == {"story.toml"}
    assert cases(root) == expected
    if "80A1!" in steps:
        assert suite.findtext("system-out") == "TRCV_C_1: 0001 7001 7002 80A1!"


def test_a_command_that_fails_is_a_test_case_too_and_one_of_start_says_so(
    tmp_path: Path, capsys: Capture
) -> None:
    project = 'start = "expect TRCV_C_1 LEN=5"\n' + PASSIVE
    code, root, _ = document(capsys, scenario(tmp_path, "peer P1 send hex 01\nrun 1", project=project))
    first, second, _ = cases(root)
    assert code == 1 and first.startswith("0.000 | start expect TRCV_C_1 LEN=5 | failure")
    assert second.startswith("0.000 | 001 peer P1 send hex 01 | failure") and "not connected" in second


def test_a_wrong_file_is_an_error_beside_the_others(tmp_path: Path, capsys: Capture) -> None:
    good = scenario(tmp_path, PULSE, "good.toml")
    wrong = scenario(tmp_path, "wiat 5\nfrob", "wrong.toml")
    code, root, err = document(capsys, wrong, good)
    assert code == 2
    first, second = root.findall("testsuite")
    error = first.find("testcase/error")
    assert error is not None and error.text is not None
    assert error.text.splitlines() == err.splitlines() and len(err.splitlines()) == 2
    assert error.get("message") == err.splitlines()[0]
    assert (first.get("errors"), second.get("errors"), second.get("failures")) == ("1", "0", "0")


def test_a_file_that_turns_out_wrong_when_it_is_loaded_onto_the_bench_is_an_error_alone(
    tmp_path: Path, capsys: Capture
) -> None:
    peers = '\n[[peer]]\nname = "{}"\nactive = false\nlocal = "127.0.0.1:4000"\n'
    project = PASSIVE + peers.format("P2") + peers.format("P3")
    code, root, _ = document(capsys, scenario(tmp_path, PULSE, project=project))
    assert code == 2
    assert [[child.tag for child in case] for case in root.iter("testcase")] == [["error"]]


def test_no_byte_of_a_partner_can_break_the_document(tmp_path: Path, capsys: Capture) -> None:
    steps = "write rx '$00$1B[2J<&]]>$0D$85$FF'\nrun 1\nexpect rx 'Ä<b>&\"'"
    file = scenario(tmp_path, steps, project=PASSIVE.replace("ARRAY[0..7] OF BYTE", "STRING[20]"))
    assert main(["scenario", "--format", "junit", file]) == 1
    out = capsys.readouterr().out
    assert out.isascii() and "\x1b" not in out and "\x00" not in out
    failure = ElementTree.fromstring(out).find(".//failure")
    assert failure is not None
    assert failure.get("message") == r"found: \x00\x1b[2J<&]]>\r\x85ÿ"
    assert failure.text is not None and failure.text.startswith("step 3: expect rx 'Ä<b>&\"'\n")


@pytest.mark.parametrize(
    "name", ["a\x00b", "\udcff", "\ufffe\uffff", "\x1b]0;x\x07", "]]>", "\u2028", '"<&>\t\n']
)
def test_no_name_can_break_the_document(name: str) -> None:
    written: list[str] = []
    junit = Junit(written.append)
    junit.write_error(Path(f"{name}.toml"), mistake(name, name, name))
    junit.end()
    (text,) = written
    assert text.isascii() and all(c.isprintable() or c == "\n" for c in text)
    assert_fits_the_schema(ElementTree.fromstring(text))


def test_a_long_line_is_cut_in_the_name_and_whole_in_the_failure(tmp_path: Path, capsys: Capture) -> None:
    long = "expect TRCV_C_1 trace " + "7000 " * 60 + "7001"
    _, root, _ = document(capsys, scenario(tmp_path, f"run 1\n{long}"))
    (case,) = root.iter("testcase")
    name, failure = case.get("name", ""), case.findtext("failure")
    assert len(name) == 124 and name.endswith("...")
    assert failure is not None and long in failure


@pytest.mark.slow
def test_every_scenario_of_the_project_gives_the_same_document_twice(capsys: Capture) -> None:
    argv = ["scenario", "--format", "junit", *map(str, BAOSKY)]
    assert main(argv) == 0
    once = capsys.readouterr().out
    assert main(argv) == 0
    assert capsys.readouterr().out == once
    root = ElementTree.fromstring(once)
    assert_fits_the_schema(root)
    assert_the_sums_are_right(root)
    assert len(root) == len(BAOSKY)


def test_the_time_of_a_live_run_is_the_clocks(tmp_path: Path, capsys: Capture) -> None:
    _, root, _ = document(capsys, scenario(tmp_path, "run 5"), "--kernel", "live")
    assert float(root.get("time", "nan")) >= 0.05
