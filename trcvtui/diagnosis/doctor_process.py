"""Judges a run or captures in another process. The process gets blocks of a journal or names of files.

Bounds: at most MOST_FINDINGS findings, the surest, and MOST_TEXT characters for each text of evidence.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from msgspec import to_builtins
from msgspec.structs import replace

from trcvtui import clock
from trcvtui.capture.pcap import open_capture
from trcvtui.diagnosis.doctor import DoctorQuestion, RecordedFacts, fill_finding, finding_key, judge_capture
from trcvtui.errors import UserError, one_line
from trcvtui.files import FilesRead, open_private_file, record_reads
from trcvtui.recording.journal import decode_entries
from trcvtui.recording.recording import RecordingWriter, read_run_header
from trcvtui.recording.writer import POST_INTERVAL_NS
from trcvtui.snapshots.doctor import DoctorSnapshot, Finding
from trcvtui.wording import json_text

if TYPE_CHECKING:
    from trcvtui.project.project import Project

MOST_FINDINGS: Final = 64
MOST_TEXT: Final = 400
ReportScan = Callable[[int, int], None]  # gets the next scan, and the last one
ReadRecordedFacts = Callable[..., RecordedFacts | None]  # runs a recording again (replay/job_facts.py)


def judge_files(paths: Sequence[str], asked: DoctorQuestion, begins_ns: int | None = None) -> DoctorSnapshot:
    """Return the findings in files, each with its time in the run."""
    found, remarks = list[Finding](), list[Finding]()
    qualities, conversations = Counter[str](), 0
    for path in paths:
        verdicts, _, _ = judge_capture(path, asked)
        first_ns, run = _first_packet_ns(path), read_run_header(path)
        run_ns = first_ns if run is None else run.wall_ns
        zero_ns = first_ns - (run_ns if begins_ns is None else begins_ns)
        for verdict in verdicts:
            conversations += verdict.conversation is not None
            qualities.update(verdict.quality)
            found += [_place_in_run(one, zero_ns) for one in verdict.findings]
            remarks += [_place_in_run(one, zero_ns) for one in verdict.remarks]
    found.sort(key=lambda one: -one.confidence)
    lacks = tuple([f"{quality} {often}" for quality, often in qualities.items()])
    return DoctorSnapshot(
        conversations=conversations, findings=_dedupe(found), remarks=_dedupe(remarks), qualities=lacks
    )


def _place_in_run(one: Finding, zero_ns: int) -> Finding:
    """Return a finding with its time in the run and bounded texts without duplicates."""
    t_ns = None if one.t_s is None else zero_ns + round(one.t_s * 1e9)
    evidence = tuple([text[:MOST_TEXT] for text in one.evidence])
    explains = tuple([text for text in one.explains if text not in evidence])
    return replace(one, evidence=evidence, t_ns=t_ns, explains=explains)


def _dedupe(found: Iterable[Finding]) -> tuple[Finding, ...]:
    first: dict[object, Finding] = {}
    for one in found:
        first.setdefault(finding_key(one), one)
    return tuple([*first.values()][:MOST_FINDINGS])


def judge_run(path: str, recorded: ReadRecordedFacts, tell: ReportScan | None = None) -> DoctorSnapshot:
    """Return the findings in a run so far, and findings in its project that traffic does not show."""
    facts = recorded(path, is_running=True, tell=tell)
    found = judge_files([path], DoctorQuestion(recorded=lambda _: facts))
    known = {one.cause for one in found.findings}
    lint = [fill_finding(one) for one in (facts.lint if facts is not None else ()) if one.cause not in known]
    findings = sorted((*found.findings, *lint), key=lambda one: -one.confidence)[:MOST_FINDINGS]
    return replace(found, findings=tuple(findings))


def _first_packet_ns(path: str) -> int:
    with open_capture(path) as reader:
        return next((packet.ns for packet in reader), 0)


class DoctorWorker:
    """Gets a question about files, or null and then a run's journal. Writes the findings when closed."""

    trouble = ""

    def __init__(self, path: str, recorded: ReadRecordedFacts, load: Callable[[Path], Project]) -> None:
        self._path, self._recorded, self._load = path, recorded, load
        self._name, self._told_at, self._reads, self._bytes = "", 0, FilesRead(), 0
        self._reads.on_progress = self._report_read
        self._opened = ExitStack()
        self._asked: Any = None
        self._writer: RecordingWriter | None = None

    def add_block(self, block: bytes) -> None:
        if self._writer is not None:
            self._bytes += len(block)
            self._report(f"gets the run: {self._bytes / 1e6:.1f} MB")
            self._writer.add_entries(decode_entries([block], self._name))
        elif (asked := json.loads(block)) is not None:
            self._asked = asked
        else:
            handle, self._name = self._opened.enter_context(open_private_file())
            file = self._opened.enter_context(os.fdopen(os.dup(handle), "r+b", 0))
            self._writer = RecordingWriter(self._name, file=file)

    def advance(self, deadline_ns: int) -> bool:
        return False

    def close(self) -> None:
        try:
            with record_reads(self._reads):
                found = self._judge()
        except UserError as wrong:
            found = DoctorSnapshot(trouble=wrong.lines()[0][:MOST_TEXT])
        Path(self._path).write_text(json_text(to_builtins(found)))

    def _report(self, text: str, at_once: bool = False) -> None:
        now = clock.now_ns()
        if at_once or now > self._told_at + POST_INTERVAL_NS:
            self._told_at = now
            with open(self._path, "r+b", 0) as file:
                file.write(one_line(text).encode(errors="replace")[:MOST_TEXT] + b"\n")

    def _report_read(self, path: str, share: float) -> None:
        name = "the run" if path == self._name else os.path.basename(path)
        self._report(f"reads {name}: {share:.0%}" if share < 1 else f"judges {name}", at_once=share == 1)

    def _report_scan(self, scan: int, last: int) -> None:
        last = max(scan, last, 1)
        self._report(f"runs it again, scan {scan} of {last}: {scan / last:.0%}")

    def _judge(self) -> DoctorSnapshot:
        if self._writer is not None:
            self._writer.close()
            with self._opened:
                return judge_run(self._name, self._recorded, self._report_scan)
        from trcvtui.diagnosis.lint import list_receivers

        files, plc, project, begins_ns, is_running = self._asked
        receivers = () if project is None else list_receivers(self._load(Path(project)))
        recorded = partial(self._recorded, is_running=is_running, tell=self._report_scan)
        return judge_files(files, DoctorQuestion(plc, receivers, recorded), begins_ns)
