"""IEC literals: durations, dates, times of day and whole numbers, both ways."""

from __future__ import annotations

import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from trcvtui.errors import UserError
from trcvtui.udt.literals import format_duration, format_literal, parse_integer, parse_literal, parse_time
from trcvtui.udt.types import ELEMENTARY, ELEMENTARY_ROWS, Elementary

TIMED = [row for row in ELEMENTARY_ROWS if row.unit_ns]


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("T#1s500ms", 1_500_000_000),
        ("t#1S500MS", 1_500_000_000),
        ("TIME#1.5s", 1_500_000_000),
        ("T#20ms", 20_000_000),
        ("T#0ms", 0),
        ("T#-2h", -7_200_000_000_000),
        ("T#25h", 90_000_000_000_000),
        ("T#1d_2h_3m", 93_780_000_000_000),
        ("LTIME#1us1ns", 1_001),
        ("LT#0.5us", 500),
        (" T#1s ", 1_000_000_000),
    ],
)
def test_a_duration_is_read_in_nanoseconds(text: str, ns: int) -> None:
    assert parse_time(text) == ns


def test_what_is_no_duration_is_refused_in_one_line() -> None:
    golden.mistakes("durations", lambda text: parse_time(text, "gap"))
    for text in ("", f"T#{'9' * 70}s"):
        with pytest.raises(UserError):
            parse_time(text)


@pytest.mark.parametrize(
    ("ns", "text"),
    [
        (0, "T#0ms"),
        (1_500_000_000, "T#1s500ms"),
        (-1_000_000, "T#-1ms"),
        (93_784_005_006_007, "T#1d2h3m4s5ms6us7ns"),
    ],
)
def test_a_duration_is_written_largest_unit_first(ns: int, text: str) -> None:
    assert format_duration(ns) == text


@given(st.integers(-(2**70), 2**70))
def test_every_duration_comes_back(ns: int) -> None:
    assert parse_time(format_duration(ns)) == ns


@pytest.mark.parametrize(
    ("type_name", "count", "text"),
    [
        ("TIME", -1, "T#-1ms"),
        ("LTIME", 1, "LTIME#1ns"),
        ("DATE", 0, "D#1970-01-01"),
        ("DATE", 19_782, "D#2024-02-29"),
        ("LDATE", -1, "LDATE#1969-12-31"),
        ("TOD", 45_015_250, "TOD#12:30:15.25"),
        ("TOD", 90_000_000, "TOD#25:00:00"),
        ("LTOD", 1, "LTOD#00:00:00.000000001"),
        ("DT", 1_700_000_000, "DT#2023-11-14-22:13:20"),
        ("LDT", -1, "LDT#1969-12-31-23:59:59.999999999"),
    ],
)
def test_a_stored_count_is_written_as_its_literal(type_name: str, count: int, text: str) -> None:
    assert format_literal(ELEMENTARY[type_name], count) == text


@given(st.data(), st.sampled_from([row for row in TIMED if row.name != "LDATE"]))
def test_every_stored_count_comes_back_from_its_literal(data: st.DataObject, row: Elementary) -> None:
    count = data.draw(st.integers(*row.limits))
    assert parse_literal(row, format_literal(row, count)) == count


@given(st.dates())
def test_dates_are_those_of_the_gregorian_calendar(date: datetime.date) -> None:
    days = date.toordinal() - datetime.date(1970, 1, 1).toordinal()
    assert format_literal(ELEMENTARY["DATE"], days) == f"D#{date.isoformat()}"
    assert parse_literal(ELEMENTARY["DATE"], f"DATE#{date.isoformat()}") == days


@pytest.mark.parametrize(
    ("type_name", "text"),
    [
        ("DATE", "D#2023-02-29"),
        ("DATE", "D#2023-13-01"),
        ("DATE", "D#2023-00-10"),
        ("DATE", "2023-01-01"),
        ("DATE", "T#1s"),
        ("TOD", "TOD#12:60:00"),
        ("TOD", "TOD#12:00:60"),
        ("TOD", "TOD#12"),
        ("TOD", "TOD#12:00:00.0001"),
        ("DT", "DT#2023-01-01"),
        ("DT", "DT#2023-01-01-24:00:00"),
        ("TIME", "T#1us"),
    ],
)
def test_what_is_no_such_literal_gives_none(type_name: str, text: str) -> None:
    assert parse_literal(ELEMENTARY[type_name], text) is None


@pytest.mark.slow
@given(st.text(max_size=80))
def test_no_text_breaks_the_literals(text: str) -> None:
    parse_integer(text)
    for row in TIMED:
        assert parse_literal(row, text) is None or "#" in text
    try:
        parse_time("T#" + text)
    except UserError as refused:
        assert len(refused.lines()) == 1
