"""A replay goes to any scan of its recording, by number, time, edge, ERROR or trigger."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from tests.replay.journals import InMemory, recorded
from tests.scenario.scenarios import CONFIGS
from trcvtui import clock
from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.history.pin_waveform import WaveformCache
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.plc.snapshot import Snapshot
from trcvtui.recording.journal import STEP, CallRecord, Entry, LostEntries
from trcvtui.replay.command import find_difference
from trcvtui.replay.driver import WORK_SLICE_NS, make_replay_driver, open_time_line
from trcvtui.replay.run_again import ReplayRun
from trcvtui.replay.survey import FIRST_EVENT, MARK_PIECES, parse_place
from trcvtui.replay.time_line import ReplayNavigator
from trcvtui.snapshots.replay import CANNOT_CHANGE_TEXT, WHAT_IF

LINK_DOWN = CONFIGS / "scenarios" / "baosky" / "80ab-link-down.toml"
LAST, ERRORS = 394, (303, 391)
INSTANCE = "TRCV_C_1"


@cache
def journal() -> tuple[Entry, ...]:
    return tuple(recorded(LINK_DOWN)[1])


class Stood:
    """A time line that is given all the work it needs after each line."""

    def __init__(
        self, at: str = "1", entries: tuple[Entry, ...] | None = None, line: ReplayNavigator | None = None
    ) -> None:
        given = journal() if entries is None else entries
        self.line = line or ReplayNavigator(InMemory(given), "a recording", parse_place(at, "--at"))
        self.settle()

    def settle(self) -> None:
        while self.line.advance(clock.now_ns() + WORK_SLICE_NS):
            pass
        self.line.advance(clock.now_ns())

    def go(self, *lines: str) -> BenchUpdate:
        for line in lines:
            self.line.handle_line(1, line)
            self.settle()
        return self.update()

    def update(self) -> BenchUpdate:
        return self.line.make_picture(
            UpdateRequest(partial_of=(INSTANCE,), bench=self.line.controller._bench_number)
        )

    @property
    def scan(self) -> int:
        return self.line.controller.scans


def shown(update: BenchUpdate) -> tuple[Snapshot, object, object]:
    return update.snapshot, update.peers, update.facts


def test_each_line_that_moves_goes_where_it_says() -> None:
    stood = Stood()
    for line, scan in (
        ("at scan 100", 100), ("at +1", 101), ("at -1", 100), ("run 5", 105), ("at end", LAST), ("at 1", 1),
        ("at T#1s", 101), ("run T#10ms", 102), ("at 99999", LAST), ("at 0", 1), ("at +1", 2),
        ("at error +1", ERRORS[0]), ("at error +1", ERRORS[1]), ("at error -1", ERRORS[0]),
    ):  # fmt: skip
        stood.go(line)
        assert stood.scan == scan, line


def test_each_edge_of_an_instance_is_found_both_ways() -> None:
    stood = Stood()
    on = []
    while not stood.line._note:
        on.append(stood.scan)
        stood.go(f"at edge +1 {INSTANCE}")
    assert stood.line._note == f"no later edge of {INSTANCE}"
    back = [stood.scan]
    while back[-1] > on[0]:
        stood.go(f"at edge -1 {INSTANCE}")
        back.append(stood.scan)
    assert back[::-1] == on and len(on) > 8


@pytest.mark.parametrize(
    "line", ["plc stop", f"set {INSTANCE} EN_R=0", "fault clear", "save scenario x", "mark", "udt reload"]
)
def test_what_would_change_the_bench_is_refused_in_one_line(line: str) -> None:
    stood = Stood("50")
    [answer] = stood.go(line).answers
    assert answer.error == CANNOT_CHANGE_TEXT
    assert stood.scan == 50


@pytest.mark.parametrize(
    "line", ["at", "at x", "at T#x", "at +x", "at error", "at edge +1", "speed 3", "run x", "at ²"]
)
def test_a_line_that_is_none_is_told_what_would_be_one(line: str) -> None:
    [answer] = Stood().go(line).answers
    assert "expected" in answer.error


def test_a_trigger_is_looked_for_to_the_end() -> None:
    stood = Stood()
    update = stood.go(f"trigger {INSTANCE} ERROR rises")
    assert stood.scan == ERRORS[1] and update.fired is None  # the ERROR before it is another instance's
    assert update.position is not None and "ERROR rises" in update.position.note
    update = stood.go(f"trigger {INSTANCE} STATUS=8083")
    assert stood.scan == LAST and not update.armed
    assert update.position is not None and "did not fire" in update.position.note


def test_it_plays_by_the_clock_and_stops_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0]
    monkeypatch.setattr(clock, "now_ns", lambda: now[0])
    stood = Stood()
    stood.line.handle_line(1, "go")
    seen = []
    for _ in range(4):
        now[0] += 500_000_000
        while stood.line._move(now[0] + 1) or stood.line.advance(now[0] + 1):
            pass
        seen.append(stood.scan)
    assert seen == [51, 101, 151, 201]
    assert not stood.update().holding
    stood.go("speed 10x")
    now[0] += 10_000_000_000
    stood.settle()
    assert stood.scan == LAST and stood.update().holding


def test_a_line_given_on_the_way_wins(monkeypatch: pytest.MonkeyPatch) -> None:
    stood = Stood("300")
    scans = 0
    once = ReplayRun.scan

    def counted(run: ReplayRun) -> bool:
        nonlocal scans
        scans += 1
        return once(run)

    monkeypatch.setattr(ReplayRun, "scan", counted)
    stood.line.handle_line(1, "at 290")
    stood.line._update_goal()
    stood.line._move(clock.now_ns())  # it has begun anew, and stands still at 300
    assert stood.scan == 300
    stood.go("at 10")
    assert (stood.scan, scans) == (10, 10)
    stood.go("at +1")
    assert (stood.scan, scans) == (11, 11)


def test_a_recording_that_was_cut_is_seen_to_its_end() -> None:
    cut = journal()[: len(journal()) // 2]
    stood = Stood("end", cut)
    position = stood.update().position
    assert position is not None and position.is_read
    assert 1 < stood.scan == position.last_scan < LAST
    assert "the end of the journal" in position.note


def test_a_journal_that_lies_ends_where_it_differs() -> None:
    told = list(journal())
    steps = [
        place for place, entry in enumerate(told) if isinstance(entry, CallRecord) and entry.call == STEP
    ]
    told[steps[200]] = told[steps[100]]  # time would go back
    stood = Stood("end", tuple(told))
    position = stood.update().position
    assert position is not None and "a time that does not go back" in position.note
    assert stood.scan == position.last_scan == 200


def test_the_errors_of_the_run_are_marked_in_their_places() -> None:
    position = Stood().update().position
    assert position is not None
    marked = [place for place, mark in enumerate(position.marks) if mark]
    assert marked == [(scan - 1) * MARK_PIECES // LAST for scan in ERRORS]
    assert position.errors == len(ERRORS)


def test_where_to_open_is_judged_before_anything_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UserError, match="--at: found 'soon'"):
        make_replay_driver(LINK_DOWN, "soon")
    file = tmp_path / "R.pcapng"
    assert main(["scenario", str(LINK_DOWN), "--record", str(file)]) == 0
    for at in ("395", "T#3s931ms", "0"):
        expected = f"--at: found '{at}', expected a scan from 1 to 394, or a time up to T#3s930ms: "
        with pytest.raises(UserError, match=expected):
            open_time_line(file, at)
    for at, scan in (("394", LAST), ("T#3s930ms", LAST), ("end", LAST), ("error +1", ERRORS[0])):
        stood = Stood(line=open_time_line(file, at))
        assert stood.scan == scan, at
    capsys.readouterr()
    for other in (["--check"], ["--format", "jsonl"], ["--dialect", "s7-1500"]):
        assert main(["replay", str(file), "--at", "5", *other]) == 2
        [line] = capsys.readouterr().err.splitlines()
        assert line.startswith(
            "trcvtui replay: found --at with --check, --format, --set or --dialect, expected"
        )


@pytest.mark.parametrize(("steps", "scan"), [(LAST, ERRORS[0]), (200, 91), (50, 1)])
def test_it_opens_at_the_first_error_else_at_the_first_done_else_at_its_begin(steps: int, scan: int) -> None:
    at = [number for number, one in enumerate(journal()) if getattr(one, "call", "") == STEP]
    entries = journal()[: at[steps] if steps < LAST else None]
    assert Stood(line=ReplayNavigator(InMemory(entries), "a recording", FIRST_EVENT)).scan == scan


def test_a_run_with_another_value_is_shown_beside_and_it_goes_where_they_part() -> None:
    stood = Stood()
    update = stood.go(f"if instance.{INSTANCE}.LEN=1")
    position = update.position
    assert position is not None and update.answers[0].error == ""
    assert stood.scan == position.parts_at == 91
    said = "\n".join(position.what_if)
    assert f"what if instance.{INSTANCE}.LEN=1" in said
    assert "first difference at scan 91" in said and "recorded:" in said and "what-if:" in said
    assert not stood.go("if off").position.what_if  # type: ignore[union-attr]
    assert stood.scan == 91


def test_the_wave_of_the_other_run_ends_where_the_screen_stands() -> None:
    stood = Stood()
    stood.go(f"if instance.{INSTANCE}.LEN=1", "at 100")
    name = WHAT_IF + INSTANCE
    cache = WaveformCache()
    number = stood.line.controller._bench_number
    for scan in (100, 200):
        stood.go(f"at {scan}")
        ask = UpdateRequest(bench=number, waves=cache.make_requests((INSTANCE, name)))
        news = stood.line.make_picture(ask).waves
        cache.add_deltas(news, 10_000_000)
        wave, other = cache.get_wave(INSTANCE), cache.get_wave(name)
        assert wave.until_scan == other.until_scan == scan
        assert max(other.edge_scans) <= scan
        done, beside = wave.lanes["DONE"], other.lanes["DONE"]
        assert done.value_at(91) == 1 and beside.value_at(91) == 1
        assert (done.value_at(93), beside.value_at(93)) == (0, 1)  # the second byte is a job of its own


@pytest.mark.parametrize(
    "line", ["if", "if x", "if instance.NOBODY.LEN=1", "if dialect nobody", "if instance.TRCV_C_1.LEN=x"]
)
def test_another_value_that_is_none_is_told_in_one_line(line: str) -> None:
    stood = Stood()
    update = stood.go(line)
    assert "expected" in update.answers[0].error and "\n" not in update.answers[0].error
    assert update.position is not None and not update.position.what_if


def test_a_journal_with_two_beginnings_is_shown_up_to_the_second() -> None:
    at = [number for number, one in enumerate(journal()) if getattr(one, "call", "") == STEP][200]
    stood = Stood(entries=(*journal()[:at], journal()[0], *journal()[at:]))
    stood.line.handle_line(1, "at end")
    slices = 0
    while stood.line.advance(clock.now_ns() + WORK_SLICE_NS) and slices < 100:
        slices += 1
    position = stood.update().position
    assert position is not None and position.scan == 200 and position.note and slices < 100


def test_after_a_gap_it_is_said_how_many_scans_cannot_run_again() -> None:
    at = [number for number, one in enumerate(journal()) if getattr(one, "call", "") == STEP][200]
    lost = LostEntries(5, "the writer was too slow")
    entries = (*journal()[:at], lost, *journal()[at + 5 :])
    told = (
        "a recording: found a gap of 5 entries (the writer was too slow) after 200 scans "
        f"(later scans that cannot run again: {LAST - 201}), expected the end of the run"
    )
    position = Stood("end", entries).update().position
    assert position is not None and (position.scan, position.note) == (200, told)
    assert find_difference(ReplayRun(iter(entries), "a recording")) == told
