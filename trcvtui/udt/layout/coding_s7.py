"""What an S7 stores in its own way: DATE_AND_TIME in BCD, DTL, S5TIME (udt.md 2.2).

Bytes that are no such value are shown as hex, and that hex is taken back: nothing is lost on the way.
"""

from __future__ import annotations

import struct

from trcvtui.udt.layout.coded import Coding, Refused, Value, hex_text, parse_hex_text
from trcvtui.udt.layout.rules import BYTE_ORDERS, LayoutRules
from trcvtui.udt.literals import (
    calendar,
    date_and_time_text,
    date_ns,
    format_time,
    parse_date_and_time,
    parse_s5time,
)
from trcvtui.udt.types import DAY, MS, SECOND

FIRST_BCD_YEAR, LAST_BCD_YEAR = 1990, 2089
HOUR, MINUTE = 3600 * SECOND, 60 * SECOND
NO_DATE = " (no date)"


def _weekday(ns: int) -> int:
    """Return the day of the week as an S7 counts it: 1 is Sunday. 1970 began on a Thursday."""
    return (ns // DAY + 4) % 7 + 1


def _clock_ns(hour: int, minute: int, second: int, ns: int) -> int | None:
    """Return the nanoseconds since midnight; None when it is no time of day."""
    if hour > 23 or minute > 59 or second > 59 or ns >= SECOND:
        return None
    return hour * HOUR + minute * MINUTE + second * SECOND + ns


def _clock(ns: int) -> tuple[int, int, int, int]:
    ns %= DAY
    return ns // HOUR, ns // MINUTE % 60, ns // SECOND % 60, ns % SECOND


# -- DATE_AND_TIME in BCD ------------------------------------------------------------------------------------


def bcd_coding(_: LayoutRules) -> Coding:
    """Return DATE_AND_TIME of 8 bytes: YY MM DD hh mm ss, milliseconds in 3 digits, day of the week."""

    def to_value(raw: bytes) -> Value:
        ns = _bcd_ns(raw)
        return hex_text(raw) if ns is None else date_and_time_text("DT#", ns)

    def to_raw(value: object) -> bytes:
        raw = parse_hex_text(value, 8)
        ns = parse_date_and_time(value) if raw is None and isinstance(value, str) else None
        if raw is None and (ns is None or ns % MS or not _is_bcd_year(ns)):
            raise Refused(
                "DT from DT#1990-01-01-00:00:00 to DT#2089-12-31-23:59:59.999, or its 8 bytes as 16#..."
            )
        return _bcd(ns) if ns is not None else raw or b""

    def odd(raw: bytes) -> str:
        ns = _bcd_ns(raw)
        return NO_DATE if ns is None else _odd_weekday(raw[7] & 15, ns)

    return Coding("8s", to_value, to_raw, odd)


def _is_bcd_year(ns: int) -> bool:
    return FIRST_BCD_YEAR <= calendar(ns // DAY)[0] <= LAST_BCD_YEAR


def _bcd_ns(raw: bytes) -> int | None:
    digits = raw.hex()
    if not digits[:15].isdecimal():
        return None
    year, month, day, hour, minute, second = (int(digits[at : at + 2]) for at in range(0, 12, 2))
    date = date_ns(year + (1900 if year >= 90 else 2000), month, day)
    clock = _clock_ns(hour, minute, second, int(digits[12:15]) * MS)
    return None if date is None or clock is None else date + clock


def _bcd(ns: int) -> bytes:
    year, month, day = calendar(ns // DAY)
    hour, minute, second, rest = _clock(ns)
    digits = f"{year % 100:02d}{month:02d}{day:02d}{hour:02d}{minute:02d}{second:02d}{rest // MS:03d}"
    return bytes.fromhex(f"{digits}{_weekday(ns)}")


def _odd_weekday(found: int, ns: int) -> str:
    return "" if found == _weekday(ns) else f" (weekday {found}, not {_weekday(ns)})"


# -- DTL -----------------------------------------------------------------------------------------------------


def dtl_coding(rules: LayoutRules) -> Coding:
    """Return DTL of 12 bytes: UINT year, month, day, weekday, hour, minute, second, UDINT nanoseconds."""
    fields = struct.Struct(BYTE_ORDERS[rules.byte_order] + "H6BI")

    def ns_of(raw: bytes) -> int | None:
        year, month, day, _, hour, minute, second, rest = fields.unpack(raw)
        date, clock = date_ns(year, month, day), _clock_ns(hour, minute, second, rest)
        return None if date is None or clock is None else date + clock

    def to_value(raw: bytes) -> Value:
        ns = ns_of(raw)
        return hex_text(raw) if ns is None else date_and_time_text("DTL#", ns)

    def to_raw(value: object) -> bytes:
        raw = parse_hex_text(value, 12)
        if raw is not None:
            return raw
        ns = parse_date_and_time(value) if isinstance(value, str) else None
        year, month, day = (-1, 0, 0) if ns is None else calendar(ns // DAY)
        if ns is None or not 0 <= year <= 0xFFFF:
            raise Refused("DTL such as DTL#2024-01-31-12:30:15.25, or its 12 bytes as 16#...")
        hour, minute, second, rest = _clock(ns)
        return fields.pack(year, month, day, _weekday(ns), hour, minute, second, rest)

    def odd(raw: bytes) -> str:
        ns = ns_of(raw)
        return NO_DATE if ns is None else _odd_weekday(raw[4], ns)

    return Coding("12s", to_value, to_raw, odd)


# -- S5TIME --------------------------------------------------------------------------------------------------

BASES_MS = (10, 100, 1000, 10_000)


def s5time_coding(rules: LayoutRules) -> Coding:
    """Return S5TIME of 2 bytes: the time base in bits 12 and 13, three digits in BCD below.

    Bits 14 and 15 say nothing.
    """
    order = BYTE_ORDERS[rules.byte_order]

    def to_value(raw: int) -> Value:
        ms = _s5_ms(raw)
        if ms is None:
            return f"16#{raw:04X}"
        # Another time base, or bits that say nothing: the word stands beside, so that it comes back.
        return format_time(ms * MS, "S5T#") + ("" if _s5(ms) == raw else f" (16#{raw:04X})")

    def to_raw(value: object) -> int:
        word = parse_hex_text(value, 2)
        if word is not None:
            return int.from_bytes(word, "big")
        text, _, beside = value.partition(" (") if isinstance(value, str) else ("", "", "")
        ns = parse_s5time(text)
        raw = None if ns is None or ns % MS else _s5(ns // MS)
        word = parse_hex_text(beside.removesuffix(")"), 2)
        if raw is not None and beside:
            found = None if word is None else int.from_bytes(word, "big")
            is_same = found is not None and ns is not None and _s5_ms(found) == ns // MS
            raw = found if is_same and beside.endswith(")") else None
        if raw is None:
            raise Refused(
                "S5TIME from S5T#0ms to S5T#2h46m30s, three digits of 10 ms, 100 ms, 1 s or 10 s, or 16#..."
            )
        return raw

    def odd(raw: bytes) -> str:
        (word,) = struct.unpack(order + "H", raw)
        return " (no S5TIME)" if _s5_ms(word) is None else ""

    return Coding("H", to_value, to_raw, odd)


def _s5_ms(raw: int) -> int | None:
    digits = f"{raw & 0xFFF:03x}"
    if not digits.isdecimal():
        return None
    return int(digits) * BASES_MS[raw >> 12 & 3]


def _s5(ms: int) -> int | None:
    """Return the word with the smallest time base that holds it exactly; None when there is none."""
    for number, base in enumerate(BASES_MS):
        if ms % base == 0 and 0 <= ms <= 999 * base:
            return number << 12 | int(str(ms // base), 16)
    return None
