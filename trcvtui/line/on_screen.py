"""Shows a capture on the screen. Its shadows run once, into a temporary recording that the screen shows.

Rule: the screen shows the same run as `trcvtui watch` on the same files, scan by scan.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import islice
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Final

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.capture.command import capture_notes
from trcvtui.line.capture_player import MISSING, CaptureOutcome, CapturePlayer, plan_capture, plan_maker
from trcvtui.line.pause_messages import PauseMessages
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.project import Project
from trcvtui.replay.driver import serve_screen
from trcvtui.replay.survey import NOTE_PREFIX
from trcvtui.wording import count

if TYPE_CHECKING:
    from trcvtui.line.shadows import ShadowChoice
    from trcvtui.replay.time_line import ReplayNavigator

MOST_NOTES: Final = 1000  # of conversations, in the history of the run
PROGRESS_INTERVAL_NS: Final = 500_000_000
MOST_PROMPT_LINES: Final = 3  # above the prompt


class _RunNotes:
    first_ns = 0

    def __init__(self) -> None:
        self.write: Callable[[str], None] = print
        self._left = MOST_NOTES

    def report_scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        for instance in lacking:
            self._write_note(f"{instance}: {MISSING}")

    def note(self, ns: int, number: int, text: str) -> None:
        self._write_note(f"C{number}: {text}")

    def _write_note(self, text: str) -> None:
        if self._left:
            self._left -= 1
            self.write(NOTE_PREFIX + text)


class _Progress:
    """Progress of reading a large capture, on the terminal before the screen opens."""

    def __init__(self, player: CapturePlayer, packets: int) -> None:
        self._player, self._packets = player, packets
        self._shown_ns = clock.now_ns()
        self._is_shown = False

    def show(self) -> None:
        now = clock.now_ns()
        if now - self._shown_ns >= PROGRESS_INTERVAL_NS and sys.stderr.isatty():
            self._shown_ns, self._is_shown = now, True
            sys.stderr.write(f"\r{self._player.packets} of {count(self._packets, 'packet')} ")
            sys.stderr.flush()

    def finish(self) -> None:
        if self._is_shown:
            sys.stderr.write("\n")


def watch_main(channel: Channel, paths: Sequence[str], asked: ShadowChoice) -> None:
    """Show the shadows of a capture, in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="trcvtui-") as folder:
        serve_screen(channel, lambda: _play_shadows(paths, asked, Path(folder) / "shadows.pcapng"))


def _play_shadows(paths: Sequence[str], asked: ShadowChoice, file: Path) -> ReplayNavigator:
    """Return the run of the shadows; raise UserError."""
    from trcvtui.diagnosis.judges import FilesJudge
    from trcvtui.recording.recorder import RunRecorder
    from trcvtui.recording.recording import Recording, RecordingWriter
    from trcvtui.replay.time_line import CaptureRun, ReplayNavigator

    plan, found, troubles = plan_capture(paths, *asked)
    plan = plan._replace(project=replace(plan.project, path=Path(describe_paths(paths))))  # the header's name
    first_ns, notes = found.first_ns or 0, _RunNotes()
    recorder = RunRecorder(lambda: RecordingWriter(file), file, secrets=False)
    with recorder:
        file = _unlink_file(file)
        player = CapturePlayer(plan, found.all, first_ns, notes, recorder.seam)
        rows = PauseMessages(plan, first_ns) if asked[0] is None else None
        player.heard = rows.add_event if rows is not None else None
        bench = player.shadows.bench
        notes.write = bench.record_line
        progress = _Progress(player, found.packets)

        def after_scan() -> None:
            recorder.finish_scan(bench)
            progress.show()

        player.shadows.after_scan = after_scan
        player.shadows.sent = lambda note, ns: recorder.seam.add_outside_note(note._replace(ns=ns))
        recorder.add_header(bench, Path(paths[0]), (), is_scenario=False)
        player.play_captures(paths)
        played = player.close()
        if rows is not None:
            rows.finish(max([each.last_ns for each in found.all], default=0))
        progress.finish()
    lines = (*plan.notes, *_describe_outcome(played), *capture_notes(found, troubles))
    project, plc, dialect = asked

    def changed(sets: Sequence[str], other: str | None) -> tuple[Project, Sequence[str]]:
        made = plan_maker(project, plc, other or dialect, sets)[0](found.all)
        return made.project, made.notes

    judge = FilesJudge(lambda: paths, plc, project)
    capture = CaptureRun(
        plan.project, player.shown, first_ns, lines[:MOST_PROMPT_LINES], changed, judge, rows
    )
    return ReplayNavigator(Recording(file), describe_paths(paths), 1, capture)


def _unlink_file(file: Path) -> Path:
    if not os.path.isdir("/proc/self/fd"):
        return file
    handle = os.open(file, os.O_RDONLY)
    file.unlink()
    with suppress(OSError):  # the folder is not empty
        file.parent.rmdir()
    return Path(f"/proc/self/fd/{handle}")


def describe_paths(paths: Sequence[str]) -> str:
    name = Path(paths[0]).name
    return name if len(paths) == 1 else f"{name} and {count(len(paths) - 1, 'file')} more"


def _describe_outcome(played: CaptureOutcome) -> list[str]:
    some = [f"C{number} ({why})" for number, why in islice(played.unassigned.items(), 8)]
    more = len(played.unassigned) - len(some)
    lines = [f"unassigned: {', '.join(some)}{f' and {more} more' if more else ''}"] if some else []
    lines += [f"C{n}: {count(size, 'byte')} never reached a shadow" for n, size in played.left_out.items()]
    return lines
