"""A run that goes on from a keyframe is the run: the same calls, the same lines, to its end."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest

from tests.replay.journals import InMemory, recorded
from tests.replay.test_time_line import LAST, Stood, journal
from tests.scenario.scenarios import CONFIGS
from trcvtui.plc.ledger import Line
from trcvtui.recording.journal import Entry
from trcvtui.recording.recording import INDEX_MAGIC, Recording, RecordingWriter
from trcvtui.replay import keyframes as module
from trcvtui.replay.command import find_difference
from trcvtui.replay.keyframes import Journal, Keyframes, PositionedEntries
from trcvtui.replay.run_again import ReplayRun

SEVERAL = (  # streams, ISO-on-TCP, UDP, a serial line, a program
    "scenarios/baosky/7006-7008-static", "scenarios/siemens/iso-passive",
    "scenarios/siemens/udp-send-and-receive",
    "scenarios/twincat/6-t09-no-suffix-0017", "scenarios/stories/en-r-dropped",
)  # fmt: skip


def lines(run: ReplayRun) -> list[Line]:
    return [*run.bench.runtime.ledger]


def seen(journal: Journal, spacing: int, monkeypatch: pytest.MonkeyPatch) -> tuple[ReplayRun, Keyframes]:
    monkeypatch.setattr(module, "KEYFRAME_SPACING", spacing)
    keyframes = Keyframes(journal, "R")
    run = keyframes.start_run()
    while run.scan():
        keyframes.keep_if_due(run)
    assert run.is_whole or isinstance(journal, Recording)
    return run, keyframes


@pytest.mark.parametrize("name", SEVERAL)
def test_from_each_keyframe_on_the_run_is_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = InMemory(tuple(recorded(CONFIGS / f"{name}.toml")[1]))
    run, keyframes = seen(entries, 40, monkeypatch)
    for scan in range(40, run.bench.runtime.scans, 40)[:: 1 + run.bench.runtime.scans // 400]:
        assert keyframes.find_keyframe_scan(scan + 1) == scan
        again = keyframes.restore_at(scan)
        assert again.bench.runtime.scans == scan
        assert find_difference(again) == ""
        assert lines(again) == lines(run)
    assert keyframes.find_keyframe_scan(39) == 0


@pytest.mark.parametrize("is_whole", [True, False], ids=["with its index", "cut before its index"])
def test_a_file_is_read_on_from_the_block_of_the_keyframe(
    is_whole: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "R.pcapng"
    writer = RecordingWriter(path)
    for place in range(0, len(journal()), 500):
        writer.add_entries(journal()[place : place + 500])
        writer.flush()
    writer.close()
    if not is_whole:
        path.write_bytes(path.read_bytes().partition(INDEX_MAGIC)[0])
    recording = Recording(path)
    run, keyframes = seen(recording, 100, monkeypatch)
    begun: list[int] = []

    def noted(first: int = 0) -> Iterator[Entry]:
        begun.append(first)
        return Recording.read_entries(recording, first)

    monkeypatch.setattr(recording, "read_entries", noted)
    again = keyframes.restore_at(300)
    assert begun[0] > 1
    assert find_difference(again) == "" and lines(again) == lines(run)


def test_entries_from_a_place_are_those_that_are_left() -> None:
    whole = PositionedEntries(InMemory(journal()))
    some = [*islice(whole, 3000)]
    rest = PositionedEntries(InMemory(journal()), whole.steps, whole.beyond)
    assert some and [*rest] == [*whole]


def test_of_too_many_keyframes_every_second_one_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    size = seen(InMemory(journal()), 100, monkeypatch)[1]._size
    monkeypatch.setattr(module, "MOST_KEYFRAME_BYTES", size * 3)
    _, keyframes = seen(InMemory(journal()), 10, monkeypatch)
    assert keyframes._size <= size * 3
    assert 4 <= len(keyframes._scans) < LAST // 10
    assert {
        later - earlier for earlier, later in zip(keyframes._scans, keyframes._scans[1:], strict=False)
    } != {10}


def test_a_screen_goes_back_from_a_keyframe_and_shows_the_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "KEYFRAME_SPACING", 50)
    monkeypatch.setattr("trcvtui.replay.time_line.LEAST_SCANS_BEFORE", 20)
    stood = Stood("end")
    passed: list[int] = []
    once = ReplayRun.scan

    def counted(run: ReplayRun) -> bool:
        went = once(run)
        passed.append(run.bench.runtime.scans)
        return went

    monkeypatch.setattr(ReplayRun, "scan", counted)
    update = stood.go("at 310")
    assert passed == [*range(251, 311)]
    passed.clear()
    forward = stood.go("at 1", "at 310")
    assert passed == [1, *range(251, 311)]
    plain = Stood("310").update()
    assert (
        (forward.snapshot, forward.peers) == (update.snapshot, update.peers) == (plain.snapshot, plain.peers)
    )
