"""The trace of one instance: as long as the run, but bounded in memory, and honest about what is lost."""

from __future__ import annotations

import tracemalloc

import pytest

from trcvtui.commands.patterns import Scan, parse_pattern
from trcvtui.scenario import step_runner
from trcvtui.scenario.step_runner import Trace

WAITING: Scan = (0x7006, False)
RECEIVED: Scan = (0x7008, False)
REFUSED: Scan = (0x80C3, True)


def shown(*scans: Scan) -> Trace:
    it = Trace()
    for scan in scans:
        it.add(scan)
    return it


def test_a_trace_is_the_scans_since_the_one_before() -> None:
    it = shown(WAITING, WAITING, RECEIVED)
    assert str(it.take_section()) == "7006{2} 7008"
    it.add(REFUSED)
    assert it.take_section().fits(parse_pattern("80C3!"))
    assert str(it.take_section()) == "no scan"
    assert str(it) == "7006{2} 7008 80C3!"


def test_an_instance_that_waits_costs_no_memory_however_long() -> None:
    it = shown(WAITING)
    tracemalloc.start()
    try:
        for _ in range(100_000):
            it.add((0x7006, False))
        snapshot = tracemalloc.take_snapshot()
    finally:
        tracemalloc.stop()
    # Other threads of the run allocate too.
    ours = snapshot.filter_traces([tracemalloc.Filter(True, step_runner.__file__)])
    assert sum(at.size for at in ours.traces) < 2_000
    assert it.take_section().fits(parse_pattern("7006{100001}"))


def test_the_text_of_a_long_trace_ends_where_it_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step_runner, "MOST_FIRST_RUNS", 2)
    it = shown(WAITING, RECEIVED, RECEIVED)
    assert str(it) == "7006 7008{2}"
    for scan in (REFUSED, RECEIVED, RECEIVED):  # the later 7008 do not belong to the earlier ones
        it.add(scan)
    assert str(it) == "7006 7008{2} ..."


def test_beyond_the_bound_the_oldest_are_lost_and_a_pattern_that_needs_them_fails_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(step_runner, "MOST_NEWEST_RUNS", 2)
    section = shown(WAITING, WAITING, WAITING, RECEIVED, WAITING).take_section()
    assert not section.fits(parse_pattern("7006{3} 7008 7006"))
    assert not section.fits(parse_pattern("7008 7006"))
    assert section.fits(parse_pattern("... 7008 7006"))
    assert str(section) == "3 older scans, not kept (only 2 changes are), then 7008 7006"
