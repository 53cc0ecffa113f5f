"""What one value of a decode says for or against the profile it was decoded in: points, and why.

Rule: zero is a sensible value of nearly everything and says little; a value without meaning says much.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Final, Literal, NamedTuple

from trcvtui.udt.coded import Value
from trcvtui.udt.layout import BYTE_ORDERS, Layout, Leaf
from trcvtui.udt.plausible import is_senseless_real, is_sensible_real, swap_verdict
from trcvtui.udt.rules import LayoutRules
from trcvtui.udt.types import DAY, Elementary, Enumeration, Kind, LeafType, Pointer, Subrange, Text
from trcvtui.udt.value_text import real_text, value_text

_Order = Literal["little", "big"]


class Hint(NamedTuple):
    """Points for (above 0) or against the profile, and the reason in words."""

    points: float
    why: str


# The points, one row a kind of evidence: value that means something, one that means nothing.
# About the logarithm of how much rarer the value is among bytes by chance.
REALS: Final = {4: (1.5, -3.0), 8: (3.5, -4.0)}  # by size
SHORT_REAL: Final = (1.0, {4: 5, 8: 8})  # more, when so few digits give the number
ODD_REAL: Final = -1.0  # between sensible and senseless
NUMBERS: Final = {2: (1.0, -1.0), 4: (1.5, -1.5), 8: (2.0, -2.0)}  # by size: small in one byte order only
BIT_STRINGS: Final = {2: (0.5, -0.5), 4: (0.5, -0.5), 8: (0.5, -0.5)}
SHIFTED: Final = -1.5  # a number whose lower half is 0
HUGE: Final = -0.5  # a number that needs its highest byte
SMALL: Final = 0.3
NAMED: Final = (2.0, -3.0)  # number of an enumeration
RANGE: Final = (1.0, -3.0)  # subrange
CALENDAR: Final = (3.0, -4.0)  # date from 1990 to 2099, time of day below 24 h, BCD and DTL
HEADER: Final = (4.0, -4.0)  # STRING with lengths
ENDED: Final = (3.0, -4.0)  # STRING with NUL
CHARACTER: Final = (0.5, -1.0)
ZERO: Final = 0.2
# A byte of padding, and the bits behind the last one of a byte, are 0 or not; they may have any value. A BOOL
# that is 0 or 1 gets the same: one FALSE more and one gap less is no evidence.
SPARE: Final = (0.2, -1.0)
BOOL: Final = (SPARE[0], -3.0)
STEADY: Final = (0.5, -1.0)  # from message to message

SENSIBLE: Final = (1e-6, 1e9)
FIRST_DAY, LAST_DAY = 7305, 47482  # 1990-01-01 and 2100-01-01 since 1970
SHOWN: Final = 32  # characters of a value


def hint_of(layout: Layout, leaf: Leaf, value: Value, raw: bytes) -> Hint | None:
    """Return what the value of a leaf says; None is nothing."""
    judged = _judge(leaf.type, leaf, value, raw, layout.rules)
    if judged is None:
        return None
    points, why = judged
    shown = value_text(leaf, value, raw)
    shown = shown if len(shown) <= SHOWN else shown[:SHOWN] + "..."
    return Hint(points, f"{leaf.path or layout.name} = {shown}: {why}")


def steady_hint(layout: Layout, leaf: Leaf, before: bytes, after: bytes) -> Hint | None:
    """Return what the change of a number from one message to the next says; None is nothing."""
    row = _number(leaf, layout.rules)
    if row is None or before == after:
        return None
    code = BYTE_ORDERS[layout.rules.byte_order] + row.code
    (a,), (b,) = struct.unpack(code, before), struct.unpack(code, after)
    name = leaf.path or layout.name
    if row.kind is Kind.REAL:
        if is_senseless_real(a) or is_senseless_real(b) or not a or not b:
            return None
        is_steady, is_jump = 0.01 < abs(a / b) < 100, not 1e-6 < abs(a / b) < 1e6
    else:
        is_steady, is_jump = abs(a - b) < 1 << 4 * row.size, abs(a - b) >= 1 << 8 * row.size - 7
    if is_steady:
        return Hint(STEADY[0], f"{name} goes from {_short(a)} to {_short(b)}: steady")
    return Hint(STEADY[1], f"{name} jumps from {_short(a)} to {_short(b)}") if is_jump else None


def spare_bits_hint(layout: Layout, leaf: Leaf, raw: bytes) -> Hint | None:
    """Return what the bits behind the last bit of a byte say."""
    if leaf.bit is None or leaf.bit == 7:
        return None
    name, rest = leaf.path or layout.name, raw[0] >> leaf.bit + 1
    if rest:
        return Hint(SPARE[1], f"bits behind {name} are set: 16#{raw[0]:02X}")
    return Hint(SPARE[0], f"bits behind {name} are 0")


def _number(leaf: Leaf, rules: LayoutRules) -> Elementary | None:
    if isinstance(leaf.type, Text | Pointer | Enumeration) or leaf.bit is not None:
        return None
    row = rules.stored(leaf.type)
    is_number = row.kind in (Kind.INTEGER, Kind.REAL, Kind.DURATION)
    return row if is_number and row.size > 1 else None


def _judge(type_: LeafType, leaf: Leaf, value: Value, raw: bytes, rules: LayoutRules) -> Hint | None:
    match type_:
        case Text():
            return (_header if rules.text.header else _ended)(type_, str(value), raw, rules)
        case Enumeration(values=values):
            if all(number is None for _, number in values):
                return _by_kind(leaf, rules, raw)
            is_named = any(value == number for _, number in values)
            return _verdict(NAMED, is_named, not value, "a named value", "no named value")
        case Subrange(low=low, high=high):
            is_inside = isinstance(value, int) and low <= value <= high
            return _verdict(RANGE, is_inside, not value, "within its range", f"not {low}..{high}")
        case Pointer():
            return None
        case Elementary():
            return None if leaf.bit is not None else _by_kind(leaf, rules, raw)


def _by_kind(leaf: Leaf, rules: LayoutRules, raw: bytes) -> Hint | None:
    assert not isinstance(leaf.type, Text)
    row = rules.stored(leaf.type)
    if row.code.endswith("s") or row.name == "S5TIME":
        is_odd = bool(leaf.coding.odd and leaf.coding.odd(raw))
        return _verdict(CALENDAR, not is_odd, not any(raw), "valid", f"no {row.name}")
    judge = KINDS.get(row.kind)
    return judge(row, raw, rules) if judge else None


def _bool(row: Elementary, raw: bytes, rules: LayoutRules) -> Hint:
    return _verdict(BOOL, raw[0] <= 1, not raw[0], "0 or 1", f"16#{raw[0]:02X} is not 0 or 1")


def _real(row: Elementary, raw: bytes, rules: LayoutRules) -> Hint:
    (number,) = struct.unpack(BYTE_ORDERS[rules.byte_order] + row.code, raw)
    good, bad = REALS[row.size]
    if number == 0:
        return Hint(ZERO if not any(raw) else 0.0, "zero")
    if is_sensible_real(number, SENSIBLE):
        digits = real_text(number, row.size).strip("-0.").replace(".", "").partition("e")[0]
        if len(digits) <= SHORT_REAL[1][row.size]:
            return Hint(good + SHORT_REAL[0], f"a sensible {row.name} of few digits")
        return Hint(good, f"a sensible {row.name}")
    return Hint(bad, f"no sensible {row.name}") if is_senseless_real(number) else Hint(ODD_REAL, "unusual")


def _whole(row: Elementary, raw: bytes, rules: LayoutRules) -> Hint | None:
    if row.size == 1:
        return None
    here = rules.byte_order
    is_signed = row.code.islower()
    read = int.from_bytes(raw, _order(here), signed=is_signed)
    swapped = int.from_bytes(raw[::-1], _order(here), signed=is_signed)
    good, bad = (BIT_STRINGS if row.kind is Kind.BITS else NUMBERS)[row.size]
    verdict = swap_verdict(row, read, swapped)
    if verdict < 0:
        return Hint(good, f"small; swapped it is {swapped}")
    if verdict > 0:
        return Hint(bad, f"large; swapped it is {swapped}")
    if row.kind is Kind.BITS or not read:
        return None
    if row.size > 2 and not read & ((1 << 4 * row.size) - 1):
        return Hint(SHIFTED, "its lower half is 0")
    if abs(read) >= 1 << 8 * (row.size - 1) and row.size > 2:
        return Hint(HUGE, "large")
    return Hint(SMALL, "small") if abs(read) < 1 << 4 * row.size else None


def _calendar(row: Elementary, raw: bytes, rules: LayoutRules) -> Hint:
    count = int.from_bytes(raw, _order(rules.byte_order), signed=row.code.islower())
    day = (count * row.unit_ns + row.epoch_ns) // DAY
    is_date = FIRST_DAY <= day < LAST_DAY
    return _verdict(CALENDAR, is_date, not count, "a date of our time", "no date of our time")


def _time_of_day(row: Elementary, raw: bytes, rules: LayoutRules) -> Hint:
    count = int.from_bytes(raw, _order(rules.byte_order))
    is_time = count * row.unit_ns < DAY
    return _verdict((RANGE[0], CALENDAR[1]), is_time, not count, "below 24 hours", "more than 24 hours")


def _character(row: Elementary, raw: bytes, rules: LayoutRules) -> Hint | None:
    code = int.from_bytes(raw, _order(rules.byte_order))
    return _verdict(CHARACTER, _is_readable(chr(code)), not code, "a character", "a control code")


KINDS: Final[dict[Kind, Callable[[Elementary, bytes, LayoutRules], Hint | None]]] = {
    Kind.BOOL: _bool,
    Kind.REAL: _real,
    Kind.INTEGER: _whole,
    Kind.BITS: _whole,
    Kind.DURATION: _whole,
    Kind.DATE: _calendar,
    Kind.DATE_AND_TIME: _calendar,
    Kind.TIME_OF_DAY: _time_of_day,
    Kind.CHARACTER: _character,
}


def _header(type_: Text, value: str, raw: bytes, rules: LayoutRules) -> Hint:
    good, bad = HEADER
    unit = 2 if type_.wide else 1
    longest, actual = (
        int.from_bytes(raw[at : at + unit], _order(rules.byte_order)) for at in range(0, 2 * unit, unit)
    )
    declared = rules.text.length(type_)
    if longest != declared:
        return Hint(bad, f"its header says at most {longest} characters, declared are {declared}")
    if actual > longest:
        return Hint(bad, f"its header says {actual} of at most {longest} characters")
    if not all(map(_is_readable, value)):
        return Hint(0.0, "the header fits, the characters cannot be read")
    return Hint(good, f"its header says {actual} of at most {longest} characters")


def _ended(type_: Text, value: str, raw: bytes, rules: LayoutRules) -> Hint:
    good, bad = ENDED
    if not any(raw):
        return Hint(ZERO, "empty")
    unit = 2 if type_.wide else 1
    ends = any(not any(raw[at : at + unit]) for at in range(0, len(raw), unit))
    if not ends:
        return Hint(bad, "no NUL")
    if not all(map(_is_readable, value)):
        return Hint(bad, "characters that cannot be read")
    if not value:
        return Hint(ZERO, "empty, with bytes behind the NUL")
    if type_.wide and any(ord(character) > 0x24F for character in value):
        return Hint(ZERO, "characters of any script")
    spare = raw[unit * (rules.text.length(type_) + 1) :]  # as good as padding
    good += SPARE[1] if any(spare) else SPARE[0] * len(spare)
    return Hint(good, f"{len(value)} characters and a NUL")


def _is_readable(character: str) -> bool:
    return character.isprintable() or character in "\r\n\t"


def _verdict(weight: tuple[float, float], is_good: bool, is_zero: bool, good: str, bad: str) -> Hint:
    if not is_good:
        return Hint(weight[1] if not is_zero else 0.0, bad)
    return Hint(ZERO if is_zero else weight[0], good)


def _order(name: str) -> _Order:
    return "little" if name == "little" else "big"


def _short(value: float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
