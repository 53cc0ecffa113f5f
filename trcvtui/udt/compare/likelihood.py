"""How likely the bytes of a member are as a value of its type: the evidence for a reading.

Points are natural logarithms. Points say how much likelier the bytes are as a value that machines send than
as bytes by chance. About half of the bytes of telegrams are 0, so a 0 is little evidence anywhere. A value
without meaning costs at most `log(UNFORESEEN)`, since machines do send such values.
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

_ByteOrder = Literal["little", "big"]
_Likelihood = tuple[float, str]  # the logarithm of the likelihood of the bytes as a value, and its name


class LeafEvidence(NamedTuple):
    """Points for (above 0) or against a reading, and the reason in words.

    `fair` has the points in the byte order that fits the bytes best, to compare byte orders. `order` has
    the points for this byte order against the other byte order. If `is_plain`, the number is not round: its
    low byte is neither 0 nor 255. If `is_odd`, machines do not send such a value.
    """

    points: float
    why: str
    fair: float
    order: float = 0.0
    is_plain: bool = False
    is_odd: bool = False


ZERO: Final = math.log(0.5)  # a byte 0 by chance
LOG_OTHER_BYTE: Final = math.log(0.5 / 255)  # each other byte by chance
MOST_MESSAGES: Final = 16  # the last ones
REPEAT_EXPONENT: Final = 0.6  # k different messages count k**REPEAT_EXPONENT times as much as one
UNFORESEEN: Final = 0.02  # the share of values that these rules do not foresee
LOG_NEVER: Final = -math.inf
ORDER_RATIO: Final = 8.0  # a number is evidence for the byte order in which it is so many times smaller
FIRST_DAY, LAST_DAY = 7305, 47482  # 1990-01-01 and 2100-01-01 since 1970
NEAR_DAYS: Final = (10_957, 25_568)  # 2000 to 2039

# Shares of numbers: 0, all ones, anything, of a few bits, of any size; below, of negative ones.
NUMBER_SHARES: Final = (0.12, 0.01, 0.08, 0.5, 0.29)
NEGATIVE_SHARE: Final = 0.2
FEW_BITS: Final = 16
# REAL: decades from, to, and their share; `DIGITS`: the share of each count of digits, and of any digits.
REAL_DECADES: Final = ((-3, 7, 0.85), (-7, -3, 0.06), (7, 12, 0.04), (-30, -7, 0.0002), (12, 30, 0.0002))
REAL_ZERO: Final = 0.08
MINUS_ZERO: Final = 0.0005  # a result of rounding
DIGITS: Final = {4: (0.12, 6, 0.25), 8: (0.07, 12, 0.12)}  # by size: each count, the most digits, any digits
MANTISSA_BITS: Final = {4: 23, 8: 52}
FORMER_REAL_SHARE: Final = 0.04  # LREALs converted from a REAL
# A byte of padding is 0 or, rarely, rubbish. Many zeros in a row count as one fact.
GAP_BYTE_POINTS: Final = (0.6, 0.05, -2.8)  # each of the first four, each more, rubbish
MOST_TEXT_POINTS: Final = 12.0  # of the letters: a long text counts as one fact
BITS_OFF_SHARES: Final = (0.3, 0.25)  # all BOOLs of a byte FALSE: a base, plus more the fewer they are


def log_chance(raw: bytes) -> float:
    """Return the logarithm of the likelihood of the bytes by chance."""
    zeros = raw.count(0)
    return zeros * ZERO + (len(raw) - zeros) * LOG_OTHER_BYTE


def repeated_zero_points(type_: LeafType, parts: Collection[bytes]) -> float:
    """Return the correction for number bytes that are 0 in every message: repeats are weak evidence."""
    if isinstance(type_, StringType):
        return 0.0
    share: float = len(parts) ** REPEAT_EXPONENT
    return ZERO * (share - 1) * sum(not any(column) for column in zip(*parts, strict=True))


def leaf_evidence(leaf: Leaf, raw: bytes, rules: LayoutRules) -> LeafEvidence | None:
    """Return the evidence of the bytes of a leaf, or None for a bit, a pointer or a type without rules."""
    if leaf.bit is not None or isinstance(leaf.type, Pointer):
        return None
    if isinstance(leaf.type, StringType):
        return _evidence(
            (_judge_header_text if rules.text.header else _judge_nul_text)(leaf.type, raw, rules), raw
        )
    row = rules.storage(leaf.type)
    if row.code.endswith("s") or row.name == "S5TIME":
        return _evidence(_judge_bcd(leaf, row, raw), raw)
    judge = _judge_integer if isinstance(leaf.type, Enumeration | Subrange) else JUDGE_BY_KIND.get(row.kind)
    if judge is None:
        return None
    if row.kind not in COUNT_KINDS:
        return _evidence(judge(leaf, row, raw, _order(rules)), raw)
    return _judge_number(leaf, row, raw, _order(rules), judge)


def value_bytes(leaf: Leaf, raw: bytes, rules: LayoutRules) -> bytes:
    """Return the bytes of a leaf that make its value. For a text these are the bytes up to its end."""
    if not isinstance(leaf.type, StringType):
        return raw
    unit = 2 if leaf.type.wide else 1
    if rules.text.header:
        return raw[: unit * (2 + int.from_bytes(raw[unit : 2 * unit], _order(rules)))]
    return raw[: next((at for at in range(0, len(raw), unit) if not any(raw[at : at + unit])), len(raw))]


def bits_evidence(used: int, raw: bytes) -> LeafEvidence:
    """Return the evidence of a byte whose first `used` bits are BOOLs."""
    if raw[0] >> used:
        return _evidence((LOG_NEVER, f"unused bits are set: 16#{raw[0]:02X}"), raw)
    off = BITS_OFF_SHARES[0] + BITS_OFF_SHARES[1] / used
    likely = off if not raw[0] else (1 - off) / ((1 << used) - 1)
    return _evidence((math.log(likely), "unused bits are 0" if used < 8 else "BOOLs"), raw)


def gap_points(raw: bytes) -> float:
    first, more, rubbish = GAP_BYTE_POINTS
    return rubbish if any(raw) else first * min(len(raw), 4) + more * max(len(raw) - 4, 0)


def judge_change(leaf: Leaf, before: bytes, after: bytes, rules: LayoutRules) -> tuple[float, str]:
    """Return points (0: no evidence) and words for a change of a REAL or of a number that is not round."""
    if isinstance(leaf.type, StringType | Pointer | Enumeration) or leaf.bit is not None:
        return 0.0, ""
    row = rules.storage(leaf.type)
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
        return 0.5, f"goes from {_format_number(a)} to {_format_number(b)}: steady"
    is_jump = not 1e-6 < abs(a / b) < 1e6 or (row.size > 2 and row.kind is not ValueKind.REAL and a * b < 0)
    return (-1.0, f"jumps from {_format_number(a)} to {_format_number(b)}") if is_jump else (0.0, "")


# -- from likelihood to points -----------------------------------------------------------------------------


def _to_points(likely: float, raw: bytes) -> float:
    more = likely - log_chance(raw)
    if more > 30:  # UNFORESEEN no longer matters, and `exp` could overflow
        return more
    return (
        math.log(UNFORESEEN + (1 - UNFORESEEN) * math.exp(more)) if more > LOG_NEVER else math.log(UNFORESEEN)
    )


def _evidence(found: _Likelihood, raw: bytes) -> LeafEvidence:
    points = _to_points(found[0], raw)
    return LeafEvidence(points, found[1], points, is_odd=found[0] == LOG_NEVER)


def _judge_number(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder, judge: _Judge) -> LeafEvidence:
    """Return the evidence of a number. For a number round in some byte order, `order` is 0."""
    likely, why = judge(leaf, row, raw, order)
    points = _to_points(likely, raw)
    ways = {raw, raw[::-1], exchange_in_pairs(raw), exchange_words(raw)}
    fair = max(_to_points(judge(leaf, row, way, order)[0], way) for way in ways)
    if isinstance(leaf.type, Enumeration | Subrange):
        fair = max(fair, 0.0)
    is_plain = raw[0 if order == "little" else -1] not in (0, 255)
    found = LeafEvidence(points, why, fair, 0.0, is_plain, likely == LOG_NEVER)
    if _is_round(raw) or row.kind is ValueKind.BITS:
        return found
    is_signed = row.code.islower()
    here = abs(int.from_bytes(raw, order, signed=is_signed))
    there = abs(int.from_bytes(raw[::-1], order, signed=is_signed))
    if max(here, there) < ORDER_RATIO * min(here, there):
        return found
    swapped = _to_points(judge(leaf, row, raw[::-1], order)[0], raw)
    return found._replace(order=points - swapped)


def _is_round(raw: bytes) -> bool:
    """Return whether a number, in some byte order, is a multiple of 256, or one less than that."""
    return 0 in raw or 255 in raw


def exchange_in_pairs(raw: bytes) -> bytes:
    """Return the bytes with the two bytes of each 16 bits exchanged: BADC."""
    out = bytearray(raw)
    even = len(raw) & ~1
    out[:even:2], out[1:even:2] = raw[1:even:2], raw[:even:2]
    return bytes(out)


def exchange_words(raw: bytes) -> bytes:
    """Return the 16-bit words in reverse order, as CDAB or GHEFCDAB. An odd last byte stays."""
    end = len(raw) & ~1
    return b"".join(raw[at : at + 2] for at in range(end - 2, -1, -2)) + raw[end:]


# -- the likelihood of values --------------------------------------------------------------------------------


def _judge_integer(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    match leaf.type:
        case Enumeration(values=values) if any(number is not None for _, number in values):
            number = int.from_bytes(raw, order, signed=row.code.islower())
            named = [known for _, known in values if known is not None]
            is_named = number in named
            likely = math.log(1 / len(named)) if is_named else LOG_NEVER
            return likely, "a named value" if is_named else "a value without a name"
        case Subrange(low=low, high=high):
            number = int.from_bytes(raw, order, signed=row.code.islower())
            if low <= number <= high:
                inside = 1 / (high - low + 1)
                return math.log(0.5 * inside + 0.5 * _score_number(number, raw, inside)), "within its range"
            return LOG_NEVER, f"not {low}..{high}"
    number = int.from_bytes(raw, order, signed=row.code.islower())
    likely = math.log(_score_number(number, raw, 2.0 ** (-8 * len(raw))))
    swapped = int.from_bytes(raw[::-1], order, signed=row.code.islower())
    if not number:
        return likely, "zero"
    if abs(number) * ORDER_RATIO <= abs(swapped):
        return likely, f"small; {swapped} with bytes swapped"
    return likely, f"large; {swapped} with bytes swapped" if abs(swapped) * ORDER_RATIO <= abs(
        number
    ) else "a number"


def _score_number(number: int, raw: bytes, any_of_them: float) -> float:
    zero, ones, anything, few, free = NUMBER_SHARES
    if not number:
        return zero
    size, bits = abs(number), 8 * len(raw)
    of_this_sign = NEGATIVE_SHARE if number < 0 else 1 - NEGATIVE_SHARE
    # Every count of binary digits is equally likely (0.6931 is ln 2); + 3 flattens the smallest numbers.
    likely = anything * any_of_them + free * of_this_sign / ((size + 3) * 0.6931 * (bits - 1))
    if size < 1 << FEW_BITS:
        likely += few * of_this_sign / ((size + 3) * 0.6931 * (min(bits, FEW_BITS) - 2))
    return likely + (ones if raw.count(255) == len(raw) else 0)


def _judge_duration(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    """Judge a duration: most are whole seconds or milliseconds."""
    count, bits = int.from_bytes(raw, order, signed=row.code.islower()), 2.0 ** (-8 * len(raw))
    likely = 0.0
    for step, share in ((SECOND, 0.3), (100 * MS, 0.3), (MS, 0.3), (row.unit_ns or MS, 0.1)):
        per = max(step // (row.unit_ns or MS), 1)
        likely += share * _score_number(count // per, raw, bits) if not count % per else 0.0
    return math.log(likely), _judge_integer(leaf, row, raw, order)[1]


def _judge_bits(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    number = int.from_bytes(raw, order)
    likely = 0.3 * _score_number(number, raw, 2.0 ** (-8 * len(raw))) + 0.7 * math.exp(log_chance(raw))
    return math.log(likely), "bits"


def _judge_bool(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    if raw[0] > 1:
        return LOG_NEVER, f"16#{raw[0]:02X} is not 0 or 1"
    return math.log(0.45 if raw[0] else 0.55), "0 or 1"


def _judge_real(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    size = len(raw)
    name = "REAL" if size == 4 else "LREAL"
    code = ("<" if order == "little" else ">") + ("f" if size == 4 else "d")
    (number,) = struct.unpack(code, raw)
    if number == 0:
        return (math.log(REAL_ZERO), "zero") if not any(raw) else (math.log(MINUS_ZERO), "minus zero")
    if not math.isfinite(number):
        return LOG_NEVER, f"no sensible {name}"
    decade = math.log10(abs(number))
    share = next((share / (high - low) for low, high, share in REAL_DECADES if low <= decade < high), 0.0)
    if not share:
        return LOG_NEVER, f"no sensible {name}"
    each, most, any_digits = DIGITS[size]
    mantissas = 3.32 * 2.0 ** MANTISSA_BITS[size]  # of a decade, which has 3.32 powers of two
    likely = any_digits / mantissas
    if size == 8 and not any(raw[:3] if order == "little" else raw[-3:]):
        likely += FORMER_REAL_SHARE / (3.32 * 2.0**23)
    digits = len(real_text(number, size).lstrip("-").partition("e")[0].replace(".", "").strip("0"))
    if digits <= most:
        likely += each / (9 * 10.0 ** (digits - 1))
    likely *= share * (NEGATIVE_SHARE if number < 0 else 1 - NEGATIVE_SHARE)
    usual = "a sensible" if share > 0.01 else "an unusual"
    return math.log(likely), f"{usual} {name}" + (" of few digits" if digits <= most - 1 else "")


def _judge_date(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    count = int.from_bytes(raw, order, signed=row.code.islower())
    if not count:
        return math.log(0.05), "zero"
    unit, epoch = row.unit_ns, row.epoch_ns
    at = count * unit + epoch
    day = at // DAY
    if not FIRST_DAY <= day < LAST_DAY:
        return LOG_NEVER, "no date of our time"
    near = NEAR_DAYS[0] <= day < NEAR_DAYS[1]
    days = (NEAR_DAYS[1] - NEAR_DAYS[0]) if near else (LAST_DAY - FIRST_DAY)
    steps = ((DAY, 0.9 if row.kind is ValueKind.DATE else 0.1), (SECOND, 0.3), (MS, 0.2), (unit, 0.1))
    likely = sum(share / max(DAY // max(step, unit), 1) for step, share in steps if at % max(step, unit) == 0)
    return math.log(likely * (0.85 if near else 0.1) / days), "a date of our time"


def _judge_time_of_day(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    unit = row.unit_ns
    at = int.from_bytes(raw, order) * unit
    if at >= DAY:
        return LOG_NEVER, "more than 24 hours"
    steps = ((DAY, 0.05), (60 * SECOND, 0.05), (SECOND, 0.3), (MS, 0.3), (unit, 0.3))
    return math.log(sum(share / (DAY // max(s, unit)) for s, share in steps if at % max(s, unit) == 0)), (
        "below 24 hours"
    )


def _judge_character(leaf: Leaf, row: Elementary, raw: bytes, order: _ByteOrder) -> _Likelihood:
    code = int.from_bytes(raw, order)
    if not code:
        return math.log(0.1), "no character"
    likely = _score_letter(code)
    return likely, "a character" if likely > -6 else "an unusual character"


def _judge_bcd(leaf: Leaf, row: Elementary, raw: bytes) -> _Likelihood:
    """Judge dates digit by digit: BCD, DTL, S5TIME."""
    if not any(raw):
        return math.log(0.1), "zero"
    if leaf.coding.odd and leaf.coding.odd(raw):
        return LOG_NEVER, f"no {row.name}"
    span = {2: 4000.0, 8: 3.4e12, 12: 3.4e12 * 1e3}.get(len(raw), 1e12)
    return math.log(0.9 / span), "valid"


def _judge_header_text(type_: StringType, raw: bytes, rules: LayoutRules) -> _Likelihood:
    unit = 2 if type_.wide else 1
    longest, actual = (int.from_bytes(raw[at : at + unit], _order(rules)) for at in range(0, 2 * unit, unit))
    declared = rules.text.length(type_)
    if not any(raw):
        return math.log(0.08) + _rest_likelihood(raw, 0), "empty, without a header"
    if longest != declared:
        return LOG_NEVER, f"its header says at most {longest} characters, the type has {declared}"
    text = f"its header says {actual} of at most {longest} characters"
    if actual > longest:
        return LOG_NEVER, text
    likely = math.log(0.9 * _score_length(actual, declared))
    likely += _score_letters(raw[2 * unit : (2 + actual) * unit], unit, rules)
    return likely + _rest_likelihood(raw, (2 + actual) * unit), text


def _judge_nul_text(type_: StringType, raw: bytes, rules: LayoutRules) -> _Likelihood:
    unit = 2 if type_.wide else 1
    if not any(raw):
        return math.log(0.1) + _rest_likelihood(raw, 0), "empty"
    ends = next((at for at in range(0, len(raw) - unit + 1, unit) if not any(raw[at : at + unit])), None)
    if ends is None:
        return LOG_NEVER, "no NUL"
    if not ends:
        return math.log(0.03) + unit * ZERO + _rest_likelihood(raw, unit), "empty, with bytes after the NUL"
    length, declared = ends // unit, rules.text.length(type_)
    if length > declared:
        return LOG_NEVER, f"{length} characters, the type has {declared}"
    likely = math.log(0.9 * _score_length(length, declared)) + _score_letters(raw[:ends], unit, rules)
    return likely + _rest_likelihood(raw, ends + unit), f"{length} characters and a NUL"


def _score_length(actual: int, declared: int) -> float:
    return (0.1 if not actual else 0) + 0.9 / (declared + 1)


def _rest_likelihood(raw: bytes, start: int) -> float:
    """Return the likelihood of the bytes after a text as zeros or as the rest of an older text."""
    rest = raw[start:]
    return log_chance(rest) + (min(GAP_BYTE_POINTS[0] * len(rest), 2.4) if not any(rest) else -0.7)


def _score_letters(raw: bytes, unit: int, rules: LayoutRules) -> float:
    order = _order(rules)
    codes = [int.from_bytes(raw[at : at + unit], order) for at in range(0, len(raw), unit)]
    gains = [
        _score_letter(code) - log_chance(raw[at * unit : (at + 1) * unit]) for at, code in enumerate(codes)
    ]
    if any(code < 0x20 and code not in (9, 10, 13) for code in codes):
        return LOG_NEVER  # machines send no control codes in a text
    good = min(sum(gain for gain in gains if gain > 0), MOST_TEXT_POINTS)
    return log_chance(raw) + good + sum(gain for gain in gains if gain < 0)


USUAL: Final = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 -_./:#,")


def _score_letter(code: int) -> float:
    if code in USUAL:
        return LETTERS[0]
    if code < 0x7F:
        return LETTERS[1] if code >= 0x20 or code in (9, 10, 13) else LETTERS[3]
    return LETTERS[2] if 0xA0 <= code < 0x180 else LETTERS[3] if code < 256 else LETTERS[4]


# Usual letters, other ASCII, European letters, control codes, any script.
LETTERS: Final = tuple(map(math.log, (0.9 / len(USUAL), 0.05 / 30, 0.04 / 200, 0.002 / 60, 0.008 / 60_000)))

_Judge = Callable[[Leaf, Elementary, bytes, _ByteOrder], _Likelihood]
JUDGE_BY_KIND: Final[dict[ValueKind, _Judge]] = {
    ValueKind.BOOL: _judge_bool,
    ValueKind.REAL: _judge_real,
    ValueKind.INTEGER: _judge_integer,
    ValueKind.BITS: _judge_bits,
    ValueKind.DURATION: _judge_duration,
    ValueKind.DATE: _judge_date,
    ValueKind.DATE_AND_TIME: _judge_date,
    ValueKind.TIME_OF_DAY: _judge_time_of_day,
    ValueKind.CHARACTER: _judge_character,
}
COUNT_KINDS: Final = (ValueKind.INTEGER, ValueKind.BITS, ValueKind.DURATION, ValueKind.TIME_OF_DAY)


def _order(rules: LayoutRules) -> _ByteOrder:
    return "little" if rules.byte_order == "little" else "big"


def _format_number(value: float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
