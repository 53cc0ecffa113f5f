"""One leaf's bytes and its value: elementary types, and which coding a leaf has under a layout's rules."""

from __future__ import annotations

import math
from collections.abc import Callable

from trcvtui.errors import UserError
from trcvtui.udt.layout.coded import Coding, Refused, Value, hex_text
from trcvtui.udt.layout.coding_s7 import bcd_coding, dtl_coding, s5time_coding
from trcvtui.udt.layout.coding_text import text_coding
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.literals import (
    EXPECTED,
    format_literal,
    format_time,
    parse_integer,
    parse_literal,
    parse_time,
)
from trcvtui.udt.types import DAY, Elementary, Enumeration, Kind, LeafType, Text

__all__ = ["Coding", "Refused", "Value", "coding_of"]

LARGEST_REAL = 3.4028235677973366e38  # the first number that rounds to no REAL (24 bits, 2**127)
BOOL_TEXTS = {"TRUE": True, "FALSE": False, "1": True, "0": False}


def coding_of(type_: LeafType, rules: LayoutRules) -> Coding:
    """Return how a leaf of this type is stored under these rules."""
    if isinstance(type_, Text):
        return text_coding(type_, rules)
    row = rules.stored(type_)
    if isinstance(type_, Enumeration):
        return _enumeration(type_, row)
    own = OWN_FORMS.get((row.name, row.code))
    return own(rules) if own else CODINGS[row.kind](row, rules)


def _bool(row: Elementary, rules: LayoutRules) -> Coding:
    def to_raw(value: object) -> bool:
        if isinstance(value, str) and value.upper() in BOOL_TEXTS:
            return BOOL_TEXTS[value.upper()]
        if isinstance(value, int) and value in (0, 1):
            return bool(value)
        raise Refused("true or false")

    def odd(raw: bytes) -> str:
        return f" ({hex_text(raw)})" if raw[0] > 1 else ""

    return Coding(row.code, None, to_raw, None if row.name in rules.bits else odd)


def _whole(row: Elementary, _: LayoutRules | None = None) -> Coding:
    low, high = row.limits

    def to_raw(value: object) -> int:
        number = parse_integer(value) if isinstance(value, str) else value
        if not isinstance(number, int) or isinstance(number, bool) or not low <= number <= high:
            raise Refused(f"{row.name}, a whole number from {low} to {high}")
        return number

    return Coding(row.code, None, to_raw)


def _real(row: Elementary, _: LayoutRules) -> Coding:
    def to_raw(value: object) -> float:
        number = _float(value)
        if number is None or (row.size == 4 and LARGEST_REAL <= abs(number) < math.inf):
            raise Refused(f"{row.name}, a number in its range, NaN, Infinity or -Infinity")
        return number

    return Coding(row.code, None, to_raw)


def _float(value: object) -> float | None:
    if not isinstance(value, int | float | str) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    # Digits without end (`1e400`) are no infinity.
    is_named = not isinstance(value, str) or "inf" in value.lower()
    return number if is_named or not math.isinf(number) else None


def _character(row: Elementary, _: LayoutRules) -> Coding:
    highest = row.limits[1]

    def to_raw(value: object) -> int:
        if not isinstance(value, str) or len(value) != 1 or ord(value) > highest:
            raise Refused(f"{row.name}, one character from code 0 to {highest}")
        return ord(value)

    return Coding(row.code, chr, to_raw)


def _literal(row: Elementary, _: LayoutRules) -> Coding:
    low, high = row.limits

    def to_value(count: int) -> str:
        return format_literal(row, count)

    def to_raw(value: object) -> int:
        count = parse_literal(row, value) if isinstance(value, str) else None
        if count is None or not low <= count <= high:
            raise Refused(f"{row.name} from {to_value(low)} to {to_value(high)}, {EXPECTED[row.kind]}")
        return count

    return Coding(row.code, to_value, to_raw)


def _date(row: Elementary, rules: LayoutRules) -> Coding:
    """Return DATE; a literal has whole days, the rest of a finer count is told behind it and taken back."""
    a_day = DAY // row.unit_ns
    if a_day == 1:
        return _literal(row, rules)
    low, high = row.limits

    def to_value(count: int) -> str:
        rest = count % a_day * row.unit_ns
        return format_literal(row, count) + (f" (and {format_time(rest)})" if rest else "")

    def to_raw(value: object) -> int:
        count = _day_and_rest(row, value) if isinstance(value, str) else None
        if count is None or not low <= count <= high:
            raise Refused(f"{row.name} from {to_value(low)} to {to_value(high)}, {EXPECTED[row.kind]}")
        return count

    return Coding(row.code, to_value, to_raw)


def _day_and_rest(row: Elementary, text: str) -> int | None:
    """Return the count of `D#1970-01-02 (and T#1s)`, or of the day alone; None when it is neither."""
    day, and_, rest = text.partition(" (and ")
    count = parse_literal(row, day)
    if count is None or not and_:
        return count
    try:
        ns = parse_time(rest.removesuffix(")"))
    except UserError:
        return None
    is_rest = rest.endswith(")") and 0 <= ns < DAY and ns % row.unit_ns == 0
    return count + ns // row.unit_ns if is_rest else None


def _address(row: Elementary, _: LayoutRules) -> Coding:
    whole = _whole(row)

    def to_value(address: int) -> str:
        return f"16#{address:0{2 * row.size}X}"

    return Coding(row.code, to_value, whole.to_raw)


def _enumeration(type_: Enumeration, row: Elementary) -> Coding:
    whole = _whole(row)
    numbers = {name.casefold(): number for name, number in type_.values}

    def to_raw(value: object) -> object:
        number = numbers.get(value.casefold()) if isinstance(value, str) else None
        return whole.to_raw(value if number is None else number)

    return Coding(whole.code, None, to_raw)


CODINGS: dict[Kind, Callable[[Elementary, LayoutRules], Coding]] = {
    Kind.BOOL: _bool,
    Kind.INTEGER: _whole,
    Kind.BITS: _whole,
    Kind.REAL: _real,
    Kind.CHARACTER: _character,
    Kind.DURATION: _literal,
    Kind.DATE: _date,
    Kind.TIME_OF_DAY: _literal,
    Kind.DATE_AND_TIME: _literal,
    Kind.ADDRESS: _address,
}
# By name and `struct` code: the same name may be a plain count elsewhere.
OWN_FORMS: dict[tuple[str, str], Callable[[LayoutRules], Coding]] = {
    ("DT", "8s"): bcd_coding,
    ("DTL", "12s"): dtl_coding,
    ("S5TIME", "H"): s5time_coding,
}
