"""The numbers of a member: decoded once, and the same as if all of them were decoded now."""

from __future__ import annotations

import math
import random
import struct

from tests.tui.fakes import bench_project
from trcvtui.history.messages import HOLE_REASON, MessageRow, MessagesDelta
from trcvtui.history.records import MAX_SCAN
from trcvtui.tui.view_model.known_messages import KnownMessages
from trcvtui.tui.view_model.member_numbers import MemberNumbers, number_in

LAYOUT = next(each.layout for each in bench_project().data if each.name == "rx")
SPEED = LAYOUT.leaf(LAYOUT.leaf_number("speed"))


def message(number: int, speed: float, reason: str = "", have: int = 24, size: int = 24) -> MessageRow:
    content = (bytes(8) + struct.pack("<f", speed) + bytes(12))[: min(have, size)]
    return MessageRow(number, number, number * 1000, 1000, size, 0, "C1", 0, reason, have, content)


def test_a_message_brings_a_number_or_leaves_what_was_there_or_brings_what_is_not_known() -> None:
    assert number_in(LAYOUT, SPEED, message(1, 2.5)) == 2.5
    assert number_in(LAYOUT, SPEED, message(1, 2.5, "FIN", 20, 20)) is None, "cut: DATA keeps what it had"
    assert number_in(LAYOUT, SPEED, message(1, 2.5, size=11)) is None, "too short for it"
    assert number_in(LAYOUT, SPEED, message(1, 2.5, HOLE_REASON, 12)) == 2.5, "it stands before the hole"
    for row in (
        message(1, 2.5, HOLE_REASON, 11),
        message(1, 2.5)._replace(content=None),
        message(1, math.nan),
    ):
        number = number_in(LAYOUT, SPEED, row)
        assert number is not None and math.isnan(number)


def test_numbers_that_are_followed_are_those_of_all_messages_that_are_known() -> None:
    seed = random.Random(1)
    known, kept, last = KnownMessages(), MemberNumbers(LAYOUT, SPEED), MemberNumbers(LAYOUT, SPEED, 60)
    known.make_request("X")
    count, gone = 0, set[bool]()
    for _ in range(200):
        first = count + 3000 * (seed.random() < 0.02)  # some came too fast to cross
        rows = tuple(message(first + n + 1, seed.random()) for n in range(seed.randrange(120)))
        count = first + len(rows)
        known.accept_rows(MessagesDelta("X", first, count, rows, max(0, count - 500)), MAX_SCAN)
        stop = seed.choice([known.next_number, max(known.first, known.next_number - 30)])
        whole = MemberNumbers(LAYOUT, SPEED).update_numbers(known, stop)
        assert [*map(repr, kept.update_numbers(known, stop))] == [*map(repr, whole)]
        assert [*map(repr, last.update_numbers(known, stop))] == [*map(repr, whole[-60:])]
        gone.add(known.first_full > known.first)
    assert known.first > 0 and gone == {True, False}
