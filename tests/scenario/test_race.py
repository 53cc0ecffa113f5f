"""Dialect race: the same pins and partners through several dialects, each scan side by side."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS
from trcvtui.cli.main import main
from trcvtui.scenario import race as racing
from trcvtui.scenario.race import (
    Cell,
    Race,
    RaceRow,
    race_file,
    race_rows,
    race_text,
    summary,
)

PASSIVE = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
BOTH = ["baosky", "s7-1500"]
RECEIVE = """
set TRCV_C_1 CONT=1 EN_R=1
run 4
peer P1 connect
run 3
peer P1 send hex 01 02 03 04 05 06 07 08
run 3
"""


def story(folder: Path, steps: str, project: str = PASSIVE) -> Path:
    file = folder / "story.toml"
    file.write_text(f'{project}\n[scenario]\nname = "story"\nsteps = """{steps}"""\n', encoding="utf-8")
    return file


def raced(folder: Path, steps: str, *dialects: str) -> Race:
    return race_file(story(folder, steps), dialects or BOTH)


def walk(race: Race, column: int, instance: int = 0) -> str:
    rows = race_rows(race.instances[instance])
    return " | ".join(f"{row.scans} {row.cells[column].text}" for row in rows)


def notes(race: Race) -> list[tuple[str, int, str]]:
    return [(note.dialect, note.step, note.text) for note in race.notes]


# -- scan by scan --------------------------------------------------------------------------------------------


def test_each_row_is_one_scan_in_every_dialect_and_says_where_they_differ(tmp_path: Path) -> None:
    race = raced(tmp_path, RECEIVE)
    assert race_text(race).splitlines() == [
        "race  story  (10 scans of T#10ms)",
        "",
        "TRCV_C_1 (TRCV_C): first differ in scan 1: 0001 vs 7001; 5 of 10 scans differ",
        "         scan   baosky      s7-1500",
        "            1 ≠ 0001        7001",
        "            2 ≠ 7001        7002",
        "            3   7002        7002",
        "            4 ≠ 80A1 E      7002",
        "            5 ≠ 7004        0001 B",
        "          6-7   7006 B      7006 B",
        "            8 ≠ 7008 D 8 B  0000 D 8 B",
        "         9-10   7006 B      7006 B",
    ]


def test_equal_scans_are_one_row_and_are_all_counted(tmp_path: Path) -> None:
    (one,) = raced(tmp_path, "run 3\nset TRCV_C_1 CONT=1\nrun 400\n").instances
    assert [row.scans for row in race_rows(one)] == ["1-3", "4", "5", "6-403"]
    assert (one.scans, one.differing) == (403, 2)
    assert [row.scans for row in race_rows(one, only_differing=True)] == ["4", "5"]


def test_data_is_compared_by_its_hash(tmp_path: Path) -> None:
    """EN_R falls in mid job: one dialect drops the job, the other goes on and writes DATA."""
    steps = """
set TRCV_C_1 CONT=1 EN_R=1
run 3
peer P1 connect
run 3
set TRCV_C_1 EN_R=0
run 1
peer P1 send hex 01 02 03 04 05 06 07 08
run 3
"""
    (one,) = raced(tmp_path, steps).instances
    done, after = [row for row in race_rows(one) if "DATA" in row.differs]
    assert done.differs == ("STATUS", "DONE", "RCVD_LEN", "DATA")
    assert [cell.text for cell in done.cells] == ["7004 DATA b5e7d96a", "0000 D 8 B DATA a4ede9f2"]
    assert (after.differs, after.scans) == (("DATA",), "9-10")


def test_a_row_that_differs_from_the_one_above_in_data_alone_shows_its_hash() -> None:
    race = race_file(CONFIGS / "scenarios" / "siemens" / "udp-send-and-receive.toml", ["baosky", "s7-1500"])
    sender = next(n for n, each in enumerate(race.instances) if each.instance == "TUSEND_2")
    first, second = walk(race, 0, sender).split(" | ")
    assert first == "1-2 7000" and second.startswith("3-13 7000 DATA ")


def test_three_dialects_stand_side_by_side(tmp_path: Path) -> None:
    race = raced(tmp_path, RECEIVE, "baosky", "s7-1200", "s7-1200-legacy")
    assert summary(race.instances[0]).startswith("first differ in scan 1: 0001 vs 7001 vs 7001; ")
    assert race_rows(race.instances[0])[4] == RaceRow(
        "5", (Cell("7004"), Cell("0001", "B"), Cell("0001", "B")), ("STATUS", "BUSY")
    )


def test_two_cpus_of_one_vendor_differ_nowhere(tmp_path: Path) -> None:
    (one,) = raced(tmp_path, RECEIVE, "s7-1500", "s7-1200").instances
    assert summary(one) == "no difference in 10 scans"


def test_the_order_of_the_dialects_changes_the_columns_and_nothing_else(tmp_path: Path) -> None:
    there, back = raced(tmp_path, RECEIVE), raced(tmp_path, RECEIVE, *reversed(BOTH))
    assert [walk(there, n) for n in (0, 1)] == [walk(back, n) for n in (1, 0)]
    assert raced(tmp_path, RECEIVE) == there


def test_a_bench_alone_shows_what_its_lane_shows(tmp_path: Path) -> None:
    """The race adds nothing: its rows are the trace that the scenario itself would give."""
    steps = RECEIVE + "expect TRCV_C_1 trace 0001 7001 7002 80A1! 7004 7006{2} 7008 7006{2}\n"
    assert main(["scenario", str(story(tmp_path, steps))]) == 0
    assert walk(raced(tmp_path, steps), 0) == (
        "1 0001 | 2 7001 | 3 7002 | 4 80A1 E | 5 7004 | 6-7 7006 B | 8 7008 D 8 B | 9-10 7006 B"
    )


def test_what_is_left_of_a_block_that_one_dialect_lacks_is_a_note() -> None:
    race = race_file(CONFIGS / "scenarios" / "siemens" / "1-10-single-instructions.toml", ["baosky"])
    alone = [one for one in race.instances if one.instance == "T_DIAG_1"]
    assert [summary(one) for one in alone] == ["in s7-1500 alone"]
    assert ("baosky", 0, "T_DIAG_1 is left out: baosky has no T_DIAG") in notes(race)


# -- expect and wait -----------------------------------------------------------------------------------------


def test_expectations_are_left_out_and_counted(tmp_path: Path) -> None:
    race = raced(tmp_path, "run 2\nexpect TRCV_C_1 STATUS=7777 within T#1s\nexpect TRCV_C_1 trace 7000\n")
    assert (race.scans, race.expectations, race.notes) == (2, 2, ())


def test_a_wait_is_over_when_it_holds_in_every_dialect(tmp_path: Path) -> None:
    steps = (
        "set TRCV_C_1 CONT=1\nrun 3\npeer P1 connect\nwait TRCV_C_1 STATUS=7004\nset TRCV_C_1 CONT=0\nrun 3\n"
    )
    race = raced(tmp_path, steps)
    assert race.notes == ()
    assert walk(race, 0).endswith("4 7004 | 5 7003 | 6 7007 | 7 7000")
    assert walk(race, 1).endswith("4 7004 | 5 7003 | 6 0003 | 7 7000")


def test_a_code_that_a_block_lacks_is_not_waited_for(tmp_path: Path) -> None:
    race = raced(tmp_path, RECEIVE + "wait TRCV_C_1 STATUS=7007 within T#50ms\n")
    assert notes(race) == [
        ("s7-1500", 7, "wait TRCV_C_1 STATUS=7007 within T#50ms: not waited for: "
                       "here 7007 is none of TRCV_C"),
        ("baosky", 7, "wait TRCV_C_1 STATUS=7007 within T#50ms: found STATUS=7006"),
    ]  # fmt: skip
    assert race.scans == 10 + 5


def test_a_code_that_says_something_else_is_not_waited_for(tmp_path: Path) -> None:
    """0001 of Baosky is the first scan of all; Siemens' 0001 is a connection that a job has waited for."""
    project = PASSIVE.replace('"baosky"', '"s7-1500"')
    steps = "set TRCV_C_1 CONT=1 EN_R=1\nrun 1\nwait TRCV_C_1 STATUS=0001 within T#300ms\n"
    race = race_file(story(tmp_path, steps, project), BOTH)
    assert notes(race) == [
        ("baosky", 0, "C1: TCON_IP_v4 is written as a TCP_CONNECTCONFIG, without its ID"),
        ("baosky", 3, "wait TRCV_C_1 STATUS=0001 within T#300ms: not waited for: "
                      "here 0001 is 'Creating the socket'"),
        ("s7-1500", 3, "wait TRCV_C_1 STATUS=0001 within T#300ms: found STATUS=7002"),
    ]  # fmt: skip
    assert race.scans == 31


def test_a_wait_that_holds_in_one_alone_ends_soon_and_the_race_goes_on(tmp_path: Path) -> None:
    project = PASSIVE.replace('"baosky"', '"s7-1500"')
    steps = RECEIVE.removesuffix("run 3\n") + "wait TRCV_C_1 STATUS=0000\nrun 2\n"
    race = race_file(story(tmp_path, steps, project), BOTH)
    (late,) = notes(race)[-1:]
    assert late[:2] == ("baosky", 6)
    assert late[2].endswith("20 scans after another dialect it still does not hold")
    assert walk(race, 0).endswith("8 7008 D 8 B | 9-30 7006 B")


def test_a_command_that_one_bench_cannot_carry_out_is_noted(tmp_path: Path) -> None:
    race = raced(tmp_path, "run 1\npeer P1 send hex 01\nrun 1\n")
    assert [(dialect, step) for dialect, step, _ in notes(race)] == [("baosky", 2), ("s7-1500", 2)]


# -- bounds -----------------------------------------------------------------------------------


def test_rows_and_notes_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(racing, "MOST_ROWS", 2)
    monkeypatch.setattr(racing, "MOST_NOTES", 1)
    race = raced(tmp_path, RECEIVE + "peer P1 rst\n" + "peer P1 send hex 01\nrun 1\n" * 5)
    (one,) = race.instances
    assert len(one.rows) == 2 and one.is_cut and len(race.notes) == 1
    assert summary(one).endswith("2 of 2 scans differ, later ones are not kept")
