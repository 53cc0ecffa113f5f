"""A file that begins in the middle of its run has keyframes, made by a run beside its writer."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from itertools import chain
from pathlib import Path
from random import Random

import pytest

from tests.replay.journals import InMemory
from tests.replay.test_keyframes import lines
from tests.replay.test_time_line import LAST, journal
from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.plc.ledger import Line
from trcvtui.recording.files import FileLimits, RecordTarget
from trcvtui.recording.journal import DO, STEP, BlockWriter, CallRecord, Entry, LostEntries
from trcvtui.recording.recording import INDEX_MAGIC, KEYFRAME_MAGIC, Recording
from trcvtui.recording.state import SharedObjects, decode_state, encode_state
from trcvtui.replay import follower
from trcvtui.replay.command import find_difference
from trcvtui.replay.follower import KeyframingSink
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.run_again import ReplayRun
from trcvtui.replay.what_if import WhatIf
from trcvtui.report.run_notes import RunNotes

SECOND = 1_000_000_000


def scans(entries: tuple[Entry, ...]) -> Iterator[list[Entry]]:
    """Yield the entries of a scan, as a bench hands them over in the gap after it."""
    some: list[Entry] = []
    for entry in entries:
        if isinstance(entry, CallRecord) and entry.call == STEP:
            yield some
            some = []
        some.append(entry)
    yield some


def written(folder: Path, limits: FileLimits | None, entries: tuple[Entry, ...] | None = None) -> list[Path]:
    target = folder if limits else folder / "R.pcapng"
    sink = KeyframingSink(
        RecordTarget(target, limits=limits).make_file_sink(Path("R") if limits else target), "R"
    )
    for some in scans(entries or journal()):
        sink.add_entries(some)
    sink.close()
    return sorted(folder.iterdir())


@cache
def whole() -> list[Line]:
    run = Keyframes(InMemory(journal()), "R").start_run()
    assert find_difference(run) == ""
    return lines(run)


def begun(path: Path) -> tuple[ReplayRun, int]:
    keyframes = Keyframes(Recording(path), str(path))
    return keyframes.start_run(), keyframes.first


@pytest.mark.parametrize("at", [18, 33], ids=["another scan", "more scans than the journal has"])
def test_a_keyframe_that_does_not_fit_its_file_is_told_in_one_line(
    at: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, FileLimits(21_500, 0, -1, -1))[-1]
    content = bytearray(path.read_bytes())
    content[content.index(KEYFRAME_MAGIC) + at] ^= 1
    path.write_bytes(content)
    assert main(["replay", str(path), "--check"]) == 2
    said = capsys.readouterr().err
    assert "keyframe" in said and said.count("\n") == 1


def test_a_replay_of_the_last_file_of_a_ring_says_which_scans_it_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, FileLimits(21_500, 0, -1, -1))[-1]
    first = begun(path)[1]
    assert main(["replay", str(path), "--check"]) == 0
    assert capsys.readouterr().out == f"{path}: scans {first + 1} to {LAST}, the same again\n"
    assert main(["replay", str(path), "--format", "jsonl"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("\n") > 1


@pytest.mark.parametrize("length", [1, 170], ids=["of a scan", "longer than a file"])
def test_each_file_has_its_keyframe_also_when_blocks_come_late(length: int, tmp_path: Path) -> None:
    sink = KeyframingSink(
        RecordTarget(tmp_path, limits=FileLimits(6000, 0, -1, -1)).make_file_sink(Path("R")), "R"
    )
    some = [*scans(journal())]
    for at in range(0, len(some), length):
        block = BlockWriter(0)
        for entry in chain.from_iterable(some[at : at + length]):
            block.add_entry(entry)
        sink.add_block(block.encode())
        if length > 1:
            sink.advance(follower.NO_DEADLINE)
    sink.close()
    runs = [begun(path) for path in sorted(tmp_path.iterdir())]
    assert [find_difference(run) for run, _ in runs] == [""] * len(runs)
    assert len(runs) > 1 and 0 not in [first for _, first in runs[1:]]
    assert runs[-1][0].bench.runtime.scans == LAST


@pytest.mark.parametrize("later", range(4))
def test_a_run_that_ends_at_the_border_of_a_file_leaves_no_file_without_a_keyframe(
    later: int, tmp_path: Path
) -> None:
    sink = RecordTarget(tmp_path, limits=FileLimits(21_500, 0, -1, -1)).make_file_sink(Path("R"))
    followed = KeyframingSink(sink, "R")
    for some in scans(journal()):
        followed.add_entries(some)
        later -= sink.first_scan > 0
        if later < 0:
            break
    followed.close()
    run, first = begun(sorted(tmp_path.iterdir())[-1])
    assert first > 0 and "found the end of the journal" in find_difference(run)  # the run itself went on


def test_files_that_cannot_be_replayed_as_was_asked_lack_nothing(tmp_path: Path) -> None:
    first, *rest = journal()
    paths = written(tmp_path, FileLimits(21_500, 0, -1, -1), (first, LostEntries(0, "--no-secrets"), *rest))
    assert len(paths) > 1


def test_a_state_that_breaks_later_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, page = written(tmp_path, FileLimits(21_500, 0, -1, -1))[-1], tmp_path / "page.html"

    def broken(notes: RunNotes) -> None:
        raise AttributeError("no such field")

    monkeypatch.setattr(RunNotes, "add_scan", broken)
    assert main(["report", str(path), "--out", str(page)]) == 2
    assert "found AttributeError no such field, expected a keyframe of this run" in capsys.readouterr().err
    monkeypatch.setattr(WhatIf, "scan", broken)
    assert main(["replay", str(path), "--set", "instance.TRCV_C_1.CONT=0"]) == 2
    assert "expected a keyframe of this run" in capsys.readouterr().err
    assert not page.exists()


def test_a_what_if_on_the_last_file_of_a_ring_begins_with_that_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, FileLimits(21_500, 0, -1, -1))[-1]
    first = begun(path)[1]
    assert main(["replay", str(path), "--set", "instance.TRCV_C_1.CONT=0"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert (at := re.fullmatch(r"first difference at scan (\d+)", said[0])) and int(at[1]) > first
    assert said[-1] == f"changed from scan {first + 1} on: the file begins there"
    for late in (
        ["--set", "options.retry=T#1s"],
        ["--dialect", "s7-1500"],
        ["--set", "task.MAIN.interval=T#20ms"],
    ):
        assert main(["replay", str(path), *late]) == 2
        assert "all else needs the run's beginning" in capsys.readouterr().err


def trigger_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(follower, "SPACING_NS", SECOND // 2)
    entries = []
    for at, some in enumerate(scans(journal())):
        entries += some
        if at == 300:
            entries.append(CallRecord("bench", DO, ("trigger X",), None))
    (path,) = written(folder, FileLimits(0, 0, SECOND // 4, SECOND // 4), tuple(entries))
    return path


def test_a_file_of_a_trigger_has_the_beginning_and_keyframes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = trigger_file(tmp_path, monkeypatch)
    run, first = begun(path)
    assert first == 0 and find_difference(run) == "" and 320 < run.bench.runtime.scans < LAST
    keyframes = Keyframes(Recording(path), "R")
    for place in Recording(path).list_keyframes():
        again = keyframes.restore_at(place.scans)
        assert find_difference(again) == "" and lines(again) == lines(run)
    assert keyframes.find_keyframe_scan(LAST) > 300


@pytest.mark.parametrize("has_index", [True, False])
def test_a_long_run_has_a_keyframe_each_half_a_minute(
    has_index: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(follower, "SPACING_NS", SECOND // 2)
    (path,) = written(tmp_path, None)
    if not has_index:
        path.write_bytes(path.read_bytes().rpartition(INDEX_MAGIC)[0])
    keyframes = Keyframes(Recording(path), "R")
    places = Recording(path).list_keyframes()
    assert len(places) == (LAST - 1) // 50
    for place in places:
        run = keyframes.restore_at(place.scans)
        assert (run.where, run.replay.where) == (
            "R",
            "R",
        )  # and not what the file was called when it was made
        assert find_difference(run) == "" or not has_index
        assert lines(run) == whole()


def test_keyframes_of_one_seed_are_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follower, "SPACING_NS", SECOND // 2)
    (tmp_path / "A").mkdir()
    (tmp_path / "B").mkdir()
    (one,), (other,) = written(tmp_path / "A", None), written(tmp_path / "B", None)
    assert one.read_bytes() == other.read_bytes() and KEYFRAME_MAGIC in one.read_bytes()


def test_a_file_without_its_keyframe_says_what_it_lacks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(KeyframingSink, "advance", lambda self, until: False)
    with pytest.raises(
        UserError,
        match=r"found no keyframe in 1 file \(the first is R-0002.pcapng\): the run that makes keyframes",
    ):
        written(tmp_path, FileLimits(21_500, 0, -1, -1))
    path = sorted(tmp_path.iterdir())[-1]
    assert main(["replay", str(path), "--check"]) in (1, 2)
    told = capsys.readouterr()
    assert "this file begins in the middle" in told.out + told.err


@pytest.mark.parametrize("seed", range(60))
def test_what_is_no_state_of_this_run_is_one_user_error(seed: int) -> None:
    shared, state = a_state()
    chance = Random(seed)
    changed = bytearray(state)
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(changed))
        changed[at] = chance.choice((0, 1, 255, chance.randrange(256)))
    try:
        run = decode_state(bytes(changed), shared, "R")
        if not isinstance(run, ReplayRun):
            return
        run.replay.entries = iter(journal()[-300:])
        run.is_restored = True
        find_difference(run)
    except UserError:
        return


@cache
def a_state() -> tuple[SharedObjects, bytes]:
    keyframes = Keyframes(InMemory(journal()), "R")
    run = keyframes.start_run()
    while run.bench.runtime.scans < 250:
        run.scan()
    return keyframes._shared, encode_state(run, keyframes._shared)
