"""Bytes written for another tool are the same bytes when that tool reads them."""

from __future__ import annotations

import ast
import base64
import csv
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.udt.udt_strategies import layout_of, types_of
from trcvtui.udt.byte_text import BYTE_FORMS, parse_hex
from trcvtui.udt.report import csv_lines, markdown, member_rows

EVERY_BYTE = bytes(range(256)) + b"'\"\\\n?"
NAME = "größe 1"


def written(form: str, content: bytes = EVERY_BYTE) -> str:
    return BYTE_FORMS[form](content, NAME)


def test_hex_is_one_line_and_comes_back() -> None:
    assert parse_hex(written("hex")) == EVERY_BYTE
    assert "\n" not in written("hex")


def test_the_iec_list_comes_back() -> None:
    assert parse_hex(written("iec")) == EVERY_BYTE
    *lines, last = written("iec").splitlines()
    assert lines and all(line.endswith(",") for line in lines) and not last.endswith(",")


def test_base64_comes_back() -> None:
    assert base64.b64decode(written("base64"), validate=True) == EVERY_BYTE


def test_python_reads_the_literal_as_the_same_bytes() -> None:
    name, _, literal = written("python").partition(" = ")
    assert name == "gr__e_1"
    assert ast.literal_eval(literal) == EVERY_BYTE


def test_the_st_array_is_a_declaration_that_this_program_reads() -> None:
    text = written("st")
    types_of(f"TYPE T : STRUCT {text} END_STRUCT END_TYPE").named("T")
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
