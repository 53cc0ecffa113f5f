"""Bytes to values and back: every type, short data, surplus data, odd data, and what encode refuses."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.udt.udt_strategies import apart, layout_of, layouts, leaf_types, rules, same, types_of, values_of
from trcvtui.errors import UserError
from trcvtui.udt.layout.layout import Layout, LayoutRules, lay_out, rules_for
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode, decode_leaves, encode, write_leaf
from trcvtui.udt.types import ELEMENTARY_ROWS, StringType, Type


def telegram() -> Layout:
    return layout_of("id : DINT; speed : REAL; ok : BOOL;")


def test_a_bool_is_false_for_0_and_true_for_every_other_byte() -> None:
    layout = layout_of("ARRAY[0..255] OF BOOL")
    assert decode(layout, bytes(range(256))) == (False,) + (True,) * 255


def test_a_string_has_a_header_of_longest_and_actual_length() -> None:
    layout = layout_of("STRING")
    data = encode(layout, {"": "AB"})
    assert data == bytes.fromhex("50024142") + bytes(78)
    assert decode(layout, data) == ("AB",)


def test_a_string_that_claims_to_be_longer_than_its_field_ends_with_the_field() -> None:
    assert decode(layout_of("STRING[3]"), b"\x03\xffABC") == ("ABC",)


@pytest.mark.parametrize("order", ["little", "big"])
def test_a_wstring_has_a_header_of_words(order: str) -> None:
    layout = layout_of("WSTRING[4]", byte_order=order)
    mark = "<" if order == "little" else ">"
    data = encode(layout, {"": "Aé"})
    assert data == struct.pack(mark + "6H", 4, 2, 0x41, 0xE9, 0, 0)
    assert decode(layout, data) == ("Aé",)


def test_times_are_literals() -> None:
    layout = layout_of("a : TIME; b : LTIME; c : DATE; d : TOD; e : DT;")
    data = struct.pack("<iqIII", -1500, 1, 19_782, 45_015_250, 1_700_000_000)
    values = ("T#-1s500ms", "LTIME#1ns", "D#2024-02-29", "TOD#12:30:15.25", "DT#2023-11-14-22:13:20")
    assert decode(layout, data) == values


def test_an_enumeration_is_a_number_and_may_be_written_by_name() -> None:
    types = types_of("TYPE Mode : (Stop, Run := 5); END_TYPE")
    layout = lay_out(types.get_type("Mode"), rules_for())
    assert decode(layout, b"\x05\x00") == (5,)
    assert decode(layout, b"\x07\x00") == (7,)
    assert encode(layout, {"": "run"}) == encode(layout, {"": 5}) == b"\x05\x00"


@given(st.sampled_from(ELEMENTARY_ROWS), rules, st.data())
def test_every_elementary_type_comes_back(row: Type, its_rules: LayoutRules, data: st.DataObject) -> None:
    layout = lay_out(row, its_rules)
    value = data.draw(values_of(layout.leaf(0), its_rules))
    assert decode(layout, encode(layout, {"": value})) == (value,)


@given(leaf_types, rules, st.data())
def test_every_leaf_takes_what_it_shows(type_: Type, its_rules: LayoutRules, data: st.DataObject) -> None:
    layout = lay_out(type_, its_rules)
    raw = data.draw(st.binary(min_size=layout.size, max_size=layout.size))
    shown = decode(layout, raw)
    again = decode(layout, encode(layout, {"": shown[0]}))
    assert same(again, shown) or shown[0] != shown[0]


@pytest.mark.slow
@given(layouts(), st.data())
def test_every_structure_comes_back(layout: Layout, data: st.DataObject) -> None:
    values = {leaf.path: data.draw(values_of(leaf, layout.rules)) for leaf in apart(layout)}
    found = decode(layout, encode(layout, values))
    shown = zip([leaf.path for leaf in layout.leaves()], found, strict=True)
    assert {path: value for path, value in shown if path in values} == values


@given(layouts(), st.data())
def test_every_prefix_agrees_with_the_whole(layout: Layout, data: st.DataObject) -> None:
    raw = data.draw(st.binary(min_size=layout.size, max_size=layout.size))
    whole = decode(layout, raw)
    ends = [leaf.offset + leaf.size for leaf in layout.leaves()]
    for length in {0, 1, layout.size // 2, layout.size - 1, *(end - 1 for end in ends[:8]), *ends[:8]}:
        expected = tuple(value if end <= length else None for value, end in zip(whole, ends, strict=True))
        assert same(decode(layout, raw[:length]), expected)


@pytest.mark.slow
@given(layouts(), st.data())
def test_a_page_shows_what_the_whole_decode_shows(layout: Layout, data: st.DataObject) -> None:
    raw = data.draw(st.binary(max_size=layout.size + 3))
    start = data.draw(st.integers(-3, layout.leaf_count + 3))
    stop = start + data.draw(st.integers(0, 20))
    expected = decode(layout, raw)[max(start, 0) : max(stop, 0)]
    assert same(decode_leaves(layout, raw, start, stop), expected)
    assert same(decode_leaves(layout, memoryview(bytearray(raw)), start, stop), expected)


@given(layouts())
def test_missing_members_and_gaps_are_zero(layout: Layout) -> None:
    assert encode(layout, {}) == bytes(layout.size)
    assert encode(layout, {leaf.path: None for leaf in layout.leaves()}) == bytes(layout.size)


def test_values_are_found_by_path_in_any_case() -> None:
    layout = layout_of("st : STRUCT arr : ARRAY[1..2] OF STRUCT x : INT; END_STRUCT END_STRUCT")
    assert encode(layout, {"ST.Arr[2].X": 258}) == bytes.fromhex("00000000 02010000")


def test_one_leaf_is_written_in_place() -> None:
    data = bytearray(b"\xff" * 12)
    write_leaf(telegram(), data, 1, "12.5")
    assert bytes(data) == b"\xff" * 4 + struct.pack("<f", 12.5) + b"\xff" * 4


OUT_OF_RANGE: dict[str, list[object]] = {
    "BOOL": [2, "yes", 0.0],
    "BYTE": [256, -1],
    "INT": [32768, -32769, 1.0, True, "1.5", 10**5000],
    "LWORD": [2**64],
    "REAL": [3.5e38, "fast", False],
    "LREAL": ["1e400", 10**400],
    "CHAR": ["ab", "", "€"],
    "STRING[3]": ["abcd", "€", 5],
    "WSTRING[3]": ["abcd"],
    "TIME": ["T#25d", 5],
    "DATE": ["D#1969-12-31"],
    "DINT": [[], {"a": 1}],
}


@pytest.mark.parametrize("type_text", OUT_OF_RANGE)
def test_a_value_out_of_range_is_refused_in_one_line(type_text: str) -> None:
    layout = layout_of(f"x : {type_text};")
    for value in OUT_OF_RANGE[type_text]:
        with pytest.raises(UserError) as refused:
            encode(layout, {"x": value})
        (problem,) = refused.value.problems
        assert problem.where == "T.x"
        assert len(str(problem)) < 200


def test_all_mistakes_of_the_values_are_told_together() -> None:
    with pytest.raises(UserError) as refused:
        encode(telegram(), {"id": 2**31, "nope": 1, "ok": "TRUE", "speed": "x"})
    assert refused.value.lines() == [
        "T.id: found 2147483648, expected DINT, a whole number from -2147483648 to 2147483647",
        "T, 'nope': found 'nope', expected a member or an index within bounds",
        "T.speed: found 'x', expected REAL, a number in its range, NaN, Infinity or -Infinity",
    ]


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity"])
@pytest.mark.parametrize("type_text", ["REAL", "LREAL"])
def test_numbers_that_are_none_pass_both_ways(type_text: str, text: str) -> None:
    layout = layout_of(type_text)
    (value,) = decode(layout, encode(layout, {"": text}))
    assert isinstance(value, float)
    assert math.isnan(value) if text == "NaN" else value == float(text)


def test_the_largest_real_is_accepted_and_the_next_refused() -> None:
    layout = layout_of("REAL")
    largest = struct.unpack("<f", bytes.fromhex("FFFF7F7F"))[0]
    assert encode(layout, {"": largest}).hex() == "ffff7f7f"
    assert encode(layout, {"": math.nextafter(3.4028235677973366e38, 0)}).hex() == "ffff7f7f"
    with pytest.raises(UserError):
        encode(layout, {"": 3.4028235677973366e38})


def test_the_largest_type_is_decoded_at_once_and_by_pages() -> None:
    wide = layout_of("ARRAY[0..131071] OF BYTE")
    data = bytes(range(256)) * 512
    assert bytes(v for v in decode(wide, data) if isinstance(v, int)) == data
    assert decode_leaves(wide, data, 70_000, 70_004) == tuple(data[70_000:70_004])


@pytest.mark.parametrize("members", ["d : DWORD; b : BOOL;", "b : BOOL; d : DWORD;"])
def test_members_of_a_union_are_encoded_to_the_bytes_they_were_decoded_from(members: str) -> None:
    types = types_of(f"TYPE U : UNION {members} END_UNION END_TYPE")
    layout = lay_out(types.get_type("U"), rules_for())
    values = dict(zip([leaf.path for leaf in layout.leaves()], decode(layout, b"\2\0\0\0"), strict=True))
    assert encode(layout, values) == b"\2\0\0\0"


def test_a_string_whose_own_longest_length_is_another_is_marked() -> None:
    (leaf,) = layout_of("STRING[3]", "s7-standard").leaves()
    assert value_text(leaf, "A", b"\3\1A\0\0") == "'A'"
    assert value_text(leaf, "A", b"\4\1A\0\0") == "'A' (header: max 4, not 3)"
    assert value_text(leaf, "ABC", b"\4\5ABC") == "'ABC' (length 5 > 3)"


UTF_8 = """TYPE T : STRUCT a : BYTE; {attribute 'TcEncoding':='UTF-8'} s : STRING[4]; t : STRING[4];
END_STRUCT END_TYPE"""


def test_a_string_marked_as_utf_8_is_read_and_written_so() -> None:
    types = types_of(UTF_8)
    layout = lay_out(types.get_type("T"), rules_for("codesys-8"))
    raw = b"\1" + "€".encode() + b"\0\0" + "€".encode() + b"\0\0"
    assert decode(layout, raw) == (1, "€", "â\x82¬")
    assert encode(layout, {"a": 1, "s": "€", "t": "â\x82¬"}) == raw
    with pytest.raises(UserError, match="at most 4 bytes in UTF-8"):
        encode(layout, {"s": "€€"})


@given(st.binary(min_size=5, max_size=5))
def test_bytes_that_are_no_utf_8_come_back_the_same(raw: bytes) -> None:
    layout = lay_out(StringType(4, utf8=True), rules_for("codesys-8"))
    (value,) = decode(layout, raw)
    assert encode(layout, {"": value}) == raw[:4].split(b"\0")[0].ljust(5, b"\0")
