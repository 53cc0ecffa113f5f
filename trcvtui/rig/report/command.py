"""`trcvtui report`: a recording run again, and told on one page."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Final

from trcvtui.capture.journal import DO, HOLDS_SECRETS, STEP, Answered, Entry
from trcvtui.capture.recording import Recording
from trcvtui.errors import UserError, mistake
from trcvtui.files import open_to_read, reason_of, replacing
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.history.records import Moment
from trcvtui.rig.replay.run_again import RunAgain
from trcvtui.rig.report.page import MARK, ReportSource, page
from trcvtui.rig.report.run_notes import EventTold, FirstAndLast, RunNotes
from trcvtui.rig.scenario.runner import Runner, Verdict

WHOLE, ENDS_EARLY = 0, 1
SHOWS: Final = "shows"  # the call of an instance that tells its outputs
MOST_EVENTS: Final = 150


class _NotedScans:
    """The scans that a scenario asks for; raise UserError where the journal has no more of them."""

    def __init__(self, run: RunAgain, notes: RunNotes) -> None:
        self._run, self._notes = run, notes

    def next_scan(self, bench: Bench) -> None:
        """Let one scan pass."""
        if self._run.replay.coming() is None:
            raise self._run.differs()
        bench.step()
        self._notes.scanned()


class _Heard:
    """The entries of a journal on their way to a replay; each command is noted with the scan before it."""

    def __init__(self, entries: Iterator[Entry]) -> None:
        self.events: FirstAndLast[EventTold] = FirstAndLast(MOST_EVENTS)
        self._entries = entries
        self._at = Moment()

    def __iter__(self) -> Iterator[Entry]:
        """Yield them all."""
        for entry in self._entries:
            if isinstance(entry, Answered):
                if entry.call == STEP and isinstance(entry.answer, int):
                    self._at = Moment(self._at.scan + 1, entry.answer)
                elif entry.call == DO and len(entry.args) == 1:
                    self.events.add(EventTold(self._at, "", str(entry.args[0])))
            yield entry

    def tell_rest(self, notes: RunNotes, front: Entry | None) -> None:
        """Tell what the journal says of outputs from this entry on: no replay has come so far."""
        for entry in chain((front,), self):
            if isinstance(entry, Answered) and entry.call == SHOWS:
                notes.shown(self._at, entry.owner, entry.args)
        notes.end_of_rest(self._at)


def look_at(
    entries: Iterator[Entry], where: str, has_payload: bool
) -> tuple[RunAgain, RunNotes, Verdict | None, str]:
    """Run again; return what was seen, the verdict of a scenario, and why it ended early or ""."""
    heard = _Heard(entries)
    run = RunAgain(iter(heard), where)
    notes, verdict, stopped = RunNotes(run.bench, heard.events, has_payload), None, ""
    run.before_close = notes.end
    try:
        if run.scenario is not None:
            steps = (*run.scenario.start, *run.scenario.steps)
            scans = _NotedScans(run, notes)
            verdict = Runner(run.bench, run.scenario.name, scans, lambda *told: None).play(steps)
            notes.end()
            run.bench.close()
            run.replay.end()
        else:
            while run.scan():
                notes.scanned()
            if not run.is_whole:
                raise run.differs()
    except UserError as told:
        stopped = str(told)
        run.replay.is_busy = False  # the last look is one in a gap
        notes.end()
        heard.tell_rest(notes, run.replay.coming())
    return run, notes, verdict, stopped


def report_file(path: Path, out: Path, has_payload: bool) -> int:
    """Write the page of a recording; return 0, or 1 where the recording ends before its run does."""
    where = f"--out {out}"
    recording = Recording(path)
    _refuse_other(out, where)
    run, notes, verdict, stopped = look_at(recording.entries(), path.name, has_payload)
    stopped = recording.stopped or stopped
    digest = sha256()
    with open_to_read(path) as file:
        while piece := file.read(1 << 20):
            digest.update(piece)
        source = ReportSource(path.name, file.tell(), digest.hexdigest())
    with replacing(out, where, is_own=True, mode=0o600) as file:
        seen = stopped.replace(str(path), path.name)  # no folder of this machine on the page
        for part in page(source, run.begins, notes, verdict, seen):
            file.write(part.encode())
    for line in (stopped, f"{path} {HOLDS_SECRETS}" if recording.has_secrets else ""):
        if line:
            sys.stderr.write(f"{line}\n")
    return ENDS_EARLY if stopped else WHOLE


def _refuse_other(out: Path, where: str) -> None:
    """Raise UserError for a file that is there already and is no report of ours."""
    try:
        with open_to_read(out) as file:
            if file.read(len(MARK)) != MARK:
                raise mistake(where, f"{out}, which is no report", "a new name, or that of a report")
    except FileNotFoundError:
        return
    except (OSError, ValueError) as failed:
        raise mistake(where, f"{out}: {reason_of(failed)}", "a new name, or that of a report") from None
