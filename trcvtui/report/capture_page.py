"""A capture on a page: what its shadow instances show, and the conversations in it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from trcvtui.capture.command import capture_notes, conversation_row
from trcvtui.capture.plc_end import NO_KNOWN_ENDS, KnownEnds, PlcEnd, parse_plc
from trcvtui.capture.reassembly import Conversation, Conversations
from trcvtui.history.records import ScanStamp
from trcvtui.line.capture_player import MISSING, CapturePlayer, ShadowOutput, plan_capture
from trcvtui.line.shadows import ShadowChoice, ShadowPlan, list_known_ends
from trcvtui.plc.ledger import StatusEdge
from trcvtui.report.page import ReportSource
from trcvtui.report.run_notes import MOST_EVENTS, EventNote, FirstAndLast, RunNotes
from trcvtui.wording import count

MOST_CONVERSATIONS: Final = 500


class _CaptureNotes(ShadowOutput):
    def __init__(self, interval_ns: int) -> None:
        self.notes: RunNotes | None = None  # from the first scan on
        self.events: FirstAndLast[EventNote] = FirstAndLast(MOST_EVENTS)
        self._interval_ns = interval_ns

    def report_scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        assert self.notes is not None
        self.notes.add_scan()
        at = ScanStamp(scan, (scan - 1) * self._interval_ns)
        for instance in lacking:
            self.events.add(EventNote(at, instance, MISSING))

    def note(self, ns: int, number: int, text: str) -> None:
        self.events.add(EventNote(ScanStamp(-(-ns // self._interval_ns) + 1, ns), f"C{number}", text))


def play_with_notes(
    path: Path, shadows: ShadowChoice, has_payload: bool, file: str, digest: str
) -> tuple[ReportSource, RunNotes, list[str]]:
    """Play a capture to shadow instances; return the source and the notes of the page, and warnings."""
    plan, found, troubles = plan_capture([str(path)], *shadows)
    lines = _CaptureNotes(min(task.interval_ns for task in plan.project.tasks))
    player = CapturePlayer(plan, found.all, found.first_ns or 0, lines)
    notes = lines.notes = RunNotes(player.shadows.bench, lines.events, has_payload)
    player.play_captures([str(path)])
    notes.note_end()
    player.close()
    project, plc, _ = shadows
    known = NO_KNOWN_ENDS if project is None else list_known_ends(plan.project)
    given = None if plc is None else parse_plc(plc)
    source = ReportSource(
        path.name,
        "a capture, played to shadow instances: what blocks with these parameters would show",
        "",
        found.first_ns or 0,
        "the conversations of the capture",
        f"{file}, {count(found.packets, 'packet')}",
        digest,
        conversations=tuple(
            _conversation_cells(one, found, plan, given, known) for one in found.all[:MOST_CONVERSATIONS]
        ),
    )
    return source, notes, [*plan.notes, *capture_notes(found, troubles)]


def _conversation_cells(
    one: Conversation, found: Conversations, plan: ShadowPlan, given: PlcEnd | None, known: KnownEnds
) -> tuple[str, ...]:
    row: dict[str, Any] = conversation_row(found, one, given, known)
    ends = [row[key] for key in ("id", "protocol", "plc", "partner", "begin", "end")]
    to, back = row["to_plc"], row["from_plc"]
    sizes = [
        str(size) for size in (to["bytes"], back["bytes"], (to["missing"] or 0) + (back["missing"] or 0))
    ]
    shadows = ", ".join(part.connect for part in plan.parts.get(one.number, ()))
    return (*ends, *sizes, plan.unassigned.get(one.number) or shadows)
