"""A capture played to shadow instances.

The capture is read twice: first its conversations, then their events, scan by scan.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from msgspec.structs import replace

from trcvtui.capture.command import read_captures
from trcvtui.capture.plc_end import make_no_match_error
from trcvtui.capture.reassembly import (
    Conversation,
    ConversationEvent,
    Conversations,
    SegmentKind,
    WireDirection,
)
from trcvtui.dialects import DIALECTS
from trcvtui.engine.controller import fresh_bench
from trcvtui.errors import Problem, UserError, mistake
from trcvtui.line.conversations import ConversationFigures
from trcvtui.line.packet_partners import FIRST_JOB_SCANS, ConnectionlessPartner, ReplayedPartner, ShadowBench
from trcvtui.line.shadows import (
    NEVER_NS,
    ShadowPlan,
    find_directions,
    make_endpoint,
    make_watch_rows,
    plan_ad_hoc,
    plan_for_project,
)
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.convert_dialect import convert_project, find_dialect
from trcvtui.project.edit import apply_edits, find_entry, make_change, read_changed
from trcvtui.project.project import Project
from trcvtui.project.tables import SetOverride, quote
from trcvtui.recording.seam import Seam
from trcvtui.scenario.scenario import load_bench_project

MOST_LISTED: Final = 1000  # conversations in the last line
MISSING: Final = "? missing in the capture"  # note of a job that lacks bytes
MOST_UNANSWERED: Final = 2  # keep-alive probes of the PLC end in a row: after these its partner is dead
END_TEXTS: Final = {SegmentKind.FIN: "has closed the connection", SegmentKind.RST: "has reset the connection"}
# Events before a connection is up; events that are not played again.
_OPENING_KINDS: Final = frozenset({SegmentKind.SYN, SegmentKind.ANSWER, SegmentKind.RST})
_IGNORED_KINDS: Final = frozenset(
    {SegmentKind.RETRANSMISSION, SegmentKind.DIFFERENT_COPY, SegmentKind.SILENCE, SegmentKind.WINDOW_OPENS,
     SegmentKind.ZERO_WINDOW, SegmentKind.WINDOW_PROBE}
)  # fmt: skip


PlanMaker = Callable[[Sequence[Conversation]], ShadowPlan]


class ShadowOutput(Protocol):
    """The output of shadows: STATUS edges and notes."""

    first_ns: int = 0  # of the first packet, with which scan 1 begins

    def report_scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        """Take the changes of a scan. `lacking` are instances whose ended job has missing bytes."""

    def note(self, ns: int, number: int, text: str) -> None:
        """Take a note on a conversation. `ns` counts from the first packet."""


class CaptureOutcome(NamedTuple):
    """For each conversation number: its CONNECTs or why it has none, and bytes that reached no shadow.

    `not_run` counts scans that were skipped during silence, but might have changed something.
    """

    assigned: dict[int, list[str]]
    unassigned: dict[int, str]
    left_out: dict[int, int]
    not_run: int


class _PlayedTalk:
    """A conversation while it is played: the ends by direction, and the unanswered keep-alive probes."""

    def __init__(self, ends: list[tuple[WireDirection, ReplayedPartner]]) -> None:
        self.ends = ends
        self.probes = 0


class CapturePlayer:
    """Plays the events of a capture to the shadows of a plan."""

    def __init__(
        self,
        plan: ShadowPlan,
        found: Sequence[Conversation],
        first_ns: int,
        lines: ShadowOutput,
        seam: Seam | None = None,
    ) -> None:
        self.first_ns, self.lines, self._plan = first_ns, lines, plan
        self._last_ns = {each.number: each.last_ns for each in found}
        self.talks: ConversationFigures | None = None  # also count the events
        self.heard: Callable[[ConversationEvent], None] | None = None  # called with each event
        self.shown = frozenset(_find_shown_instances(plan))  # the instances whose scans are reported
        self.overlaps: dict[int, int] = {}  # unassigned conversation -> the one that holds its CONNECT
        self._over: list[int] = []  # ended conversations beyond MOST_LISTED
        self.shadows = ShadowBench(fresh_bench(plan.project, "sim", seam), self._report_scan)
        self._running: dict[int, _PlayedTalk] = {}
        self._reading = Conversations(self.play_event)
        self._left_out: Counter[int] = Counter()  # bytes by number of their conversation
        self._at: dict[str, tuple[int, ReplayedPartner]] = {}  # CONNECT -> the one that has it
        self._played: dict[str, ConnectionlessPartner] = {}  # by UDP_CONFIG, CONNECT of UDP, or ComBuffer
        calls = [config.name for config in plan.project.connects if config.active]
        self.shadows.network.wire.played.update({name: [] for name in calls})  # nothing else answers

    @property
    def packets(self) -> int:
        return self._reading.packets

    def change_plan(self, plan: ShadowPlan) -> None:
        """Switch to this plan: new and changed shadows begin with the next scan."""
        self._plan, shadows = plan, self.shadows
        self.shown |= _find_shown_instances(plan)
        wire = shadows.network.wire
        wire.addresses = plan.project.sim.addresses
        for config in plan.project.connects:
            if config.active:
                wire.played.setdefault(config.name, [])
        shadows.bench.replace_project(plan.project)
        shadows.works_on = {each.name: each.connect for each in plan.project.instances}
        shadows.forbid_skipping()

    def forget_conversation(self, number: int) -> None:
        """Forget an ended conversation, unless it has a CONNECT or the last output line lists it."""
        if number > MOST_LISTED:
            self._over.append(number)
        if len(self._over) <= MOST_LISTED:
            return
        had = {number for number, _ in self._at.values()}
        for over in self._over:
            if over not in had:
                plan = self._plan
                for kept in (self._running, plan.parts, plan.unassigned, plan.guesses, self.overlaps):
                    kept.pop(over, None)
                self._last_ns.pop(over, None)
        self._over = [over for over in self._over if over in had]

    def _report_scan(self, scan: int, changed: Sequence[StatusEdge], lacking: frozenset[str]) -> None:
        shown = [edge for edge in changed if edge.instance in self.shown]
        ended = (
            [edge.instance for edge in shown if edge.outputs.done or edge.outputs.error] if lacking else []
        )
        if shown:
            self.lines.report_scan(scan, shown, [name for name in ended if name in lacking])

    def play_event(self, event: ConversationEvent) -> None:
        """Run the scans before an event, then play it."""
        number = event.conversation.number
        if self.talks is not None and number in self._plan.guesses:
            self.talks.add_event(event, event.direction is self._plc_direction(event.conversation))
        if number not in self._plan.parts or number in self._plan.unassigned:
            return
        if self.heard is not None:
            self.heard(event)
        ns = max(event.ns - self.first_ns, 0)
        if event.kind in _IGNORED_KINDS:
            return
        self.shadows.advance_to(ns)
        self.shadows.packet_ns = ns
        if event.conversation.protocol != "tcp":
            self._play_without_stream(ns, event)
            return
        running = self._running.get(number)
        if running is not None and event.kind is SegmentKind.BYTES:
            for says, end in running.ends:  # the usual case, without the checks below
                if says is not event.direction:
                    end.note_plc_bytes()
                elif not end.has_ended:
                    running.probes = 0
                    end.send(event.data)
            return
        if running is None and event.conversation.begins_with_syn and event.kind in _OPENING_KINDS:
            if event.kind is SegmentKind.RST:
                self._refuse_call(event)
            return
        if running is None:
            running = self._begin_conversation(ns, event.conversation)
        if running is None:
            return
        self._report_hole(ns, event)
        for says, end in running.ends:
            self._play_to_partner(ns, event, event.direction is says, end, running)

    def _play_without_stream(self, ns: int, event: ConversationEvent) -> None:
        self._report_hole(ns, event)
        if event.kind is not SegmentKind.BYTES:
            return
        conversation, is_plc = event.conversation, event.direction is self._plc_direction(event.conversation)
        for part in self._plan.parts[conversation.number]:
            if part.plays_plc == is_plc:
                line = self._played.get(part.connect)
                if line is None:
                    line = ConnectionlessPartner(self.shadows, part.connect, self._left_out)
                    self._played[part.connect] = line
                source = make_endpoint(event.direction.address)
                line.send(conversation.number, source, event.data, event.size - len(event.data))

    def _begin_conversation(self, ns: int, conversation: Conversation) -> _PlayedTalk | None:
        """Give a conversation its CONNECTs, or return None if another conversation has one of these."""
        if not conversation.begins_with_syn:
            self.lines.note(ns, conversation.number, "begins in the middle")
        parts, guess = self._plan.parts[conversation.number], self._plan.guesses[conversation.number]
        for part in parts:
            holder = self._at.get(part.connect)
            if holder is not None and not holder[1].has_ended:
                if self._last_ns.get(holder[0], NEVER_NS) >= ns + self.first_ns:
                    why = f"it overlaps C{holder[0]}"
                    self.overlaps[conversation.number] = holder[0]
                    self._plan.unassigned[conversation.number] = why
                    self.lines.note(ns, conversation.number, f"unassigned: {why}")
                    return None
                holder[1].end_partner(reset=True)  # its end is not in the capture
            if holder is not None:
                self._release_partner(*holder)
        plc, partner = find_directions(guess, conversation)
        ends = []
        for part in parts:
            says = plc if part.plays_plc else partner
            end = ReplayedPartner(self.shadows, part.connect, make_endpoint(says.address), part.calls)
            self._at[part.connect] = conversation.number, end
            ends.append((says, end))
        running = self._running[conversation.number] = _PlayedTalk(ends)
        return running

    def _release_partner(self, number: int, end: ReplayedPartner) -> None:
        end.end_shadow_now()
        if end.left_out:
            self._left_out[number] += end.left_out
            end.left_out = 0
        running = self._running[number]
        running.ends = [each for each in running.ends if each[1] is not end]

    def _refuse_call(self, event: ConversationEvent) -> None:
        is_plc = event.direction is self._plc_direction(event.conversation)
        for part in self._plan.parts[event.conversation.number]:
            if not part.calls and part.plays_plc == is_plc:
                self.shadows.refuse_call(part.connect)

    def _report_hole(self, ns: int, event: ConversationEvent) -> None:
        if event.kind is SegmentKind.MISSING:
            says = event.conversation.number, event.direction
            way = "to" if says[1] is not self._plc_direction(event.conversation) else "from"
            text = f"? {event.size} bytes missing in the capture, {way} the PLC end, from byte {event.at}"
            self.lines.note(ns, says[0], text)

    def _plc_direction(self, conversation: Conversation) -> WireDirection:
        return find_directions(self._plan.guesses[conversation.number], conversation)[0]

    def _play_to_partner(
        self, ns: int, event: ConversationEvent, is_own: bool, end: ReplayedPartner, running: _PlayedTalk
    ) -> None:
        is_left = not is_own and event.kind in END_TEXTS and not event.conversation.is_ours
        if end.has_left if is_left else end.has_ended:
            return
        end.begin_connecting()
        if is_left:
            if not end.has_ended and event.direction is self._plc_direction(event.conversation):
                self.lines.note(ns, event.conversation.number, f"the PLC end {END_TEXTS[event.kind]}")
            is_fin, has_read = event.kind is SegmentKind.FIN, event.conversation.sent is not None
            end.end_shadow(event.direction.unread, end.has_ended and is_fin, has_read)
            return
        if is_own:
            running.probes = 0
        match event.kind:
            case SegmentKind.BYTES if is_own:
                end.send(event.data)
            case SegmentKind.BYTES:
                end.note_plc_bytes()
            case SegmentKind.MISSING if is_own:
                end.send_placeholder(event.size)
            case SegmentKind.FIN if is_own:
                end.end_partner(reset=False)
            case SegmentKind.RST:
                end.end_partner(reset=True)
            case SegmentKind.KEEP_ALIVE if not is_own:
                running.probes += 1
                if running.probes > MOST_UNANSWERED:
                    end.fall_silent()

    def resolve_overlap(self, number: int, last_ns: int) -> None:
        """Give a conversation its CONNECT. The conversation that had it was silent after `last_ns`."""
        self._last_ns[self.overlaps.pop(number)] = last_ns
        self._plan.unassigned.pop(number, None)

    def end_conversation(self, number: int, ns: int) -> None:
        """Free the CONNECTs of a conversation from `ns` on, even if no packet showed its end."""
        self._last_ns[number] = ns

    def play_captures(self, paths: Sequence[str]) -> None:
        """Play captures to the last packet, and let the shadows settle."""
        read_captures(paths, self._reading, [])
        recorded_to = self._reading.recorded_to
        last_ns = max(*self._last_ns.values(), recorded_to or 0, self.first_ns)
        self.shadows.advance_to(last_ns - self.first_ns)
        if recorded_to is not None:  # the recorded PLC read no datagram after that
            tasks = [self.shadows.task_period_scans(link) for link in self._played]
            for _ in range(FIRST_JOB_SCANS * max(tasks, default=0)):
                self.shadows.step()
            for line in self._played.values():
                line.drop_unread()
        self.shadows.settle()

    def close(self) -> CaptureOutcome:
        """End the shadows; return the outcome of each conversation."""
        self.shadows.bench.close()
        for holder in self._at.values():
            self._release_partner(*holder)
        for line in self._played.values():
            line.drop_waiting()
        unassigned = self._plan.unassigned
        assigned = {
            number: [part.connect for part in parts]
            for number, parts in sorted(self._plan.parts.items())
            if number not in unassigned
        }
        left_out = dict(sorted(self._left_out.items()))
        return CaptureOutcome(assigned, dict(sorted(unassigned.items())), left_out, self.shadows.not_run)


def _find_shown_instances(plan: ShadowPlan) -> set[str]:
    links = {part.connect for parts in plan.parts.values() for part in parts}
    shown: set[str] = set()
    while more := {i.name for i in plan.project.instances if i.connect in links} - shown:
        shown |= more
        links |= {each.name for each in plan.project.combuffers if each.source in shown | links}
    return shown


def plan_capture(
    paths: Sequence[str], project: Path | None, plc: str | None, dialect: str | None
) -> tuple[ShadowPlan, Conversations, list[Problem]]:
    """Return the shadows of a capture, its conversations, and its troubles.

    Raise UserError, for example if no conversation fits the PLC end or the project.
    """
    found, troubles = Conversations(), list[Problem]()
    plan_of, _ = plan_maker(project, plc, dialect)
    read_captures(paths, found, troubles)
    if troubles and not found.packets:
        raise UserError(troubles)
    plan = plan_of(found.all)
    if plc is not None and found.all and not plan.guesses:
        raise make_no_match_error("--plc", f"'{plc}', which no conversation has", found.all)
    if project is not None and found.all and not plan.parts:
        fits = "no CONNECT (or several) for a conversation"
        offer = "a CONNECT that has, or --plc as, "
        raise make_no_match_error(f"--project {project}", fits, found.all, offer)
    return plan, found, troubles


def plan_maker(
    project: Path | None, plc: str | None, dialect: str | None, sets: Sequence[str] = ()
) -> tuple[PlanMaker, Project | None]:
    """Return a function that plans for conversations, and the loaded project or None; raise UserError."""
    if project is None:
        name = dialect or next(iter(DIALECTS))
        return lambda found: _change_ad_hoc_keys(plan_ad_hoc(found, plc, name), sets), None
    loaded, notes = load_bench_project(project, sets), tuple[str, ...]()
    loaded = replace(loaded, watches=loaded.watches or make_watch_rows(loaded.taps))
    if dialect is not None:
        loaded, notes = convert_project(loaded, find_dialect(dialect))
    return lambda found: plan_for_project(found, loaded, plc)._replace(notes=notes), loaded


def _change_ad_hoc_keys(plan: ShadowPlan, sets: Sequence[str]) -> ShadowPlan:
    """Return the plan, with keys of its ad-hoc shadows set as `--set` says. Raise UserError."""
    project = plan.project
    for text in sets:
        path, _, value = text.partition("=")
        kind, name, key, *_ = (*path.strip().split("."), "", "", "")
        decl = find_entry(kind, name, project) if kind in ("instance", "data") else None
        if decl is None:
            shadows = ", ".join(each.name for each in project.instances)
            raise mistake(
                f"--set {path.strip()}", quote(name or kind), f"instance.NAME.PIN; a NAME of {shadows}"
            )
        after = read_changed(
            decl, {key: SetOverride(path.strip(), value.strip())}, project, f"--set {path.strip()}"
        )
        project = apply_edits(project, (make_change(decl, after, project),))
    return plan._replace(project=project)
