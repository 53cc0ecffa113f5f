"""Waves: no pulse of one scan is lost, at no zoom; what was left out is a gap, never a guess."""

from __future__ import annotations

import os
from functools import cache
from itertools import pairwise

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.history.waveform_runs import RECEIVER, SENDER, Run, connected, random_run
from trcvtui.history import waveform_recorder as waves
from trcvtui.history.pin_waveform import POLL_NS, PinWaveform, Window
from trcvtui.history.waveform_text import drawn, ruler
from trcvtui.plc.ledger import StatusEdge
from trcvtui.tui.panes.timing import ZOOMS

LEVELS = "▁▔█╱╲┃"
SCANS = 10_000 if "TRCVTUI_SOAK" in os.environ else 2_500


def text(run: Run, name: str, first: int, count: int, zoom: int = 1, instance: str = RECEIVER) -> str:
    window = Window((first - 1) // zoom, count, zoom)
    return "".join(part for part, _ in drawn(run.wave(instance), name, window))


# -- every pulse, at every zoom ----------------------------------------------------------------------------


@cache
def long_run(seed: int) -> Run:
    return random_run(seed, SCANS)


@pytest.mark.slow
@settings(max_examples=2, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.integers(0, 2**32))
def test_every_one_scan_pulse_of_a_random_run_is_found_at_every_zoom(seed: int) -> None:
    run = long_run(seed)
    pulses = 0
    for instance, seen in run.seen.items():
        for pin, values in seen.items():
            lane = run.lane(pin, instance)
            for n in range(1, len(values) - 1):
                before, value, after = values[n - 1 : n + 2]
                if value is None or value in (before, after):
                    continue
                pulses += 1
                for zoom in ZOOMS:
                    window = Window(n // zoom, 1, zoom)
                    (column,) = lane.columns(window, run.wave(instance).until_scan)
                    assert column is not None and column.low is not None and column.high is not None
                    assert column.low <= value <= column.high, (instance, pin, n + 1, zoom)
                    if zoom > 1 and before is not None and (n - 1) // zoom == n // zoom:
                        assert not column.is_level, (instance, pin, n + 1, zoom)
    assert pulses > SCANS // 10
    assert sum(value or 0 for value in run.seen[RECEIVER]["DONE"]) > SCANS // 200


@pytest.mark.slow
@pytest.mark.parametrize("zoom", ZOOMS)
def test_a_column_is_the_least_and_the_greatest_of_its_scans(zoom: int) -> None:
    run = long_run(1)
    for pin, values in run.seen[RECEIVER].items():
        lane = run.lane(pin)
        twice = {scan for scan, after in pairwise(lane.scans) if scan == after}  # COM_RST; STOP and RUN
        columns = lane.columns(Window(0, -(-len(values) // zoom), zoom), run.wave().until_scan)
        for n, column in enumerate(columns):
            scans = range(n * zoom + 1, min((n + 1) * zoom, len(values)) + 1)
            part = [value for scan in scans if (value := values[scan - 1]) is not None]
            assert column is not None and column.low is not None and column.high is not None
            assert column.low <= min(part) and max(part) <= column.high, (pin, n, zoom)
            if not twice.intersection(scans):
                assert (column.low, column.high) == (min(part), max(part)), (pin, n, zoom)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 1)), max_size=60), st.sampled_from(ZOOMS[:6]))
def test_a_lane_drawn_while_it_grows_is_drawn_as_at_the_end(steps: list[tuple[int, int]], zoom: int) -> None:
    growing, scan = PinWaveform(), 1
    for scans, value in steps:
        scan += scans
        growing.add(scan, scan * 10, value)
        growing.columns(Window(0, scan // zoom + 1, zoom), scan)
    window = Window(0, scan // zoom + 1, zoom)
    fresh = PinWaveform()
    for at, t_ns, kept in zip(growing.scans, growing.times, growing.values, strict=True):
        fresh.add(at, t_ns, kept)
    assert growing.columns(window, scan) == fresh.columns(window, scan)


def test_a_com_rst_that_rises_and_falls_within_one_scan_is_drawn() -> None:
    run = connected()
    run.play("pulse TRCV_C_1 COM_RST", 3)
    at = run.lane("COM_RST").next_edge(0, 1)
    assert at is not None and run.seen[RECEIVER]["COM_RST"][at - 1] == 0
    assert text(run, "COM_RST", at - 2, 5) == "▁▁┃▁▁"


def test_signs_tell_levels_edges_and_pulses_apart_without_colour() -> None:
    run = connected()
    first = run.console.bench.runtime.scans + 1
    run.play("peer P1 send random 8 seed=1", 10)
    done = run.lane("DONE").next_edge(first - 1, 1)
    assert done is not None
    assert text(run, "DONE", done - 2, 5) == "▁▁█▁▁"
    assert text(run, "EN_R", done - 2, 5) == "▔▔▔▔▔"
    assert "╵7008" in text(run, "codes", done - 2, 20)
    assert text(run, "RCVD_LEN", done - 2, 5) == "▁▁╵8▁"
    assert "┃" in text(run, "DONE", 1, 4, zoom=10)
    assert len(set(LEVELS)) == len(LEVELS)


# -- from the engine to the screen ------------------------------------------------------------------------


def test_what_does_not_fit_into_one_picture_comes_with_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    run = random_run(5, 400, look_every=10_000)
    whole = list(zip(run.lane("STATUS").scans, run.lane("STATUS").values, strict=True))
    news = run.console._waves.news(RECEIVER, 0, (400, 0), 10)
    assert news is not None and len(news.changes) == 10 and news.until_scan == news.changes[-1][1]
    run.scenario_folder = type(run.scenario_folder)()
    for _ in range(1000):
        wave = run.wave()
        more = run.console._waves.news(RECEIVER, wave.number, (400, 3_990_000_000), 10)
        assert more is not None
        wave.take(more, 10_000_000)
    assert list(zip(run.lane("STATUS").scans, run.lane("STATUS").values, strict=True)) == whole
    assert not run.wave().gaps and run.wave().until_scan == 400


def test_what_the_engine_no_longer_keeps_is_drawn_as_a_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waves, "KEPT_CHANGES", 50)
    monkeypatch.setattr(waves, "LEAST_KEPT", 50)
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
    assert run.lane("DONE").at(first) is None, "between the two nobody can say"
    assert run.lane("LEN").at(last) == 3, "what changed inside the gap is known after it"
    for pin, values in run.seen[RECEIVER].items():
        for scan in range(last + 1, len(values) + 1):
            assert run.lane(pin).at(scan) == values[scan - 1], (pin, scan)


def test_a_late_look_knows_every_pin_though_its_last_change_is_no_longer_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(waves, "KEPT_CHANGES", 50)
    monkeypatch.setattr(waves, "LEAST_KEPT", 50)
    run = connected()
    run.play("set TRCV_C_1 EN_R=blink", 300)
    assert run.lane("CONT").at(300) == 1
    assert run.wave().gaps[0][0] == 1


def test_more_in_one_scan_than_the_ledger_keeps_leaves_nothing_known(monkeypatch: pytest.MonkeyPatch) -> None:
    run = connected()
    ledger = run.console.bench.runtime.ledger
    edge = ledger.since(0)[-1].event
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
    assert run.lane("EN_R").at(run.wave().until_scan) is None
    run.say("create TRCV_C TRCV_C_9 connect=C1 data=rx")
    run.scan(3)
    run.look("TRCV_C_9")
    assert run.lane("EN_R", "TRCV_C_9").values[-1] == 0
    assert run.lane("STATUS", "TRCV_C_9").values[-1] is not None


def test_a_fresh_bench_begins_with_fresh_waves() -> None:
    run = connected()
    run.console._go_home()
    run.scenario_folder = type(run.scenario_folder)()
    run.scan(2)
    run.catch_up()
    assert run.wave().until_scan == 2 and run.lane("EN_R").at(2) == 0


# -- what is asked ------------------------------------------------------------------------------------------


def test_searches_find_edges_codes_and_errors_in_both_directions() -> None:
    run = connected()
    run.say("peer P1 send random 8 seed=1")
    run.scan(5)
    run.play("peer P1 rst", 5)
    wave = run.wave()
    errors = [
        line.scan for line in wave.edges if isinstance(line.event, StatusEdge) and line.event.outputs.error
    ]
    assert errors and wave.next_where(0, lambda edge: edge.outputs.error) == errors[0]
    assert wave.next_where(errors[-1], lambda edge: edge.outputs.error) is None
    done = wave.next_where(0, lambda edge: edge.outputs.status == 0x7008)
    assert done == wave.next_edge(0, 1, ("DONE",))
    assert done is not None and wave.next_edge(done, 1, ("DONE",)) == done + 1
    assert wave.next_edge(done, -1, ("DONE",)) is None or wave.next_edge(done, -1, ("DONE",)) == 1
    line = wave.edge_at(done)
    assert line is not None and isinstance(line.event, StatusEdge) and line.event.outputs.status == 0x7008


def test_the_time_of_a_scan_is_exact_where_it_is_known() -> None:
    run = connected()
    run.scan(100)
    run.catch_up()
    assert run.wave().time_at(57) == (560_000_000, True), "simulated time has no jitter"
    news = run.console._waves.news(RECEIVER, 0, (110, 1_200_000_000))
    late = type(run.wave())(RECEIVER)
    assert news is not None
    late.take(news, 10_000_000)
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
        values, ghost = run.seen[RECEIVER][pin], run.wave().polled(pin)
        for poll in range(0, (len(values) - 1) * interval, POLL_NS):
            scan = poll // interval + 1
            assert ghost.at(scan) == values[scan - 1], (pin, scan)
            assert ghost.at(scan + 5) == values[scan - 1] or scan + 5 > len(values), (
                "held until the next poll"
            )
    done = sum(v or 0 for v in run.seen[RECEIVER]["DONE"])
    assert 0 < run.wave().polled("DONE").rises(1, 2000) < done, "a watch table misses most of them"


def test_the_ruler_names_scans_and_shows_marks() -> None:
    from trcvtui.history.waveform_text import Mark

    drawn_ruler = "".join(part for part, _ in ruler(Window(0, 50, 1), 100, [Mark(5, "▼")]))
    assert drawn_ruler.startswith("╷1  ▼") and "╷21" in drawn_ruler
