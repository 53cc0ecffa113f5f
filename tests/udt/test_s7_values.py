"""DATE_AND_TIME in BCD, DTL, S5TIME, texts with a NUL: printed vectors, odd bytes, and what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from trcvtui.errors import UserError
from trcvtui.udt.layout.layout import Layout, lay_out, rules_for
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode, encode
from trcvtui.udt.sources import parse_type
from trcvtui.udt.types import ELEMENTARY, Pointer, Subrange, Type


def layout_of(type_: str | Type, layout: str = "s7-standard", order: str | None = None) -> Layout:
    return lay_out(parse_type(type_) if isinstance(type_, str) else type_, rules_for(layout, order))


def shown(layout: Layout, raw: bytes) -> str:
    """Return the value as a person reads it."""
    (value,) = decode(layout, raw)
    return value_text(layout.leaf(0), value, raw)


# As python-snap7 reads and writes them.
VECTORS = [
    ("DT", "99 12 13 07 06 05 88 82", "DT#1999-12-13-07:06:05.888"),
    ("DT", "89 12 31 23 59 59 99 97", "DT#2089-12-31-23:59:59.999"),
    ("DTL", "07EA 0B 15 07 0A 1E 00 075BCD15", "DTL#2026-11-21-10:30:00.123456789"),
    ("S5TIME", "0150", "S5T#1s500ms"),
    ("S5TIME", "3999", "S5T#2h46m30s"),
    ("S5TIME", "0000", "S5T#0ms"),
    ("DATE", "0000", "D#1990-01-01"),
    ("DATE", "FFFF", "D#2169-06-06"),
    ("TIME", "80000000", "T#-24d20h31m23s648ms"),
    ("LDT", "0000000000000001", "LDT#1970-01-01-00:00:00.000000001"),
    ("WSTRING[2]", "0002 0001 20AC 0000", "€"),
]


@pytest.mark.parametrize(("type_", "data", "value"), VECTORS)
def test_bytes_and_literals_are_each_others_inverse(type_: str, data: str, value: str) -> None:
    layout, raw = layout_of(type_), bytes.fromhex(data)
    assert decode(layout, raw) == (value,)
    assert encode(layout, {"": value}) == raw
    assert shown(layout, raw).strip("'") == value, "nothing is odd about it"


def test_a_dtl_of_a_little_endian_partner() -> None:
    layout = layout_of("DTL", "codesys-8")
    raw = bytes.fromhex("EA07 0B 15 07 0A 1E 00 15CD5B07")
    assert decode(layout, raw) == ("DTL#2026-11-21-10:30:00.123456789",)
    assert encode(layout, {"": "dt#2026-11-21-10:30:00.123456789"}) == raw


@pytest.mark.parametrize(
    ("type_", "data", "text"),
    [
        ("DT", "99 12 32 07 06 05 88 81", "16#9912320706058881 (no date)"),
        ("DT", "A9 12 13 07 06 05 88 81", "16#A912130706058881 (no date)"),
        ("DT", "99 12 13 24 06 05 88 81", "16#9912132406058881 (no date)"),
        ("DT", "99 12 13 07 06 05 88 80", "DT#1999-12-13-07:06:05.888 (weekday 0, not 2)"),
        ("DTL", "00" * 12, "16#000000000000000000000000 (no date)"),
        ("DTL", "07EA 0B 15 03 0A 1E 00 00000000", "DTL#2026-11-21-10:30:00 (weekday 3, not 7)"),
        ("DTL", "07EA 0B 15 07 0A 1E 00 3B9ACA00", "16#07EA0B15070A1E003B9ACA00 (no date)"),
        ("S5TIME", "015A", "16#015A (no S5TIME)"),
        ("S5TIME", "8150", "S5T#1s500ms (16#8150)"),
        ("S5TIME", "1015", "S5T#1s500ms (16#1015)"),
    ],
)
def test_odd_bytes_are_shown_and_marked_and_never_refused(type_: str, data: str, text: str) -> None:
    layout, raw = layout_of(type_), bytes.fromhex(data)
    assert shown(layout, raw) == text
    (value,) = decode(layout, raw)
    assert decode(layout, encode(layout, {"": value})) == (value,)


@given(st.sampled_from(["DT", "DTL", "S5TIME"]), st.sampled_from(["little", "big"]), st.data())
def test_what_is_shown_as_hex_comes_back_byte_for_byte(type_: str, order: str, data: st.DataObject) -> None:
    layout = layout_of(type_, order=order)
    raw = data.draw(st.binary(min_size=layout.size, max_size=layout.size))
    (value,) = decode(layout, raw)
    again = encode(layout, {"": value})
    if str(value).startswith("16#") or "(" not in shown(layout, raw):
        assert again == raw
    assert decode(layout, again) == (value,)


def test_what_an_s7_cannot_hold_is_refused_in_one_line() -> None:
    def write(case: str) -> None:
        type_, _, value = case.partition(" ")
        encode(layout_of(type_), {"": value})

    golden.mistakes("values of an S7", write)


# -- CODESYS -------------------------------------------------------------------------------------------------


def test_a_codesys_string_ends_with_a_nul() -> None:
    layout = layout_of("STRING[3]", "codesys-8")
    assert encode(layout, {"": "AB"}) == b"AB\0\0"
    assert shown(layout, b"AB\0X") == "'AB'", "what is after the NUL is nothing"
    assert shown(layout, b"ABC\0") == "'ABC'"
    assert shown(layout, b"ABCD") == "'ABC' (no NUL)"
    for wrong in ("ABCD", "A\0B", "€", 5):
        with pytest.raises(UserError, match="text of at most 3 characters, codes 1 to 255"):
            encode(layout, {"": wrong})


@pytest.mark.parametrize(("order", "data"), [("little", "41003004 0000 0000"), ("big", "00410430 0000 0000")])
def test_a_codesys_wstring_ends_with_a_word_of_zero(order: str, data: str) -> None:
    layout, raw = layout_of("WSTRING[3]", "codesys-8", order), bytes.fromhex(data)
    assert decode(layout, raw) == ("Aа",)
    assert encode(layout, {"": "Aа"}) == raw
    assert shown(layout, bytes.fromhex("0101" * 4)) == "'āāā' (no NUL)"


def test_baosky_text_as_a_c_string_has_two_bytes_more() -> None:
    layout = lay_out(parse_type("STRING[3]"), rules_for("baosky", None, "cstr"))
    assert encode(layout, {"": "ABC"}) == b"ABC\0\0"
    assert shown(layout, b"ABCD\0") == "'ABC' (length 4 > 3)"


def test_codesys_durations_have_no_sign_and_dates_count_seconds() -> None:
    assert decode(layout_of("TIME", "codesys-8"), b"\xff" * 4) == ("T#49d17h2m47s295ms",)
    date = layout_of("DATE", "codesys-8")
    assert encode(date, {"": "D#1970-01-02"}) == (86_400).to_bytes(4, "little")
    assert shown(date, (86_401).to_bytes(4, "little")) == "D#1970-01-02 (and T#1s)"
    assert encode(date, {"": "D#1970-01-02 (and T#1s)"}) == (86_401).to_bytes(4, "little")
    for wrong in ("D#1970-01-02 (and T#1s", "D#1970-01-02 (and T#24h)", "D#1970-01-02 (and T#1ms)"):
        with pytest.raises(UserError):
            encode(date, {"": wrong})


@given(st.binary(min_size=8, max_size=8))
def test_no_ldate_loses_its_part_of_the_day(raw: bytes) -> None:
    layout = layout_of("LDATE")
    assert encode(layout, {"": decode(layout, raw)[0]}) == raw
    edge = bytes(7) + b"\x80"
    assert encode(layout, {"": decode(layout, edge)[0]}) == edge


@given(st.integers(0, 0xFFFF))
def test_an_s5time_comes_back_bit_for_bit(word: int) -> None:
    layout = layout_of("S5TIME")
    raw = word.to_bytes(2, "little")
    assert encode(layout, {"": decode(layout, raw)[0]}) == raw


@pytest.mark.parametrize("value", ["S5T#1s (16#1011)", "S5T#1s (16#1010", "S5T#1s (x)"])
def test_an_s5time_with_another_word_beside_it_is_refused(value: str) -> None:
    with pytest.raises(UserError):
        encode(layout_of("S5TIME"), {"": value})


def test_an_address_is_hex() -> None:
    pointer = Pointer("POINTER TO BYTE")
    wide, narrow = layout_of(pointer, "codesys-8"), lay_out(pointer, rules_for("codesys-8", pointer_size=4))
    assert decode(wide, bytes.fromhex("7856341200000000")) == ("16#0000000012345678",)
    assert decode(narrow, bytes.fromhex("78563412")) == ("16#12345678",)
    assert encode(narrow, {"": "16#12345678"}) == encode(narrow, {"": 0x12345678})
    with pytest.raises(UserError, match="a whole number from 0 to"):
        encode(narrow, {"": "16#112345678"})


def test_a_number_outside_its_subrange_is_shown_as_such() -> None:
    layout = layout_of(Subrange(ELEMENTARY["INT"], 0, 10), "codesys-8")
    assert decode(layout, b"\x0b\x00") == (11,)
    assert shown(layout, b"\x0b\x00") == "11 (not 0..10)"
    assert shown(layout, b"\x0a\x00") == "10"
    assert encode(layout, {"": 11}) == b"\x0b\x00"
