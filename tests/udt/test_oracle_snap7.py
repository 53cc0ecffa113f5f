"""Values of an S7 agree with the getters of python-snap7, on bytes that both call valid."""

from __future__ import annotations

import datetime as dt
import re
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.udt.udt_strategies import values_of
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.layout.values import decode, encode
from trcvtui.udt.sources import parse_type
from trcvtui.udt.types import ELEMENTARY_ROWS, WHOLE_KINDS

getters = pytest.importorskip("snap7.util.getters", reason="python-snap7 is not installed: no other opinion")

S7 = rules_for("s7-standard")
UNITS = {
    "d": 86_400_000_000, "h": 3_600_000_000, "m": 60_000_000, "s": 1_000_000, "ms": 1000, "us": 1, "ns": 0,
}  # fmt: skip


def microseconds(literal: str) -> int:
    """Return the whole microseconds of a duration, rounded down as python-snap7 does."""
    sign = -1 if "#-" in literal else 1
    parts = re.findall(r"(\d+)(ms|us|ns|d|h|m|s)", literal)
    whole = sum(int(count) * UNITS[unit] for count, unit in parts)
    return -whole - any(unit == "ns" for _, unit in parts) if sign < 0 else whole


def clock(text: str) -> dt.timedelta:
    """Return `12:30:15.25` as a duration."""
    hour, minute, second = text.split(":")
    whole, _, fraction = second.partition(".")
    rest = int(fraction.ljust(6, "0")[:6]) if fraction else 0
    return dt.timedelta(hours=int(hour), minutes=int(minute), seconds=int(whole), microseconds=rest)


def moment(literal: str) -> dt.datetime:
    """Return a date and time."""
    year, month, day, time = literal.partition("#")[2].split("-")
    return dt.datetime(int(year), int(month), int(day)) + clock(time)


def snap7_duration(text: str) -> int:
    """Return the microseconds of python-snap7's `-24:20:31:23.648`."""
    found = re.fullmatch(r"(-?)(\d+):(\d+):(\d+):(\d+)\.(\d+)", text)
    assert found
    days, hours, minutes, seconds, ms = map(int, found.groups()[1:])
    whole = ((days * 24 + hours) * 60 + minutes) * 60 + seconds
    return (-1 if found[1] else 1) * (whole * 1000 + ms) * 1000


def value_of(type_: str, raw: bytes) -> str:
    """Return what we decode."""
    (value,) = decode(lay_out(parse_type(type_), S7), raw)
    assert isinstance(value, str)
    return value


INTEGERS = [row.name for row in ELEMENTARY_ROWS if row.kind in WHOLE_KINDS]


@given(st.sampled_from(INTEGERS), st.binary(min_size=8, max_size=8))
def test_whole_numbers(type_: str, raw: bytes) -> None:
    layout = lay_out(parse_type(type_), S7)
    theirs = getattr(getters, f"get_{type_.lower()}")(bytearray(raw), 0)
    if isinstance(theirs, bytes | bytearray):
        theirs = int.from_bytes(theirs, "big")
    assert decode(layout, raw) == (theirs,)


@given(st.binary(min_size=4, max_size=4), st.integers(0, 3), st.integers(0, 7))
def test_bits(raw: bytes, byte: int, bit: int) -> None:
    layout = lay_out(parse_type("ARRAY[0..31] OF BOOL"), S7)
    assert decode(layout, raw)[8 * byte + bit] == getters.get_bool(bytearray(raw), byte, bit)


@given(st.floats(width=32, allow_nan=False), st.floats(allow_nan=False))
def test_reals(single: float, double: float) -> None:
    raw = struct.pack(">fd", single, double)
    assert decode(lay_out(parse_type("REAL"), S7), raw) == (getters.get_real(bytearray(raw), 0),)
    assert decode(lay_out(parse_type("LREAL"), S7), raw[4:]) == (getters.get_lreal(bytearray(raw), 4),)


@given(st.dates(dt.date(1990, 1, 1), dt.date(2168, 12, 31)))
def test_dates(day: dt.date) -> None:
    raw = ((day - dt.date(1990, 1, 1)).days).to_bytes(2, "big")
    assert value_of("DATE", raw) == f"D#{getters.get_date(bytearray(raw), 0)}"


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**63), 2**63 - 1))
def test_durations(ms: int, ns: int) -> None:
    raw = struct.pack(">iq", ms, ns)
    assert microseconds(value_of("TIME", raw[:4])) == snap7_duration(getters.get_time(bytearray(raw), 0))
    theirs = getters.get_ltime(bytearray(raw), 4)
    assert microseconds(value_of("LTIME", raw[4:])) == theirs // dt.timedelta(microseconds=1)


@given(st.integers(0, 86_399_999), st.integers(0, 86_400 * 10**9 - 1))
def test_times_of_day(ms: int, ns: int) -> None:
    raw = struct.pack(">IQ", ms, ns)
    assert clock(value_of("TOD", raw[:4]).partition("#")[2]) == getters.get_tod(bytearray(raw), 0)
    assert clock(value_of("LTOD", raw[4:]).partition("#")[2]) == getters.get_ltod(bytearray(raw), 4)


@given(st.integers(0, 2**63 - 1))
def test_ldt(ns: int) -> None:
    raw = struct.pack(">q", ns)
    assert moment(value_of("LDT", raw)) == getters.get_ldt(bytearray(raw), 0)


@given(st.datetimes(dt.datetime(1990, 1, 1), dt.datetime(2089, 12, 31)))
def test_date_and_time_in_bcd_both_ways(at: dt.datetime) -> None:
    at = at.replace(microsecond=at.microsecond // 1000 * 1000)
    literal = f"DT#{at:%Y-%m-%d-%H:%M:%S.%f}"
    raw = encode(lay_out(parse_type("DT"), S7), {"": literal})
    assert getters.get_date_time_object(bytearray(raw), 0) == at == moment(value_of("DT", raw))
    assert raw[7] & 15 == at.isoweekday() % 7 + 1, "1 is Sunday"


@given(st.datetimes(dt.datetime(1970, 1, 1), dt.datetime(2554, 12, 31)))
def test_dtl_both_ways(at: dt.datetime) -> None:
    raw = encode(lay_out(parse_type("DTL"), S7), {"": f"DTL#{at:%Y-%m-%d-%H:%M:%S.%f}"})
    assert getters.get_dtl(bytearray(raw), 0) == at == moment(value_of("DTL", raw))
    assert raw[4] == at.isoweekday() % 7 + 1


@given(st.integers(0, 3), st.integers(0, 999))
def test_s5time(base: int, count: int) -> None:
    raw = bytes.fromhex(f"{base}{count:03d}")
    days, _, rest = getters.get_s5time(bytearray(raw), 0).rpartition(", ")
    assert not days
    assert dt.timedelta(microseconds=microseconds(value_of("S5TIME", raw))) == clock(rest)


def is_text(value: object) -> bool:
    """Return whether no half of a surrogate pair is in it, which python-snap7 refuses."""
    return not any(0xD800 <= ord(character) < 0xE000 for character in str(value))


@given(st.data(), st.sampled_from(["STRING[20]", "WSTRING[20]", "STRING", "CHAR", "WCHAR"]))
def test_texts(data: st.DataObject, type_: str) -> None:
    layout = lay_out(parse_type(type_), S7)
    value = data.draw(values_of(layout.leaf(0), S7).filter(is_text))
    raw = encode(layout, {"": value})
    theirs = getattr(getters, f"get_{type_.partition('[')[0].lower()}")(bytearray(raw), 0)
    assert decode(layout, raw) == (theirs,) == (value,)
