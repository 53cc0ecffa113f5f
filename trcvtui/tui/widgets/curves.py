"""Draws numbers over time in cells of text: a line of blocks or a curve of braille. No peak is lost.

A message without the member has the number None, and the curve stays at the number before. At NaN or an
infinity, the curve stops until the next number.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from operator import itemgetter
from typing import Final, NamedTuple

from trcvtui.tui.view_model.member_numbers import Number

Numbers = Sequence[Number | None]
Spans = Sequence[tuple[int, int]]  # from, to: ns

SPAN_BEGIN: Final = itemgetter(0)
SPARK_BLOCKS: Final = "▁▂▃▄▅▆▇█"
NO_NUMBER_SIGN: Final = "×"
FIRST_BRAILLE: Final = 0x2800
# The dots of a braille cell by its column, from the top: their bits in the code of the character.
BRAILLE_DOTS: Final = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))


def list_finite(numbers: Iterable[Number | None]) -> list[Number]:
    return [number for number in numbers if number is not None and math.isfinite(number)]


def axis_ends(numbers: Sequence[Number]) -> tuple[Number, Number]:
    """Return the ends of the axis; for BOOL always 0 and 1."""
    if all(isinstance(number, bool) for number in numbers):
        return 0, 1
    return min(numbers), max(numbers)


def place_between(number: Number, low: Number, high: Number) -> float:
    """Return where a number is, from 0 at `low` to 1 at `high`. Return 0.5 if `low` equals `high`."""
    if math.isinf(high - low):  # too far apart, such as -1e308 and 1e308
        return place_between(number / 2, low / 2, high / 2)
    return (number - low) / (high - low) if high > low else 0.5


def sparkline(numbers: Numbers) -> str:
    """Return a block for each message. If all numbers are equal and not BOOL, each is the lowest block."""
    known = list_finite(numbers)
    if not known:
        return ""
    low, high = axis_ends(known)
    top = len(SPARK_BLOCKS) - 1 if low != high else 0
    return "".join(
        NO_NUMBER_SIGN
        if each is None or not math.isfinite(each)
        else SPARK_BLOCKS[round(place_between(each, low, high) * top)]
        for each in numbers
    )


class Curve(NamedTuple):
    """A curve as rows of cells, the top row first. Each bit of a cell is one braille dot."""

    cells: list[list[int]]
    axis: tuple[Number, Number]
    least: Number
    most: Number


def curve(
    times: Sequence[int], numbers: Numbers, window: tuple[int, int], width: int, height: int, gaps: Spans = ()
) -> Curve | None:
    """Return the curve, or None without a number in the window. `times` and `gaps` are in ascending order.

    The curve stays at a number until the next number, but not in a gap. Each column of dots reaches from
    the smallest to the largest number in the column's time.
    """
    columns = _columns(times, numbers, window, 2 * width, gaps)
    known = [span for span in columns if span is not None]
    if not known:
        return None
    least, most = min(low for low, _ in known), max(high for _, high in known)
    axis = axis_ends([*(low for low, _ in known), *(high for _, high in known)])
    cells, top = [[0] * width for _ in range(height)], 4 * height - 1
    for column, span in enumerate(columns):
        if span is not None:
            first, last = (top - round(place_between(number, *axis) * top) for number in reversed(span))
            _fill(cells, column, first, last)
    return Curve(cells, axis, least, most)


def _columns(
    times: Sequence[int], numbers: Numbers, window: tuple[int, int], count: int, gaps: Spans
) -> list[tuple[Number, Number] | None]:
    """Return the smallest and the largest number of each column of dots."""
    first, last = window
    at = bisect_left(times, first)
    held = next((number for number in reversed(numbers[:at]) if number is not None), None)
    found: list[tuple[Number, Number] | None] = []
    begin = first
    for column in range(count):
        end = first + (last - first) * (column + 1) // count
        stop = bisect_left(times, end, at) if column < count - 1 else bisect_right(times, last, at)
        own = numbers[at:stop]
        in_gap = bisect_right(gaps, begin, key=SPAN_BEGIN) - 1
        is_held = in_gap < 0 or gaps[in_gap][1] < end
        some = list_finite((held, *own) if is_held else own)
        found.append((min(some), max(some)) if some else None)
        held = next((number for number in reversed(own) if number is not None), held)
        at, begin = stop, end
    return found


def _fill(cells: list[list[int]], column: int, first: int, last: int) -> None:
    bits, x = BRAILLE_DOTS[column % 2], column // 2
    for y in range(first // 4, last // 4 + 1):
        cells[y][x] |= sum(bits[max(first - 4 * y, 0) : last - 4 * y + 1])


def braille(cell: int) -> str:
    return chr(FIRST_BRAILLE + cell) if cell else " "
