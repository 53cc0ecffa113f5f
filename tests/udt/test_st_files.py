"""Rows of the grammar table of udt.md section 5: what stands around the types, and the other text formats."""

from __future__ import annotations

import pytest

from tests.udt.st_texts import good, lines, members, read
from tests.udt.udt_strategies import types_of
from trcvtui.udt.sources import parse_source
from trcvtui.udt.sources.st import read_spec, read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import (
    Enumeration,
    StringType,
    Struct,
)

# -- what stands around the types ------------------------------------------------------------------------


def test_other_blocks_of_the_file_are_passed_over() -> None:
    types = good(
        "FUNCTION_BLOCK F VAR x : T; END_VAR {attribute 'pack_mode' := '1'} x := 5; IF a THEN TYPE_ :="
        " 1; END_IF"
        " END_FUNCTION_BLOCK\n TYPE T : STRUCT a : INT; END_STRUCT END_TYPE\n PROGRAM MAIN END_PROGRAM\n"
        'VAR_GLOBAL RETAIN x : INT; END_VAR DATA_BLOCK "db" STRUCT a : Int; END_STRUCT BEGIN a := 5;'
        " END_DATA_BLOCK"
        " TYPE U : T; END_TYPE CONFIGURATION c RESOURCE r END_RESOURCE END_CONFIGURATION"
    )
    assert types.names() == ["T", "db", "U"]
    type_ = types.get_type("T")
    assert isinstance(type_, Struct) and type_.pack is None


def test_a_block_without_an_end_is_told_and_hides_nothing() -> None:
    types = types_of("PROGRAM MAIN x := 5; TYPE T : INT; END_TYPE", "f.st")
    assert [str(p) for p in types.problems] == ["f.st:1:1: found 'PROGRAM', expected 'END_PROGRAM' after it"]
    assert types.names() == ["T"]
    types = types_of("TYPE T : INT; PROGRAM MAIN END_PROGRAM TYPE U : INT; END_TYPE", "f.st")
    assert [str(p) for p in types.problems] == ["f.st:1:15: found 'PROGRAM', expected 'END_TYPE'"]
    assert types.names() == ["T", "U"]


def test_constants_of_the_file_are_kept_the_others_passed_over() -> None:
    declared = read_st(
        "VAR_GLOBAL CONSTANT {x} A : INT := 5; B, C : UINT := A * 2; s : STRING := 'a;b'; r : REAL := 1.5;\n"
        "t : BOOL := TRUE; d AT %MW0 : INT := 16#F END_VAR VAR_GLOBAL x : INT := 1; END_VAR",
        "f.st",
    )
    assert declared.problems == ()
    found = [(name, n if isinstance(n, int) else n.text) for name, n, _ in declared.constants]
    assert found == [
        ("A", 5), ("B", "A*2"), ("C", "A*2"), ("t", "TRUE"), ("d", 15),
    ]  # fmt: skip


# -- the other text formats ------------------------------------------------------------------------------

AWL = """TYPE UDT 5
TITLE =don't
VERSION : 0.1
  STRUCT
   A : INT ;  // Zähler
   B : ARRAY  [0 .. 2 ] OF BYTE ;
  END_STRUCT ;
END_TYPE
DATA_BLOCK DB 10
TITLE =Begin of (* it's
VERSION : 0.1
  STRUCT
   K : UDT 5;
   L : BOOL  := TRUE;
  END_STRUCT ;
BEGIN
   K.A := 0;  // END_DATA_BLOCK
   K.B[0] := 'END_DATA_BLOCK {'; (* don't
   END_DATA_BLOCK *) STRUCT ( { TYPE
END_DATA_BLOCK
DATA_BLOCK DB 11 FB 3 BEGIN END_DATA_BLOCK
DATA_BLOCK "instance" "Motor" BEGIN END_DATA_BLOCK
FUNCTION_BLOCK "Motor" VAR a : INT; END_VAR BEGIN U( ; L DB10.DBW 0; END_FUNCTION_BLOCK
DATA_BLOCK "of UDT" { S7_Optimized_Access := 'TRUE' } VERSION : 0.1 NON_RETAIN UDT5 BEGIN END_DATA_BLOCK
DATA_BLOCK vars
NON_RETAIN
  VAR Begin : Int; END_VAR VAR RETAIN b { S7_SetPoint := 'True'} : DInt := 5; END_VAR
BEGIN
END_DATA_BLOCK
DATA_BLOCK "array" READ_ONLY Array[0..1] of UDT 5; END_DATA_BLOCK
"""


@pytest.mark.parametrize("suffix", [".db", ".awl", ".scl", ".txt", ""])
def test_a_data_block_is_a_type_and_one_of_an_fb_is_none(suffix: str) -> None:
    types = read(suffix, AWL)
    assert members(types, "DB10") == {"K": "UDT5", "L": "BOOL"}
    assert members(types, "of UDT") == members(types, "UDT5") == {"A": "INT", "B": "ARRAY[0..2] OF BYTE"}
    assert members(types, "vars") == {"Begin": "INT", "b": "DINT"}
    assert types.names() == ["UDT5", "DB10", "of UDT", "vars", "array"]
    assert {types.source_layout(name) for name in types.names()} == {"s7-standard"}
    assert list(types.notes) == ["of udt"] and "optimised access" in types.notes["of udt"][0]


def test_what_is_wrong_in_a_data_block_ends_with_it() -> None:
    broken = "DATA_BLOCK D STRUCT a : INT BEGIN END_DATA_BLOCK DATA_BLOCK E INT 5 END_DATA_BLOCK"
    assert lines(f"{broken} TYPE T : INT; END_TYPE") == [
        "f.st:1:29: found 'BEGIN', expected ';'",
        "f.st:1:35: found 'END_DATA_BLOCK', expected a member or 'END_STRUCT'",
        "f.st:1:67: found '5', expected 'BEGIN'",
    ]


def test_struct_and_var_alone_are_a_type_named_by_the_file() -> None:
    text = "{attribute 'pack_mode' := '1'} STRUCT array : ARRAY[1...GVL.N] OF INT; Type : INT; END_STRUCT"
    types = join_declarations([parse_source(text, "plc/weight.st")], "weight.st", {"GVL.N": 2})
    assert members(types, "weight") == {"array": "ARRAY[1..2] OF INT", "Type": "INT"}
    weight = types.get_type("weight")
    assert isinstance(weight, Struct) and weight.pack == 1
    assert members(read(".st", "VAR a : INT; END_VAR VAR b : F(c := 1); END_VAR"), "f") == {
        "a": "INT",
        "b": "F",
    }
    assert "variables" in read("", "VAR a : INT; END_VAR").notes["f"][0]
    for program in ("VAR a : INT; END_VAR TYPE T : INT; END_TYPE", "VAR CONSTANT A : INT := 1; END_VAR"):
        assert "f" not in read(".st", program).names()


@pytest.mark.parametrize(
    ("text", "name", "layout"),
    [
        ("struct T { int a; };", "T", ""),
        ('\ufeff<?xml version="1.0"?><TcPlcObject><DUT Name="T"><Declaration>TYPE T : INT; END_TYPE'
         "</Declaration></DUT></TcPlcObject>", "T", ""),
        ('TYPE "T"\nVERSION : 0.1\nSTRUCT a : Int; END_STRUCT; END_TYPE', "T", "s7-standard"),
        ("(* @NESTEDCOMMENTS := 'No' *) (* @PATH := '' *) TYPE T : INT; END_TYPE (* @OBJECT_END *)", "T", ""),
        ("struct a : INT; end_struct", "f", ""),
    ],
)  # fmt: skip
def test_a_text_without_a_suffix_tells_its_format(text: str, name: str, layout: str) -> None:
    types = read("", text.removeprefix("\ufeff"))
    assert types.names() == [name] and types.source_layout(name) == layout


def test_a_tia_header_that_does_not_end_is_told() -> None:
    declared = parse_source(
        'TYPE "A" VERSION : 0.1\nEND_TYPE TYPE "B" STRUCT a : Int; END_STRUCT; END_TYPE', "f.udt", ".udt"
    )
    types = join_declarations([declared], "f.udt")
    assert [str(p) for p in types.problems] == ["f.udt:2:1: found 'END_TYPE', expected 'STRUCT'"]
    assert types.names() == ["B"]


def test_b_and_r_has_many_types_in_a_block_and_enumerations_of_four_bytes() -> None:
    types = read(
        ".typ",
        "TYPE\n\tA : \tSTRUCT  (*c*)\n\t\tx : {REDUND_UNREPLICABLE} ARRAY[0..1]OF BOOL; (*c*)\n\t\tm :"
        " Mode := RUN;\n"
        "\tEND_STRUCT;\n\tMode : \n\t\t( (*c*)\n\t\tSTOP := 10, (*c*)\n\t\tRUN\n\t\t);\n\tB : (P)"
        " USINT;\nEND_TYPE",
    )
    mode, other = types.get_type("Mode"), types.get_type("B")
    assert isinstance(mode, Enumeration) and isinstance(other, Enumeration)
    assert (mode.base.name, mode.values, other.base.name) == ("DINT", (("STOP", 10), ("RUN", 11)), "USINT")
    assert members(types, "A") == {"x": "ARRAY[0..1] OF BOOL", "m": "Mode"}
    constants = parse_source(
        "VAR CONSTANT\n\tMAX : USINT := 5;\nEND_VAR\nVAR x : INT := 3; END_VAR", "f.var", ".var"
    )
    assert [one[:2] for one in constants.constants] == [("MAX", 5)]


def test_codesys_2_3_headers_are_comments_and_other_objects_are_passed_over() -> None:
    types = read(
        ".exp",
        "\r\n\r\n(* @NESTEDCOMMENTS := 'Yes' *)\r\n(* @PATH := '\\/Types' *)\r\n(* @OBJECTFLAGS := '0,"
        " 8' *)\r\n"
        "TYPE T :\r\nSTRUCT\r\n\ta: ARRAY [0..2] OF INT := 1,2,3; (* (* *)"
        " *)\r\nEND_STRUCT\r\nEND_TYPE\r\n\r\n"
        "(* @END_DECLARATION := '0' *)\r\nPROGRAM P\r\n_LD_BODY\r\n_NETWORKS :"
        " 1\r\nEND_PROGRAM\r\n_ALARMCONFIG\r\n"
        "_ALARMCONFIGNEXTTEXTID : 1\r\nTYPE U : T; END_TYPE\r\nVISUALISATION x _VISU_END\r\n",
    )
    assert types.names() == ["T", "U"]
    text = "(* @NESTEDCOMMENTS := 'No' *) (* a (* b *) TYPE T : INT; END_TYPE (* c *) (* d *) *) "
    assert join_declarations([parse_source(text, "f.exp", ".exp")], "f.exp").names() == ["T"]


# -- inside another file ---------------------------------------------------------------------------------


def test_a_text_inside_another_file_tells_the_lines_of_that_file() -> None:
    declared = read_st("TYPE T :\nSTRUCT a INT; END_STRUCT END_TYPE", "f.xml", first_line=40)
    assert [str(p) for p in declared.types[0].problems] == ["f.xml:41:10: found 'INT', expected ':'"]
    assert declared.types[0].where == "f.xml:40:6"


def test_one_type_of_tia_is_read_as_a_specification() -> None:
    assert read_spec("String[10]", "m") == StringType(10)
    assert type(read_spec('Array[0.."N"] of "My type"', "m")).__name__ == "ArraySpec"


def test_a_second_declaration_is_refused_with_both_places() -> None:
    files = [
        read_st("TYPE A : INT; END_TYPE", "a.st"),
        read_st("TYPE a : STRUCT x : BOOL; END_STRUCT END_TYPE", "b.st"),
    ]
    asked = join_declarations(files, "both")
    assert asked.names() == []
    assert [str(problem) for problem in asked.problems] == [
        "b.st:1:6: found 'a' a second time, expected one declaration of it; the first is at a.st:1:6"
    ]
