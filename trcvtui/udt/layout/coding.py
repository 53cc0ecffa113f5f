"""The coding of one leaf: its bytes to a value and back, for every type, with the texts and times of S7.

Rule: `to_value` never fails, whatever the bytes are. `to_raw` raises ValueRefused if a value does not fit.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from trcvtui.udt.layout.rules import BYTE_ORDERS, LayoutRules
from trcvtui.udt.literals import (
    EXPECTED,
    date_and_time_text,
    date_ns,
    format_duration,
    format_literal,
    parse_date_and_time,
    parse_duration,
    parse_integer,
    parse_literal,
    parse_s5time,
    to_date,
)
from trcvtui.udt.types import DAY, MS, SECOND, Elementary, Enumeration, LeafType, StringType, ValueKind

Value = bool | int | float | str


class ValueRefused(Exception):
    """A value that the type cannot hold; the text says what it can hold."""


class Coding(NamedTuple):
    """How a leaf is stored. `code` is for `struct`, without byte order. `to_value` is None for no change.

    `odd` describes odd bytes of the leaf, such as `16#05` for a BOOL. `odd` returns "" if nothing is odd.
    """

    code: str
    to_value: Callable[[Any], Value] | None
    to_raw: Callable[[object], Any]
    odd: Callable[[bytes], str] | None = None


def hex_text(raw: bytes) -> str:
    """Return bytes in memory order, such as `16#9912130706058881`."""
    return f"16#{raw.hex().upper()}"


def parse_hex_text(value: object, size: int) -> bytes | None:
    """Return the bytes of `16#...` if the text has all digits of `size` bytes, else None."""
    if not isinstance(value, str) or not value.startswith("16#") or len(value) != 3 + 2 * size:
        return None
    try:
        raw = bytes.fromhex(value[3:])
    except ValueError:
        return None
    return raw if len(raw) == size else None


# The bytes after a text may have any value; encode writes zeros. WSTRING is UTF-16 in the data's byte order.

# Bytes that are not text in the encoding become surrogates, which no text contains, and are written back.
ENCODING_ERRORS = {
    "latin-1": "strict",
    "utf-8": "surrogateescape",
    "utf-16-le": "surrogatepass",
    "utf-16-be": "surrogatepass",
}
SURROGATE = re.compile("[\ud800-\udfff]")  # a code that is not a character by itself


def _mark_odd_codes(coding: Coding, rules: LayoutRules, digits: int = 4) -> Coding:
    """Return a coding that also marks codes that are not characters, as `no text: 16#DC00 and 2 more`."""

    def describe_odd(raw: bytes) -> str:
        assert coding.to_value is not None
        (stored,) = struct.unpack(BYTE_ORDERS[rules.byte_order] + coding.code, raw)
        found = SURROGATE.findall(str(coding.to_value(stored)))
        own_mark = coding.odd(raw) if coding.odd else ""
        more = f" and {len(found) - 1} more" if found[1:] else ""
        mark = f"no text: 16#{f'{ord(found[0]):04X}'[-digits:]}{more}" if found else ""
        return ", ".join(filter(None, (own_mark, mark)))

    return coding._replace(odd=describe_odd)


def text_coding(type_: StringType, rules: LayoutRules) -> Coding:
    charset = "utf-8" if type_.utf8 else "latin-1"
    if type_.wide:
        charset = "utf-16-le" if rules.byte_order == "little" else "utf-16-be"
    coding = (_header_text_coding if rules.text.header else _nul_text_coding)(type_, rules, charset)
    return coding if charset == "latin-1" else _mark_odd_codes(coding, rules, 2 if type_.utf8 else 4)


def _header_text_coding(type_: StringType, rules: LayoutRules, charset: str) -> Coding:
    longest = rules.text.length(type_)
    lengths = struct.Struct(BYTE_ORDERS[rules.byte_order] + ("HH" if type_.wide else "BB"))
    unit = lengths.size // 2
    characters_of = _make_encoder(type_, longest, charset, has_nul=True)

    def to_value(raw: bytes) -> str:
        # The slice ends at the field even if the actual length is larger.
        actual: int = lengths.unpack_from(raw)[1]
        return raw[lengths.size :][: actual * unit].decode(charset, ENCODING_ERRORS[charset])

    def to_raw(value: object) -> bytes:
        characters = characters_of(value)
        return lengths.pack(longest, len(characters) // unit) + characters

    def describe_odd(raw: bytes) -> str:
        own, actual = lengths.unpack_from(raw)
        if actual > longest:
            return f"length {actual} > {longest}"
        return f"header: max {own}, not {longest}" if own != longest else ""

    return Coding(f"{rules.text.size(type_)}s", to_value, to_raw, describe_odd)


def _nul_text_coding(type_: StringType, rules: LayoutRules, charset: str) -> Coding:
    unit = 2 if type_.wide else 1
    longest = rules.text.length(type_)

    def to_value(raw: bytes) -> str:
        # Without a NUL the text ends at its longest length.
        return raw[: min(_find_end(raw, unit), longest * unit)].decode(charset, ENCODING_ERRORS[charset])

    def describe_odd(raw: bytes) -> str:
        end = _find_end(raw, unit)
        if end > longest * unit:
            return "no NUL" if end == len(raw) else f"length {end // unit} > {longest}"
        return ""

    to_raw = _make_encoder(type_, longest, charset, has_nul=False)
    return Coding(f"{rules.text.size(type_)}s", to_value, to_raw, describe_odd)


def _find_end(raw: bytes, unit: int) -> int:
    if unit == 1:
        end = raw.find(0)
    else:
        end = next((at for at in range(0, len(raw), 2) if not raw[at] and not raw[at + 1]), -1)
    return len(raw) if end < 0 else end


def _make_encoder(type_: StringType, longest: int, charset: str, has_nul: bool) -> Callable[[object], bytes]:
    unit = 2 if type_.wide else 1
    codes = "" if has_nul else ", none of code 0"
    if not (type_.wide or type_.utf8):
        codes = f", codes {0 if has_nul else 1} to 255"
    expected = f"text of at most {longest} {'bytes in UTF-8' if type_.utf8 else 'characters'}{codes}"

    def encode_checked(value: object) -> bytes:
        if not isinstance(value, str) or ("\0" in value and not has_nul):
            raise ValueRefused(expected)
        try:
            characters = value.encode(charset, ENCODING_ERRORS[charset])
        except UnicodeEncodeError:
            raise ValueRefused(expected) from None
        if len(characters) > longest * unit:
            raise ValueRefused(expected)
        return characters

    return encode_checked


# Bytes that are not a date or time are shown as hex, and encode accepts that hex: nothing is lost.

FIRST_BCD_YEAR, LAST_BCD_YEAR = 1990, 2089
HOUR, MINUTE = 3600 * SECOND, 60 * SECOND


def _weekday(ns: int) -> int:
    """Return the day of the week as in S7: 1 is Sunday. 1 January 1970 was a Thursday, which is 5."""
    return (ns // DAY + 4) % 7 + 1


def _moment_ns(year: int, month: int, day: int, hour: int, minute: int, second: int, ns: int) -> int | None:
    """Return the nanoseconds since 1970; None if there is no such date or time of day."""
    date = date_ns(year, month, day)
    if date is None or hour > 23 or minute > 59 or second > 59 or ns >= SECOND:
        return None
    return date + hour * HOUR + minute * MINUTE + second * SECOND + ns


def _split_moment(ns: int) -> tuple[int, int, int, int, int, int, int]:
    """Return the arguments of `_moment_ns` for nanoseconds since 1970."""
    clock = ns % DAY
    return *to_date(ns // DAY), clock // HOUR, clock // MINUTE % 60, clock // SECOND % 60, clock % SECOND


# -- DATE_AND_TIME in BCD, and DTL ---------------------------------------------------------------------------


def _packed_date_coding(
    size: int,
    prefix: str,
    expected: str,
    read: Callable[[bytes], tuple[int | None, int]],
    bytes_of: Callable[[int], bytes | None],
) -> Coding:
    """Return the coding of a date. `read` returns ns since 1970 (None: no date) and the weekday."""

    def to_value(raw: bytes) -> Value:
        ns, _ = read(raw)
        return hex_text(raw) if ns is None else date_and_time_text(prefix, ns)

    def to_raw(value: object) -> bytes:
        raw = parse_hex_text(value, size)
        ns = parse_date_and_time(value) if raw is None and isinstance(value, str) else None
        raw = raw if ns is None else bytes_of(ns)
        if raw is None:
            raise ValueRefused(f"{expected}, or its {size} bytes as 16#...")
        return raw

    def describe_odd(raw: bytes) -> str:
        ns, weekday = read(raw)
        if ns is None:
            return "no date"
        return "" if weekday == _weekday(ns) else f"weekday {weekday}, not {_weekday(ns)}"

    return Coding(f"{size}s", to_value, to_raw, describe_odd)


def bcd_date_coding(_: LayoutRules) -> Coding:
    """Return DATE_AND_TIME of 8 bytes: YY MM DD hh mm ss, milliseconds in 3 digits, day of the week."""
    expected = "DT from DT#1990-01-01-00:00:00 to DT#2089-12-31-23:59:59.999"
    return _packed_date_coding(8, "DT#", expected, _parse_bcd_date, _format_bcd_date)


def _parse_bcd_date(raw: bytes) -> tuple[int | None, int]:
    digits = raw.hex()
    if not digits[:15].isdecimal():
        return None, 0
    year, month, day, hour, minute, second = (int(digits[at : at + 2]) for at in range(0, 12, 2))
    year += 1900 if year >= 90 else 2000  # STEP 7: 90 to 99 are 1990 to 1999
    return _moment_ns(year, month, day, hour, minute, second, int(digits[12:15]) * MS), raw[7] & 15


def _format_bcd_date(ns: int) -> bytes | None:
    year, month, day, hour, minute, second, rest = _split_moment(ns)
    if ns % MS or not FIRST_BCD_YEAR <= year <= LAST_BCD_YEAR:
        return None
    digits = f"{year % 100:02d}{month:02d}{day:02d}{hour:02d}{minute:02d}{second:02d}{rest // MS:03d}"
    return bytes.fromhex(f"{digits}{_weekday(ns)}")


def dtl_coding(rules: LayoutRules) -> Coding:
    """Return DTL of 12 bytes: year (UINT), month, day, weekday, hour, minute, second, ns (UDINT)."""
    fields = struct.Struct(BYTE_ORDERS[rules.byte_order] + "H6BI")

    def read(raw: bytes) -> tuple[int | None, int]:
        year, month, day, weekday, *clock = fields.unpack(raw)
        return _moment_ns(year, month, day, *clock), weekday

    def bytes_of(ns: int) -> bytes | None:
        year, month, day, *clock = _split_moment(ns)
        return fields.pack(year, month, day, _weekday(ns), *clock) if 0 <= year <= 0xFFFF else None

    return _packed_date_coding(12, "DTL#", "DTL such as DTL#2024-01-31-12:30:15.25", read, bytes_of)


# -- S5TIME --------------------------------------------------------------------------------------------------

S5_BASES_MS = (10, 100, 1000, 10_000)


def s5time_coding(rules: LayoutRules) -> Coding:
    """Return 2-byte S5TIME. Bits 0 to 11 are 3 BCD digits, 12 and 13 the time base, 14 and 15 unused."""
    order = BYTE_ORDERS[rules.byte_order]

    def to_value(raw: int) -> Value:
        ms = _s5_word_to_ms(raw)
        if ms is None:
            return f"16#{raw:04X}"
        # The word is not the usual one for this time: it follows in brackets, so that encode restores it.
        return format_duration(ms * MS, "S5T#") + ("" if _ms_to_s5_word(ms) == raw else f" (16#{raw:04X})")

    def to_raw(value: object) -> int:
        word = parse_hex_text(value, 2)
        if word is not None:
            return int.from_bytes(word, "big")
        text, _, beside = value.partition(" (") if isinstance(value, str) else ("", "", "")
        ns = parse_s5time(text)
        raw = None if ns is None or ns % MS else _ms_to_s5_word(ns // MS)
        if raw is not None and beside:
            word = parse_hex_text(beside.removesuffix(")"), 2) if beside.endswith(")") else None
            found = None if word is None else int.from_bytes(word, "big")
            raw = found if found is not None and _s5_word_to_ms(found) == _s5_word_to_ms(raw) else None
        if raw is None:
            raise ValueRefused(
                "S5TIME from S5T#0ms to S5T#2h46m30s (up to 999 times 10 ms, 100 ms, 1 s or 10 s), or 16#..."
            )
        return raw

    def describe_odd(raw: bytes) -> str:
        (word,) = struct.unpack(order + "H", raw)
        return "no S5TIME" if _s5_word_to_ms(word) is None else ""

    return Coding("H", to_value, to_raw, describe_odd)


def _s5_word_to_ms(raw: int) -> int | None:
    digits = f"{raw & 0xFFF:03x}"
    if not digits.isdecimal():
        return None
    return int(digits) * S5_BASES_MS[raw >> 12 & 3]


def _ms_to_s5_word(ms: int) -> int | None:
    """Return the word with the smallest time base that is exact, or None if no base fits."""
    for number, base in enumerate(S5_BASES_MS):
        if ms % base == 0 and 0 <= ms <= 999 * base:
            return number << 12 | int(str(ms // base), 16)
    return None


LARGEST_REAL = 3.4028235677973366e38  # from here on a number rounds beyond REAL (24 bits, 2**127)
BOOL_TEXTS = {"TRUE": True, "FALSE": False, "1": True, "0": False}


def coding_of(type_: LeafType, rules: LayoutRules) -> Coding:
    if isinstance(type_, StringType):
        return text_coding(type_, rules)
    row = rules.storage(type_)
    if isinstance(type_, Enumeration):
        return _enumeration_coding(type_, row)
    own = OWN_CODINGS.get((row.name, row.code))
    return own(rules) if own else CODING_BY_KIND[row.kind](row, rules)


def _bool_coding(row: Elementary, rules: LayoutRules) -> Coding:
    def to_raw(value: object) -> bool:
        if isinstance(value, str) and value.upper() in BOOL_TEXTS:
            return BOOL_TEXTS[value.upper()]
        if isinstance(value, int) and value in (0, 1):
            return bool(value)
        raise ValueRefused("true or false")

    def describe_odd(raw: bytes) -> str:
        return hex_text(raw) if raw[0] > 1 else ""

    return Coding(row.code, None, to_raw, None if row.name in rules.bits else describe_odd)


def _integer_coding(row: Elementary, _: LayoutRules | None = None) -> Coding:
    low, high = row.limits

    def to_raw(value: object) -> int:
        number = parse_integer(value) if isinstance(value, str) else value
        if not isinstance(number, int) or isinstance(number, bool) or not low <= number <= high:
            raise ValueRefused(f"{row.name}, a whole number from {low} to {high}")
        return number

    return Coding(row.code, None, to_raw)


def _real_coding(row: Elementary, _: LayoutRules) -> Coding:
    def to_raw(value: object) -> float:
        number = _to_float(value)
        if number is None or (row.size == 4 and LARGEST_REAL <= abs(number) < math.inf):
            raise ValueRefused(f"{row.name}, a number in its range, NaN, Infinity or -Infinity")
        return number

    return Coding(row.code, None, to_raw)


def _to_float(value: object) -> float | None:
    if not isinstance(value, int | float | str) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    # `1e400` is too large, not infinity: infinity must be named.
    is_named = not isinstance(value, str) or "inf" in value.lower()
    return number if is_named or not math.isinf(number) else None


def _character_coding(row: Elementary, rules: LayoutRules) -> Coding:
    highest = row.limits[1]

    def to_raw(value: object) -> int:
        if not isinstance(value, str) or len(value) != 1 or ord(value) > highest:
            raise ValueRefused(f"{row.name}, one character with a code from 0 to {highest}")
        return ord(value)

    coding = Coding(row.code, chr, to_raw)
    return _mark_odd_codes(coding, rules) if row.size > 1 else coding


def _literal_coding(row: Elementary, _: LayoutRules) -> Coding:
    return _count_coding(row, partial(format_literal, row), partial(parse_literal, row))


def _date_coding(row: Elementary, rules: LayoutRules) -> Coding:
    a_day = DAY // row.unit_ns

    def to_value(count: int) -> str:
        rest = count % a_day * row.unit_ns
        return format_literal(row, count) + (f" (and {format_duration(rest)})" if rest else "")

    return (
        _literal_coding(row, rules) if a_day == 1 else _count_coding(row, to_value, partial(_parse_day, row))
    )


def _count_coding(
    row: Elementary, to_value: Callable[[int], str], count_of: Callable[[str], int | None]
) -> Coding:
    low, high = row.limits

    def to_raw(value: object) -> int:
        count = count_of(value) if isinstance(value, str) else None
        if count is None or not low <= count <= high:
            raise ValueRefused(f"{row.name} from {to_value(low)} to {to_value(high)}, {EXPECTED[row.kind]}")
        return count

    return Coding(row.code, to_value, to_raw)


def _parse_day(row: Elementary, text: str) -> int | None:
    """Return the count of `D#1970-01-02 (and T#1s)`, or of the day alone, else None."""
    day, and_, rest = text.partition(" (and ")
    count = parse_literal(row, day)
    if count is None or not and_:
        return count
    ns = parse_duration(rest.removesuffix(")")) if rest.endswith(")") else None
    if ns is None or not 0 <= ns < DAY or ns % row.unit_ns:
        return None
    return count + ns // row.unit_ns


def _address_coding(row: Elementary, _: LayoutRules) -> Coding:
    whole = _integer_coding(row)

    def to_value(address: int) -> str:
        return f"16#{address:0{2 * row.size}X}"

    return Coding(row.code, to_value, whole.to_raw)


def _enumeration_coding(type_: Enumeration, row: Elementary) -> Coding:
    whole = _integer_coding(row)
    numbers = {name.casefold(): number for name, number in type_.values}

    def to_raw(value: object) -> object:
        number = numbers.get(value.casefold()) if isinstance(value, str) else None
        return whole.to_raw(value if number is None else number)

    return Coding(whole.code, None, to_raw)


CODING_BY_KIND: dict[ValueKind, Callable[[Elementary, LayoutRules], Coding]] = {
    ValueKind.BOOL: _bool_coding,
    ValueKind.INTEGER: _integer_coding,
    ValueKind.BITS: _integer_coding,
    ValueKind.REAL: _real_coding,
    ValueKind.CHARACTER: _character_coding,
    ValueKind.DURATION: _literal_coding,
    ValueKind.DATE: _date_coding,
    ValueKind.TIME_OF_DAY: _literal_coding,
    ValueKind.DATE_AND_TIME: _literal_coding,
    ValueKind.ADDRESS: _address_coding,
}
# By name and `struct` code: under other layouts the same name may be a plain count.
OWN_CODINGS: dict[tuple[str, str], Callable[[LayoutRules], Coding]] = {
    ("DT", "8s"): bcd_date_coding,
    ("DTL", "12s"): dtl_coding,
    ("S5TIME", "H"): s5time_coding,
}
