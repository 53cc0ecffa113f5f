"""`trcvtui watch`: a capture put through shadow instances, as lines of text or of JSON.

The capture is read twice: first who talks to whom, then what they said when, scan by scan.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Final, Protocol

from trcvtui.capture.command import capture_notes, take_captures
from trcvtui.capture.reassembly import (
    Conversation,
    ConversationEvent,
    Conversations,
    EventKind,
    WireDirection,
)
from trcvtui.dialects import DIALECTS
from trcvtui.errors import Problem, UserError, one_line
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.convert_dialect import dialect_named, in_dialect
from trcvtui.records import NamedTuple
from trcvtui.rig.engine.controller import fresh_bench
from trcvtui.rig.scenario.report import JsonLines, outputs_record
from trcvtui.rig.scenario.scenario import load_bench
from trcvtui.rig.watch.player import PlayedEnd, Shadows
from trcvtui.rig.watch.shadows import ShadowPlan, end_of, ends_of, plan_ad_hoc, plan_of_project
from trcvtui.rig.wording import utc_text

MISSING: Final = "? missing in the capture"
MOST_LISTED: Final = 1000  # conversations in the last line
UNANSWERED: Final = 2  # probes of the PLC end in a row, after which its partner is silent


class ShadowLines(Protocol):
    """Who is told what shadows show."""

    def scan(self, scan: int, changed: Sequence[StatusEdge], lacking: frozenset[str]) -> None:
        """Take what changed in a scan; `lacking` are those whose job lacks bytes."""
        ...

    def note(self, ns: int, number: int, text: str) -> None:
        """Take what is said of a conversation; `ns` counts from the first packet."""
        ...


class Played(NamedTuple):
    """By number of a conversation: its CONNECTs, why it has none, how many bytes never reached a shadow.

    `not_run`: scans of silence of which nobody knows whether they change something.
    """

    assigned: dict[int, list[str]]
    unassigned: dict[int, str]
    left_out: dict[int, int]
    not_run: int


class WatchLines:
    """The records of the shadows, and what is said of conversations between them."""

    def __init__(
        self, write: Callable[[str], object], form: str | None, interval_ns: int, first_ns: int
    ) -> None:
        self._write = write
        self._lines = None if form is None else JsonLines(write, interval_ns)
        self._interval_ns = interval_ns
        self._first_ns = first_ns

    def scan(self, scan: int, changed: Sequence[StatusEdge], lacking: frozenset[str]) -> None:
        """Write one line for each instance that changed; `lacking` are those whose job lacks bytes."""
        for edge in changed:
            of_job = edge.instance in lacking and (edge.outputs.done or edge.outputs.error)
            self._say(scan, outputs_record(edge) | ({"note": MISSING} if of_job else {}))

    def note(self, ns: int, number: int, text: str) -> None:
        """Write what is said of a conversation; `ns` counts from the first packet."""
        self._say(-(-ns // self._interval_ns) + 1, {"conversation": f"C{number}", "note": text})

    def _say(self, scan: int, record: dict[str, object]) -> None:
        ns = self._first_ns + (scan - 1) * self._interval_ns
        if self._lines is not None:
            self._lines.line(scan, {"time": utc_text(ns), **record})
        else:
            self._write(f"{utc_text(ns)}  scan {scan}  {one_line('  '.join(_words(record)))}\n")

    def end(self, played: Played) -> None:
        """Write the last line."""
        if self._lines is None:
            for number, connects in islice(played.assigned.items(), MOST_LISTED):
                self._write(f"C{number} was played to {', '.join(connects)}\n")
            for number, why in islice(played.unassigned.items(), MOST_LISTED):
                self._write(f"C{number} is unassigned: {why}\n")
            for number, size in played.left_out.items():
                self._write(f"C{number}: {size} bytes never reached a shadow\n")
            if played.not_run:
                self._write(f"{played.not_run} scans of silence were not run\n")
            return
        assigned = islice(played.assigned.items(), MOST_LISTED)
        unassigned = islice(played.unassigned.items(), MOST_LISTED)
        record: dict[str, object] = {
            "assigned": [{"id": f"C{number}", "shadows": connects} for number, connects in assigned],
            "unassigned": [{"id": f"C{number}", "why": why} for number, why in unassigned],
            "left_out": {f"C{number}": size for number, size in played.left_out.items()},
        }
        self._lines.write(record | ({"not_run": played.not_run} if played.not_run else {}))


def _words(record: Mapping[str, object]) -> Iterator[str]:
    """Yield what a line of text says of a record."""
    if "conversation" in record:
        yield f"{record['conversation']}: {record['note']}"
        return
    yield f"{record['instance']}  {record['STATUS']}{'!' if record['ERROR'] else ''}"
    if record["DONE"]:
        yield f"DONE {record['RCVD_LEN']} B" if record.get("RCVD_LEN") else "DONE"
    cause = record.get("cause")
    if isinstance(cause, Mapping):
        yield str(cause["text"])
    if "note" in record:
        yield str(record["note"])


class _Running:
    """A conversation while it is played: its ends by direction, and what the wire has shown of it."""

    def __init__(self, ends: list[tuple[WireDirection, PlayedEnd]]) -> None:
        self.ends = ends
        self.probes = 0


class CapturePlayer:
    """Plays the events of a capture to the shadows of a plan."""

    def __init__(
        self, plan: ShadowPlan, found: Sequence[Conversation], first_ns: int, lines: ShadowLines
    ) -> None:
        self._first_ns, self._lines, self._plan = first_ns, lines, plan
        self._last_ns = {each.number: each.last_ns for each in found}
        used = {part.connect for parts in plan.parts.values() for part in parts}
        self._shown = {each.name for each in plan.project.instances if each.connect in used}
        self.shadows = Shadows(fresh_bench(plan.project, "sim"), self._show)
        self._running: dict[int, _Running] = {}
        self._left_out: Counter[int] = Counter()  # bytes by number of their conversation
        self._at: dict[str, tuple[int, PlayedEnd]] = {}  # CONNECT -> who has it
        calls = [config.name for config in plan.project.connects if config.active]
        self.shadows.network.wire.played.update({name: [] for name in calls})  # nobody else answers

    def _show(self, scan: int, changed: Sequence[StatusEdge], lacking: frozenset[str]) -> None:
        shown = [edge for edge in changed if edge.instance in self._shown]
        if shown:
            self._lines.scan(scan, shown, lacking)

    def take(self, event: ConversationEvent) -> None:
        """Let time pass up to an event, and do what it says."""
        number = event.conversation.number
        if number not in self._plan.parts or number in self._plan.unassigned:
            return
        ns = max(event.ns - self._first_ns, 0)
        if event.kind in _OF_NO_PARTNER:
            return
        self.shadows.go_to(ns)
        running = self._running.get(number)
        if running is None and event.conversation.begins_with_syn and event.kind in _BEFORE:
            if event.kind is EventKind.RST:
                self._refuse(event)
            return
        if running is None:
            running = self._begin(ns, event.conversation)
        if running is None:
            return
        self._tell_hole(ns, event)
        for says, end in running.ends:
            self._play(event, event.direction is says, end, running)

    def _begin(self, ns: int, conversation: Conversation) -> _Running | None:
        """Give a conversation its CONNECTs; None: it is not built yet, or another one has them."""
        if not conversation.begins_with_syn:
            self._lines.note(ns, conversation.number, "begins in the middle")
        parts, guess = self._plan.parts[conversation.number], self._plan.guesses[conversation.number]
        for part in parts:
            holder = self._at.get(part.connect)
            if holder is not None and not holder[1].has_ended:
                if self._last_ns[holder[0]] >= ns + self._first_ns:
                    why = f"it overlaps C{holder[0]}"
                    self._plan.unassigned[conversation.number] = why
                    self._lines.note(ns, conversation.number, f"unassigned: {why}")
                    return None
                holder[1].end(reset=True)  # its end is not in the capture
            if holder is not None:
                self._let_go(*holder)
        plc, partner = ends_of(guess, conversation)
        ends = []
        for part in parts:
            says = plc if part.plays_plc else partner
            end = PlayedEnd(self.shadows, part.connect, end_of(says.address), part.calls)
            self._at[part.connect] = conversation.number, end
            ends.append((says, end))
        running = self._running[conversation.number] = _Running(ends)
        return running

    def _let_go(self, number: int, end: PlayedEnd) -> None:
        if end.left_out:
            self._left_out[number] += end.left_out
            end.left_out = 0
        running = self._running[number]
        running.ends = [each for each in running.ends if each[1] is not end]

    def _refuse(self, event: ConversationEvent) -> None:
        """Let those who were called refuse, as the wire shows it."""
        is_plc = event.direction is self._plc_of(event.conversation)
        for part in self._plan.parts[event.conversation.number]:
            if not part.calls and part.plays_plc == is_plc:
                self.shadows.network.wire.refuse(part.connect)
                self.shadows.wake()

    def _tell_hole(self, ns: int, event: ConversationEvent) -> None:
        if event.kind is EventKind.MISSING:
            says = event.conversation.number, event.direction
            way = "to" if says[1] is not self._plc_of(event.conversation) else "from"
            text = f"? {event.size} bytes missing in the capture, {way} the PLC end, from byte {event.at}"
            self._lines.note(ns, says[0], text)

    def _plc_of(self, conversation: Conversation) -> WireDirection:
        return ends_of(self._plan.guesses[conversation.number], conversation)[0]

    def _play(self, event: ConversationEvent, is_own: bool, end: PlayedEnd, running: _Running) -> None:
        if end.has_ended:
            return
        end.begin()
        if is_own:
            running.probes = 0
        match event.kind:
            case EventKind.BYTES if is_own:
                end.send(event.data)
            case EventKind.MISSING if is_own:
                end.leave_out(event.size)
            case EventKind.FIN if is_own:
                end.end(reset=False)
            case EventKind.RST:
                end.end(reset=True)
            case EventKind.KEEP_ALIVE if not is_own:
                running.probes += 1
                if running.probes > UNANSWERED:
                    end.fall_silent()

    def play(self, paths: Sequence[str]) -> None:
        """Play a capture to its last packet, and let the shadows settle."""
        take_captures(paths, Conversations(self.take), [])
        self.shadows.go_to(max(self._last_ns.values(), default=self._first_ns) - self._first_ns)
        self.shadows.settle()

    def close(self) -> Played:
        """End it; return what became of the conversations."""
        self.shadows.bench.close()
        for holder in self._at.values():
            self._let_go(*holder)
        unassigned = self._plan.unassigned
        assigned = {
            number: [part.connect for part in parts]
            for number, parts in self._plan.parts.items()
            if number not in unassigned
        }
        left_out = dict(sorted(self._left_out.items()))
        return Played(assigned, dict(sorted(unassigned.items())), left_out, self.shadows.not_run)


_BEFORE: Final = frozenset({EventKind.SYN, EventKind.ANSWER, EventKind.RST})  # of a connection that is built
_OF_NO_PARTNER: Final = frozenset(
    {EventKind.RETRANSMISSION, EventKind.DIFFERENT_COPY, EventKind.SILENCE, EventKind.WINDOW_OPENS,
     EventKind.ZERO_WINDOW, EventKind.WINDOW_PROBE}
)  # fmt: skip


def plan_capture(
    paths: Sequence[str], project: Path | None, plc: str | None, dialect: str | None
) -> tuple[ShadowPlan, Conversations, list[Problem]]:
    """Return the shadows of a capture, what is in it, what could not be read; raise UserError."""
    found, troubles = Conversations(), list[Problem]()
    loaded, notes = None if project is None else load_bench(project), tuple[str, ...]()
    if loaded is not None and dialect is not None:
        loaded, notes = in_dialect(loaded, dialect_named(dialect))
    take_captures(paths, found, troubles)
    if troubles and not found.packets:
        raise UserError(troubles)
    if loaded is not None:
        plan = plan_of_project(found.all, loaded, plc)._replace(notes=notes)
    else:
        plan = plan_ad_hoc(found.all, plc, dialect or next(iter(DIALECTS)))
    return plan, found, troubles


def watch_lines(
    paths: Sequence[str],
    project: Path | None,
    plc: str | None,
    dialect: str | None,
    form: str | None,
    write: Callable[[str], object],
) -> Iterator[str]:
    """Write the records of the shadows; yield what there is to say beside; raise UserError for bad input."""
    plan, found, troubles = plan_capture(paths, project, plc, dialect)
    first_ns = found.first_ns or 0
    interval = min(task.interval_ns for task in plan.project.tasks)
    lines = WatchLines(write, form, interval, first_ns)
    player = CapturePlayer(plan, found.all, first_ns, lines)
    player.play(paths)
    lines.end(player.close())
    yield from plan.notes
    yield from capture_notes(found, troubles)


def watch(
    paths: Sequence[str], project: Path | None, plc: str | None, dialect: str | None, form: str | None
) -> None:
    """Write lines to stdout, JSON where `form` says so, and to stderr what could not be read."""
    for line in watch_lines(paths, project, plc, dialect, form, sys.stdout.write):
        sys.stderr.write(line + "\n")
