"""The benchmarks' arithmetic and their report: what does not depend on the machine."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import __main__ as bench
from benchmarks.figures import QUICK, Effort, Figure, alternate, percentile, ratios, spread
from benchmarks.lateness import p99_of_histogram
from benchmarks.partners import FRAME, Conversation
from benchmarks.report import UNSAID, line, markdown
from benchmarks.scans import Scan, Scans, overruns
from benchmarks.targets import TARGETS, Aim, Target, aim_of
from trcvtui import clock
from trcvtui.engine.timing import ScanTiming


def test_a_ratio_is_taken_pair_by_pair_and_not_of_the_sums() -> None:
    # The machine was four times faster in the last pair: the share of each pair is what counts.
    share = ratios([(50.0, 100.0), (45.0, 100.0), (220.0, 400.0)])
    assert share.median == 0.5
    assert share.count == 3


def test_the_tenth_and_the_ninetieth_percentile_stand_around_the_median() -> None:
    figures = [float(n) for n in range(1, 12)]
    assert spread(figures).text(0) == "6 [2 .. 10]"
    assert spread([0.5]).text() == "0.50 [0.50 .. 0.50]"
    with pytest.raises(ValueError, match="no figures"):
        spread([])


def test_a_pair_whose_reference_did_nothing_is_left_out() -> None:
    assert ratios([(1.0, 0.0), (3.0, 4.0)]).median == 0.75


def test_who_goes_first_changes_from_pair_to_pair() -> None:
    turns: list[str] = []

    def ours() -> float:
        turns.append("ours")
        return 1.0

    def reference() -> float:
        turns.append("reference")
        return 2.0

    assert alternate(ours, reference, 3) == [(1.0, 2.0)] * 3
    assert turns == ["ours", "reference", "reference", "ours", "ours", "reference"]


def test_a_percentile_is_a_figure_that_was_measured() -> None:
    assert percentile([float(n) for n in range(1, 101)], 0.99) == 99.0
    assert percentile([7.0], 0.99) == 7.0
    assert percentile([], 0.99) == 0.0


def test_the_histogram_of_cyclictest_is_read_as_it_prints_it() -> None:
    text = "# Histogram\n000011 000098\n000020 000001\n000300 000001\n# Total: 100\nT: 0 (12) P:80 I:1000\n"
    assert p99_of_histogram(text) == 20.0


def test_the_page_lists_every_target_what_was_before_and_what_is_aimed_at() -> None:
    figure = Figure("16 x 64 KiB", "0.97 [0.95 .. 0.99]", 0.97, "sender in C")
    page = markdown(["2 cores"], [(t, [figure] if t.name == "M1" else []) for t in TARGETS], "make bench")
    assert [target.name for target in TARGETS] == [
        *(f"M{n}" for n in range(1, 12)),
        *(f"R{n}" for n in range(1, 8)),
        "F1",
        "growth",
    ]
    for target in TARGETS:
        assert f"| **{target.name}** |" in page
    assert "| | 16 x 64 KiB | 0.87 | 0.97 [0.95 .. 0.99] | >= 0.3 | reached | sender in C |" in page
    assert "* 2 cores" in page
    assert "Every aim is reached." in page


def made_up(measured: Iterator[Figure]) -> Target:
    aims = (Aim("one *", ">= 0.95", in_the_way="a made-up wall"), Aim("two", "<= 3 ms"))
    return Target("M0", "a made-up one", lambda effort: measured, aims)


def test_a_missed_aim_is_said_with_what_stands_in_the_way_and_is_no_failure() -> None:
    missed, silent = Figure("one of it", "0.60", 0.60), Figure("two", "4 ms", 4.0)
    target = made_up(iter(()))
    assert "aim >= 0.95: not reached" in line(target, missed)
    page = markdown([], [(target, [missed, silent])], "make bench")
    assert "* M0, one of it: a made-up wall\n" in page
    assert f"* M0, two: {UNSAID}\n" in page
    assert "a made-up wall" not in markdown([], [(target, [Figure("one of it", "0.95", 0.95)])], "make bench")


def test_what_the_machine_has_no_room_for_is_its_limit_and_an_absent_figure_is_no_verdict() -> None:
    aim = Aim("*", "<= 3 ms")
    assert aim.verdict(Figure("a", "4 ms", 4.0, at_limit=True)) == "machine limit"
    assert aim.verdict(Figure("a", "3 ms", 3.0, at_limit=True)) == "reached"
    assert aim.verdict(Figure.missing("a", "needs cyclictest")) == ""
    assert Aim("*", "").verdict(Figure("a", "4 ms", 4.0)) == ""


def test_of_two_patterns_the_first_one_holds() -> None:
    target = next(target for target in TARGETS if target.name == "M2")
    for case, text in (
        ("256 x 64 KiB in step: overruns", ""),
        ("32 busy beside the screen: overruns", "<= 0"),
    ):
        aim = aim_of(target, Figure(case, ""))
        assert aim is not None
        assert aim.text == text


def test_a_part_that_fails_is_said_and_loses_no_figure_before_it(capsys: pytest.CaptureFixture[str]) -> None:
    def breaks() -> Iterator[Figure]:
        yield Figure("one of it", "1.00", 1.0)
        raise OSError("no sockets")

    kept: list[Figure] = []
    assert not bench._measure(made_up(breaks()), QUICK, kept, 0)
    assert [(figure.case, figure.note) for figure in kept] == [
        ("one of it", ""),
        ("the rest", "OSError: no sockets"),
    ]
    assert "one of it" in capsys.readouterr().out


def test_the_page_is_written_after_a_part_has_failed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fails(effort: Effort) -> Iterator[Figure]:
        raise OSError("no sockets")

    good = Target("M2", "a good one", lambda effort: iter([Figure("two", "2 ms", 2.0)]), ())
    monkeypatch.setattr(bench, "TARGETS", (Target("M1", "a bad one", fails, ()), good))
    monkeypatch.setattr(bench, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr("sys.argv", ["bench"])
    assert bench.main() == 1
    page = (tmp_path / "page.md").read_text()
    assert "OSError: no sockets" in page
    assert "| | two |  | 2 ms |  |  |  |" in page


# -- who overran (M2) ----------------------------------------------------------------------------------------

MS = 1_000_000


def test_an_overrun_is_the_engines_when_it_used_more_processor_time_than_an_interval() -> None:
    in_time = Scan(began=0, late=2 * MS, length=8 * MS, used=12 * MS)
    computed = Scan(began=1, late=0, length=11 * MS, used=11 * MS)
    preempted = Scan(began=2, late=0, length=15 * MS, used=3 * MS)
    woken_late = Scan(began=3, late=9 * MS, length=2 * MS, used=2 * MS)
    scans = Scans("", 10 * MS, (in_time, computed, preempted, woken_late))
    assert (scans.overruns, scans.own_overruns) == (3, 1)
    assert scans.blame() == "1 by the engine, 2 by the machine"
    assert overruns("a load", scans).number == 1
    assert overruns("a load", scans.between(2, 4)).number == 0


def test_a_scan_is_late_after_work_when_the_engine_has_not_slept_before_it() -> None:
    first = Scan(began=0, late=0, length=MS, used=MS)
    slept = Scan(began=12 * MS, late=2 * MS, length=MS, used=2 * MS)
    at_work = Scan(began=21 * MS, late=MS, length=MS, used=9 * MS)
    in_time = Scan(began=30 * MS, late=0, length=MS, used=9 * MS)
    assert Scans("", 10 * MS, (first, slept)).late_after_work == 0
    assert Scans("", 10 * MS, (slept, at_work)).late_after_work == 1
    assert Scans("", 10 * MS, (at_work, in_time)).late_after_work == 0, "it was in time all the same"


def test_the_engine_writes_what_each_scan_cost_and_waiting_costs_nothing(tmp_path: Path) -> None:
    timing = ScanTiming("slice")
    timing.keep_every()
    timing.scanned(due=0, began=5, ended=20 * MS, interval=10 * MS)
    used = clock.used_ns()
    while clock.used_ns() < used + 11 * MS:
        pass
    timing.scanned(due=30 * MS, began=30 * MS, ended=50 * MS, interval=10 * MS)
    timing.write_to(tmp_path / "timing.json")
    scans = Scans.read(tmp_path / "timing.json", 10 * MS)
    waited, computed = scans.scans
    assert scans.mode == "slice"
    assert (waited.began, waited.late, waited.length) == (5, 5, 20 * MS - 5)
    assert waited.used < 10 * MS < 11 * MS <= computed.used
    assert scans.blame() == "1 by the engine, 1 by the machine"


def test_a_partner_learns_from_the_echo_how_far_the_plc_is_and_sees_a_torn_frame() -> None:
    ours, plc = socket.socketpair()
    talk = Conversation(ours)
    for _ in range(3):
        talk.go_on(selectors.EVENT_WRITE)
    frames = [plc.recv(FRAME, socket.MSG_WAITALL) for _ in range(3)]
    assert len({*frames}) == 3

    def comes_back(frame: bytes) -> tuple[int, int, int]:
        plc.sendall(frame)
        talk.go_on(selectors.EVENT_READ)
        return talk.progress()

    assert comes_back(frames[0]) == (1, 1, 0)
    assert comes_back(frames[2]) == (3, 2, 0), (
        "the PLC sends its newest: the second was received all the same"
    )
    assert comes_back(frames[2][:8] + frames[1][8:]) == (3, 3, 1), "of two frames"
    assert comes_back(frames[1]) == (3, 4, 2), "older than one that has been here"
    ours.close()
    plc.close()
