"""A run or captures, judged by a process beside: it gets blocks of a journal, or the names of files.

Bounds: MOST_FINDINGS, the surest, in texts of MOST_TEXT characters.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Final

from trcvtui import clock
from trcvtui.capture.pcap import open_capture
from trcvtui.diagnosis.doctor import DoctorQuestion, finding_row, judge, same_finding
from trcvtui.errors import UserError, one_line
from trcvtui.files import FilesRead, noting_reads, unnamed
from trcvtui.recording.journal import entries_of
from trcvtui.recording.recording import RecordingWriter, begin_of_run
from trcvtui.recording.writer import POST_NS, write_all
from trcvtui.replay.job_facts import PassScan, recorded_facts
from trcvtui.replay.run_again import ReplayRun

MOST_FINDINGS: Final = 64
MOST_TEXT: Final = 400
Found = dict[str, Any]


def found_in(paths: Sequence[str], asked: DoctorQuestion, begins_ns: int | None = None) -> Found:
    """Return what the doctor finds, as plain data: each finding with its ends, and its time in the run."""
    rows: dict[str, list[Found]] = {"findings": [], "remarks": []}
    qualities = Counter[str]()
    conversations = 0
    for path in paths:
        verdicts, _, _ = judge(path, asked)
        zero_ns = _first_packet_ns(path) - (_run_begins_ns(path) if begins_ns is None else begins_ns)
        for verdict in verdicts:
            conversations += verdict["conversation"] is not None
            qualities.update(verdict["quality"])
            for kind, found in rows.items():
                for one in verdict[kind]:
                    t_ns = None if one["t_s"] is None else zero_ns + round(one["t_s"] * 1e9)
                    evidence = [text[:MOST_TEXT] for text in one["evidence"]]
                    ends = verdict["conversation"]
                    found.append({**one, "evidence": evidence, "ends": ends, "t_ns": t_ns})
    rows["findings"].sort(key=lambda one: -one["confidence"])
    some = {kind: _each_once(found)[:MOST_FINDINGS] for kind, found in rows.items()}
    lacks = [f"{quality} {often}" for quality, often in qualities.items()]
    return {"conversations": conversations, **some, "qualities": lacks, "trouble": ""}


def _each_once(found: list[Found]) -> list[Found]:
    first: dict[object, Found] = {}
    for one in found:
        first.setdefault(same_finding(one, one["ends"]), one)
    return [*first.values()]


def found_in_run(path: str, pass_scan: PassScan | None = None) -> Found:
    """Return what is found in a run so far, and in its project where the traffic does not show it."""
    facts = recorded_facts(path, is_running=True, pass_scan=pass_scan)
    found = found_in([path], DoctorQuestion(recorded=lambda _: facts))
    known = {one["cause"] for one in found["findings"]}
    lint = [finding_row(None, one) for one in (facts.lint if facts is not None else ())]
    more = [{**one, "ends": None, "t_ns": None} for one in lint if one["cause"] not in known]
    findings = [*found["findings"], *more]
    return {**found, "findings": sorted(findings, key=lambda one: -one["confidence"])[:MOST_FINDINGS]}


def _first_packet_ns(path: str) -> int:
    with open_capture(path) as reader:
        return next((packet.ns for packet in reader), 0)


def _run_begins_ns(path: str) -> int:
    begins = begin_of_run(path)
    return begins.wall_ns if begins is not None else _first_packet_ns(path)


class DoctorInput:
    """Takes all that is to be judged, and at the end of it writes what is found."""

    trouble = ""

    def __init__(self, path: str) -> None:
        self._path, self._name, self._told_at, self._reads = path, "", 0, FilesRead()
        self._reads.how_far = self._tell_read

    def take_block(self, block: bytes) -> None:
        self._asked = json.loads(block)

    def go_on(self, until: int) -> bool:
        return False

    def close(self) -> None:
        try:
            with noting_reads(self._reads):
                found = self._found()
        except UserError as wrong:
            none: Found = {"conversations": 0, "findings": [], "remarks": [], "qualities": []}
            found = {**none, "trouble": wrong.lines()[0][:MOST_TEXT]}
        Path(self._path).write_text(json.dumps(found))

    def _tell(self, text: str, at_once: bool = False) -> None:
        now = clock.now_ns()
        if at_once or now > self._told_at + POST_NS:
            self._told_at = now
            with open(self._path, "r+b", 0) as file:
                file.write(one_line(text).encode(errors="replace")[:MOST_TEXT] + b"\n")

    def _tell_read(self, path: str, share: float) -> None:
        name = "the run" if path == self._name else os.path.basename(path)
        self._tell(f"reads {name}: {share:.0%}" if share < 1 else f"judges {name}", at_once=share == 1)

    def _pass_scan(self, run: ReplayRun, last: int) -> bool:
        scan, last = run.bench.runtime.scans, max(run.bench.runtime.scans, last, 1)
        self._tell(f"runs it again, scan {scan} of {last}: {scan / last:.0%}")
        return run.scan()

    def _found(self) -> Found:
        from trcvtui.diagnosis.lint import receivers_of
        from trcvtui.scenario.scenario import load_bench

        files, plc, project, begins_ns, is_running = self._asked
        receivers = () if project is None else receivers_of(load_bench(Path(project)))
        recorded = partial(recorded_facts, is_running=is_running, pass_scan=self._pass_scan)
        return found_in(files, DoctorQuestion(plc, receivers, recorded), begins_ns)


class _JudgedRun(DoctorInput):
    def __init__(self, path: str) -> None:
        super().__init__(path)
        self._opened, self._bytes = ExitStack(), 0
        handle, self._name = self._opened.enter_context(unnamed())
        file = self._opened.enter_context(os.fdopen(os.dup(handle), "r+b", 0))
        self._writer = RecordingWriter(self._name, file=file)

    def take_block(self, block: bytes) -> None:
        self._bytes += len(block)
        self._tell(f"gets the run: {self._bytes / 1e6:.1f} MB")
        self._writer.take(entries_of([block], self._name))

    def _found(self) -> Found:
        self._writer.close()
        with self._opened:
            return found_in_run(self._name, self._pass_scan)


def run_main(path: str, asked: str) -> None:
    """Be the process that judges a run (recording/black_box.py)."""
    write_all(asked, lambda _: _JudgedRun(path), path)


def files_main(path: str, asked: str) -> None:
    """Be the process that judges files (replay/time_line.py)."""
    write_all(asked, lambda _: DoctorInput(path), path)
