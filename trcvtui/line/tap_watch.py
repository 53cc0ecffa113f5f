"""The pcapng of a tap, played to shadows: packets of conversations, and notes. Orders go back to the tap.

This pcapng is played like a growing capture. The notes announce each conversation and its tap. A note on a
conversation is played between the events, at the time of the note.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from trcvtui.line.capture_player import CapturePlayer, PlanMaker, plan_maker
from trcvtui.line.conversations import ConversationFigures
from trcvtui.line.live import ANY_PORT, LivePlan, LiveWatch, TimedAction, make_conversation
from trcvtui.line.shadows import ShadowPlan, make_watch_rows, plan_for_project
from trcvtui.line.tap_capture import TapNote
from trcvtui.net.os.lossy_pipe import MOST_LINE
from trcvtui.net.tap import WAY_BACK, WAY_TO, Route, TapOrder, TapPlace, format_end, make_route
from trcvtui.project.project import TapDecl

_MAPPED_PREFIX: Final = bytes(10) + b"\xff\xff"  # before an IPv4 address in a packet whose other end has IPv6


class TapPlan(LivePlan):
    """Assigns the conversations of a tap to CONNECTs. `plc` is the PLC end, or None for the end at `to`."""

    def __init__(
        self, places: Sequence[Sequence[str]], project: Path | None, plc: str | None, dialect: str | None
    ) -> None:
        self.routes = [make_route(name, listen, to, ("LISTEN", "CONNECT")) for name, listen, to in places]
        super().__init__(project, plc, dialect)

    def _prepare_plan(
        self, project: Path | None, plc: str | None, dialect: str | None
    ) -> tuple[PlanMaker, list[Conversation]]:
        routes, to, given = self.routes, self.routes[0].to, None if plc is None else parse_plc(plc)
        self.calls = [given is not None and not _is_at(route.to, given) for route in routes]
        if given is not None and given.port is not None and any(self.calls):
            raise mistake("--plc", f"'{plc}'", "the end at CONNECT, or LISTEN's caller without a port")
        end = plc or (format_end(to.address, to.port) if to.kind != "serial" else None)
        plan_of, loaded = plan_maker(project, end, dialect)
        known = {} if loaded is None else {tap.name: tap for tap in loaded.taps}
        rows = make_watch_rows([known[route.name] for route in routes if route.name in known and not plc])
        watched = replace(loaded, watches=rows) if loaded is not None and rows else None
        others = [TapDecl(r.name, str(r.listen), str(r.to), "") for r in routes if r.name not in known]
        taps, path = (*known.values(), *others), Path(f"tap to {to}") if loaded is None else loaded.path
        self.lines = {r.name: known[r.name].connect if r.name in known else r.name for r in routes}

        def make_tap_plan(found: Sequence[Conversation]) -> ShadowPlan:
            plan = plan_of(found) if watched is None else plan_for_project(found, watched, None)
            return plan._replace(project=replace(plan.project, taps=taps, path=path))

        near = [given.address if given is not None and calls else b"" for calls in self.calls]
        return make_tap_plan, [
            self._expected_talk(-n, *each) for n, each in enumerate(zip(routes, near, strict=True), 1)
        ]

    def _expected_talk(self, number: int, route: Route, near: bytes) -> Conversation:
        if route.to.kind == "serial":
            return make_conversation(number, *_make_line_ends(self.lines[route.name]), "serial", route.name)
        far = ip_address(route.to.address).packed
        caller = (near or bytes(len(far) - 1) + b"\1", ANY_PORT)
        return make_conversation(number, caller, (far, route.to.port), route.to.kind, route.name)


def _is_at(place: TapPlace, end: PlcEnd) -> bool:
    if place.kind == "serial":
        return True
    return ip_address(place.address).packed == end.address and end.port in (None, place.port)


def _make_line_ends(name: str) -> TwoEnds:
    return (name.encode(), RECEIVED_END), (name.encode(), SENT_END)


class TapWatch(LiveWatch):
    """Plays the packets and notes of a tap.

    `tell` gets time, note and text of each note that concerns no conversation. `order` gets lines for the
    tap. The first note names the taps, and so turns a plan without taps into a TapPlan.
    """

    play_delay_ns = 0  # all PLC ends are in the plan from the beginning

    def __init__(
        self,
        plan: LivePlan,
        begin: Callable[[ShadowPlan, int], CapturePlayer],
        left: Callable[[Conversation, str], object] | None,
        tell: Callable[[int, TapNote, str], object],
        order: Callable[[bytes], object] | None = None,
    ) -> None:
        super().__init__(plan, begin, left)
        self.found.noted = self._handle_note
        self._tell, self._order = tell, order
        self._talks: dict[int, Conversation] = {}  # the open ones
        self._typed = b""

    def _handle_note(self, ns: int, data: bytes) -> None:
        """Handle a note; ignore a broken one."""
        wire = None
        try:
            note = decode(data, type=TapNote)
            if note.note == "taps" and not self._plan.routes:
                self._plan = TapPlan(note.taps, self._plan.path, note.plc, note.dialect)
            first = bytes.fromhex(note.first)
            if note.note == "open" and note.conversation not in self._talks:
                talk, wire = self._make_conversation(ns, note)
            tap = self._plan.routes[note.tap].name
        except (MsgspecError, UserError, ValueError, LookupError, OverflowError, RecursionError):
            return
        self.found.is_tapped = True
        if self.player is None:
            self._start_player()
        if note.note == "taps":  # from a new server process: it missed the end of these
            for number in [each for each in self._talks if each not in note.open]:
                self._end_conversation(ns, replace(note, note="end", conversation=number))
        elif wire is not None and self.found.open_tapped(ns, talk, wire, note.new):
            self._talks[talk.number] = talk
        elif note.note == "end":
            self._end_conversation(ns, note)
        else:
            self._queue_event(TimedAction(ns, partial(self._apply_note, ns, note, tap, first)))

    def _end_conversation(self, ns: int, note: TapNote) -> None:
        talk = self._talks.pop(note.conversation, None)
        if talk is not None:
            talk.end, talk.last_ns = talk.end or ("fin", talk.there), max(ns, talk.last_ns)
        self._queue_event(TimedAction(ns, partial(self._apply_note, ns, note, "", b"")))

    def handle_idle(self, idle_ns: int) -> None:
        """Do nothing: the tap itself sends the time between its packets."""

    def _make_conversation(self, ns: int, note: TapNote) -> tuple[Conversation, TwoEnds]:
        name, ((near, near_port), (far, far_port)) = self._plan.routes[note.tap].name, note.ends
        if note.kind == "serial":
            ends, wire = _make_line_ends(self._plan.lines[name]), _make_line_ends(f"{near} - {far}")
        else:
            one, other = ip_address(near).packed, ip_address(far).packed
            ends, size = ((one, near_port), (other, far_port)), max(len(one), len(other))
            wire = ((_MAPPED_PREFIX + one)[-size:], near_port), ((_MAPPED_PREFIX + other)[-size:], far_port)
        talk = Conversation(note.conversation, note.kind, ns, ends)
        talk.tap, talk.listener = name, talk.back if note.kind == "tcp" else None
        return talk, wire

    def _start_player(self) -> CapturePlayer:
        player = super()._start_player()
        player.talks = player.talks or ConversationFigures()
        player.shadows.bench.on_tap = self._order_tap if self._order is not None else None
        return player

    def _apply_note(self, ns: int, note: TapNote, tap: str, first: bytes) -> None:
        player, number, guess = self.player, note.conversation, self._plan.plan.guesses.get(note.conversation)
        assert player is not None and player.talks is not None  # set by the first note
        to_plc = guess is not None and note.to_connect is (guess.says is guess.says.conversation.back)
        match note.note:
            case "refused" | "lack":
                self._tell(ns, note, one_line(f"{tap}: {note.text}"))
            case "lost":
                lost = f"{note.events} events with {note.bytes} bytes came faster than they were shown"
                self._tell(ns, note, lost)
            case "ours" if guess is not None:
                act = f"{'to-plc' if to_plc else 'from-plc'} {one_line(note.text)}"
                player.shadows.bench.note(tap, "tap", act)
                player.lines.note(max(ns - player.first_ns, 0), number, f"ours: {act}")
            case "open" if not note.new:  # notes of bytes that are still held follow
                player.talks.clear_held(number)
            case "held":
                player.talks.set_held(number, to_plc, note.bytes if note.holds else None, first)
            case "figures":
                figures = note.round_trip_us * 1000, note.window, note.again
                player.talks.set_figures(number, to_plc, *figures)
            case "end":
                player.talks.end_conversation(number)
                player.end_conversation(number, ns)

    # -- lines of the user ---------------------------------------------------------------------------------

    def run_typed_lines(self, data: bytes) -> list[str]:
        """Run typed bench commands, one a line; return their errors."""
        assert self.player is not None  # set by the first note
        bench, wrong = self.player.shadows.bench, list[str]()
        *lines, self._typed = (self._typed + data).split(b"\n")
        if len(self._typed) > MOST_LINE:
            self._typed = b""
            wrong.append(f"stdin: found a line of more than {MOST_LINE} bytes, expected a bench command")
        for line in lines:
            try:
                command = parse_line(line.decode(errors="replace").strip(), bench.project, "stdin")
                wrong += [] if command is None else filter(None, [bench.do(command)])
            except UserError as mistakes:
                wrong += mistakes.lines()
            self.player.shadows.forbid_skipping()
        return wrong

    def _order_tap(self, command: words.TapAct) -> str:
        names = [route.name for route in self._plan.routes]
        if command.tap not in names or self._order is None:
            return f"tap {command.tap} does not run"
        route = names.index(command.tap)
        way = WAY_BACK if command.to_plc == self._plan.calls[route] else WAY_TO
        order = TapOrder(route, command.conversation, way, command.verb, command.sizes, command.payload)
        self._order(order.encode())
        return ""
