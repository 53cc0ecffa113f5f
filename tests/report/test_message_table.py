"""Messages as csv, jsonl and text: the columns, and values as `udt decode` has them."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import struct
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.udt.udt_strategies import layout_of, layouts
from trcvtui.errors import UserError, one_line
from trcvtui.history.messages import MessageRow
from trcvtui.report.message_table import FIRST, LAST, MessageTable, MessageType, format_csv
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import encode
from trcvtui.udt.report import decoded_json
from trcvtui.udt.types import StringType

BEGUN_NS = 1_700_000_000_123_456_789
TELEGRAM = "state : INT; weight : REAL; count : DINT;"


def row_of(content: bytes | None, number: int = 1, **more: object) -> MessageRow:
    size = len(content or b"")
    row = MessageRow(number, 7, 12_330_000_001, 1_500_000, size, 0x7008, "C1", 0, "", size, content)
    return row._replace(**more)  # type: ignore[arg-type]


def written(form: str, layout: Layout | None, *rows: MessageRow, members: str = "") -> str:
    out = io.StringIO(newline="")
    types = [MessageType("X", layout)] if layout is not None else []
    table = MessageTable(out, form, types, members=members, begun_ns=BEGUN_NS)
    for row in rows:
        table.write(("X",), row)
    table.finish()
    return out.getvalue()


def read_csv(text: str) -> list[dict[str, str]]:
    return [*csv.DictReader(io.StringIO(text, newline=""), strict=True)]


def test_a_row_has_its_columns_then_its_members() -> None:
    content = struct.pack("<hxxfi", 3, 50.1, -7)
    [found] = read_csv(written("csv", layout_of(TELEGRAM), row_of(content)))
    assert found == {
        "n": "1", "time": "2023-11-14T22:13:32.453456790Z", "t_s": "12.330000001", "scan": "7",
        "gap_ms": "1.500000", "instance": "X", "length": "12", "status": "7008", "reason": "",
        "hex": content.hex(" "), "state": "3", "weight": "50.1", "count": "-7",
    }  # fmt: skip
    assert [*found] == [*FIRST, "instance", *LAST, "state", "weight", "count"]
    line = json.loads(written("jsonl", layout_of(TELEGRAM), row_of(content)))
    assert [*line] == [*found], "the same names"
    assert (line["t_s"], line["gap_ms"], line["scan"], line["reason"]) == (12.330000001, 1.5, 7, None)
    assert line["weight"] == struct.unpack("<f", struct.pack("<f", 50.1))[0], "as `udt decode` has it"
    head, shown = written("text", layout_of(TELEGRAM), row_of(content)).splitlines()
    assert head.split() == [*found]
    assert shown.split()[-3:] == ["3", "50.1", "-7"]


def test_without_a_row_nothing_is_written() -> None:
    assert [written(form, layout_of(TELEGRAM)) for form in ("csv", "jsonl", "text")] == ["", "", ""]


@pytest.mark.parametrize(
    ("content", "have", "values"),
    [
        (None, 12, ["", "", ""]), (b"", 0, ["", "", ""]), (b"\5\0", 2, ["5", "", ""]),
        (b"\5\0\0\0\0\0\0\0\1\0\0\0", 6, ["5", "", ""]), (b"\0" * 65535, 65535, ["0", "0.0", "0"]),
    ],
)  # fmt: skip
def test_a_member_without_its_bytes_is_empty_and_never_0(
    content: bytes | None, have: int, values: list[str]
) -> None:
    row = row_of(content, size=12, have=have)
    [found] = read_csv(written("csv", layout_of(TELEGRAM), row))
    assert [found[name] for name in ("state", "weight", "count")] == values
    line = json.loads(written("jsonl", layout_of(TELEGRAM), row))
    assert [line[name] is None for name in ("state", "weight", "count")] == [not value for value in values]
    assert (line["hex"] is None) is (content is None)


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=1+1", "'=1+1"), ("+1", "'+1"), ("-1", "'-1"), ("@a", "'@a"), ("\t1", "'\\t1"), ("\r=1", "'\\r=1"),
        ("a=1", "a=1"), (" =1", " =1"), ('a"b,c', 'a"b,c'), ("a\nb\x1b[2J", "a\\nb\\x1b[2J"), ("", ""),
    ],
)  # fmt: skip
def test_a_text_that_a_spreadsheet_would_run_gets_a_quote_in_csv_alone(text: str, cell: str) -> None:
    layout = layout_of("t : STRING[10]; d : INT; r : REAL;")
    row = row_of(encode(layout, {"t": text, "d": -1, "r": -2.5}))
    found = written("csv", layout, row)
    assert read_csv(found)[0]["t"] == cell
    assert [read_csv(found)[0][name] for name in "dr"] == ["-1", "-2.5"], "numbers never"
    assert json.loads(written("jsonl", layout, row))["t"] == text
    shown = written("text", layout, row)
    assert (
        one_line(text) in shown
        and f"''{text}" not in shown.replace("''  -1", "")
        and "\x1b" not in found + shown
    )


def test_what_is_odd_is_shown_as_udt_decode_shows_it() -> None:
    layout = layout_of("b : BOOL; r : REAL; l : LREAL; w : WORD; u : REAL;")
    content = struct.pack("<?xxxfdHxxf", True, math.nan, -math.inf, 0x5A, 1e6)
    row = row_of(b"\7" + content[1:])
    [found] = read_csv(written("csv", layout, row))
    assert [found[name] for name in "brlwu"] == ["TRUE (16#07)", "NaN", "-Infinity", "90", "1000000.0"]
    line = json.loads(written("jsonl", layout, row))
    assert (line["b"], line["r"], line["l"], line["marks"]) == (True, "NaN", "-Infinity", {"b": "16#07"})


def test_a_member_called_like_a_column_stands_behind_data() -> None:
    layout = layout_of("status : INT; Length : INT; n : INT; hex2 : INT;")
    line = json.loads(written("jsonl", layout, row_of(b"\1\0\2\0\3\0\4\0")))
    assert [*line][-4:] == ["data.status", "data.Length", "data.n", "hex2"]
    assert (line["status"], line["data.status"], line["n"], line["data.n"]) == ("7008", 1, 1, 3)


def test_the_members_that_are_asked_for_stand_in_their_order() -> None:
    layout, row = layout_of("a : INT; m : ARRAY[1..2, 0..1] OF INT; b : INT;"), row_of(bytes(range(12)))
    [found] = read_csv(written("csv", layout, row, members="b, m[2,0],data.a"))
    assert [*found][10:] == ["b", "m[2,0]", "a"] and found["a"] == str(0x0100)
    [found] = read_csv(written("csv", layout, row, members="m"))
    assert [*found][10:] == ["m[1,0]", "m[1,1]", "m[2,0]", "m[2,1]"], "all of a part"
    with pytest.raises(UserError, match="--members: found 'mm', expected m"):
        written("csv", layout_of("m : INT;"), members="mm")


def test_of_too_many_members_the_first_are_columns() -> None:
    out, layout = io.StringIO(), layout_of("m : ARRAY[0..2000] OF BYTE;")
    table = MessageTable(out, "csv", [MessageType("X", layout)])
    table.write(("X",), row_of(bytes(2001)))
    assert (table.left_out, len(out.getvalue().splitlines()[0].split(","))) == (2001 - 1024, 10 + 1024)
    with pytest.raises(UserError, match="2001 of them, expected at most 1024"):
        MessageTable(out, "csv", [MessageType("X", layout)], members="m")


def test_several_types_share_one_header() -> None:
    out = io.StringIO()
    types = [MessageType(name, layout_of(text)) for name, text in (("A", "a : INT;"), ("B", "b : DINT;"))]
    table = MessageTable(out, "csv", types)
    table.write(("A",), row_of(b"\1\0"))
    table.write(("B",), row_of(b"\2\0\0\0"))
    table.write(("C",), row_of(b"\3"))
    found = read_csv(out.getvalue())
    assert [(row["A.a"], row["B.b"]) for row in found] == [("1", ""), ("", "2"), ("", "")]
    same = io.StringIO()
    table = MessageTable(same, "csv", [types[0], types[0]._replace(instance="B")])
    table.write(("B",), row_of(b"\1\0"))
    assert read_csv(same.getvalue())[0]["a"] == "1", "of one type no instance stands before it"


def told(layout: Layout, raw: bytes) -> Sequence[object]:
    return [*json.loads(decoded_json(layout, raw, "T"))["values"].values()]


@pytest.mark.slow
@given(layouts(), st.data())
def test_random_messages_have_the_values_of_udt_decode(layout: Layout, data: st.DataObject) -> None:
    raw = data.draw(st.binary(max_size=layout.size + 2))
    leaves = layout.leaves(0, 1024)
    expected = told(layout, raw)[:1024]
    line = [*json.loads(written("jsonl", layout, row_of(raw))).values()][10 : 10 + len(leaves)]
    assert line == expected
    cells = [*csv.reader(io.StringIO(written("csv", layout, row_of(raw)), newline=""))][1][10:]
    for leaf, cell, value in zip(leaves, cells, expected, strict=True):
        shown = cell.partition(" (")[0] if not isinstance(value, str) else cell
        match value:
            case None:
                assert cell == ""
            case bool():
                assert shown == str(value).upper()
            case float():
                code = "<f" if leaf.size == 4 else "<d"
                assert struct.pack(code, float(cell)) == struct.pack(code, value)
            case str():
                is_text = isinstance(leaf.type, StringType) or value_text(leaf, value)[:1] == "'"
                guard = "'" * (is_text and value.startswith(("=", "+", "-", "@", "\t", "\r")))
                mark = "" if is_text else cell[len(value) :]
                assert cell == guard + one_line(value) + mark
                assert not mark or re.fullmatch(r" \(.*\)", mark)
            case _:
                assert cell == str(value)


def test_csv_of_one_instance_is_a_whole_file() -> None:
    rows = [row_of(b"\1\0", number) for number in (4, 5)]
    text = format_csv(rows, MessageType("X", layout_of("a : INT;")), "X", None)
    assert [(row["n"], row["time"], row["a"]) for row in read_csv(text)] == [("4", "", "1"), ("5", "", "1")]
    assert format_csv(rows, None, "X", None).splitlines()[1].endswith("01 00")
