"""How likely bytes are as a value: what those of a member say for a reading.

Points are natural logarithms: how much likelier the bytes are as a value that machines send than as bytes by
chance. Of the bytes of telegrams about half are 0, so a 0 says little wherever it stands; a value without
meaning costs at most `log(DOUBT)`, for machines do send such.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection
from typing import Final, Literal, NamedTuple

from trcvtui.udt.layout.layout import BYTE_ORDERS, Leaf
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.layout.value_text import real_text
from trcvtui.udt.types import (
    DAY,
    MS,
    SECOND,
    Elementary,
    Enumeration,
    LeafType,
    Pointer,
    StringType,
    Subrange,
    ValueKind,
)

_Order = Literal["little", "big"]
_Chance = tuple[float, str]  # the logarithm of how likely the bytes are as a value, and what they are


class LeafEvidence(NamedTuple):
    """Points for (above 0) or against a reading, and the reason in words.

    `fair` are the points where the byte order is in doubt: a number that is round in one of the orders has
    those of its best order. `order` is what it says for this order against the other one. `is_plain`: it is
    a number that is round in no way (no multiple of 256, nor one less); `is_odd`: machines send none such.
    """

    points: float
    why: str
    fair: float
    order: float = 0.0
    is_plain: bool = False
    is_odd: bool = False


ZERO: Final = math.log(0.5)  # a byte 0 by chance
OTHER: Final = math.log(0.5 / 255)  # any other one
MOST_MESSAGES: Final = 16  # the last ones
REPEATED: Final = 0.6  # k messages of other bytes say k**REPEATED times as much as one
DOUBT: Final = 0.02  # how often a value is none that is foreseen here
NEVER: Final = -math.inf
PLAIN: Final = 8.0  # a number says something of the byte order when it is so many times smaller in one
FIRST_DAY, LAST_DAY = 7305, 47482  # 1990-01-01 and 2100-01-01 since 1970
NEAR_DAYS: Final = (10_957, 25_568)  # 2000 to 2039

# How often a number is 0, all ones, anything; of a few bits, of any size; and the share of negative ones.
NUMBER: Final = (0.12, 0.01, 0.08, 0.5, 0.29)
NEGATIVE: Final = 0.2
FEW_BITS: Final = 16
# REAL: decades from, to, and their share; the share of each count of digits, and of a number of any digits.
DECADES: Final = ((-3, 7, 0.85), (-7, -3, 0.06), (7, 12, 0.04), (-30, -7, 0.0002), (12, 30, 0.0002))
REAL_ZERO: Final = 0.08
MINUS_ZERO: Final = 0.0005  # of rounding
DIGITS: Final = {4: (0.12, 6, 0.25), 8: (0.07, 12, 0.12)}  # by size: each count, the most digits, any digits
REAL_BITS: Final = {4: 23, 8: 52}  # of the mantissa
AS_REAL: Final = 0.04  # an LREAL that was a REAL before
# A byte of padding is 0 or, rarely, rubbish. Many zeros in a row are one fact.
GAP: Final = (0.6, 0.05, -2.8)  # each of the first four, each more, rubbish
MOST_OF_TEXT: Final = 12.0  # points of the letters: those of a long text are one fact
BITS_OFF: Final = (0.3, 0.25)  # all BOOLs of a byte FALSE, and more the fewer they are


def chance(raw: bytes) -> float:
    """Return the logarithm of how likely the bytes are by chance."""
    zeros = raw.count(0)
    return zeros * ZERO + (len(raw) - zeros) * OTHER


def repeated_zeros(type_: LeafType, parts: Collection[bytes]) -> float:
    """Return what the bytes of numbers say too much that are 0 in each message: one fact, as padding is."""
    if isinstance(type_, StringType):
        return 0.0
    share: float = len(parts) ** REPEATED
    return ZERO * (share - 1) * sum(not any(column) for column in zip(*parts, strict=True))


def evidence(leaf: Leaf, raw: bytes, rules: LayoutRules) -> LeafEvidence | None:
    """Return what the bytes of a leaf say, of a bit nothing; None is nothing."""
    if leaf.bit is not None or isinstance(leaf.type, Pointer):
        return None
    if isinstance(leaf.type, StringType):
        return _plain((_headed if rules.text.header else _ended)(leaf.type, raw, rules), raw)
    row = rules.stored(leaf.type)
    if row.code.endswith("s") or row.name == "S5TIME":
        return _plain(_digits(leaf, row, raw), raw)
    judge = _whole if isinstance(leaf.type, Enumeration | Subrange) else JUDGES.get(row.kind)
    if judge is None:
        return None
    if row.kind not in COUNTS:
        return _plain(judge(leaf, row, raw, _order(rules)), raw)
    return _count(leaf, row, raw, _order(rules), judge)


def spoken(leaf: Leaf, raw: bytes, rules: LayoutRules) -> bytes:
    """Return the bytes of a leaf that make its value: of a text without what stands after its end."""
    if not isinstance(leaf.type, StringType):
        return raw
    unit = 2 if leaf.type.wide else 1
    if rules.text.header:
        return raw[: unit * (2 + int.from_bytes(raw[unit : 2 * unit], _order(rules)))]
    return raw[: next((at for at in range(0, len(raw), unit) if not any(raw[at : at + unit])), len(raw))]


def bits_evidence(used: int, raw: bytes) -> LeafEvidence:
    """Return what a byte of BOOLs says of which the first `used` bits are some."""
    if raw[0] >> used:
        return _plain((NEVER, f"bits after them are set: 16#{raw[0]:02X}"), raw)
    off = BITS_OFF[0] + BITS_OFF[1] / used
    likely = off if not raw[0] else (1 - off) / ((1 << used) - 1)
    return _plain((math.log(likely), "the bits after them are 0" if used < 8 else "BOOLs"), raw)


def gap_points(raw: bytes) -> float:
    first, more, rubbish = GAP
    return rubbish if any(raw) else first * min(len(raw), 4) + more * max(len(raw) - 4, 0)


def steady(leaf: Leaf, before: bytes, after: bytes, rules: LayoutRules) -> tuple[float, str]:
    """Return what the change of a REAL, or of a number that is round in no order, says; 0 is nothing."""
    if isinstance(leaf.type, StringType | Pointer | Enumeration) or leaf.bit is not None:
        return 0.0, ""
    row = rules.stored(leaf.type)
    if (
        row.kind not in (ValueKind.REAL, ValueKind.INTEGER, ValueKind.DURATION)
        or row.size == 1
        or row.code.endswith("s")
    ):
        return 0.0, ""
    if row.kind is not ValueKind.REAL and (_is_round(before) or _is_round(after)):
        return 0.0, ""
    code = BYTE_ORDERS[rules.byte_order] + row.code
    (a,), (b,) = struct.unpack(code, before), struct.unpack(code, after)
    if not (math.isfinite(a) and math.isfinite(b) and a and b):
        return 0.0, ""
    if 0.1 < a / b < 10:
        return 0.5, f"goes from {_short(a)} to {_short(b)}: steady"
    is_jump = not 1e-6 < abs(a / b) < 1e6 or (row.size > 2 and row.kind is not ValueKind.REAL and a * b < 0)
    return (-1.0, f"jumps from {_short(a)} to {_short(b)}") if is_jump else (0.0, "")


# -- from how likely to points -----------------------------------------------------------------------------


def _points(likely: float, raw: bytes) -> float:
    more = likely - chance(raw)
    if more > 30:
        return more
    return math.log(DOUBT + (1 - DOUBT) * math.exp(more)) if more > NEVER else math.log(DOUBT)


def _plain(found: _Chance, raw: bytes) -> LeafEvidence:
    points = _points(found[0], raw)
    return LeafEvidence(points, found[1], points, is_odd=found[0] == NEVER)


def _count(leaf: Leaf, row: Elementary, raw: bytes, order: _Order, judge: _Judge) -> LeafEvidence:
    """Return what a number says; of the byte order only where it is round in none of them."""
    likely, why = judge(leaf, row, raw, order)
    points = _points(likely, raw)
    ways = {raw, raw[::-1], pairs_exchanged(raw), words_exchanged(raw)}
    fair = max(_points(judge(leaf, row, way, order)[0], way) for way in ways)
    if isinstance(leaf.type, Enumeration | Subrange):
        fair = max(fair, 0.0)
    is_plain = raw[0 if order == "little" else -1] not in (0, 255)
    found = LeafEvidence(points, why, fair, 0.0, is_plain, likely == NEVER)
    if _is_round(raw) or row.kind is ValueKind.BITS:
        return found
    is_signed = row.code.islower()
    here = abs(int.from_bytes(raw, order, signed=is_signed))
    there = abs(int.from_bytes(raw[::-1], order, signed=is_signed))
    if max(here, there) < PLAIN * min(here, there):
        return found
    swapped = _points(judge(leaf, row, raw[::-1], order)[0], raw)
    return found._replace(order=points - swapped)


def _is_round(raw: bytes) -> bool:
    """Return whether a number is, in some order, a multiple of 256, or one less."""
    return 0 in raw or 255 in raw


def pairs_exchanged(raw: bytes) -> bytes:
    """Return bytes with those of each 16 bits exchanged: BADC."""
    out = bytearray(raw)
    even = len(raw) & ~1
    out[:even:2], out[1:even:2] = raw[1:even:2], raw[:even:2]
    return bytes(out)


def words_exchanged(raw: bytes) -> bytes:
    """Return bytes with their 16-bit words in reverse order: CDAB, or GHEFCDAB; an odd last one stays."""
    end = len(raw) & ~1
    return b"".join(raw[at : at + 2] for at in range(end - 2, -1, -2)) + raw[end:]


# -- how likely values are -----------------------------------------------------------------------------------


def _whole(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    match leaf.type:
        case Enumeration(values=values) if any(number is not None for _, number in values):
            number = int.from_bytes(raw, order, signed=row.code.islower())
            named = [known for _, known in values if known is not None]
            is_named = number in named
            likely = math.log(1 / len(named)) if is_named else NEVER
            return likely, "a named value" if is_named else "no named value"
        case Subrange(low=low, high=high):
            number = int.from_bytes(raw, order, signed=row.code.islower())
            if low <= number <= high:
                inside = 1 / (high - low + 1)
                return math.log(0.5 * inside + 0.5 * _number(number, raw, inside)), "within its range"
            return NEVER, f"not {low}..{high}"
    number = int.from_bytes(raw, order, signed=row.code.islower())
    likely = math.log(_number(number, raw, 2.0 ** (-8 * len(raw))))
    swapped = int.from_bytes(raw[::-1], order, signed=row.code.islower())
    if not number:
        return likely, "zero"
    if abs(number) * PLAIN <= abs(swapped):
        return likely, f"small; swapped it is {swapped}"
    return likely, f"large; swapped it is {swapped}" if abs(swapped) * PLAIN <= abs(number) else "a number"


def _number(number: int, raw: bytes, any_of_them: float) -> float:
    zero, ones, anything, few, free = NUMBER
    if not number:
        return zero
    size, bits = abs(number), 8 * len(raw)
    of_this_sign = NEGATIVE if number < 0 else 1 - NEGATIVE
    likely = anything * any_of_them + free * of_this_sign / ((size + 3) * 0.6931 * (bits - 1))
    if size < 1 << FEW_BITS:
        likely += few * of_this_sign / ((size + 3) * 0.6931 * (min(bits, FEW_BITS) - 2))
    return likely + (ones if raw.count(255) == len(raw) else 0)


def _duration(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    """Judge a duration: most are whole seconds, or at least whole milliseconds."""
    count, bits = int.from_bytes(raw, order, signed=row.code.islower()), 2.0 ** (-8 * len(raw))
    likely = 0.0
    for step, share in ((SECOND, 0.3), (100 * MS, 0.3), (MS, 0.3), (row.unit_ns or MS, 0.1)):
        per = max(step // (row.unit_ns or MS), 1)
        likely += share * _number(count // per, raw, bits) if not count % per else 0.0
    return math.log(likely), _whole(leaf, row, raw, order)[1]


def _bits(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    number = int.from_bytes(raw, order)
    likely = 0.3 * _number(number, raw, 2.0 ** (-8 * len(raw))) + 0.7 * math.exp(chance(raw))
    return math.log(likely), "bits"


def _bool(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    if raw[0] > 1:
        return NEVER, f"16#{raw[0]:02X} is not 0 or 1"
    return math.log(0.45 if raw[0] else 0.55), "0 or 1"


def _real(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    size = len(raw)
    name = "REAL" if size == 4 else "LREAL"
    code = ("<" if order == "little" else ">") + ("f" if size == 4 else "d")
    (number,) = struct.unpack(code, raw)
    if number == 0:
        return (math.log(REAL_ZERO), "zero") if not any(raw) else (math.log(MINUS_ZERO), "minus zero")
    if not math.isfinite(number):
        return NEVER, f"no sensible {name}"
    decade = math.log10(abs(number))
    share = next((share / (high - low) for low, high, share in DECADES if low <= decade < high), 0.0)
    if not share:
        return NEVER, f"no sensible {name}"
    each, most, any_digits = DIGITS[size]
    mantissas = 3.32 * 2.0 ** REAL_BITS[size]
    likely = any_digits / mantissas
    if size == 8 and not any(raw[:3] if order == "little" else raw[-3:]):
        likely += AS_REAL / (3.32 * 2.0**23)
    digits = len(real_text(number, size).lstrip("-").partition("e")[0].replace(".", "").strip("0"))
    if digits <= most:
        likely += each / (9 * 10.0 ** (digits - 1))
    likely *= share * (NEGATIVE if number < 0 else 1 - NEGATIVE)
    usual = "a sensible" if share > 0.01 else "an unusual"
    return math.log(likely), f"{usual} {name}" + (" of few digits" if digits <= most - 1 else "")


def _date(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    count = int.from_bytes(raw, order, signed=row.code.islower())
    if not count:
        return math.log(0.05), "zero"
    unit, epoch = row.unit_ns, row.epoch_ns
    at = count * unit + epoch
    day = at // DAY
    if not FIRST_DAY <= day < LAST_DAY:
        return NEVER, "no date of our time"
    near = NEAR_DAYS[0] <= day < NEAR_DAYS[1]
    days = (NEAR_DAYS[1] - NEAR_DAYS[0]) if near else (LAST_DAY - FIRST_DAY)
    steps = ((DAY, 0.9 if row.kind is ValueKind.DATE else 0.1), (SECOND, 0.3), (MS, 0.2), (unit, 0.1))
    likely = sum(share / max(DAY // max(step, unit), 1) for step, share in steps if at % max(step, unit) == 0)
    return math.log(likely * (0.85 if near else 0.1) / days), "a date of our time"


def _time_of_day(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    unit = row.unit_ns
    at = int.from_bytes(raw, order) * unit
    if at >= DAY:
        return NEVER, "more than 24 hours"
    steps = ((DAY, 0.05), (60 * SECOND, 0.05), (SECOND, 0.3), (MS, 0.3), (unit, 0.3))
    return math.log(sum(share / (DAY // max(s, unit)) for s, share in steps if at % max(s, unit) == 0)), (
        "below 24 hours"
    )


def _character(leaf: Leaf, row: Elementary, raw: bytes, order: _Order) -> _Chance:
    code = int.from_bytes(raw, order)
    if not code:
        return math.log(0.1), "no character"
    likely = _letter(code)
    return likely, "a character" if likely > -6 else "an unusual character"


def _digits(leaf: Leaf, row: Elementary, raw: bytes) -> _Chance:
    """Judge dates digit by digit: BCD, DTL, S5TIME."""
    if not any(raw):
        return math.log(0.1), "zero"
    if leaf.coding.odd and leaf.coding.odd(raw):
        return NEVER, f"no {row.name}"
    span = {2: 4000.0, 8: 3.4e12, 12: 3.4e12 * 1e3}.get(len(raw), 1e12)
    return math.log(0.9 / span), "valid"


def _headed(type_: StringType, raw: bytes, rules: LayoutRules) -> _Chance:
    unit = 2 if type_.wide else 1
    longest, actual = (int.from_bytes(raw[at : at + unit], _order(rules)) for at in range(0, 2 * unit, unit))
    declared = rules.text.length(type_)
    if not any(raw):
        return math.log(0.08) + _behind(raw, 0), "empty, without a header"
    if longest != declared:
        return NEVER, f"its header says at most {longest} characters, declared are {declared}"
    said = f"its header says {actual} of at most {longest} characters"
    if actual > longest:
        return NEVER, said
    likely = math.log(0.9 * _length(actual, declared))
    likely += _letters(raw[2 * unit : (2 + actual) * unit], unit, rules)
    return likely + _behind(raw, (2 + actual) * unit), said


def _ended(type_: StringType, raw: bytes, rules: LayoutRules) -> _Chance:
    unit = 2 if type_.wide else 1
    if not any(raw):
        return math.log(0.1) + _behind(raw, 0), "empty"
    ends = next((at for at in range(0, len(raw) - unit + 1, unit) if not any(raw[at : at + unit])), None)
    if ends is None:
        return NEVER, "no NUL"
    if not ends:
        return math.log(0.03) + unit * ZERO + _behind(raw, unit), "empty, with bytes after the NUL"
    length, declared = ends // unit, rules.text.length(type_)
    if length > declared:
        return NEVER, f"{length} characters, declared are {declared}"
    likely = math.log(0.9 * _length(length, declared)) + _letters(raw[:ends], unit, rules)
    return likely + _behind(raw, ends + unit), f"{length} characters and a NUL"


def _length(actual: int, declared: int) -> float:
    return (0.1 if not actual else 0) + 0.9 / (declared + 1)


def _behind(raw: bytes, start: int) -> float:
    """Return how likely the bytes after a text are: zeros, or what an older text has left."""
    rest = raw[start:]
    return chance(rest) + (min(GAP[0] * len(rest), 2.4) if not any(rest) else -0.7)


def _letters(raw: bytes, unit: int, rules: LayoutRules) -> float:
    order = _order(rules)
    codes = [int.from_bytes(raw[at : at + unit], order) for at in range(0, len(raw), unit)]
    gains = [_letter(code) - chance(raw[at * unit : (at + 1) * unit]) for at, code in enumerate(codes)]
    if any(code < 0x20 and code not in (9, 10, 13) for code in codes):
        return NEVER  # machines send no control codes in a text
    good = min(sum(gain for gain in gains if gain > 0), MOST_OF_TEXT)
    return chance(raw) + good + sum(gain for gain in gains if gain < 0)


USUAL: Final = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 -_./:#,")


def _letter(code: int) -> float:
    if code in USUAL:
        return LETTERS[0]
    if code < 0x7F:
        return LETTERS[1] if code >= 0x20 or code in (9, 10, 13) else LETTERS[3]
    return LETTERS[2] if 0xA0 <= code < 0x180 else LETTERS[3] if code < 256 else LETTERS[4]


# Usual ones, others of ASCII, letters of Europe, control codes, any script.
LETTERS: Final = tuple(map(math.log, (0.9 / len(USUAL), 0.05 / 30, 0.04 / 200, 0.002 / 60, 0.008 / 60_000)))

_Judge = Callable[[Leaf, Elementary, bytes, _Order], _Chance]
JUDGES: Final[dict[ValueKind, _Judge]] = {
    ValueKind.BOOL: _bool,
    ValueKind.REAL: _real,
    ValueKind.INTEGER: _whole,
    ValueKind.BITS: _bits,
    ValueKind.DURATION: _duration,
    ValueKind.DATE: _date,
    ValueKind.DATE_AND_TIME: _date,
    ValueKind.TIME_OF_DAY: _time_of_day,
    ValueKind.CHARACTER: _character,
}
COUNTS: Final = (ValueKind.INTEGER, ValueKind.BITS, ValueKind.DURATION, ValueKind.TIME_OF_DAY)


def _order(rules: LayoutRules) -> _Order:
    return "little" if rules.byte_order == "little" else "big"


def _short(value: float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
