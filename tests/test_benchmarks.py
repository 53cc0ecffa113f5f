"""The benchmarks' arithmetic and their report: what does not depend on the machine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import __main__ as bench
from benchmarks.figures import Effort, Figure, ratios
from benchmarks.report import UNSAID, line, markdown
from benchmarks.scans import Scan, Scans, overruns
from benchmarks.targets import Aim, Target
from trcvtui import clock
from trcvtui.engine.timing import ScanTiming


def test_a_ratio_is_taken_pair_by_pair_and_not_of_the_sums() -> None:
    # The machine was four times faster in the last pair: the share of each pair is what counts.
    # A pair whose reference did nothing is left out.
    share = ratios([(50.0, 100.0), (45.0, 100.0), (220.0, 400.0), (1.0, 0.0)])
    assert share.median == 0.5
    assert share.count == 3


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
    assert "| | two |  | 2 ms |  |  |" in page


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
    timing.keep_every_scan()
    timing.count_scan(due=0, began=5, ended=20 * MS, interval=10 * MS)
    used = clock.thread_cpu_ns()
    while clock.thread_cpu_ns() < used + 11 * MS:
        pass
    timing.count_scan(due=30 * MS, began=30 * MS, ended=50 * MS, interval=10 * MS)
    timing.write_to(tmp_path / "timing.json")
    scans = Scans.read(tmp_path / "timing.json", 10 * MS)
    waited, computed = scans.scans
    assert scans.mode == "slice"
    assert (waited.began, waited.late, waited.length) == (5, 5, 20 * MS - 5)
    assert waited.used < 10 * MS < 11 * MS <= computed.used
    assert scans.blame() == "1 by the engine, 1 by the machine"
