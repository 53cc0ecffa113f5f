"""`scenario --dialect A --dialect B`: the traces side by side, scan by scan, and where they differ."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.cli.main import main
from trcvtui.scenario import dialects

PASSIVE = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
RECEIVE = """
set TRCV_C_1 CONT=1 EN_R=1
run 4
peer P1 connect
run 3
peer P1 send hex 01 02 03 04 05 06 07 08
run 3
"""
BOTH = ("baosky", "s7-1500")


def play(
    capsys: pytest.CaptureFixture[str], folder: Path, steps: str | Path, *names: str, form: str = "text"
) -> tuple[int, list[str], str]:
    """Play steps, or a file, in these dialects; return the exit code, the lines of stdout, stderr."""
    file = folder / "story.toml" if isinstance(steps, str) else steps
    if isinstance(steps, str):
        text = f'{PASSIVE}\n[scenario]\nname = "story"\nsteps = """{steps}"""\n'
        file.write_text(text, encoding="utf-8")
    argv = [word for name in names for word in ("--dialect", name)]
    code = main(["scenario", str(file), "--format", form, *argv])
    out, err = capsys.readouterr()
    return code, out.splitlines(), err


def test_each_row_is_one_scan_in_every_dialect_and_says_where_they_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = play(capsys, tmp_path, RECEIVE, *BOTH)
    assert (code, err) == (0, "")
    assert out[:-3] == [
        "TRCV_C_1 (TRCV_C): first differ in scan 1: 0001 vs 7001; 5 scans differ",
        "    scan     baosky      s7-1500",
        "       1  ≠  0001        7001",
        "       2  ≠  7001        7002",
        "       3     7002        7002",
        "       4  ≠  80A1 E      7002",
        "       5  ≠  7004        0001 B",
        "     6-7     7006 B      7006 B",
        "       8  ≠  7008 D 8 B  0000 D 8 B",
        "    9-10     7006 B      7006 B",
    ]
    assert [line.split()[:2] for line in out[-3:]] == [
        ["passed", "baosky:"],
        ["ERROR", "TRCV_C_1"],
        ["passed", "s7-1500:"],
    ]


def test_json_lines_are_those_of_each_dialect_with_its_name_then_where_they_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, alone, _ = play(capsys, tmp_path, RECEIVE, form="jsonl")
    _, out, _ = play(capsys, tmp_path, RECEIVE, *BOTH, form="jsonl")
    *lines, last = map(json.loads, out)
    own = [line for line in lines if line.pop("dialect") == "baosky"]
    assert own == [json.loads(line) for line in alone]
    assert last == {"instance": "TRCV_C_1", "dialects": [*BOTH], "differing": 5, "first": 1}


def test_three_dialects_two_of_which_never_differ(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ("baosky", "s7-1500", "s7-1200")
    _, (where, head, *rows), _ = play(capsys, tmp_path, RECEIVE, *names)
    assert "0001 vs 7001 vs 7001" in where and head.split() == ["scan", *names]
    assert rows[4].split() == ["5", "≠", "7004", "0001", "B", "0001", "B"]
    _, (where, *_), _ = play(capsys, tmp_path, RECEIVE, *names[1:])
    assert "no difference" in where


def test_a_dialect_is_judged_as_if_it_had_run_alone_and_ends_with_its_own_wait(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = RECEIVE + "wait TRCV_C_1 STATUS=7006\nexpect TRCV_C_1 trace ... 7008 7006+\nrun 5\n"
    code, out, _ = play(capsys, tmp_path, steps, *BOTH, form="jsonl")
    ends = [line for line in map(json.loads, out) if "passed" in line]
    assert code == 1
    assert [(one["dialect"], one["passed"], one["scans"]) for one in ends] == [
        ("baosky", True, 15),
        ("s7-1500", False, 15),
    ]


def test_what_one_dialect_lacks_is_left_out_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = CONFIGS / "scenarios" / "siemens" / "1-10-single-instructions.toml"
    _, out, _ = play(capsys, tmp_path, file, "baosky", "s7-1500")
    assert "T_DIAG_1 (T_DIAG): in s7-1500 alone" in out
    told = out[next(n for n, line in enumerate(out) if line.split()[1:2] == ["baosky:"]) :]
    assert any("T_DIAG_1 is left out" in line for line in told)
    assert any("left out: step" in line and "T_DIAG_1" in line for line in told)


def test_changes_are_bounded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dialects, "MOST_CHANGES", 2)
    _, out, _ = play(capsys, tmp_path, RECEIVE, *BOTH)
    assert len([line for line in out if line.split()[0][0].isdigit()]) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--dialect baosky", "--dialect: found baosky, expected two"),
        ("--dialect baosky --dialect baosky", "--dialect: found baosky, baosky, expected two"),
        ("--dialect baosky --dialect x", "--dialect: found 'x', expected one of baosky"),
        ("--dialect baosky --dialect s7-1500 --format junit", "--format: found 'junit', expected with"),
        ("--dialect baosky --dialect s7-1500 --record R", "--record: found --dialect beside it"),
        ("--dialect baosky --dialect s7-1500", "baosky: connect C1: found ISO-on-TCP"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scenario", str(CONFIGS / "scenarios/siemens/iso-active.toml"), *words.split()]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1) and err.startswith(said)
