"""Rows of the grammar table of udt.md section 5: arrays, texts, names, structures, each as a small file."""

from __future__ import annotations

import pytest

from tests.udt.st_texts import INT, good, lines, member, members
from tests.udt.udt_strategies import types_of
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join
from trcvtui.udt.types import (
    Array,
    Pointer,
    StringType,
    Struct,
    Unplaced,
    type_text,
)

# -- arrays, constants, texts, subranges -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ARRAY [ 1 .. 3 , 0 .. 2 ] OF INT", "ARRAY[1..3,0..2] OF INT"),
        ("ARRAY[0..1]OF\nARRAY[0..1]OF BYTE", "ARRAY[0..1] OF ARRAY[0..1] OF BYTE"),
        ("ARRAY[-(3)..2*(4-1)] OF INT", "ARRAY[-3..6] OF INT"),
        ("Array[0..\"MAX\"] of Bool", "ARRAY[0..10] OF BOOL"),
        ("ARRAY[1..GVL.MAX+1] OF INT", "ARRAY[1..11] OF INT"),
        ("ARRAY[1..Lib.GVL.MAX / 3] OF INT", "ARRAY[1..3] OF INT"),
        ("ARRAY[E#A..E.C] OF INT", "ARRAY[2..4] OF INT"),
        ("ARRAY[0..UINT#16#F] OF INT", "ARRAY[0..15] OF INT"),
        ("STRING[gvl.max]", "STRING[10]"),
        ("WSTRING(MAX - 1)", "WSTRING[9]"),
        ("INT(-MAX..MAX)", "INT(-10..10)"),
        ("Small(1..2)", "SINT(1..2)"),
        ("REAL(0.0..1.5)", "REAL"),
    ],
)  # fmt: skip
def test_bounds_and_lengths_are_worked_out(text: str, expected: str) -> None:
    constants = "VAR_GLOBAL CONSTANT MAX : INT := 10; END_VAR"
    types = good(f"{constants} TYPE E : (A := 2, B, C); Small : SINT(0..5); T : {text}; END_TYPE")
    assert type_text(types.named("T")) == expected


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("ARRAY[MAX..9] OF INT", "f.st:1:16: found 'MAX', which is 10, expected a number up to 9"),
        (
            "ARRAY[1..MAX-10] OF INT",
            "f.st:1:19: found 'MAX-10', which is 0, expected a number from 1 upwards",
        ),
        ("STRING[MAX-10]", "f.st:1:17: found 'MAX-10', which is 0, expected a length of 1 or more"),
        ("ARRAY[0..MAX/0] OF INT", "f.st:1:19: found 'MAX/0', expected no division by zero"),
        ("SINT(0..200)", "f.st:1:10: found SINT(0..200), expected limits from -128 to 127"),
        ("BOOL(0..1)", "f.st:1:10: found 'BOOL', expected an integer type such as INT"),
        ("ARRAY[*] OF INT", "f.st:1:16: found '*', expected a whole number"),
        (
            "ARRAY[0..9999999999999999999*9] OF INT",
            "f.st:1:19: found '9999999999999999999*9', expected a number of at most 64 bits",
        ),
    ],
)
def test_bounds_that_do_not_work_out(text: str, line: str) -> None:
    constants = "VAR_GLOBAL CONSTANT MAX : INT := 10; END_VAR"
    assert lines(f"TYPE T : {text}; END_TYPE {constants}") == [line]


def test_unknown_types_and_constants_are_told_together_each_once_and_the_good_ones_are_kept() -> None:
    types = types_of(
        "TYPE A : STRUCT x : ARRAY[1..GVL.N] OF Foo; y : STRING[gvl.n + M]; z : FOO; END_STRUCT\n"
        "B : ARRAY[0..M] OF INT; C : A; D : INT; END_TYPE",
        "f.st",
    )
    assert [problem.found for problem in types.problems] == ["'GVL.N'", "'Foo'", "'M'"]
    assert types.unknown_constants == ("GVL.N", "M")
    assert types.names() == ["D"]
    later = types_of("TYPE A : ARRAY[0..Z] OF B; B : ARRAY[0..Y] OF INT; C : ARRAY[0..X] OF INT; END_TYPE")
    assert later.unknown_constants == ("Z", "Y", "X")
    known = join([read_st("TYPE B : ARRAY[0..M] OF INT; END_TYPE", "f.st")], "f.st", {"Lib.M": 2})
    assert type_text(known.named("B")) == "ARRAY[0..2] OF INT"


def test_a_huge_bound_costs_nothing() -> None:
    type_ = good(f"TYPE T : ARRAY[0..{2**63}, 0..{2**63}] OF STRING[{2**40}]; END_TYPE").named("T")
    assert isinstance(type_, Array)
    assert type_.count == (2**63 + 1) ** 2


# -- names -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Lib.T", "_.T", "Ns.Sub.t", "`T`", '"T"', '_."T"', "x . T"])
def test_a_qualified_name_is_known_by_its_last_part(name: str) -> None:
    types = good(f"TYPE T : STRUCT END_STRUCT U : {name}; END_TYPE")
    assert types.named("U") is types.named("T")


def test_quoted_names_may_be_keywords_and_hold_anything() -> None:
    types = good(
        'TYPE "My type-1" : STRUCT "Type" : INT; "END_STRUCT" : BOOL; `x y` : "My type-2"; END_STRUCT;'
        ' "My type-2" : INT; END_TYPE'
    )
    assert members(types, "my TYPE-1") == {"Type": "INT", "END_STRUCT": "BOOL", "x y": "INT"}


def test_places_and_several_names() -> None:
    types = good(
        "TYPE T : STRUCT a AT %I* : INT; b AT%Q*:BOOL; c, d AT %MD48 : BYTE; e {x} AT %IX0.3 : BIT;"
        " AT : INT; END_STRUCT END_TYPE"
    )
    assert members(types, "T") == {"a": "INT", "b": "BOOL", "c": "BYTE", "d": "BYTE", "e": "BIT", "AT": "INT"}


def test_names_of_all_letters_and_an_empty_struct() -> None:
    types = good("TYPE 温度_1 : STRUCT END_STRUCT; Größe : STRUCT ключ : 温度_1; END_STRUCT END_TYPE // ±°C")
    assert members(types, "温度_1") == {}
    assert members(types, "Größe") == {"ключ": "温度_1"}


# -- structures ------------------------------------------------------------------------------------------


def test_structures_and_unions_in_place() -> None:
    types = good(
        "TYPE T : STRUCT a : STRUCT b : UNION x : REAL := 1.0; y : ARRAY[0..3] OF BYTE; END_UNION;"
        " END_STRUCT;"
        " c : ARRAY[0..1] OF STRUCT d : INT END_STRUCT; e : (P, Q); END_STRUCT; END_TYPE"
    )
    assert members(types, "T") == {"a": "STRUCT", "c": "ARRAY[0..1] OF STRUCT", "e": "INT"}


@pytest.mark.parametrize("word", ["OVERLAP", "PERSISTENT"])
def test_a_word_after_struct_is_accepted_and_may_be_a_member(word: str) -> None:
    types = good(f"TYPE T : STRUCT {word} a : INT; END_STRUCT END_TYPE TYPE U : INT; END_TYPE")
    assert members(types, "T") == {"a": "INT"}
    assert list(types.notes) == (["t"] if word == "OVERLAP" else [])
    assert members(good(f"TYPE T : STRUCT {word} : INT; END_STRUCT END_TYPE"), "T") == {word: "INT"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("POINTER TO Nowhere", "POINTER TO Nowhere"),
        ("pointer to array[0..9] of Lib.T", "pointer to array[0..9] of Lib.T"),
        ("REFERENCE TO INT", "REFERENCE TO INT"),
        ("REF_TO STRING[20]", "REF_TO STRING[20]"),
        ("POINTER TO POINTER TO BYTE", "POINTER TO POINTER TO BYTE"),
    ],
)
def test_pointers_keep_their_text_and_their_target_may_be_unknown(text: str, expected: str) -> None:
    assert member(f"a : {text} := 0;") == Pointer(expected)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("TON := (PT := T#5S)", "TON"),
        ("TON", "TON"),
        ("Standard.R_TRIG", "R_TRIG"),
        ("Lib.Cyl(MAIN._a, b := (1))", "Lib.Cyl"),
        ("Inspector(THISSTRUCT)", "Inspector"),
        ("ANY_NUM", "ANY_NUM"),
        ("Variant", "VARIANT"),
        ("Pointer", "POINTER"),
    ],
)
def test_what_nobody_can_lay_out_keeps_its_name_and_the_members_around_it(text: str, name: str) -> None:
    types = good(f"TYPE T : STRUCT x : INT; a : {text}; y : INT; END_STRUCT END_TYPE")
    type_ = types.named("T")
    assert isinstance(type_, Struct)
    unplaced = type_.members[1].type
    assert isinstance(unplaced, Unplaced)
    assert unplaced.name == name


def test_a_declared_type_wins_over_a_builtin_one() -> None:
    types = good(
        "TYPE TON : STRUCT a : INT; END_STRUCT; T : TON; DTL : INT; U : DTL; V : T_MaxString; END_TYPE"
    )
    assert types.named("T") is types.named("TON")
    assert types.named("U") is INT
    assert types.named("V") == StringType(255)
