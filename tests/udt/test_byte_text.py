"""Bytes as text: hex as people write it, a dump, the forms of other tools, what can be looked for."""

from __future__ import annotations

import ast
import base64
import csv
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from tests.udt.udt_strategies import layout_of, types_of
from trcvtui.errors import UserError
from trcvtui.udt.byte_text import (
    BYTE_FORMS,
    find_all,
    find_first,
    find_last,
    hexdump,
    parse_hex,
    parse_search,
)
from trcvtui.udt.report import csv_lines, markdown, member_rows


@pytest.mark.parametrize("text", ["", "  ", "\n", ",", " , "])
def test_no_digits_are_no_bytes(text: str) -> None:
    assert parse_hex(text) == b""


def test_the_first_thing_that_is_no_hex_is_named_with_its_place() -> None:
    golden.mistakes("hex", parse_hex)
    with pytest.raises(UserError, match=r"position 4: found '\\x1b'"):
        parse_hex("01 \x1b[2J")


def test_a_long_run_of_digits_is_not_repeated_in_the_message() -> None:
    with pytest.raises(UserError) as raised:
        parse_hex("12 " + "0" * 10_001, "rx.hex")
    assert raised.value.lines() == [
        "rx.hex, position 4: found '00000000000000000000...' with 10001 digits, "
        "expected hex bytes such as 01 02 0A"
    ]


@given(st.binary(max_size=50), st.sampled_from(["", " ", ",", "\n"]))
def test_bytes_written_as_hex_read_back(payload: bytes, gap: str) -> None:
    assert parse_hex(gap.join(f"{byte:02x}" for byte in payload)) == payload


@given(st.text(alphabet="0123456789abcxX#, \n_g", max_size=30))
def test_any_text_is_bytes_or_a_mistake_of_one_line(text: str) -> None:
    try:
        assert isinstance(parse_hex(text), bytes)
    except UserError as refused:
        assert len(refused.lines()) == 1


def test_a_dump_has_offset_hex_text_and_at_last_the_length() -> None:
    assert hexdump(b"0123456789abcdef\x00\x1b[1m\x7f\xff") == (
        b"00000000  30 31 32 33 34 35 36 37  38 39 61 62 63 64 65 66  |0123456789abcdef|\n"
        b"00000010  00 1b 5b 31 6d 7f ff                              |..[1m..|\n"
        b"00000017\n"
    )
    assert hexdump(bytes(48)).count(b"|................|") == 3, "equal lines are not left out"
    assert hexdump(b"") == b""


@pytest.mark.skipif(shutil.which("hexdump") is None, reason="needs the program hexdump")
@given(st.binary(min_size=1, max_size=400))
def test_hexdump_itself_says_the_same(content: bytes) -> None:
    theirs = subprocess.run(["hexdump", "-v", "-C"], input=content, capture_output=True, check=True)
    assert hexdump(content) == theirs.stdout


EVERY_BYTE = bytes(range(256)) + b"'\"\\\n?"
NAME = "größe 1"


def written(form: str, content: bytes = EVERY_BYTE) -> str:
    return BYTE_FORMS[form](content, NAME)


def test_hex_in_one_line_base64_and_the_iec_list_come_back() -> None:
    assert base64.b64decode(written("base64"), validate=True) == EVERY_BYTE
    assert parse_hex(written("hex")) == parse_hex(written("iec")) == EVERY_BYTE
    assert "\n" not in written("hex")
    *lines, last = written("iec").splitlines()
    assert lines and all(line.endswith(",") for line in lines) and not last.endswith(",")


def test_python_reads_the_literal_as_the_same_bytes() -> None:
    name, _, literal = written("python").partition(" = ")
    assert name == "gr__e_1"
    assert ast.literal_eval(literal) == EVERY_BYTE


def test_the_st_array_is_a_declaration_that_this_program_reads() -> None:
    text = written("st")
    types_of(f"TYPE T : STRUCT {text} END_STRUCT END_TYPE").get_type("T")
    assert text.startswith(f"gr__e_1 : ARRAY[0..{len(EVERY_BYTE) - 1}] OF BYTE := [")
    assert parse_hex(text.partition("[\n")[2].removesuffix("];")) == EVERY_BYTE


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_gcc_compiles_the_c_array_to_the_same_bytes(tmp_path: Path) -> None:
    program = tmp_path / "array.c"
    program.write_text(
        "#include <stdint.h>\n#include <stdio.h>\n"
        + written("c")
        + "\nint main(void) { fwrite(gr__e_1, 1, sizeof gr__e_1, stdout); return 0; }\n"
    )
    subprocess.run(["gcc", "-Wall", "-Werror", "-o", tmp_path / "array", program], check=True)
    assert subprocess.run([tmp_path / "array"], capture_output=True, check=True).stdout == EVERY_BYTE


def test_in_markdown_no_value_is_markup() -> None:
    layout = layout_of("s : STRING[20];", "packed")
    rows = member_rows(layout, b"\x14\x0a|<b>`*_]\n\x1b" + bytes(12), "T")
    assert [*markdown(rows)][2] == ("| 0 | STRING\\[20\\] | s | '\\|\\<b\\>\\`\\*\\_\\]\\\\n\\\\x1b' |")


def test_csv_comes_back_with_missing_members_named() -> None:
    layout = layout_of("a : INT; s : STRING[3]; b : BOOL;", "packed")
    text = csv_lines(member_rows(layout, b'\x05\0\x03\x03",;', "T"))
    assert list(csv.reader(text)) == [
        ["offset", "type", "member", "value"],
        ["0", "INT", "a", "5"],
        ["2", "STRING[3]", "s", "'\",;'"],
        ["7", "BOOL", "b", "no data"],
    ]


@pytest.mark.parametrize(
    ("text", "patterns"),
    [
        ("29 00", (b"\x29\x00",)),
        ("0x29,16#0", (b"\x29\x00",)),
        ('"héllo"', ("héllo".encode(),)),
        ("'open", (b"open",)),
        ("4x", (b"4x",)),
        ("abc", (b"abc",)),
        ("=258", (b"\x02\x01", b"\x01\x02", b"\x02\x01\0\0", b"\0\0\x01\x02",
                  struct.pack("<q", 258), struct.pack(">q", 258))),
        ("=-1", (b"\xff" * 2, b"\xff" * 4, b"\xff" * 8)),
        ("=65536", (b"\0\0\x01\0", b"\0\x01\0\0", struct.pack("<q", 65536), struct.pack(">q", 65536))),
        ("=1.5", tuple(struct.pack(code, 1.5) for code in ("<f", ">f", "<d", ">d"))),
        ("=16#FFFF", (b"\xff\xff", b"\xff\xff\0\0", b"\0\0\xff\xff",
                      b"\xff\xff" + bytes(6), bytes(6) + b"\xff\xff")),
    ],
)  # fmt: skip
def test_a_text_asks_for_these_bytes(text: str, patterns: tuple[bytes, ...]) -> None:
    assert parse_search(text).patterns == patterns


@pytest.mark.parametrize("text", ["", '""', "=", "=abc", "=99999999999999999999", "00" * 257])
def test_what_asks_for_nothing_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(UserError) as refused:
        parse_search(text)
    assert len(refused.value.lines()) == 1


def test_the_nearest_of_several_patterns_counts() -> None:
    content = b"..ab..cd..ab"
    assert find_first(content, (b"cd", b"ab")) == 2
    assert find_first(content, (b"cd", b"ab"), 3) == 6
    assert find_last(content, (b"cd", b"ab"), 10) == 6
    assert find_last(content, (b"cd", b"ab"), 11) == 10
    assert find_first(content, (b"x",)) is None and find_last(content, (b"ab",), 0) is None
    assert list(find_all(b"aaa", (b"aa",))) == [range(2), range(1, 3)]
