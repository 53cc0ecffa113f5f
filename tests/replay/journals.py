"""Journals that need no file: of scenarios, and of benches that a screen drives."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from tests.scenario.scenarios import Kept, play
from trcvtui.bench.bench import Bench
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.files import record_reads
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.recording.journal import Entry, Keyframe, decode_entries, encode_blocks
from trcvtui.recording.recorder import RunRecorder
from trcvtui.recording.recording import BlockPlace
from trcvtui.replay.command import replay_to_jsonl
from trcvtui.replay.keyframes import Keyframes
from trcvtui.replay.run_again import ReplayRun
from trcvtui.replay.what_if import WhatIf
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.snapshots.bench import EngineTiming


class InMemory:
    """A journal whose blocks have no places."""

    def __init__(self, entries: Sequence[Entry]) -> None:
        self._entries = entries

    def read_entries(self, first: int = 0) -> Iterator[Entry]:
        assert not first
        return iter(self._entries)

    def read_index(self) -> tuple[()]:
        return ()

    def list_keyframes(self) -> tuple[()]:
        return ()

    def read_keyframe(self, place: BlockPlace) -> Keyframe:
        raise AssertionError(place)


def recorded(path: Path, *overrides: str) -> tuple[str, list[Entry]]:
    run = play(path, "sim", *overrides, is_recorded=True)
    return run.text, [*run.entries]


def again(entries: Iterable[Entry]) -> ReplayRun:
    return ReplayRun(decode_entries(encode_blocks(entries), "R"), "R")


def jsonl(entries: Iterable[Entry]) -> str:
    out = io.StringIO()
    replay_to_jsonl(again(entries), out.write)
    return out.getvalue()


def what_if_nothing_changed(entries: Sequence[Entry]) -> None:
    run = WhatIf(Keyframes(InMemory(entries), "R.pcapng"), (), None)
    run.run_to_end()
    nothing_differs(run)


def nothing_differs(run: WhatIf) -> None:
    was, now = run.get_totals()
    assert (run.parts_at, run.guess_from, run.trouble, now) == (None, None, "", was)


def on_the_screen(path: Path, lines: str) -> tuple[Bench, list[Entry]]:
    """Return a bench after these lines with five scans each, and its journal."""
    kept = Kept()
    recorder = RunRecorder(lambda: kept, waits=False)
    with record_reads(recorder.reads):
        project = load_bench_project(path)
        with recorder:
            bench = fresh_bench(project, "sim", recorder.seam)
            recorder.add_header(bench, path, (), is_scenario=False)
            console = Controller(bench)
            for number, line in enumerate(lines.splitlines()):
                console.handle_line(number, line)
                for _ in range(5):
                    console.scan()
                    console.picture(UpdateRequest(), EngineTiming(mode=""), 10)
                    recorder.finish_scan(bench)
            bench.close()
    return bench, kept.entries
