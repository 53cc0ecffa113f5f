"""Pane 7 on the line: figures of conversations, and the keys with which a tap intervenes."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.recording.wire import NS, PARTNER, PLC
from tests.tui.fakes import picture
from tests.tui.looking import WIDE, looking
from trcvtui.capture.reassembly import Conversation, ConversationEvent, SegmentKind
from trcvtui.line.conversations import SHOWN_SECONDS, ConversationFigures
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.snapshots.conversations import ARMED_TAP, TAP, ConversationSnapshot
from trcvtui.tui.prompt import PromptInput

SECOND = 1_000_000_000


class TapStory:
    def __init__(self) -> None:
        self.talks = ConversationFigures()
        ends = (bytes([10, 0, 0, 9]), PARTNER[1]), (bytes([10, 0, 0, 5]), PLC[1])
        self.talk = Conversation(1, "tcp", NS, ends)
        self.talk.tap = "T"

    def tell(
        self, kind: SegmentKind, s: float = 0, from_plc: bool = False, data: bytes = b"", size: int = 0
    ) -> None:
        says = self.talk.back if from_plc else self.talk.there
        event = ConversationEvent(NS + int(s * SECOND), self.talk, says, kind, 0, size or len(data), data)
        self.talks.add_event(event, from_plc)

    @property
    def shown(self) -> ConversationSnapshot:
        return self.talks.make_snapshots()[0]


def connected() -> TapStory:
    told = TapStory()
    told.tell(SegmentKind.SYN)
    assert told.shown.state == "connecting"
    told.tell(SegmentKind.ESTABLISHED, 0.002)
    told.tell(SegmentKind.BYTES, 1, data=b"12345")
    told.tell(SegmentKind.BYTES, 1.5, from_plc=True, data=b"ok")
    return told


def test_bytes_are_counted_by_direction_and_by_second() -> None:
    shown = connected().shown
    assert (shown.plc, shown.partner, shown.state) == ("10.0.0.5:2000", "10.0.0.9:51000", "open")
    assert (shown.to_plc.size, shown.from_plc.size, shown.to_plc.segments) == (5, 2, 1)
    assert shown.handshake_ns == 2_000_000
    assert shown.seconds[-1] == 7 and len(shown.seconds) == SHOWN_SECONDS


def test_a_rate_is_that_of_the_newest_second_and_falls_to_none() -> None:
    told = connected()
    assert told.shown.to_plc.rate == 5
    told.tell(SegmentKind.KEEP_ALIVE, 9)
    assert told.shown.to_plc.rate == 0


def test_what_is_not_as_it_should_be_is_counted() -> None:
    told = connected()
    told.tell(SegmentKind.RETRANSMISSION, 2, size=5)
    told.tell(SegmentKind.MISSING, 2, size=7)
    told.tell(SegmentKind.ZERO_WINDOW, 2, from_plc=True)
    assert (told.shown.to_plc.again, told.shown.to_plc.missing, told.shown.to_plc.is_closed) == (5, 7, True)
    told.tell(SegmentKind.WINDOW_OPENS, 3, from_plc=True)
    assert not told.shown.to_plc.is_closed
    told.tell(SegmentKind.RST, 3)
    assert told.shown.state == "reset"


def test_what_the_stack_of_a_tap_says_is_shown_beside_each_direction() -> None:
    told = connected()
    told.talks.set_figures(1, True, 250_000, 64240, 0)
    told.talks.set_figures(1, False, 90_000_000, 0, 12)
    shown = told.shown
    assert (shown.to_plc.round_trip_ns, shown.to_plc.window) == (250_000, 64240)
    assert (shown.from_plc.is_closed, shown.from_plc.again) == (True, 12)
    told.talks.end_conversation(1)
    assert told.shown.state == "ended"


def test_those_that_are_over_go_first_when_there_are_too_many() -> None:
    told = connected()
    for number in range(2, 2000):
        told.talk = Conversation(number, "tcp", NS, ((bytes(4), number), (bytes(4), 1)))
        told.tell(SegmentKind.BYTES, 2, data=b"x")
        told.tell(SegmentKind.FIN, 2)
    listed = told.talks.make_snapshots()
    assert listed[0].number == 1 and len(listed) == 64


def of_a_tap(told: TapStory, kernel: str = TAP) -> BenchUpdate:
    return replace(
        picture(), talks=told.talks.make_snapshots(), shadows=frozenset({"TRCV_C_1"}), kernel=kernel
    )


async def test_a_key_asks_with_its_command_and_enter_sends_it_but_hold_and_go_act() -> None:
    told = connected()
    async with looking(WIDE, of_a_tap(told)) as looker:
        assert "open 10.0.0.9:51000 → 10.0.0.5:2000 round trip 2 ms" in looker.pane("talks")
        await looker.press("7", "h")
        told.talks.set_held(1, True, 3, b"\x01\x02\x03")
        await looker.show(of_a_tap(told))
        assert "3 B held" in looker.pane("talks")
        await looker.press("h")
        acted = ["tap T to-plc hold conversation 1", "tap T to-plc go conversation 1"]
        assert looker.lines == acted
        for key, command in (
            ("e", "tap T to-plc conversation 1 edit 0 hex 01 02 03"),
            ("i", "tap T to-plc conversation 1 insert hex "),
            ("d", "tap T to-plc conversation 1 drop 3"),
            ("y", "tap T to-plc conversation 1 delay T#"),
            ("s", "tap T to-plc conversation 1 split "),
            ("r", "tap T to-plc rst conversation 1"),
            ("f", "tap T to-plc fin conversation 1"),
        ):
            await looker.press(key)
            field = looker.app.focused
            assert isinstance(field, PromptInput) and field.value == command
            await looker.press("escape")
            assert looker.lines == acted, key
        await looker.press("down", "e")
        assert "nothing is held in this direction" in looker.text
        await looker.press("r", "enter")
        assert looker.lines[2:] == ["tap T from-plc rst conversation 1"]


async def test_on_an_armed_tap_rst_and_fin_act_at_once() -> None:
    async with looking(WIDE, of_a_tap(connected(), ARMED_TAP)) as looker:
        await looker.press("7", "r", "f")
        assert looker.lines == ["tap T to-plc rst conversation 1", "tap T to-plc fin conversation 1"]


@pytest.mark.parametrize("size", [(80, 24), WIDE])
async def test_the_header_says_that_it_is_in_the_line_and_since_when_it_holds(size: tuple[int, int]) -> None:
    told = connected()
    told.talks.now_ns = 5 * SECOND
    async with looking(size, of_a_tap(told)) as looker:
        assert "IN THE LINE" in looker.text and "HELD" not in looker.text
        told.talks.set_held(1, False, 0, b"")
        told.talks.now_ns = 7 * SECOND
        told.talks.set_held(1, True, 3, b"\x01\x02\x03")
        told.talks.now_ns = 17 * SECOND
        told.talks.set_held(1, False, 9, b"\x01")
        await looker.press("F")
        await looker.show(of_a_tap(told))
        header = looker.pane("header")
        assert "IN THE LINE" in header and "HELD 12 s" in header and "FROZEN" in header
        told.talks.end_conversation(1)
        await looker.show(of_a_tap(told))
        assert "HELD" not in looker.pane("header")
        looker.app.main.header.ended = True
        await looker.show(of_a_tap(told))
        assert "IN THE LINE" in looker.pane("header"), "bytes still go through it"


async def test_who_only_watches_cannot_intervene() -> None:
    told = connected()
    only_watched = replace(told.shown, tap="")
    async with looking(WIDE) as looker:
        await looker.show(replace(picture(), talks=(only_watched,)))
        await looker.press("7", "h")
        assert not looker.lines
        assert "only a tap can intervene" in looker.text
        await looker.press("w")
        assert looker.lines == ["watch"]
