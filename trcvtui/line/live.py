"""Plays packets of a growing capture to shadows as they come. A conversation gets shadows when it begins.

Rule 1: time comes from the packets. An event is played when a packet 40 ms younger has come. So the shadows
of a new PLC end exist before its first event. How reads cut the packets does not matter.
Rule 2: after 30 ms without a packet all events are played, and time advances a few scans. Only after one
second does time follow the clock, as the program that pipes packets may hold older packets back.
Rule 3: ended conversations are forgotten, so that only open ones use memory.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.capture.command import capture_notes
from trcvtui.capture.pcap import CaptureReader, Packet, interface_block, packet_block, section_block
from trcvtui.capture.plc_end import PlcEnd, PlcGuess, address_text, parse_plc
from trcvtui.capture.reassembly import SILENCE_NS, Conversation, ConversationEvent, Conversations, SegmentKind
from trcvtui.errors import UserError, mistake
from trcvtui.files import open_private_file
from trcvtui.line.capture_player import CapturePlayer, PlanMaker, plan_maker
from trcvtui.line.shadows import ShadowEnd, ShadowPlan, begins_late, plan_ad_hoc
from trcvtui.net.os.packet_pipe import PacketPipe
from trcvtui.net.results import ANY_ADDRESS, Endpoint
from trcvtui.net.tap import Route
from trcvtui.project.project import Project

PLAY_DELAY_NS: Final = 40_000_000
IDLE_HOLD_NS: Final = 30_000_000
LULL_NS: Final = 1_000_000_000
SCANS_AFTER_LAST: Final = 6  # so that the effect of the last packet is shown
SWEEP_INTERVAL_NS: Final = 10_000_000_000  # between two searches for ended conversations
MOST_WAITING_EVENTS: Final = 1 << 16  # events
MOST_KEPT_BYTES: Final = 8 << 20  # bytes of packets, for the doctor
MOST_DECISIONS: Final = 4096  # pairs of ends with a decision
MOST_LATE_NS: Final = 1_000_000_000  # lag of the shadows from which TOO_FAST_TEXT is shown
TOO_FAST_TEXT: Final = "packets come faster than they are played; those that the capture drops are missing"
ANY_PORT: Final = 49_152
_ANY_CALLER: Final = bytes((127, 0, 0, 1))  # never shown: the shadow listens
_DECIDING_KINDS: Final = frozenset({SegmentKind.ESTABLISHED, SegmentKind.BYTES, SegmentKind.MISSING})


class _Decision(NamedTuple):
    """The ShadowEnds for conversations between two ends or why there are none, and which end is the PLC."""

    parts: tuple[ShadowEnd, ...] | None
    why: str
    is_there: bool
    confidence: float
    guess_why: str


class LivePlan:
    """A plan that grows with new conversations. Raise UserError for a wrong project, PLC end or dialect."""

    routes: Sequence[Route] = ()  # of taps; `calls`: which the PLC calls; `lines`: names of serial lines
    calls: Sequence[bool] = ()
    lines: Mapping[str, str] = {}

    def __init__(self, project: Path | None, plc: str | None, dialect: str | None) -> None:
        self.path = project
        self._plan_of, expected = self._prepare_plan(project, plc, dialect)
        self._first: list[Conversation] = []  # the first of each CONNECT: it decides the CONNECT's values
        self._of_first: dict[int, tuple[ShadowEnd, ...]] = {}
        self._known: dict[tuple[object, ...], _Decision] = {}
        self._own: Project | None = None  # the shadows that the user added (`add_shadow`)
        self.decided: set[int] = set()  # numbers of conversations
        self.plan = self._plan_of(expected)
        for talk in expected:
            if talk.number in self.plan.parts:
                self._keep_first(talk, self.plan.parts[talk.number])
        self.interval_ns = min(task.interval_ns for task in self.plan.project.tasks)

    def _prepare_plan(
        self, project: Path | None, plc: str | None, dialect: str | None
    ) -> tuple[PlanMaker, list[Conversation]]:
        """Return the plan maker and the expected conversations."""
        plan_of, loaded = plan_maker(project, plc, dialect)
        return plan_of, [] if loaded is None else list_expected_talks(loaded, plc)

    def start_plan(self, talks: Iterable[Conversation]) -> ShadowPlan:
        """Return the plan for the conversations before the first scan."""
        listed = sorted(talks, key=lambda talk: talk.number)
        made = self._plan_of([*self._first, *listed])
        self.plan = self.plan._replace(project=made.project)
        for talk in listed:
            parts = made.parts.get(talk.number)
            if parts is not None:
                if parts not in self._of_first.values():
                    self._keep_first(talk, parts)
                self._known[_make_decision_key(talk, _is_under_way(talk))] = _make_decision(made, talk)
            self.assign(talk)
        return self.plan

    def assign(self, talk: Conversation) -> bool:
        """Give a conversation its ShadowEnds; return whether the shadows must change."""
        number, plan = talk.number, self.plan
        if number in self.decided:
            return False
        is_under_way = _is_under_way(talk)
        key = _make_decision_key(talk, is_under_way)
        known, grows = self._known.get(key), False
        if known is None:
            known, grows = self._decide(talk)
            if len(self._known) == MOST_DECISIONS:
                self._known.clear()
            self._known[key] = known
        says = talk.there if known.is_there else talk.back
        self.plan.guesses[number] = PlcGuess(says, known.confidence, known.guess_why)
        if known.parts is not None:
            self.plan.parts[number] = known.parts
            plan.unassigned.pop(number, None)
        else:
            self.plan.unassigned[number] = known.why
        if known.parts is not None or is_under_way:
            self.decided.add(number)
        return grows

    def _decide(self, talk: Conversation) -> tuple[_Decision, bool]:
        made = self._plan_of([*self._first, talk])
        expects = not talk.tap and any(each.number < 0 for each in self._first)
        if talk.number not in made.parts and expects:
            # An expected conversation may begin at the other end: then the expected one is dropped.
            real = [each for each in self._first if each.number > 0]
            other = self._plan_of([*real, talk])
            if talk.number in other.parts:
                made, self._first = other, real
        decision = _make_decision(made, talk)
        whole = made.project if self._own is None else _join_projects(made.project, self._own)
        if decision.parts is None or whole == self.plan.project:
            return decision, False
        self.plan = self.plan._replace(project=whole)
        self._keep_first(talk, decision.parts)
        return decision, True

    def _keep_first(self, talk: Conversation, parts: tuple[ShadowEnd, ...]) -> None:
        self._first.append(talk)
        self._of_first[talk.number] = parts

    def add_shadow(self, talk: Conversation) -> str:
        """Add shadows for a conversation that has none. Return an error or ""."""
        number, plan = talk.number, self.plan
        plc = address_text(plan.guesses[number].says.address if number in plan.guesses else talk.back.address)
        made = plan_ad_hoc([talk], plc, plan.project.dialect.name)
        parts = made.parts.get(number)
        if parts is None:
            return f"C{number}: {made.unassigned[number]}"
        names = {each.name for each in plan.project.connects} | {c.name for c in plan.project.udp_configs}
        if not names.isdisjoint(part.connect for part in parts):
            return f"{parts[0].connect} is a CONNECT already"
        connects = [replace(c, local=Endpoint(c.local.address, 0)) for c in made.project.connects]
        own = replace(made.project, connects=tuple(connects))  # port 0: another CONNECT has the PLC's port
        self._own = own if self._own is None else _join_projects(self._own, own)
        plan.parts[number], plan.guesses[number] = parts, made.guesses[number]
        plan.unassigned.pop(number, None)
        self.decided.add(number)
        self.plan = plan._replace(project=_join_projects(plan.project, own))
        return ""

    def forget_conversation(self, number: int) -> None:
        self.decided.discard(number)


def _join_projects(project: Project, other: Project) -> Project:
    task = project.tasks[0].name
    return replace(
        project,
        connects=(*project.connects, *other.connects),
        udp_configs=(*project.udp_configs, *other.udp_configs),
        addrs=(*project.addrs, *other.addrs),
        data=(*project.data, *other.data),
        instances=(*project.instances, *[replace(each, task=task) for each in other.instances]),
        sim=replace(
            project.sim, addresses=tuple(dict.fromkeys((*project.sim.addresses, *other.sim.addresses)))
        ),
    )


def _is_under_way(talk: Conversation) -> bool:
    return talk.is_established or begins_late(talk)


def _make_decision(made: ShadowPlan, talk: Conversation) -> _Decision:
    number = talk.number
    guess, why = made.guesses.get(number), made.unassigned.get(number, "")
    if guess is None:
        return _Decision(None, why, True, 0.0, "")
    is_there = guess.says is talk.there
    return _Decision(made.parts.get(number), why, is_there, guess.confidence, guess.why)


def _make_decision_key(talk: Conversation, is_under_way: bool) -> tuple[object, ...]:
    there, back, listener = talk.there, talk.back, talk.listener
    one = there.address[0] if listener is back else there.address
    other = back.address[0] if listener is there else back.address
    return talk.tap, talk.protocol, is_under_way, one, there.mac[:3], other, back.mac[:3], listener is None


def list_expected_talks(project: Project, plc: str | None) -> list[Conversation]:
    """Return the expected conversations of the named PLC ends: an end with a port listens, others call.

    The [[watch]] row or the CONNECT names the called partner; without a name no conversation is expected.
    """
    rows = [(each.plc, each.partner, project.connect(each.connect)) for each in project.watches]
    if plc is not None:
        calling = [config for config in project.connects if config.active and not config.is_datagram]
        rows = [(plc, "", calling[0] if len(calling) == 1 else None)]
    made = []
    for number, (one, other, config) in enumerate(rows, 1):
        end, partner = parse_plc(one), parse_plc(other) if other else None
        if end.port is not None:
            address = partner.address if partner is not None else _ANY_CALLER
            made.append(make_conversation(-number, (address, ANY_PORT), (end.address, end.port)))
            continue
        if partner is None and config is not None and config.remote_address != ANY_ADDRESS:
            partner = _parse_partner(config.remote_address)
        port = partner.port if partner is not None else None
        if port is None and config is not None and isinstance(config.remote_port, int):
            port = config.remote_port
        if partner is not None and port:
            made.append(make_conversation(-number, (end.address, ANY_PORT), (partner.address, port)))
    return made


def _parse_partner(address: str) -> PlcEnd | None:
    try:
        return parse_plc(address)
    except UserError:
        return None


def make_conversation(
    number: int, caller: tuple[bytes, int], listener: tuple[bytes, int], kind: str = "tcp", tap: str = ""
) -> Conversation:
    made = Conversation(number, kind, 0, (caller, listener))
    made.tap = tap
    made.mark_established()
    return made


class TimedAction(NamedTuple):
    """An action between two events."""

    ns: int
    act: Callable[[], object]


class LiveWatch:
    """Plays the conversations of a growing capture. `begin` makes the player from a plan and a time.

    `left` is called with each conversation that has no shadow, and the reason.
    """

    play_delay_ns = PLAY_DELAY_NS

    def __init__(
        self,
        plan: LivePlan,
        begin: Callable[[ShadowPlan, int], CapturePlayer],
        left: Callable[[Conversation, str], object] | None = None,
    ) -> None:
        self.found = Conversations(self._add_event)
        self.player: CapturePlayer | None = None
        self._plan, self._begin, self._left = plan, begin, left
        self._waiting: deque[ConversationEvent | TimedAction] = deque()
        self._seen: dict[int, Conversation] = {}  # before there is a player
        self._newest = self._swept = 0

    def _add_event(self, event: ConversationEvent) -> None:
        talk = event.conversation
        plan = self._plan.plan
        if self.player is None:
            self._seen[talk.number] = talk
        elif talk.number not in self._plan.decided and (
            talk.number not in plan.unassigned or event.kind in _DECIDING_KINDS
        ):
            self._assign(talk)
        self._queue_event(event)

    def _queue_event(self, event: ConversationEvent | TimedAction) -> None:
        waiting = self._waiting
        waiting.append(event)
        if event.ns - self.play_delay_ns > waiting[0].ns or len(waiting) > MOST_WAITING_EVENTS:
            self._play_until(event.ns - self.play_delay_ns)

    def _assign(self, talk: Conversation) -> None:
        if self._plan.assign(talk) and self.player is not None:
            self.player.change_plan(self._plan.plan)
        self._report_unassigned(talk)

    def _report_unassigned(self, talk: Conversation) -> None:
        plan = self._plan.plan
        if self._left is not None and talk.number in self._plan.decided and talk.number not in plan.parts:
            self._left(talk, plan.unassigned[talk.number])

    def _play_until(self, until: int) -> CapturePlayer:
        player = self.player or self._start_player()
        if not player.first_ns:
            player.first_ns = player.lines.first_ns = self.found.first_ns or 0
        waiting = self._waiting
        while waiting and (waiting[0].ns <= until or len(waiting) > MOST_WAITING_EVENTS):
            event = waiting.popleft()
            if isinstance(event, TimedAction):
                self._advance_to(player, event.ns)
                event.act()
                continue
            if player.overlaps and event.conversation.number in player.overlaps:
                self._check_overlap(player, event)
            player.play_event(event)
        return player

    def _start_player(self) -> CapturePlayer:
        first_ns = self._swept = self.found.first_ns or 0
        plan = self._plan.start_plan(self._seen.values())
        self.player = self._begin(plan, first_ns)
        for talk in self._seen.values():
            self._report_unassigned(talk)
        for kept in (plan.parts, plan.unassigned, plan.guesses):
            for number in [number for number in kept if number not in self._seen]:  # that were expected
                del kept[number]
        self._seen.clear()
        return self.player

    def _advance_to(self, player: CapturePlayer, ns: int) -> None:
        """Advance to a UTC time; do nothing before the first packet."""
        if player.first_ns:
            player.shadows.advance_to(max(ns - player.first_ns, 0))
            if player.talks is not None:
                player.talks.now_ns = max(ns, player.talks.now_ns)

    def _check_overlap(self, player: CapturePlayer, event: ConversationEvent) -> None:
        number = event.conversation.number
        if event.conversation.tap:
            return  # a tap reports the end of the other conversation
        holder = next((t for t in self.found.all if t.number == player.overlaps[number]), None)
        last_ns = 0 if holder is None else holder.last_ns
        if event.ns - last_ns > SILENCE_NS:
            player.resolve_overlap(number, last_ns)

    def add_shadow(self, name: str) -> str:
        """Add shadows for `C7`; "" names the newest conversation that has none. Return an error or ""."""
        plan, player = self._plan.plan, self.player
        left = [talk for talk in self.found.all if talk.number in plan.unassigned]
        chosen = [talk for talk in left if name in ("", f"C{talk.number}")]
        if player is None or not chosen:
            some = ", ".join(f"C{talk.number}" for talk in left[-8:])
            return f"found '{name}', expected a conversation without a shadow: {some or 'there is none'}"
        wrong = self._plan.add_shadow(chosen[-1])
        if not wrong:
            player.overlaps.pop(chosen[-1].number, None)
            player.change_plan(self._plan.plan)
        return wrong

    def advance_to_packet(self, ns: int) -> None:
        """Advance to the time of the newest packet read."""
        self._newest = ns = max(self._newest, ns)
        if self.player is None and not (self._waiting and self._waiting[0].ns < ns - self.play_delay_ns):
            return
        player = self._play_until(ns - self.play_delay_ns)
        self._advance_to(player, ns - self.play_delay_ns)
        if ns - self._swept > SWEEP_INTERVAL_NS:
            self._swept = ns
            for number in self.found.forget_silent(ns):
                self._plan.forget_conversation(number)
                player.forget_conversation(number)

    def handle_idle(self, idle_ns: int) -> None:
        """Advance time after `idle_ns` without a packet (Rule 2)."""
        if idle_ns < IDLE_HOLD_NS or (self.player is None and not self._waiting):
            return
        player = self._play_until(self._newest)
        shown = SCANS_AFTER_LAST * self._plan.interval_ns
        passed_ns = max(min(idle_ns - IDLE_HOLD_NS, shown), idle_ns - LULL_NS)
        self._advance_to(player, self._newest + passed_ns)

    def finish(self) -> CapturePlayer:
        """Play all waiting events, and let the shadows settle."""
        self.found.close()
        last_ns = max((talk.last_ns for talk in self.found.all), default=0)
        player = self._play_until(max(last_ns, self._newest, *(event.ns for event in self._waiting), 0))
        for talk in self.found.all:
            if talk.number not in self._plan.decided:
                self._assign(talk)
        self._advance_to(player, last_ns)
        player.shadows.settle()
        return player


class PacketBuffer:
    """The newest packets of a stream, MOST_KEPT_BYTES at most, as a file for the doctor."""

    def __init__(self) -> None:
        self._packets: deque[Packet] = deque()
        self.interfaces: Callable[[], Sequence[tuple[int, str]]] = tuple  # link type and name of each
        self._size = 0
        self._opened = ExitStack()

    def keep_passing(self, reader: CaptureReader) -> Iterator[Packet]:
        self.interfaces = lambda: [(each.link_type, each.name) for each in reader.interfaces]
        for packet in reader:
            self.add_packet(packet)
            yield packet

    def add_packet(self, packet: Packet) -> None:
        self._packets.append(packet)
        self._size += len(packet.data)
        while self._size > MOST_KEPT_BYTES:
            self._size -= len(self._packets.popleft().data)

    def write_file(self) -> list[str]:
        """Write the packets into a file in memory. Return a name by which other processes can open it."""
        self._opened.close()
        handle, name = self._opened.enter_context(open_private_file())
        with open(handle, "wb", closefd=False) as file:
            file.write(section_block(""))
            file.writelines(interface_block(*each) for each in self.interfaces())
            file.writelines(
                packet_block(one.interface, one.ns, one.data, (), one.length) for one in self._packets
            )
        return [name.replace("self", str(os.getpid()), 1) if name.startswith("/proc") else name]


class PacketStream:
    """The packets of a pipe, for `live`. `say` gets lines for the user.

    `came` is called after each play, at least every 50 ms. `kept` stores the newest packets.
    Raise UserError after `most_idle_ns` without a byte; 0 means no limit.
    """

    def __init__(
        self,
        fd: int,
        live: LiveWatch,
        say: Callable[[str], object],
        came: Callable[[], object] = int,
        kept: PacketBuffer | None = None,
        most_idle_ns: int = 0,
        whole: Callable[[bytes], bytes | None] = bytes,
    ) -> None:
        self._kept, self._most_idle_ns = kept, most_idle_ns
        self.pipe = PacketPipe(fd, self._handle_wait, whole)
        self._live, self._say, self._came = live, say, came
        self._reader: CaptureReader | None = None
        self._busy_from = self._from_ns = 0  # when the pipe was last empty, and the newest packet then
        self._is_late = False
        self._failed: Exception | None = None

    def _handle_wait(self, idle_ns: int) -> None:
        if 0 < self._most_idle_ns < idle_ns:
            raise mistake("the tap", f"nothing for {idle_ns // 10**9} s", "a sign of life each 50 ms")
        self._run_action(lambda: self._live.handle_idle(idle_ns))

    def _read(self, most: int) -> bytes:
        reader = self._reader
        if reader is not None:
            self._run_action(lambda: self._live.advance_to_packet(reader.last_ns))
            self._check_late(reader.last_ns)
        return self.pipe.read(most) if self._failed is None else b""

    def _run_action(self, act: Callable[[], object]) -> None:
        if self._failed is None:
            try:
                act()
                self._came()
            except (OSError, EOFError, ValueError) as failed:
                self._failed = failed
                self.pipe.stop_when_empty()

    def _check_late(self, newest_ns: int) -> None:
        if self.pipe.empty_at != self._busy_from:
            self._busy_from, self._from_ns, self._is_late = self.pipe.empty_at, newest_ns, False
        late = self.pipe.since_empty_ns - (newest_ns - self._from_ns)
        if late > MOST_LATE_NS and not self._is_late:
            self._is_late = True
            self._say(TOO_FAST_TEXT)

    def play_all(self) -> list[str]:
        """Read all packets; return notes for the user. Raise UserError if the pipe carries no capture."""
        found = self._live.found
        try:
            reader = CaptureReader(self._read, "stdin" if found.noted is None else "the tap")
        except UserError as none:
            if self._failed is None and self.pipe.is_stopping:
                return []
            raise self._failed or none from None
        self._reader, found.names = reader, reader.interface_name
        packets = iter(reader) if self._kept is None else self._kept.keep_passing(reader)
        found.add_packets(packets, reader.link_types)
        if self._failed is not None:
            raise self._failed
        notes = [f"the capture program dropped {reader.drop_count} packets"] if reader.drop_count else []
        troubles = [reader.trouble] if reader.trouble and not self.pipe.is_stopping else []
        if found.is_tapped:  # the tap has reported losses and conversations itself
            return [*map(str, troubles)]
        return [*notes, *capture_notes(found, troubles)]
