"""The observer of a tap, a process of its own: shadows on its bytes, and bench commands for it.

Events come over stdin, and go back as orders over the same socket; what shadows show goes to stdout.
A reader that is too slow makes it miss events, and not the tap wait: bytes that are missed are a hole.
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from ipaddress import ip_address
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from trcvtui.capture.plc_end import PlcGuess, parse_plc
from trcvtui.capture.reassembly import (
    RECEIVED_END,
    SENT_END,
    Conversation,
    ConversationEvent,
    SegmentKind,
    TwoEnds,
)
from trcvtui.commands import words
from trcvtui.commands.table import parse_line
from trcvtui.dialects import DIALECTS
from trcvtui.errors import UserError, mistake
from trcvtui.line.capture_player import CaptureOutcome, CapturePlayer, ShadowLines
from trcvtui.line.conversations import ConversationFigures
from trcvtui.line.shadows import plan_ad_hoc, plan_of_project, rows_of_taps
from trcvtui.line.watch_command import WatchLines
from trcvtui.net.tap import (
    BACK,
    FIGURES,
    LOSS,
    TO,
    Route,
    TapEvent,
    TapEventKind,
    TapOrder,
    TapPlace,
    end_text,
    events_of,
    route_of,
)
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.convert_dialect import dialect_named, in_dialect
from trcvtui.project.project import TapDecl
from trcvtui.scenario.scenario import load_bench
from trcvtui.signals import OF_A_GROUP, leave

_ANY_PORT: Final = 49_152
_KINDS: Final = {
    TapEventKind.BYTES: SegmentKind.BYTES,
    TapEventKind.FIN: SegmentKind.FIN,
    TapEventKind.RST: SegmentKind.RST,
}


class TapPlan:
    """Which CONNECT gets the conversations of each tap; `plc` names the PLC end where it is not at `to`."""

    def __init__(
        self, routes: Sequence[Route], project: Path | None, plc: str | None, dialect: str | None
    ) -> None:
        self.routes = routes
        loaded = None if project is None else load_bench(project)
        if loaded is not None and dialect is not None:
            loaded = in_dialect(loaded, dialect_named(dialect)).project
        given = None if plc is None else parse_plc(plc)
        self.calls = [
            given is not None and not _is_at(route.to, given.address, given.port) for route in routes
        ]
        self.near = given
        if given is not None and given.port is not None and any(self.calls):
            raise mistake("--plc", f"'{plc}'", "the end at CONNECT, or without a port who comes to LISTEN")
        named_so = {} if loaded is None else {tap.name: tap for tap in loaded.taps}
        first = [
            _conversation(number, route, given.address if given and calls else None, named_so)
            for number, (route, calls) in enumerate(zip(routes, self.calls, strict=True), 1)
        ]
        to = routes[0].to
        at = plc or (end_text(to.address, to.port) if to.kind != "serial" else None)
        if loaded is None:
            self.plan = plan_ad_hoc(first, at, dialect or next(iter(DIALECTS)))
        else:
            own = named_so if plc is None else {}
            rows = rows_of_taps([own[r.name] for r in routes if r.name in own])
            named = replace(loaded, watches=rows) if rows else loaded
            self.plan = plan_of_project(first, named, None if rows else at)
        taps = loaded.taps if loaded is not None else ()
        known = {tap.name for tap in taps}
        taps += tuple([TapDecl(r.name, str(r.listen), str(r.to), "") for r in routes if r.name not in known])
        path = Path(f"tap to {routes[0].to}") if loaded is None else loaded.path
        self.plan = self.plan._replace(project=replace(self.plan.project, taps=taps, path=path))
        self._parts, self._why_not = dict(self.plan.parts), dict(self.plan.unassigned)

    def begin(self) -> None:
        """Take numbers as those of conversations from now on, no more as those of taps."""
        for kept in (self.plan.parts, self.plan.unassigned, self.plan.guesses):
            kept.clear()

    def assign(self, route: int, conversation: Conversation) -> None:
        number, parts = conversation.number, self._parts.get(route + 1)
        plc = conversation.there if self.calls[route] else conversation.back
        self.plan.guesses[number] = PlcGuess(plc, 1.0, "the end of the tap")
        if parts is None:
            self.plan.unassigned[number] = self._why_not.get(route + 1, "no CONNECT fits it")
        elif self.calls[route] and self.near is not None and plc.address[0] != self.near.address:
            self.plan.unassigned[number] = "it is not of this PLC"
        else:
            self.plan.parts[number] = parts


def asked_plan(
    places: Iterable[Sequence[str]], project: str | None, plc: str | None, dialect: str | None
) -> TapPlan:
    """Return the plan of taps that another process names; raise UserError."""
    routes = [route_of(name, listen, to, ("LISTEN", "CONNECT")) for name, listen, to in places]
    return TapPlan(routes, None if project is None else Path(project), plc, dialect)


def _is_at(place: TapPlace, address: bytes, port: int | None) -> bool:
    if place.kind == "serial":
        return True
    return ip_address(place.address).packed == address and port in (None, place.port)


def _conversation(number: int, route: Route, near: bytes | None, taps: Mapping[str, TapDecl]) -> Conversation:
    kind, to = route.to.kind, route.to
    if kind == "serial":
        line = taps[route.name].connect if route.name in taps else route.name
        ends = _line_ends(line)
    else:
        far = ip_address(to.address).packed
        ends = (near or bytes(len(far) - 1) + b"\1", _ANY_PORT), (far, to.port)
    made = Conversation(number, kind, 0, ends)
    made.build()
    return made


def _line_ends(name: str) -> TwoEnds:
    return (name.encode(), RECEIVED_END), (name.encode(), SENT_END)


class TapObserver:
    """Plays the events of a tap to shadows as they come; `order` hands the tap an order.

    Without `lines_of` there are orders alone: the tap sends no bytes, and nothing is played. It is called
    with the time of the first event, in ns from 1970.
    """

    def __init__(
        self,
        plan: TapPlan,
        lines_of: Callable[[int], ShadowLines] | None,
        order: Callable[[TapOrder], object],
        complain: Callable[[str], object],
    ) -> None:
        self._plan, self._is_shown = plan, lines_of is not None
        self._lines_of = lines_of or (lambda ns: WatchLines(len, None, 1, ns))
        self._order, self._complain = order, complain
        self._lines = self._lines_of(0)
        self.player = self._player = CapturePlayer(plan.plan, (), 0, self)
        self._talks = self._player.talks = ConversationFigures()
        plan.begin()
        self._player.shadows.bench.on_tap = self._intervene
        self._first_ns: int | None = None
        self._now = 0
        self._running: dict[int, Conversation] = {}
        self._taps: dict[int, str] = {}  # by the number of a conversation: through which it goes
        self._typed = b""

    # -- what shadows show: written with the time of the first packet ------------------------------------

    def scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        self._lines.scan(scan, changed, lacking)

    def note(self, ns: int, number: int, text: str) -> None:
        self._lines.note(ns, number, text)

    # -- what the tap tells --------------------------------------------------------------------------------

    def take(self, event: TapEvent) -> None:
        match event.kind:
            case TapEventKind.LINE:
                self._type(event.data)
                return
            case TapEventKind.REFUSED:
                self._complain(f"{self._plan.routes[event.route].name}: {event.data.decode()}")
                return
            case TapEventKind.LACK:
                name, text = self._plan.routes[event.route].name, event.data.decode()
                if isinstance(self._lines, WatchLines):
                    self._lines.tell_tap(event.ns, {"tap": name, "waiting": event.at, "note": text})
                else:
                    self._complain(f"{name}: {text}")
                return
            case TapEventKind.NOW if self._first_ns is None:
                return
            case TapEventKind.OPEN:
                if event.number not in self._running:
                    self._open(event)
                return
        self._now = max(event.ns - (self._first_ns or event.ns), self._now)
        self._talks.now_ns = self._now
        if event.kind == TapEventKind.NOW:
            self._player.shadows.go_to(self._now)
        elif event.kind == TapEventKind.LOST:
            self._lost(event)
        elif (talk := self._running.get(event.number)) is not None:
            self._of(event, talk)

    def _of(self, event: TapEvent, talk: Conversation) -> None:
        says = talk.there if event.way == TO else talk.back
        to_plc = says is not self._plan.plan.guesses[talk.number].says
        if event.kind == TapEventKind.OURS:
            act = f"{'to-plc' if to_plc else 'from-plc'} {event.data.decode()}"
            self._player.shadows.bench.note(self._plan.routes[event.route].name, "tap", act)
            self.note(self._now, talk.number, f"ours: {act}")
        elif event.kind == TapEventKind.STANDS:
            for kind, who in ((SegmentKind.ANSWER, talk.back), (SegmentKind.ESTABLISHED, talk.there)):
                self._play(ConversationEvent(event.ns, talk, who, kind, 0, 0, b""))
        elif event.kind == TapEventKind.HELD:
            self._talks.hold(talk.number, to_plc, event.at if event.data else None, event.data[1:])
        elif event.kind == TapEventKind.FIGURES:
            round_trip, window, again = FIGURES.unpack(event.data)
            self._talks.measure(talk.number, to_plc, round_trip * 1000, window, again)
        elif event.kind == TapEventKind.OVER:
            self._talks.end(talk.number)
            self._forget(talk.number)
        else:
            kind = _KINDS[TapEventKind(event.kind)]
            if says.position < 0:
                says.position = event.at
            if event.at > says.position and kind is not SegmentKind.RST:
                gap = event.at - says.position
                self._play(
                    ConversationEvent(event.ns, talk, says, SegmentKind.MISSING, says.position, gap, b"")
                )
                says.position = event.at
            data = event.data
            self._play(ConversationEvent(event.ns, talk, says, kind, event.at, len(data), data))
            says.position += len(data)

    def _open(self, event: TapEvent) -> None:
        kind, near, near_port, far, far_port = event.data.decode().split("|")
        if kind == "serial":
            ends = _line_ends(self._plan.routes[event.route].name)
        else:
            packed = [ip_address(address.partition("%")[0]).packed for address in (near, far)]
            ends = (packed[0], int(near_port)), (packed[1], int(far_port))
        talk = Conversation(event.number, kind, event.ns, ends)
        talk.build()
        if event.at:  # it stood before
            talk.begins_with_syn = talk.is_established = False
            talk.there.position = talk.back.position = -1
        if self._first_ns is None:
            self._first_ns = event.ns
            self._lines = self._lines_of(event.ns)
            self._player.first_ns = event.ns
        self._running[event.number] = talk
        self._taps[event.number] = self._plan.routes[event.route].name
        self._plan.assign(event.route, talk)
        first = SegmentKind.KEEP_ALIVE if event.at else SegmentKind.SYN  # the former: nothing new is said
        self._play(ConversationEvent(event.ns, talk, talk.there, first, 0, 0, b""))

    def _play(self, event: ConversationEvent) -> None:
        if self._is_shown:
            self._player.tap = self._taps.get(event.conversation.number, "")
            self._player.take(event)

    def _lost(self, event: TapEvent) -> None:
        count, size = LOSS.unpack_from(event.data)
        alive = {number for (number,) in struct.iter_unpack("<I", event.data[LOSS.size :])}
        self._complain(f"{count} events with {size} bytes came faster than they were shown")
        for number in [each for each in self._running if each not in alive]:
            self._forget(number)

    def _forget(self, number: int) -> None:
        self._running.pop(number, None)
        self._taps.pop(number, None)
        self._player.forget(number)

    # -- what the user says --------------------------------------------------------------------------------

    def _type(self, data: bytes) -> None:
        *lines, self._typed = (self._typed + data).split(b"\n")
        for line in lines:
            bench = self._player.shadows.bench
            try:
                command = parse_line(line.decode(errors="replace").strip(), bench.project, "stdin")
                wrong = "" if command is None else bench.do(command)
            except UserError as mistakes:
                wrong = "\n".join(mistakes.lines())
            if wrong:
                self._complain(wrong)
            self._player.shadows.wake()

    def _intervene(self, command: words.Intervene) -> str:
        names = [route.name for route in self._plan.routes]
        if command.tap not in names:
            return f"tap {command.tap} does not run"
        route = names.index(command.tap)
        way = BACK if command.to_plc == self._plan.calls[route] else TO
        self._order(TapOrder(route, command.conversation, way, command.verb, command.sizes, command.payload))
        return ""

    def end_all(self) -> None:
        self._talks.end_all()

    def close(self) -> CaptureOutcome:
        """Let the shadows settle; return what became of the conversations."""
        self._player.shadows.settle()
        played = self._player.close()
        if isinstance(self._lines, WatchLines):
            self._lines.end(played)
        return played


# -- the process -------------------------------------------------------------------------------------------


def look_on(asked: str) -> None:
    """Say an empty line when all is well; then play what comes over stdin until its end."""
    leave(OF_A_GROUP)  # they end the tap, and its end ends us
    places, project, plc, dialect, form, is_shown = json.loads(asked)

    def complain(text: str) -> None:
        sys.stderr.write("".join(f"{line}\n" for line in text.split("\n")))
        sys.stderr.flush()

    try:
        plan = asked_plan(places, project, plc, dialect)
    except UserError as wrong:
        complain("\n".join(wrong.lines()))
        sys.exit(2)
    interval = min(task.interval_ns for task in plan.plan.project.tasks)

    def lines_of(first_ns: int) -> WatchLines:
        return WatchLines(sys.stdout.write, form, interval, first_ns)

    looking = TapObserver(
        plan, lines_of if is_shown else None, lambda order: os.write(0, order.line()), complain
    )
    os.write(0, b"\n")
    try:
        for events in events_of(lambda most: os.read(0, most)):
            for event in events:
                looking.take(event)
            sys.stdout.flush()
        looking.close()
        sys.stdout.flush()
    except OSError:  # the reader of what shadows show is gone, or its terminal
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
