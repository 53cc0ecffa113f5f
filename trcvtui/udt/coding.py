"""One leaf's bytes and its value: the `struct` code, and the change between raw and shown value.

Rule: to_value never fails, whatever the bytes are; to_raw raises Refused for every value that does not fit.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from trcvtui.udt.literals import EXPECTED, format_literal, parse_integer, parse_literal
from trcvtui.udt.rules import BYTE_ORDERS, LayoutRules
from trcvtui.udt.types import Elementary, Enumeration, Kind, LeafType, Text

Value = bool | int | float | str

LARGEST_REAL = 3.4028235677973366e38  # the first number that rounds to no REAL (24 bits, 2**127)
BOOL_TEXTS = {"TRUE": True, "FALSE": False, "1": True, "0": False}


class Refused(Exception):
    """A value that the type cannot hold; the text says what it can hold."""


class Coding(NamedTuple):
    """How one leaf is stored: `struct` code without byte order, and both changes (None: as it is)."""

    code: str
    to_value: Callable[[Any], Value] | None
    to_raw: Callable[[object], Any]


def coding_of(type_: LeafType, rules: LayoutRules) -> Coding:
    """Return how a leaf of this type is stored under these rules."""
    if isinstance(type_, Text):
        return _text(type_, rules)
    if isinstance(type_, Enumeration):
        return _enumeration(type_, rules)
    row = rules.row(type_)
    return CODINGS[row.kind](row)


def _bool(row: Elementary) -> Coding:
    def to_raw(value: object) -> bool:
        if isinstance(value, str) and value.upper() in BOOL_TEXTS:
            return BOOL_TEXTS[value.upper()]
        if isinstance(value, int) and value in (0, 1):
            return bool(value)
        raise Refused("true or false")

    return Coding(row.code, None, to_raw)


def _whole(row: Elementary) -> Coding:
    low, high = row.limits

    def to_raw(value: object) -> int:
        number = parse_integer(value) if isinstance(value, str) else value
        if not isinstance(number, int) or isinstance(number, bool) or not low <= number <= high:
            raise Refused(f"{row.name}, a whole number from {low} to {high}")
        return number

    return Coding(row.code, None, to_raw)


def _real(row: Elementary) -> Coding:
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
        return float(value)
    except (ValueError, OverflowError):
        return None


def _character(row: Elementary) -> Coding:
    highest = row.limits[1]

    def to_raw(value: object) -> int:
        if not isinstance(value, str) or len(value) != 1 or ord(value) > highest:
            raise Refused(f"{row.name}, one character from code 0 to {highest}")
        return ord(value)

    return Coding(row.code, chr, to_raw)


def _literal(row: Elementary) -> Coding:
    low, high = row.limits

    def to_value(count: int) -> str:
        return format_literal(row, count)

    def to_raw(value: object) -> int:
        count = parse_literal(row, value) if isinstance(value, str) else None
        if count is None or not low <= count <= high:
            raise Refused(f"{row.name} from {to_value(low)} to {to_value(high)}, {EXPECTED[row.kind]}")
        return count

    return Coding(row.code, to_value, to_raw)


def _enumeration(type_: Enumeration, rules: LayoutRules) -> Coding:
    whole = _whole(rules.row(type_.base))
    numbers = {name.casefold(): number for name, number in type_.values}

    def to_raw(value: object) -> Any:
        number = numbers.get(value.casefold()) if isinstance(value, str) else None
        return whole.to_raw(value if number is None else number)

    return Coding(whole.code, None, to_raw)


# udt.md 3.3, form `s7` (unverified): [longest][actual] and the characters, zeros to the end. WSTRING in the
# same form with words, UTF-16 in the byte order of the data: no page of Baosky describes it.
def _text(type_: Text, rules: LayoutRules) -> Coding:
    order, longest = BYTE_ORDERS[rules.byte_order], rules.text.length(type_)
    lengths = struct.Struct(order + ("HH" if type_.wide else "BB"))
    unit = lengths.size // 2
    charset = ("utf-16-le" if order == "<" else "utf-16-be") if type_.wide else "latin-1"

    def to_value(raw: bytes) -> str:
        # An actual length beyond the field ends at the field (udt.md U12).
        actual: int = lengths.unpack_from(raw)[1]
        return raw[lengths.size :][: actual * unit].decode(charset, "surrogatepass")

    def to_raw(value: object) -> bytes:
        characters = _characters(value, charset)
        if characters is None or len(characters) > longest * unit:
            raise Refused(
                f"text of at most {longest} characters" + ("" if type_.wide else ", codes 0 to 255")
            )
        return lengths.pack(longest, len(characters) // unit) + characters

    return Coding(f"{rules.text.size(type_)}s", to_value, to_raw)


def _characters(value: object, charset: str) -> bytes | None:
    if not isinstance(value, str):
        return None
    try:
        return value.encode(charset, "surrogatepass")
    except UnicodeEncodeError:
        return None


CODINGS: dict[Kind, Callable[[Elementary], Coding]] = {
    Kind.BOOL: _bool,
    Kind.INTEGER: _whole,
    Kind.BITS: _whole,
    Kind.REAL: _real,
    Kind.CHARACTER: _character,
    Kind.DURATION: _literal,
    Kind.DATE: _literal,
    Kind.TIME_OF_DAY: _literal,
    Kind.DATE_AND_TIME: _literal,
}
