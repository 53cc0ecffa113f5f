"""Waves: no pulse of one scan is lost, at no zoom; what was left out is a gap, never a guess."""

from __future__ import annotations

import os
from functools import cache
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.history.waveform_runs import RECEIVER, SENDER, Run, connected, random_run
from trcvtui.history import waveform_recorder as waves
from trcvtui.history.pin_waveform import POLL_NS, PinWaveform, ScanWindow
from trcvtui.history.waveform_text import draw_row
from trcvtui.tui.panes.timing import ZOOM_LEVELS

SCANS = 10_000 if "TRCVTUI_SOAK" in os.environ else 2_500


def text(run: Run, name: str, first: int, count: int, zoom: int = 1) -> str:
    window = ScanWindow((first - 1) // zoom, count, zoom)
    return "".join(part for part, _ in draw_row(run.wave(), name, window))


# -- every pulse, at every zoom ----------------------------------------------------------------------------


@cache
def long_run(seed: int) -> Run:
    return random_run(seed, SCANS)


@pytest.mark.slow
@pytest.mark.parametrize("zoom", ZOOM_LEVELS)
def test_a_column_is_the_least_and_the_greatest_of_its_scans(zoom: int) -> None:
    run = long_run(1)
    for pin, values in run.seen[RECEIVER].items():
        lane = run.lane(pin)
        twice = {scan for scan, after in pairwise(lane.scans) if scan == after}  # COM_RST; STOP and RUN
        columns = lane.list_columns(ScanWindow(0, -(-len(values) // zoom), zoom), run.wave().until_scan)
        for n, column in enumerate(columns):
            scans = range(n * zoom + 1, min((n + 1) * zoom, len(values)) + 1)
            part = [value for scan in scans if (value := values[scan - 1]) is not None]
            assert column is not None and column.low is not None and column.high is not None
            assert column.low <= min(part) and max(part) <= column.high, (pin, n, zoom)
            if not twice.intersection(scans):
                assert (column.low, column.high) == (min(part), max(part)), (pin, n, zoom)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 1)), max_size=60), st.sampled_from(ZOOM_LEVELS[:6])
)
def test_a_lane_drawn_while_it_grows_is_drawn_as_at_the_end(steps: list[tuple[int, int]], zoom: int) -> None:
    growing, scan = PinWaveform(), 1
    for scans, value in steps:
        scan += scans
        growing.add(scan, scan * 10, value)
        growing.list_columns(ScanWindow(0, scan // zoom + 1, zoom), scan)
    window = ScanWindow(0, scan // zoom + 1, zoom)
    fresh = PinWaveform()
    for at, t_ns, kept in zip(growing.scans, growing.times, growing.values, strict=True):
        fresh.add(at, t_ns, kept)
    assert growing.list_columns(window, scan) == fresh.list_columns(window, scan)


# -- from the engine to the screen ------------------------------------------------------------------------


def test_what_does_not_fit_into_one_picture_comes_with_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    run = random_run(5, 400, look_every=10_000)
    whole = list(zip(run.lane("STATUS").scans, run.lane("STATUS").values, strict=True))
    news = run.console._waves.make_delta(RECEIVER, 0, (400, 0), 10)
    assert news is not None and len(news.changes) == 10 and news.until_scan == news.changes[-1][1]
    run.scenario_folder = type(run.scenario_folder)()
    for _ in range(1000):
        wave = run.wave()
        more = run.console._waves.make_delta(RECEIVER, wave.number, (400, 3_990_000_000), 10)
        assert more is not None
        wave.add_delta(more, 10_000_000)
    assert list(zip(run.lane("STATUS").scans, run.lane("STATUS").values, strict=True)) == whole
    assert not run.wave().gaps and run.wave().until_scan == 400


def test_what_the_engine_no_longer_keeps_is_drawn_as_a_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waves, "KEPT_CHANGES", 50)
    monkeypatch.setattr(waves, "LEAST_CHANGES", 50)
    run = connected()
    run.look()
    known = run.wave().until_scan
    run.say("set TRCV_C_1 LEN=3")
    run.scan()
    run.play("set TRCV_C_1 EN_R=blink", 200)
    ((first, last),) = run.wave().gaps
    assert first == known + 1 and last > known + 100
    assert text(run, "DONE", first, 3) == "░░░"
    assert text(run, "DONE", first, 3, zoom=20)[0] == "░"
    assert run.lane("DONE").value_at(first) is None, "between the two nobody can say"
    assert run.lane("LEN").value_at(last) == 3, "what changed inside the gap is known after it"
    for pin, values in run.seen[RECEIVER].items():
        for scan in range(last + 1, len(values) + 1):
            assert run.lane(pin).value_at(scan) == values[scan - 1], (pin, scan)


def test_a_late_look_knows_every_pin_though_its_last_change_is_no_longer_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(waves, "KEPT_CHANGES", 50)
    monkeypatch.setattr(waves, "LEAST_CHANGES", 50)
    run = connected()
    run.play("set TRCV_C_1 EN_R=blink", 300)
    assert run.lane("CONT").value_at(300) == 1
    assert run.wave().gaps[0][0] == 1


def test_more_in_one_scan_than_the_ledger_keeps_leaves_nothing_known(monkeypatch: pytest.MonkeyPatch) -> None:
    run = connected()
    ledger = run.console.bench.runtime.ledger
    edge = ledger.lines_since(0)[-1].event
    for _ in range(25_000):
        ledger.write(edge)
    run.scan()
    run.catch_up()
    assert None in run.lane("EN_R").values


def test_an_instance_that_does_not_change_costs_nothing() -> None:
    run = connected()
    run.catch_up()
    record = run.console._waves.records[SENDER]
    before = record.total
    run.say("peer P1 send random 8 seed=1")
    run.scan(50)
    assert record.total == before


def test_a_deleted_instance_ends_and_a_created_one_begins() -> None:
    run = connected()
    run.say("delete TRCV_C_1")
    run.seen.pop(RECEIVER)
    run.scan(3)
    run.look(RECEIVER)
    assert run.lane("EN_R").value_at(run.wave().until_scan) is None
    run.say("create TRCV_C TRCV_C_9 connect=C1 data=rx")
    run.scan(3)
    run.look("TRCV_C_9")
    assert run.lane("EN_R", "TRCV_C_9").values[-1] == 0
    assert run.lane("STATUS", "TRCV_C_9").values[-1] is not None


def test_a_fresh_bench_begins_with_fresh_waves() -> None:
    run = connected()
    run.console._leave_scenario()
    run.scenario_folder = type(run.scenario_folder)()
    run.scan(2)
    run.catch_up()
    assert run.wave().until_scan == 2 and run.lane("EN_R").value_at(2) == 0


# -- what is asked ------------------------------------------------------------------------------------------


def test_the_time_of_a_scan_is_exact_where_it_is_known() -> None:
    run = connected()
    run.scan(100)
    run.catch_up()
    assert run.wave().time_at(57) == (560_000_000, True), "simulated time has no jitter"
    news = run.console._waves.make_delta(RECEIVER, 0, (110, 1_200_000_000))
    late = type(run.wave())(RECEIVER)
    assert news is not None
    late.add_delta(news, 10_000_000)
    t_ns, is_exact = late.time_at(57)
    assert not is_exact and 100_000_000 < t_ns < 1_200_000_000


def test_the_ghost_row_is_what_polling_every_100_ms_shows() -> None:
    run = connected()
    for _ in range(200):
        run.say("peer P1 send random 8 seed=1")
        run.scan(7)
    run.catch_up()
    interval = 10_000_000
    for pin in ("STATUS", "DONE"):
        values, ghost = run.seen[RECEIVER][pin], run.wave().get_polled(pin)
        for poll in range(0, (len(values) - 1) * interval, POLL_NS):
            scan = poll // interval + 1
            assert ghost.value_at(scan) == values[scan - 1], (pin, scan)
            assert ghost.value_at(scan + 5) == values[scan - 1] or scan + 5 > len(values), (
                "held until the next poll"
            )
    done = sum(v or 0 for v in run.seen[RECEIVER]["DONE"])
    assert 0 < run.wave().get_polled("DONE").count_rises(1, 2000) < done, "a watch table misses most of them"
