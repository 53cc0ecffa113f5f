"""`trcvtui report` runs a recording again, or plays a capture to shadows. The command writes one page."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import escape

from trcvtui.bench.bench import Bench
from trcvtui.diagnosis.doctor import DoctorQuestion, try_to_judge
from trcvtui.diagnosis.lint import list_receivers
from trcvtui.errors import UserError, mistake, one_line
from trcvtui.files import FilesRead, open_to_read, reason_of, replace_file
from trcvtui.history.records import ScanStamp
from trcvtui.recording.journal import DO, SECRETS_WARNING, SHOWS, STEP, CallRecord, Entry
from trcvtui.recording.recording import Recording
from trcvtui.replay.job_facts import collect_recorded_facts
from trcvtui.replay.keyframes import Journal, Keyframes
from trcvtui.replay.run_again import ReplayRun, guard_restored
from trcvtui.report.page import REPORT_MARK, ReportSource, generate_page
from trcvtui.report.run_notes import MOST_EVENTS, EventNote, FirstAndLast, RunNotes
from trcvtui.scenario.runner import ScenarioRunner, Verdict
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.snapshots.doctor import Finding
from trcvtui.wording import count, last_part

if TYPE_CHECKING:  # a recording needs none of it
    from trcvtui.line.shadows import ShadowChoice

EXIT_WHOLE, EXIT_ENDS_EARLY = 0, 1


class _ReplayPace:
    """Lets the recorded scans of a scenario pass; raises UserError if the journal has no call left."""

    def __init__(self, run: ReplayRun, notes: RunNotes) -> None:
        self._run, self._notes = run, notes

    def next_scan(self, bench: Bench) -> None:
        if self._run.replay.peek_call() is None:
            raise self._run.make_end_error()
        bench.step()
        self._notes.add_scan()


class _NotedEntries:
    """Hands the entries of a journal to a replay, and notes each command with the scan before it."""

    def __init__(self, entries: Iterator[Entry], scan: int = 0) -> None:
        self.events: FirstAndLast[EventNote] = FirstAndLast(MOST_EVENTS)
        self._entries = entries
        self._at = ScanStamp(scan)

    def __iter__(self) -> Iterator[Entry]:
        for entry in self._entries:
            if isinstance(entry, CallRecord):
                if entry.call == STEP and isinstance(entry.answer, int):
                    self._at = ScanStamp(self._at.scan + 1, entry.answer)
                elif entry.call == DO and len(entry.args) == 1:
                    self.events.add(EventNote(self._at, "", str(entry.args[0])))
            yield entry

    def note_rest(self, notes: RunNotes, front: Entry | None) -> None:
        for entry in chain((front,), self):
            if isinstance(entry, CallRecord) and entry.call == SHOWS:
                notes.add_outputs(self._at, entry.owner, entry.args)
        notes.extend_lanes_to(self._at)


def replay_with_notes(
    journal: Journal, where: str, has_payload: bool
) -> tuple[ReplayRun, RunNotes, Verdict | None, str]:
    """Repeat a run. Return the run, its notes, a scenario's verdict, and why the run ended early, if so."""
    keyframes = Keyframes(journal, where)
    with guard_restored(keyframes.first > 0, where):
        if keyframes.first:
            run = keyframes.start_run()
            heard = _NotedEntries(run.replay.entries, keyframes.first + 1)
            run.replay.entries = iter(heard)
        else:
            heard = _NotedEntries(journal.read_entries())
            run = ReplayRun(iter(heard), where)
        notes, verdict, stopped = RunNotes(run.bench, heard.events, has_payload), None, ""
        run.before_close = notes.note_end
        try:
            if run.scenario is not None and not keyframes.first:
                steps = (*run.scenario.start, *run.scenario.steps)
                scans = _ReplayPace(run, notes)
                verdict = ScenarioRunner(run.bench, run.scenario.name, scans, lambda *_: None).play(steps)
                notes.note_end()
                run.bench.close()
                run.replay.check_end()
            else:
                while run.scan():
                    notes.add_scan()
                if not run.is_whole:
                    raise run.make_end_error()
        except UserError as error:
            stopped = str(error)
            run.replay.is_busy = False  # notes are taken between two scans
            notes.note_end()
            heard.note_rest(notes, run.replay.peek_call())
        return run, notes, verdict, stopped


def recording_source(
    run: ReplayRun, notes: RunNotes, verdict: Verdict | None, stopped: str, file: str, digest: str
) -> ReportSource:
    begins = run.begins
    files = [(last_part(name), str(len(data)), sha256(data).hexdigest()) for name, data in begins.files]
    return ReportSource(
        verdict.scenario if verdict is not None else last_part(begins.path),
        f"run again from the recording, {count(notes.seen.scan, 'scan')}: the same",
        stopped,
        begins.wall_ns,
        f"simulated network, seed {begins.seed}" if begins.kernel == "sim" else "real network",
        f"{file}, a recording of trcvtui {begins.program}",
        digest,
        (*files, *((last_part(name), "", known) for name, known in begins.digests)),
    )


def _folders(files: FilesRead, path: str) -> list[str]:
    names = [os.path.join(files.folder, name) for name in ("", path, *files.contents, *files.digests)]
    before = {name.removesuffix(last_part(name)) for name in names}
    return sorted([str(escape(one_line(each))) for each in before if len(each) > 1], key=len, reverse=True)


def write_report(path: Path, out: Path, has_payload: bool, shadows: ShadowChoice) -> int:
    """Write the page of a file. Return 1 if a recording ends before its run does, else 0.

    Any file but our own recordings is a capture. If any of `shadows` (project, PLC end, dialect) is given,
    a recording is a capture, too.
    """
    where = f"--out {out}"
    _refuse_foreign_file(out, where)
    digest, size = sha256(), 0
    try:
        with open_to_read(path) as file:
            while piece := file.read(1 << 20):
                digest.update(piece)
                size += len(piece)
    except (OSError, ValueError) as failed:
        raise mistake(str(path), reason_of(failed), "a recording or a capture that can be read") from None
    named = f"{path.name}, {size} bytes"
    recording, folders = None if any(shadows) else _recording(path), list[str]()
    findings, verdict = _judge_file(path, shadows[0], shadows[1]), None
    gc.collect()  # else a large capture would be in memory twice
    if recording is None:
        from trcvtui.report.capture_page import play_with_notes  # a recording needs none of it

        source, notes, lines = play_with_notes(path, shadows, has_payload, named, digest.hexdigest())
    else:
        run, notes, verdict, stopped = replay_with_notes(recording, path.name, has_payload)
        lines, folders = [recording.find_damage() or stopped], _folders(run.replay.files, run.begins.path)
        seen = lines[0].replace(str(path), path.name)  # no folder of this machine on the page
        source = recording_source(run, notes, verdict, seen, named, digest.hexdigest())
        lines += [f"{path} {SECRETS_WARNING}"] * recording.has_secrets
    source = source._replace(findings=findings)
    is_restored = recording is not None and run.is_restored
    with guard_restored(is_restored, str(path)), replace_file(out, where, is_own=True, mode=0o600) as file:
        for part in generate_page(source, notes, verdict):
            for folder in folders:
                part = part.replace(folder, "")
            file.write(part.encode())
    sys.stderr.write("".join(f"{line}\n" for line in lines if line))
    return EXIT_ENDS_EARLY if source.stopped else EXIT_WHOLE


def _judge_file(path: Path, project: Path | None, plc: str | None) -> tuple[Finding, ...]:
    receivers = () if project is None else list_receivers(load_bench_project(project))
    answer = try_to_judge(str(path), DoctorQuestion(plc, receivers, collect_recorded_facts))
    if isinstance(answer, UserError):
        return ()
    found = [finding for verdict in answer[0] for finding in verdict.findings]
    return tuple(sorted(found, key=lambda one: -one.confidence))


def _recording(path: Path) -> Recording | None:
    try:
        return Recording(path)
    except UserError:
        return None


def _refuse_foreign_file(out: Path, where: str) -> None:
    """Raise UserError if the file exists and is not our own report."""
    try:
        with open_to_read(out) as file:
            if file.read(len(REPORT_MARK)) != REPORT_MARK:
                raise mistake(where, f"{out}, which is no report", "a new name, or that of a report")
    except FileNotFoundError:
        return
    except (OSError, ValueError) as failed:
        raise mistake(where, f"{out}: {reason_of(failed)}", "a new name, or that of a report") from None
