"""The benchmarks' arithmetic and their report: what does not depend on the machine."""

from __future__ import annotations

import pytest

from benchmarks.figures import Figure
from benchmarks.lateness import p99_of_histogram
from benchmarks.paired import alternate, percentile, ratios, spread
from benchmarks.report import LATER, lines, markdown
from benchmarks.targets import TARGETS


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


def test_the_page_lists_every_target_of_the_design() -> None:
    figure = Figure("16 x 64 KiB", "0.97 [0.95 .. 0.99]", ">= 0.95", True, "sender in C")
    page = markdown(["2 cores"], [(t, [figure] if t.name == "M1" else []) for t in TARGETS], "make bench")
    assert [target.name for target in TARGETS] == [f"M{n}" for n in range(1, 11)]
    for target in TARGETS:
        assert f"| **{target.name}** |" in page
    assert page.count(LATER) == sum(target.measure is None for target in TARGETS)
    assert "| | 16 x 64 KiB | 0.97 [0.95 .. 0.99] | >= 0.95 | reached | sender in C |" in page
    assert "* 2 cores" in page


def test_a_missed_aim_is_said_and_is_no_failure() -> None:
    missed = Figure("1 x 64 KiB", "0.60 [0.50 .. 0.70]", ">= 0.95", False)
    assert "aim >= 0.95: not reached" in "\n".join(lines(TARGETS[0], [missed]))
    assert lines(TARGETS[1], []) == [f"M2   {TARGETS[1].promise}: {LATER}"]
