"""A tap for shadows: the packets of its conversations, notes of what it does, and orders for it.

Its pcapng is played as any capture that grows. The notes say which conversations there are, and which tap has
each; what they say of one is played in its place between the events.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from ipaddress import ip_address
from pathlib import Path
from typing import Final

from msgspec import MsgspecError
from msgspec.json import decode
from msgspec.structs import replace

from trcvtui.capture.plc_end import PlcEnd, parse_plc
from trcvtui.capture.reassembly import RECEIVED_END, SENT_END, Conversation, TwoEnds
from trcvtui.commands import words
from trcvtui.commands.table import parse_line
from trcvtui.errors import UserError, mistake, one_line
from trcvtui.line.capture_player import CapturePlayer, PlanMaker, planned
from trcvtui.line.conversations import ConversationFigures
from trcvtui.line.live import Decision, LivePlan, LiveWatch, Remark, decision_of
from trcvtui.line.shadows import ShadowPlan
from trcvtui.line.tapped import TapNote
from trcvtui.net.tap import BACK, TO, Route, TapOrder, TapPlace, end_text, route_of
from trcvtui.project.project import TapDecl

_ANY_PORT: Final = 49_152
_MAPPED: Final = bytes(10) + b"\xff\xff"  # before an IPv4 address in a packet whose other end has IPv6


class TapPlan(LivePlan):
    """Which CONNECT gets the conversations of each tap; `plc` names the PLC end where it is not at `to`."""

    def __init__(
        self, places: Sequence[Sequence[str]], project: Path | None, plc: str | None, dialect: str | None
    ) -> None:
        self.routes = [route_of(name, listen, to, ("LISTEN", "CONNECT")) for name, listen, to in places]
        self._near = given = None if plc is None else parse_plc(plc)
        self.calls = [given is not None and not _is_at(route.to, given) for route in self.routes]
        if given is not None and given.port is not None and any(self.calls):
            raise mistake("--plc", f"'{plc}'", "the end at CONNECT, or without a port who comes to LISTEN")
        super().__init__(project, plc, dialect)

    def _expect(
        self, project: Path | None, plc: str | None, dialect: str | None
    ) -> tuple[PlanMaker, list[Conversation]]:
        routes, to = self.routes, self.routes[0].to
        end = plc or (end_text(to.address, to.port) if to.kind != "serial" else None)
        own = [] if plc else [route.name for route in routes]
        plan_of, loaded = planned(project, end, dialect, taps=own)
        known = {} if loaded is None else {tap.name: tap for tap in loaded.taps}
        others = [TapDecl(r.name, str(r.listen), str(r.to), "") for r in routes if r.name not in known]
        taps, path = (*known.values(), *others), Path(f"tap to {to}") if loaded is None else loaded.path
        near = [self._near.address if self._near and calls else b"" for calls in self.calls]
        first = [
            _expected(number, route, caller, known.get(route.name))
            for number, (route, caller) in enumerate(zip(routes, near, strict=True), 1)
        ]
        made = plan_of(first)
        self._of_tap = {
            route.name: decision_of(made, talk)._replace(
                is_there=calls, confidence=1.0, guess_why="the end of the tap"
            )
            for route, talk, calls in zip(routes, first, self.calls, strict=True)
        }

        def named(found: Sequence[Conversation]) -> ShadowPlan:
            plan = plan_of(found)
            return plan._replace(project=replace(plan.project, taps=taps, path=path))

        return named, first

    def _decide(self, talk: Conversation) -> tuple[Decision, bool]:
        made, near = self._of_tap[talk.tap], self._near
        if made.is_there and near is not None and talk.there.address[0] != near.address:
            made = made._replace(parts=None, why="it is not of this PLC")
        return made, False


def _is_at(place: TapPlace, end: PlcEnd) -> bool:
    if place.kind == "serial":
        return True
    return ip_address(place.address).packed == end.address and end.port in (None, place.port)


def _expected(number: int, route: Route, near: bytes, tap: TapDecl | None) -> Conversation:
    kind, to = route.to.kind, route.to
    if kind == "serial":
        ends = _line_ends(route.name if tap is None else tap.connect)
    else:
        far = ip_address(to.address).packed
        ends = (near or bytes(len(far) - 1) + b"\1", _ANY_PORT), (far, to.port)
    made = Conversation(number, kind, 0, ends)
    made.tap = route.name
    made.build()
    return made


def _line_ends(name: str) -> TwoEnds:
    return (name.encode(), RECEIVED_END), (name.encode(), SENT_END)


class TapWatch(LiveWatch):
    """Plays what a tap tells.

    `tell` gets what is said of no conversation: when, the note, its words. `order` hands the tap an order.
    A plan that is none of a tap becomes one with the first note, which names the taps.
    """

    look_ns = 0  # no PLC end comes that the plan does not have

    def __init__(
        self,
        plan: LivePlan,
        begin: Callable[[ShadowPlan, int], CapturePlayer],
        tell: Callable[[int, TapNote, str], object],
        left: Callable[[Conversation, str], object] | None = None,
        order: Callable[[TapOrder], object] | None = None,
    ) -> None:
        super().__init__(plan, begin, left)
        self.found.noted = self._hear
        self._tell, self._order = tell, order
        self._routes = plan.routes if isinstance(plan, TapPlan) else []
        self._talks: dict[int, Conversation] = {}  # that go on
        self._typed = b""

    def _hear(self, ns: int, data: bytes) -> None:
        """Take a note; leave out what is none."""
        with suppress(MsgspecError, UserError, ValueError, LookupError, OverflowError, RecursionError):
            note = decode(data, type=TapNote)
            if note.note == "taps":
                self._take_taps(note)
                return
            name, first = self._routes[note.tap].name, bytes.fromhex(note.first)
            if note.note == "open":
                self._open(ns, note, name)
            elif note.note == "end" and (talk := self._talks.pop(note.conversation, None)) is not None:
                talk.end, talk.last_ns = talk.end or ("fin", talk.there), max(ns, talk.last_ns)
            self._put(Remark(ns, partial(self._take_note, ns, note, name, first)))

    def _take_taps(self, note: TapNote) -> None:
        if not isinstance(self._plan, TapPlan):
            plan = TapPlan(note.taps, self._plan.path, note.plc, note.dialect)
            self._plan, self._routes = plan, plan.routes
        self.found.is_tapped = True
        if self.player is None:
            self._started()

    def _started(self) -> CapturePlayer:
        player = super()._started()
        player.talks = player.talks or ConversationFigures()
        player.shadows.bench.on_tap = self._intervene if self._order is not None else None
        return player

    def finish(self) -> CapturePlayer:
        player = super().finish()
        if player.talks is not None:
            player.talks.end_all()
        return player

    def _open(self, ns: int, note: TapNote, name: str) -> None:
        if note.conversation in self._talks:
            return
        (near, near_port), (far, far_port) = note.ends
        if note.kind == "serial":
            ends, wire = _line_ends(name), _line_ends(f"{near} - {far}")
        else:
            one, other = ip_address(near).packed, ip_address(far).packed
            ends, size = ((one, near_port), (other, far_port)), max(len(one), len(other))
            wire = ((_MAPPED + one)[-size:], near_port), ((_MAPPED + other)[-size:], far_port)
        talk = Conversation(note.conversation, note.kind, ns, ends)
        talk.tap = name
        if self.found.open(ns, talk, wire, note.new):
            self._talks[talk.number] = talk

    def _take_note(self, ns: int, note: TapNote, name: str, first: bytes) -> None:
        player, number = self._play(0), note.conversation
        talks, guess = player.talks, self._plan.plan.guesses.get(number)
        if note.note in ("refused", "lack"):
            self._tell(ns, note, one_line(f"{name}: {note.text}"))
        elif note.note == "lost":
            size = f"{note.events} events with {note.bytes} bytes"
            self._tell(ns, note, f"{size} came faster than they were shown")
        if guess is None or talks is None:
            return
        to_plc = note.to_connect is (guess.says is guess.says.conversation.back)
        match note.note:
            case "ours":
                act = f"{'to-plc' if to_plc else 'from-plc'} {one_line(note.text)}"
                player.shadows.bench.note(name, "tap", act)
                player.lines.note(max(ns - player.first_ns, 0), number, f"ours: {act}")
            case "held":
                talks.hold(number, to_plc, note.bytes if note.holds else None, first)
            case "figures":
                talks.measure(number, to_plc, note.round_trip_us * 1000, note.window, note.again)
            case "end":
                talks.end(number)

    # -- what the user says --------------------------------------------------------------------------------

    def type(self, data: bytes) -> list[str]:
        """Take what was typed, lines of a bench; return what is wrong in them."""
        assert self.player is not None  # it stands since the first note
        bench, wrong = self.player.shadows.bench, list[str]()
        *lines, self._typed = (self._typed + data).split(b"\n")
        for line in lines:
            try:
                command = parse_line(line.decode(errors="replace").strip(), bench.project, "stdin")
                wrong += [] if command is None else filter(None, [bench.do(command)])
            except UserError as mistakes:
                wrong += mistakes.lines()
            self.player.shadows.wake()
        return wrong

    def _intervene(self, command: words.Intervene) -> str:
        names = [route.name for route in self._routes]
        if command.tap not in names or self._order is None:
            return f"tap {command.tap} does not run"
        route = names.index(command.tap)
        is_there = isinstance(self._plan, TapPlan) and self._plan.calls[route]
        way = BACK if command.to_plc == is_there else TO
        self._order(TapOrder(route, command.conversation, way, command.verb, command.sizes, command.payload))
        return ""
