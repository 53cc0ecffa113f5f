"""Figures of captured conversations: ends, state, bytes each way, retransmitted and missing bytes."""

from __future__ import annotations

from collections import deque
from typing import Final

from trcvtui.capture.plc_end import address_text
from trcvtui.capture.reassembly import Conversation, ConversationEvent, SegmentKind
from trcvtui.snapshots.conversations import ConversationSnapshot, DirectionSnapshot
from trcvtui.wording import SECOND

MOST_CONVERSATIONS: Final = 512  # with figures; above it ended ones are dropped first
MOST_SHOWN: Final = 64
SHOWN_SECONDS: Final = 30
_END_STATES: Final = {SegmentKind.FIN: "ended", SegmentKind.RST: "reset"}


class _DirectionFigures:
    def __init__(self) -> None:
        self.size = self.segments = self.again = self.missing = 0
        self.second = self.in_second = self.rate = 0
        self.is_closed = False
        self.held: int | None = None
        self.first = b""
        self.held_since = 0
        self.round_trip_ns: int | None = None
        self.window: int | None = None

    def count_bytes(self, second: int, size: int) -> None:
        if second != self.second:
            self.rate = self.in_second if second == self.second + 1 else 0
            self.second, self.in_second = second, 0
        self.in_second += size

    def make_snapshot(self, second: int, now_ns: int) -> DirectionSnapshot:
        rate = max(self.rate, self.in_second) if second <= self.second + 1 else 0
        return DirectionSnapshot(
            self.size, rate, self.segments, self.again, self.missing, self.is_closed, self.held, self.first,
            self.round_trip_ns, self.window, 0 if self.held is None else now_ns - self.held_since,
        )  # fmt: skip


class _Figures:
    """The figures of one conversation. `ways` are the directions to the PLC end and from it."""

    def __init__(self, talk: Conversation) -> None:
        self.talk = talk
        begins = "connecting" if talk.begins_with_syn else "open"
        self.state = begins if talk.protocol == "tcp" else talk.protocol
        self.ways = _DirectionFigures(), _DirectionFigures()
        self.plc = self.partner = ""
        self.syn_ns = 0
        self.handshake_ns: int | None = None
        self.seconds: deque[tuple[int, int]] = deque(maxlen=SHOWN_SECONDS)

    @property
    def is_over(self) -> bool:
        return self.state in ("ended", "reset")

    def count_bytes(self, second: int, size: int) -> None:
        if self.seconds and self.seconds[-1][0] == second:
            self.seconds[-1] = second, self.seconds[-1][1] + size
        else:
            self.seconds.append((second, size))


class ConversationFigures:
    def __init__(self) -> None:
        self._figures: dict[int, _Figures] = {}
        self._newest = 0  # ns
        self.now_ns = 0  # a tap's time, which advances without packets, too

    def add_event(self, event: ConversationEvent, is_from_plc: bool) -> None:
        """Take one event. If `is_from_plc`, the PLC end has sent the packet."""
        figures = self._get_figures(event, is_from_plc)
        way, kind, ns = figures.ways[is_from_plc], event.kind, event.ns
        self._newest = max(self._newest, ns)
        if kind is SegmentKind.BYTES:
            size = len(event.data)
            way.size += size
            way.segments += 1
            way.count_bytes(ns // SECOND, size)
            figures.count_bytes(ns // SECOND, size)
            if figures.state == "connecting":
                figures.state = "open"
        elif kind is SegmentKind.SYN:
            figures.syn_ns, figures.state = ns, "connecting"
        elif kind is SegmentKind.ESTABLISHED:
            figures.state = "open"
            figures.handshake_ns = ns - figures.syn_ns if figures.syn_ns else None
        elif kind in _END_STATES:
            figures.state = _END_STATES[kind]
        elif kind is SegmentKind.RETRANSMISSION:
            way.again += event.size
        elif kind is SegmentKind.MISSING:
            way.missing += event.size
        elif kind in (SegmentKind.ZERO_WINDOW, SegmentKind.WINDOW_OPENS):
            figures.ways[not is_from_plc].is_closed = kind is SegmentKind.ZERO_WINDOW

    def _get_figures(self, event: ConversationEvent, is_from_plc: bool) -> _Figures:
        talk = event.conversation
        figures = self._figures.get(talk.number)
        if figures is None:
            if len(self._figures) == MOST_CONVERSATIONS:
                over = (number for number, each in self._figures.items() if each.is_over)
                del self._figures[next(over, next(iter(self._figures)))]
            figures = self._figures[talk.number] = _Figures(talk)
            says = event.direction if is_from_plc else event.direction.other
            figures.plc, figures.partner = address_text(says.address), address_text(says.other.address)
        return figures

    def set_held(self, number: int, to_plc: bool, held: int | None, first: bytes) -> None:
        """Set how many bytes a tap holds back in a direction; None: it does not hold the direction."""
        figures = self._figures.get(number)
        if figures is not None:
            way = figures.ways[not to_plc]
            way.held_since = self.now_ns if way.held is None else way.held_since
            way.held, way.first = held, first

    def set_figures(self, number: int, to_plc: bool, round_trip_ns: int, window: int, again: int) -> None:
        """Set the tap's TCP figures for the receiving end of a direction."""
        figures = self._figures.get(number)
        if figures is not None:
            way = figures.ways[not to_plc]
            way.round_trip_ns, way.window, way.again, way.is_closed = round_trip_ns, window, again, not window

    def end_conversation(self, number: int) -> None:
        figures = self._figures.get(number)
        if figures is not None and not figures.is_over:
            figures.state = "ended"
        self.clear_held(number)

    def clear_held(self, number: int) -> None:
        self.set_held(number, True, None, b"")
        self.set_held(number, False, None, b"")

    def make_snapshots(self) -> tuple[ConversationSnapshot, ...]:
        """Return the open conversations, the newest first, then the ended ones."""
        listed = sorted(self._figures.values(), key=lambda each: (each.is_over, -each.talk.number))
        return tuple([self._make_snapshot(each) for each in listed[:MOST_SHOWN]])

    def _make_snapshot(self, each: _Figures) -> ConversationSnapshot:
        second = self._newest // SECOND
        sizes = dict(each.seconds)
        seconds = tuple([sizes.get(second - ago, 0) for ago in range(SHOWN_SECONDS - 1, -1, -1)])
        to_plc, from_plc = (way.make_snapshot(second, self.now_ns) for way in each.ways)
        return ConversationSnapshot(
            each.talk.number, each.talk.tap, each.plc, each.partner, each.state, to_plc, from_plc, seconds,
            each.handshake_ns,
        )  # fmt: skip
