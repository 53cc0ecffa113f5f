"""IEC names and literals, read and written: durations, dates, times of day and whole numbers.

Rule: times are whole nanoseconds, never floats, so every stored count is read back exactly.
"""

from __future__ import annotations

import re
from typing import Final

from trcvtui.errors import mistake
from trcvtui.udt.types import DAY, ELEMENTARY, MS, SECOND, WHOLE_KINDS, Elementary, ValueKind

# `\w` has no combining marks (Hindi vowels, Thai tones, decomposed accents). The ranges leave out the
# bidirectional and zero-width characters and the spaces between them.
_COMBINING_MARKS: Final = (
    r"\u0300-\u036f\u0483-\u0489\u0591-\u05bd\u05bf\u05c1\u05c2\u05c4\u05c5\u05c7\u0610-\u061a\u064b-\u065f"
    r"\u0670\u06d6-\u06dc\u06df-\u06e4\u0711-\u074a\u07a6-\u07b0\u0900-\u0963\u0981-\u09e3\u0a01-\u0a51"
    r"\u0a81-\u0ae3\u0b01-\u0b63\u0b82-\u0bcd\u0c00-\u0c63\u0c81-\u0ce3\u0d00-\u0d63\u0d81-\u0df3"
    r"\u0e31-\u0e3a\u0e47-\u0e4e\u0eb1-\u0ebc\u0ec8-\u0ece\u0f18-\u0fbc\u102b-\u103e\u1056-\u109d"
    r"\u17b4-\u17d3\u1ab0-\u1aff\u1b00-\u1b44\u1dc0-\u1dff\u20d0-\u20f0\u302a-\u302f\u3099\u309a"
)
NAME_PATTERN: Final = rf"[^\W\d][\w{_COMBINING_MARKS}]*"


# IEC 61131-3 table 8: largest first, each at most once.
UNIT_NS = {"d": DAY, "h": 3600 * SECOND, "m": 60 * SECOND, "s": SECOND, "ms": MS, "us": 1000, "ns": 1}
PREFIXES = {name: f"{name}#" for name in ("LTIME", "LDATE", "TOD", "LTOD", "DT", "LDT")}
PREFIXES |= {"TIME": "T#", "DATE": "D#"}
EXPECTED = {
    ValueKind.DURATION: "a duration such as T#1s500ms",
    ValueKind.DATE: "a date such as D#2024-01-31",
    ValueKind.TIME_OF_DAY: "a time of day such as TOD#12:30:15.250",
    ValueKind.DATE_AND_TIME: "a date and time such as DT#2024-01-31-12:30:15",
}

_LONGEST_LITERAL = 64  # characters; a longer text is refused without a look at it

# Patterns stay text: `re` compiles and caches those in use, so an import compiles none.
_DURATION_PART = r"(?ai)(\d{1,20})(?:\.(\d{1,9}))?(ms|us|ns|d|h|m|s)_?"
_DURATION = r"(?ai)(?:T|TIME|LT|LTIME)#(-?)((?:[\d.]+[a-z]+_?)+)"
_S5TIME = r"(?ai)S5T(?:IME)?#(.*)"
_DAY_PART = r"(\d{4,20})-(\d{1,2})-(\d{1,2})"
_CLOCK_PART = r"(\d{1,20}):(\d{1,2})(?::(\d{1,2})(?:\.(\d{1,9}))?)?"
_DATE = r"(?ai)(?:D|DATE|LD|LDATE)#" + _DAY_PART
_CLOCK = r"(?ai)(?:TOD|TIME_OF_DAY|LTOD|LTIME_OF_DAY)#" + _CLOCK_PART
_DATE_CLOCK = rf"(?ai)(?:DT|DATE_AND_TIME|LDT|LDATE_AND_TIME|DATE_AND_LTIME|DTL)#{_DAY_PART}-{_CLOCK_PART}"
_INTEGER = r"(?ai)(?:([a-z]+)#)?([+-]?)(?:(2|8|16)#)?([0-9a-f]+(?:_[0-9a-f]+)*)"


def quote_text(text: str, mark: str = "'", digits: int = 2) -> str:
    """Return a text in IEC quotes. Control codes, codes 127 to 255 and `*` in `(*` and `*)` become $hh."""
    coded = []
    for one in text:
        is_code = ord(one) < 0x20 or 0x7F <= ord(one) <= 0xFF or 0xD800 <= ord(one) <= 0xDFFF
        code = f"${ord(one) % 16**digits:0{digits}X}" if is_code else one
        coded.append(f"${one}" if one in f"${mark}" else code)
    star = f"${ord('*'):0{digits}X}"
    return mark + "".join(coded).replace("(*", f"({star}").replace("*)", f"{star})") + mark


def parse_time(text: str, where: str = "duration") -> int:
    """Return the nanoseconds of an IEC duration such as `T#1s500ms`; raise UserError for anything else."""
    ns = parse_duration(text)
    if ns is None:
        shown = f"'{text}'" if len(text) <= _LONGEST_LITERAL else f"'{text[:_LONGEST_LITERAL]}...'"
        raise mistake(where, shown, EXPECTED[ValueKind.DURATION])
    return ns


def format_duration(ns: int, prefix: str = "T#") -> str:
    """Return nanoseconds as an IEC duration, largest unit first: 1_500_000_000 is `T#1s500ms`."""
    parts = []
    rest = abs(ns)
    for unit, size in UNIT_NS.items():
        count, rest = divmod(rest, size)
        if count:
            parts.append(f"{count}{unit}")
    return f"{prefix}{'-' if ns < 0 else ''}{''.join(parts) or '0ms'}"


def format_literal(row: Elementary, count: int) -> str:
    """Return the literal of a TIME-like type for its stored count, such as `TOD#12:30:15.25`."""
    prefix = PREFIXES[row.name]
    ns = count * row.unit_ns + row.epoch_ns
    match row.kind:
        case ValueKind.DURATION:
            return format_duration(ns, prefix)
        case ValueKind.DATE:
            return prefix + _date_text(ns // DAY)
        case ValueKind.TIME_OF_DAY:
            return prefix + _clock_text(ns)
        case _:
            return date_and_time_text(prefix, ns)


def date_and_time_text(prefix: str, ns: int) -> str:
    """Return nanoseconds since 1970 as the literal of a date and time."""
    return f"{prefix}{_date_text(ns // DAY)}-{_clock_text(ns % DAY)}"


def parse_literal(row: Elementary, text: str) -> int | None:
    """Return the count that a TIME-like type stores for a literal; None if it is no literal of the type."""
    ns = _LITERAL_PARSERS[row.kind](text)
    if ns is None or (ns - row.epoch_ns) % row.unit_ns:
        return None
    return (ns - row.epoch_ns) // row.unit_ns


def parse_s5time(text: str) -> int | None:
    """Return the nanoseconds of `S5T#1s500ms` or of a TIME literal, else None."""
    found = _match_literal(_S5TIME, text)
    return parse_duration(f"T#{found[1]}" if found else text)


def parse_integer(text: str) -> int | None:
    """Return the number of an IEC integer literal (`-5`, `16#FF`, `1_000`, `INT#5`), else None."""
    found = _match_literal(_INTEGER, text)
    if found is None:
        return None
    type_name, sign, base, digits = found.groups()
    row = ELEMENTARY.get((type_name or "INT").upper())
    if row is None or row.kind not in WHOLE_KINDS:
        return None
    try:
        number = int(digits, int(base or 10))
    except ValueError:
        return None
    return -number if sign == "-" else number


def _match_literal(pattern: str, text: str) -> re.Match[str] | None:
    return re.fullmatch(pattern, text.strip()) if len(text) <= _LONGEST_LITERAL else None


def parse_duration(text: str) -> int | None:
    """Return the nanoseconds of an IEC duration such as `T#1s500ms`, else None."""
    found = _match_literal(_DURATION, text)
    if found is None:
        return None
    sign, parts = found.group(1), found.group(2).lower()
    ns, at, ceiling = 0, 0, DAY + 1
    while at < len(parts):
        part = re.match(_DURATION_PART, parts[at:])
        if part is None or UNIT_NS[part.group(3)] >= ceiling:  # units descend, each at most once
            return None
        whole, fraction, unit = part.groups()
        ceiling, at = UNIT_NS[unit], at + part.end()
        ns += int(whole) * ceiling
        if fraction:
            # Only the last part may have a fraction, and it must be whole nanoseconds.
            small, rest = divmod(int(fraction) * ceiling, 10 ** len(fraction))
            if rest or at < len(parts):
                return None
            ns += small
    if parts.endswith("_"):
        return None
    return -ns if sign else ns


def _parse_date(text: str) -> int | None:
    found = _match_literal(_DATE, text)
    return None if found is None else date_ns(*map(int, found.groups()))


def _parse_clock(text: str) -> int | None:
    found = _match_literal(_CLOCK, text)
    return None if found is None else _clock_ns(*found.groups())


def parse_date_and_time(text: str) -> int | None:
    """Return the nanoseconds since 1970 of a literal such as `DTL#2024-01-31-12:30:15`, else None."""
    found = _match_literal(_DATE_CLOCK, text)
    if found is None:
        return None
    day, clock = date_ns(*map(int, found.groups()[:3])), _clock_ns(*found.groups()[3:])
    return None if day is None or clock is None or clock >= DAY else day + clock


_LITERAL_PARSERS = {
    ValueKind.DURATION: parse_duration,
    ValueKind.DATE: _parse_date,
    ValueKind.TIME_OF_DAY: _parse_clock,
    ValueKind.DATE_AND_TIME: parse_date_and_time,
}


def _clock_ns(hour: str, minute: str, second: str | None, fraction: str | None) -> int | None:
    if int(minute) > 59 or int(second or 0) > 59:
        return None
    seconds = (int(hour) * 60 + int(minute)) * 60 + int(second or 0)
    return seconds * SECOND + int((fraction or "0").ljust(9, "0"))


def _clock_text(ns: int) -> str:
    # A count past midnight is shown as it is (TOD#25:00:00): received bytes always have a text.
    seconds, fraction = divmod(ns, SECOND)
    text = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return text + (f".{fraction:09d}".rstrip("0") if fraction else "")


# Dates are counted from 1 March of year 0 in eras of 400 years. Not `datetime`: it ends in the year 9999,
# an unsigned count of days does not, and its import is slow for a single command line.
_ERA_DAYS = 146_097
_MARCH_0_TO_1970 = 719_468


def to_date(days: int) -> tuple[int, int, int]:
    """Return year, month and day of a number of days since 1970."""
    era, day = divmod(days + _MARCH_0_TO_1970, _ERA_DAYS)
    year = (day - day // 1460 + day // 36_524 - day // 146_096) // 365
    day -= 365 * year + year // 4 - year // 100
    month = (5 * day + 2) // 153
    date = day - (153 * month + 2) // 5 + 1
    month = month + 3 if month < 10 else month - 9
    return era * 400 + year + (month <= 2), month, date


def _date_text(days: int) -> str:
    year, month, date = to_date(days)
    return f"{year:04d}-{month:02d}-{date:02d}"


def _days_since_1970(year: int, month: int, date: int) -> int:
    era, year = divmod(year - (month <= 2), 400)
    day = (153 * (month - 3 if month > 2 else month + 9) + 2) // 5 + date - 1
    return era * _ERA_DAYS + year * 365 + year // 4 - year // 100 + day - _MARCH_0_TO_1970


def date_ns(year: int, month: int, date: int) -> int | None:
    """Return the nanoseconds from 1970 to a date; None when the calendar has no such date."""
    if not 1 <= month <= 12:
        return None
    days = _days_since_1970(year, month, date)
    # 31 April converts back to 1 May: such a date does not exist.
    return days * DAY if to_date(days) == (year, month, date) else None
