"""Curves of braille and blocks: no peak is lost, whatever the numbers are."""

from __future__ import annotations

import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.tui.view_model.member_numbers import Number
from trcvtui.tui.widgets.curves import BRAILLE_DOTS, Curve, Numbers, curve, place_between, sparkline

HUGE = 1.7976931348623157e308
NUMBERS = st.one_of(st.integers(-(2**63), 2**64), st.floats(), st.sampled_from([HUGE, -HUGE]), st.booleans())
MESSAGES = st.lists(st.tuples(st.integers(0, 1000), st.none() | NUMBERS), min_size=1, max_size=60)


def dots(drawn: Curve) -> set[tuple[int, int]]:
    """Return column and row, from the bottom up, of each dot."""
    top = 4 * len(drawn.cells) - 1
    return {
        (2 * x + side, top - 4 * y - dot)
        for y, line in enumerate(drawn.cells)
        for x, cell in enumerate(line)
        for side, bits in enumerate(BRAILLE_DOTS)
        for dot, bit in enumerate(bits)
        if cell & bit
    }


def columns(times: list[int], numbers: Numbers, width: int, gaps: list[tuple[int, int]]) -> str:
    """Return a sign for each column of dots of a curve from 0 to `width` * 2: its height, `.` for none."""
    drawn = curve(times, numbers, (0, 2 * width), width, 1, gaps)
    assert drawn is not None
    rows = dots(drawn)
    found = ["".join(str(y) for y in range(4) if (x, y) in rows) for x in range(2 * width)]
    return " ".join(each or "." for each in found)


@given(MESSAGES, st.integers(1, 1000), st.integers(1, 30), st.integers(1, 9))
def test_each_number_of_the_window_is_drawn_in_its_column_and_height(
    messages: list[tuple[int, Number | None]], until: int, width: int, height: int
) -> None:
    messages.sort(key=lambda message: message[0])
    times, numbers = [t for t, _ in messages], [number for _, number in messages]
    shown = [(t, n) for t, n in messages if t <= until and n is not None and math.isfinite(n)]
    drawn = curve(times, numbers, (0, until), width, height, [(3, 900)])
    if drawn is None:
        assert not shown
        return
    assert (drawn.least, drawn.most) == (min(n for _, n in shown), max(n for _, n in shown))
    rows, top = dots(drawn), 4 * height - 1
    assert all(0 <= y <= top for _, y in rows)
    for t, number in shown:
        ends = [until * column // (2 * width) for column in range(1, 2 * width)]
        column = sum(end <= t for end in ends)
        assert (column, round(place_between(number, *drawn.axis) * top)) in rows


@pytest.mark.parametrize(
    ("numbers", "drawn"),
    [
        ([1, 2, 3, 8], "▁▂▃█"),
        ([5, 5, 5], "▁▁▁"),
        ([False, False], "▁▁"),
        ([7.5], "▁"),
        ([-HUGE, 0.0, HUGE], "▁▅█"),
        ([2**63 - 2, 2**63 - 1], "▁█"),
        ([1, None, math.nan, math.inf, 2], "▁×××█"),
        ([None, math.nan], ""),
        ([], ""),
    ],
)
def test_a_sparkline_has_a_column_for_each_message(numbers: Numbers, drawn: str) -> None:
    assert sparkline(numbers) == drawn


@pytest.mark.parametrize(
    ("times", "numbers", "gaps", "drawn"),
    [
        ([0, 4], [0, 3], [], "0 0 0 0 0123 3 3 3"),
        ([0, 1, 2, 3, 4], [0, 3, 0, 1, 0], [], "0 0123 0123 01 01 0 0 0"),
        ([0, 6], [0, 3], [(2, 6)], "0 0 . . . . 0123 3"),  # the connection was down from 2 to 6
        ([0, 4], [0, 3], [(2, 4), (6, 1000)], "0 0 . . 0123 3 . ."),
        ([0, 2, 4, 6], [0, None, math.nan, 3], [], "0 0 0 0 0 . 3 3"),  # cut: held; NaN: none
        ([2], [5], [], ". . 2 2 2 2 2 2"),
        ([-5, 8], [0, 3], [], "0 0 0 0 0 0 0 0123"),  # what was there before the window; its last ns
    ],
)
def test_a_number_is_held_until_the_next_one_but_not_while_the_connection_is_down(
    times: list[int], numbers: Numbers, gaps: list[tuple[int, int]], drawn: str
) -> None:
    assert columns(times, numbers, 4, gaps) == drawn


def test_ten_thousand_messages_are_drawn_with_their_one_peak() -> None:
    numbers = [0.0] * 10_000
    numbers[5_000] = 1e-3
    began = time.process_time()
    drawn = curve(range(10_000), numbers, (0, 9_999), 180, 40)
    assert drawn is not None and drawn.most == 1e-3 and any(drawn.cells[0])
    assert time.process_time() - began < 1, "it takes some 4 ms"
