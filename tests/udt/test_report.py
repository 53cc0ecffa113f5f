"""What `udt show`, `decode` and `encode` answer: the JSON of the contract, and tables for people."""

from __future__ import annotations

import json
import os
import struct

import msgspec
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.udt.answers import decode_json, show_json
from tests.udt.udt_strategies import layout_of, layouts
from trcvtui.udt import report
from trcvtui.udt.compare.compare import Comparison, comparison_json
from trcvtui.udt.layout.layout import Layout, lay_out, rules_for
from trcvtui.udt.layout.value_text import real_text
from trcvtui.udt.report import csv_lines, decoded_text, encode_values, layout_table, markdown, member_rows
from trcvtui.udt.type_set import TypeSet
from trcvtui.udt.types import StringType, Struct

TELEGRAM = """TYPE Mode : (Stop, Run := 5); Telegram : STRUCT
  id : DINT; speed : REAL; ok : BOOL; bits : WORD; mode : Mode; name : STRING[4]; c : CHAR; wait : TIME;
END_STRUCT END_TYPE"""
BYTES = bytes.fromhex("01000000 00509A44 05 00 34 12 05 00 04 02 41 1B 00 00 58 00 00 00 DC 05 00 00")
RANDOM = 10_000 if "TRCVTUI_SOAK" in os.environ else 200
# Any bytes; and texts of halves of characters, of what ends a text and of what stands for itself.
TELLING = st.lists(st.sampled_from(b"\xd8\xdc\xdf\xff\xc3\0\\A"), max_size=9).map(lambda b: bytes(b) * 99)


def telegram() -> Layout:
    from tests.udt.udt_strategies import types_of

    types: TypeSet = types_of(TELEGRAM)
    return lay_out(types.get_type("Telegram"), rules_for(), "telegram")


def test_show_as_json_is_the_contract() -> None:
    assert show_json(telegram()) == {
        "type": "Telegram",
        "size": 28,
        "align": 4,
        "layout": "baosky",
        "byte_order": "little",
        "members": [
            {"path": "id", "type": "DINT", "offset": 0, "size": 4},
            {"path": "speed", "type": "REAL", "offset": 4, "size": 4},
            {"path": "ok", "type": "BOOL", "offset": 8, "size": 1},
            {"path": "bits", "type": "WORD", "offset": 10, "size": 2},
            {"path": "mode", "type": "INT", "offset": 12, "size": 2},
            {"path": "name", "type": "STRING[4]", "offset": 14, "size": 6},
            {"path": "c", "type": "CHAR", "offset": 20, "size": 1},
            {"path": "wait", "type": "TIME", "offset": 24, "size": 4},
        ],
        "padding": [{"offset": 9, "size": 1}, {"offset": 21, "size": 3}],
    }


def test_show_as_text_lists_members_and_gaps_in_order() -> None:
    assert layout_table(telegram()).splitlines() == [
        "Telegram: 28 bytes, align 4, layout baosky, little-endian",
        "offset  size  type        path",
        "     0     4  DINT        id",
        "     4     4  REAL        speed",
        "     8     1  BOOL        ok",
        "     9     1              (padding)",
        "    10     2  WORD        bits",
        "    12     2  INT (Mode)  mode",
        "    14     6  STRING[4]   name",
        "    20     1  CHAR        c",
        "    21     3              (padding)",
        "    24     4  TIME        wait",
        "unverified for this layout: STRING",
    ]


def test_decode_as_json_is_the_contract() -> None:
    assert decode_json(telegram(), BYTES) == {
        "type": "Telegram",
        "size": 28,
        "complete": True,
        "values": {
            "id": 1,
            "speed": 1234.5,
            "ok": True,
            "bits": 0x1234,
            "mode": 5,
            "name": "A\x1b",
            "c": "X",
            "wait": "T#1s500ms",
        },
        "marks": {"ok": "16#05"},
    }


def test_decode_as_text_shows_what_is_odd_and_no_control_code() -> None:
    assert decoded_text(telegram(), BYTES[:26]).splitlines() == [
        "Telegram: 26 of 28 bytes, layout baosky, little-endian",
        "offset  type       path   value",
        "     0  DINT       id     1",
        "     4  REAL       speed  1234.5",
        "     8  BOOL       ok     TRUE (16#05)",
        "    10  WORD       bits   4660 (16#1234)",
        "    12  INT        mode   5 (Run)",
        "    14  STRING[4]  name   'A\\x1b'",
        "    20  CHAR       c      'X'",
        "    24  TIME       wait   no data",
        "unverified for this layout: STRING",
    ]


def test_a_lone_value_is_shown_under_the_name_of_its_type() -> None:
    layout = lay_out(telegram().leaf(1).type, rules_for(), "Speed")
    assert layout_table(layout).splitlines()[2] == "     0     4  REAL  Speed"
    assert show_json(layout)["members"] == [{"path": "", "type": "REAL", "offset": 0, "size": 4}]


def test_numbers_that_are_none_are_text_in_json() -> None:
    layout = layout_of("ARRAY[0..2] OF REAL")
    data = struct.pack("<3f", float("nan"), float("inf"), float("-inf"))
    assert decode_json(layout, data)["values"] == {"[0]": "NaN", "[1]": "Infinity", "[2]": "-Infinity"}
    assert decoded_text(layout, data).splitlines()[2].endswith("NaN")


def test_encode_takes_values_and_what_decode_gave() -> None:
    values = {"id": 1, "speed": 1234.5, "ok": True, "wait": "T#1s500ms"}
    expected = bytes.fromhex("01000000 00509A44 01 00") + bytes(14) + bytes.fromhex("DC050000")
    assert encode_values(telegram(), values) == expected
    assert (
        encode_values(telegram(), decode_json(telegram(), expected))
        == bytes(expected[:14]) + b"\4" + expected[15:]
    )
    assert encode_values(telegram(), {}) == bytes(28)


def texts_overlap(layout: Layout) -> bool:
    """Return whether texts share bytes with other texts: their values alone do not always tell the bytes."""
    if not layout.root.overlaps:
        return False
    places = [
        range(leaf.offset, leaf.offset + leaf.size)
        for leaf in layout.leaves()
        if isinstance(leaf.type, StringType)
    ]
    return sum(map(len, places)) > len({at for place in places for at in place})


@pytest.mark.parametrize(
    ("text", "layout", "raw", "value", "mark"),
    [
        ("WSTRING[5]", "codesys-8", "0001 00DC 0042 0045 0000 0000", "\u0100\\udc00\u4200\u4500", "16#DC00"),
        ("WSTRING[4]", "codesys-8", "5C00 41D8 41DC 00DF 0000", "\\\\\U00020441\\udf00", "16#DF00"),
        ("WSTRING[2]", "s7-standard", "0002 0002 D800 D801", "\\ud800\\ud801", "16#D800 and 1 more"),
        ("WCHAR", "s7-standard", "DC41", "\\udc41", "16#DC41"),
    ],
)
def test_a_code_unit_that_is_no_character_is_escaped_and_marked_and_comes_back(
    text: str, layout: str, raw: str, value: str, mark: str
) -> None:
    of, data = layout_of(f"t : {text};", layout), bytes.fromhex(raw)
    found = msgspec.json.decode(report.decoded_json(of, data))
    assert found["values"] == {"t": value} and found["escaped"] == ["t"]
    assert found["marks"] == {"t": f"no text: {mark}"}
    assert f"(no text: {mark})" in decoded_text(of, data)
    assert encode_values(of, found) == data


def test_a_text_with_backslashes_is_as_it_was() -> None:
    of, data = layout_of("t : WSTRING[7];", "codesys-8"), "\\udc00\\\0".encode("utf-16-le")
    found = decode_json(of, data)
    assert found["values"] == {"t": "\\udc00\\"} and not {"escaped", "marks"} & set(found)
    assert encode_values(of, found) == data


@pytest.mark.slow
@given(layouts(), st.data())
def test_what_decode_prints_encode_takes_and_gives_the_same_again(
    layout: Layout, data: st.DataObject
) -> None:
    assume(not texts_overlap(layout))
    raw = data.draw(st.binary(max_size=layout.size) | TELLING)
    printed = json.loads(json.dumps(decode_json(layout, raw), allow_nan=False))
    again = decode_json(layout, encode_values(layout, printed))["values"]
    assert isinstance(again, dict)
    for path, value in printed["values"].items():
        assert value is None or again[path] == value


@pytest.mark.slow
@pytest.mark.timeout(3600)
@settings(max_examples=RANDOM)
@given(layouts(), st.data())
def test_no_bytes_break_a_format_or_reach_it_raw(layout: Layout, data: st.DataObject) -> None:
    raw = data.draw(st.binary(max_size=layout.size + 2) | TELLING)
    rows = [(*row[:2], row[2] or "T", row[3]) for row in member_rows(layout, raw, "T")]
    for text in (layout_table(layout), decoded_text(layout, raw), *markdown(rows), *csv_lines(rows)):
        assert all(line.isprintable() for line in text.splitlines())
    comparison = Comparison(layout, layout)
    for text in (
        report.decoded_json(layout, raw),
        comparison_json(comparison, list(comparison.rows(raw)), raw),
    ):
        assert text.isascii() and msgspec.json.decode(text)  # it refuses half a character, too


@pytest.mark.slow
@given(layouts())
def test_members_stand_in_offset_order_and_those_at_one_offset_in_declared_order(layout: Layout) -> None:
    by_offset = sorted(layout.leaves(), key=lambda leaf: leaf.offset)
    shown = show_json(layout)
    assert [member["path"] for member in shown["members"]] == [leaf.path for leaf in by_offset]
    assert [(gap["offset"], gap["size"]) for gap in shown["padding"]] == layout.padding()


def test_what_is_printed_is_what_json_dumps_with_an_indent_of_two() -> None:
    for layout in (telegram(), lay_out(Struct("Empty", ()), rules_for())):
        for text in (report.layout_json(layout), report.decoded_json(layout, BYTES)):
            assert text == json.dumps(json.loads(text), indent=2)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_real_is_written_with_digits_that_give_it_again(value: float) -> None:
    assert struct.pack("<f", float(real_text(value, 4))) == struct.pack("<f", value)
    assert real_text(struct.unpack("<f", struct.pack("<f", 0.1))[0], 4) == "0.1"
