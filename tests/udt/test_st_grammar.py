"""Every row of the grammar table of udt.md section 5, each as a small file of its own."""

from __future__ import annotations

import pytest

from tests.udt.st_texts import INT, good, member, members
from tests.udt.udt_strategies import types_of
from trcvtui.udt.ast import MOST_NESTED
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Enumeration,
    Pointer,
    StringType,
    Struct,
    Union,
    type_text,
)

# -- comments, pragmas, attributes -----------------------------------------------------------------------


def test_pack_mode_of_several_types_in_one_block_and_of_a_union() -> None:
    types = good(
        "TYPE A : STRUCT x : INT; END_STRUCT; {attribute 'pack_mode' := '2'} B : UNION x : INT; END_UNION;"
        " C : INT; END_TYPE"
    )
    a, b = types.get_type("A"), types.get_type("B")
    assert isinstance(a, Struct) and isinstance(b, Union)
    assert (a.pack, b.pack) == (None, 2)


# -- initial values --------------------------------------------------------------------------------------


def test_the_last_member_and_the_last_type_may_lack_their_semicolon() -> None:
    types = good(
        "TYPE T : STRUCT a : INT; b : BOOL END_STRUCT END_TYPE TYPE U : UNION c : INT END_UNION END_TYPE;"
    )
    assert (members(types, "T"), members(types, "U")) == ({"a": "INT", "b": "BOOL"}, {"c": "INT"})


# -- alias, enumeration ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "base", "is_named", "values"),
    [
        ("(a, b := 5) UINT := b", "UINT", True, [("a", 0), ("b", 5)]),
        ("(a := 2#101, b) ", "INT", False, [("a", 5), ("b", 6)]),
        ("INT (A := 1, B := 2)", "INT", True, [("A", 1), ("B", 2)]),
        ("USINT (A, B := USINT#16#10, C,)", "USINT", True, [("A", 0), ("B", 16), ("C", 17)]),
        ("(A := 4, B := A + 1, C, D := E#A * 2, F := T.C)", "INT", False,
         [("A", 4), ("B", 5), ("C", 6), ("D", 8), ("F", 6)]),
        ("(A := Nope, B, C := 3, D)", "INT", False, [("A", None), ("B", None), ("C", 3), ("D", 4)]),
        ("Word (A := 1)", "WORD", True, [("A", 1)]),
        ("(A := 5, B, C := 2,)", "INT", False, [("A", 5), ("B", 6), ("C", 2)]),
        ("(A := 16#10, B := -1) DINT := B", "DINT", True, [("A", 16), ("B", -1)]),
        ("(A, B := A + (3, 4), C, D := 9)", "INT", False, [("A", 0), ("B", None), ("C", None), ("D", 9)]),
    ],
)  # fmt: skip
def test_enumerations(text: str, base: str, is_named: bool, values: list[tuple[str, int | None]]) -> None:
    type_ = good(f"TYPE T : {text}; END_TYPE TYPE E : (A := 4); END_TYPE").get_type("T")
    assert isinstance(type_, Enumeration)
    assert (type_.base.name, type_.is_named, list(type_.values)) == (base, is_named, values)


def test_the_base_of_an_enumeration_may_be_an_alias_or_a_subrange() -> None:
    types = good("TYPE A : UINT; B : UINT(0..9); T : (x) A; U : B (y := 1); END_TYPE")
    for name in ("T", "U"):
        type_ = types.get_type(name)
        assert isinstance(type_, Enumeration) and type_.base is ELEMENTARY["UINT"]


def test_named_values_of_other_types_are_those_types() -> None:
    types = good("TYPE Pi : LREAL (HALF := 1.57, WHOLE := 3.14); Name : STRING; END_TYPE")
    assert types.get_type("Pi") is ELEMENTARY["LREAL"]


# -- EXTENDS, access words -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "head", ["T EXTENDS B :", "T : EXTENDS B :", "T : EXTENDS B", "T EXTENDS Lib.B :", "PUBLIC T EXTENDS b :"]
)
def test_extends_stands_before_or_after_the_colon(head: str) -> None:
    types = good(
        f"TYPE {head} STRUCT x : INT; END_STRUCT END_TYPE TYPE B : STRUCT y : BOOL; END_STRUCT END_TYPE"
    )
    type_ = types.get_type("T")
    assert isinstance(type_, Struct)
    assert type_.base is types.get_type("B")


def test_a_union_extends_a_union() -> None:
    types = good(
        "TYPE V EXTENDS U : UNION b : INT; END_UNION END_TYPE TYPE U : UNION a : INT; END_UNION END_TYPE"
    )
    type_ = types.get_type("V")
    assert isinstance(type_, Union)
    assert type_.base is types.get_type("U")


@pytest.mark.parametrize("word", ["INTERNAL", "PUBLIC", "PRIVATE", "PROTECTED"])
def test_an_access_word_may_stand_before_a_name_and_be_one(word: str) -> None:
    assert good(f"TYPE {word} T : INT; END_TYPE").names() == ["T"]
    assert good(f"TYPE {word} : INT; END_TYPE").names() == [word]


def test_a_long_chain_of_bases_is_refused_and_its_lower_part_kept() -> None:
    chain = "".join(f"T{n} EXTENDS T{n + 1} : STRUCT m{n} : INT; END_STRUCT " for n in range(3000))
    types = types_of(f"TYPE {chain} T3000 : STRUCT END_STRUCT END_TYPE")
    assert len(types.names()) == MOST_NESTED
    assert types.problems


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
    assert type_text(types.get_type("T")) == expected


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
    known = join_declarations(
        [read_st("TYPE B : ARRAY[0..M] OF INT; END_TYPE", "f.st")], "f.st", {"Lib.M": 2}
    )
    assert type_text(known.get_type("B")) == "ARRAY[0..2] OF INT"


def test_a_huge_bound_costs_nothing() -> None:
    type_ = good(f"TYPE T : ARRAY[0..{2**63}, 0..{2**63}] OF STRING[{2**40}]; END_TYPE").get_type("T")
    assert isinstance(type_, Array)
    assert type_.count == (2**63 + 1) ** 2


# -- names -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Lib.T", "_.T", "Ns.Sub.t", "`T`", '"T"', '_."T"', "x . T"])
def test_a_qualified_name_is_known_by_its_last_part(name: str) -> None:
    types = good(f"TYPE T : STRUCT END_STRUCT U : {name}; END_TYPE")
    assert types.get_type("U") is types.get_type("T")


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


def test_a_declared_type_wins_over_a_builtin_one() -> None:
    types = good(
        "TYPE TON : STRUCT a : INT; END_STRUCT; T : TON; DTL : INT; U : DTL; V : T_MaxString; END_TYPE"
    )
    assert types.get_type("T") is types.get_type("TON")
    assert types.get_type("U") is INT
    assert types.get_type("V") == StringType(255)
