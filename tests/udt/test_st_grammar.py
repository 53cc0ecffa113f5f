"""Every row of the grammar table of udt.md section 5, each as a small file of its own: words and types."""

from __future__ import annotations

import pytest

from tests.udt.st_texts import good, lines, members
from tests.udt.udt_strategies import types_of
from trcvtui.udt.ast import MOST_NESTED
from trcvtui.udt.types import (
    ELEMENTARY,
    Enumeration,
    Struct,
    Union,
)

# -- comments, pragmas, attributes -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "pragma",
    [
        "{attribute 'x' := 'y'}",
        '{attribute addProperty Name "a } b"}',
        "{attribute 'pytmc' := '\n    pv: A;\n    field: } INVALID ;\n    io: i;\n'}",
        "{attribute 'text' := 'the valve's state'}",
        "{S7.extern = ReadOnly}",
        '{\n  S7_Access := "ReadOnly := External";\n  S7_Visibility := "Hidden"\n}',
        "{ }",
        "{attribute wpf [Container(Layout.Tabs)]}",
    ],
)
def test_pragmas_stand_before_and_after_everything(pragma: str) -> None:
    types = good(
        f"{pragma} TYPE {pragma} T {pragma} : {pragma} STRUCT {pragma} a {pragma} : {pragma} INT;"
        f"{pragma} b : {pragma} BOOL {pragma} ; {pragma} END_STRUCT {pragma} END_TYPE {pragma}"
    )
    assert members(types, "T") == {"a": "INT", "b": "BOOL"}


@pytest.mark.parametrize("mode", [0, 1, 2, 4, 8])
def test_pack_mode_above_a_type_is_kept_for_this_type_only(mode: int) -> None:
    types = good(
        f"TYPE A : STRUCT x : INT; END_STRUCT END_TYPE {{attribute 'hide'}}\n"
        f"{{attribute 'pack_mode' := '{mode}'}}\n(* comment *) TYPE INTERNAL B :\nSTRUCT x : INT; END_STRUCT"
        " END_TYPE;\n"
        f"TYPE C : STRUCT {{attribute 'pack_mode' := '1'}} x : INT; END_STRUCT END_TYPE"
    )
    found = {name: types.named(name) for name in types.names()}
    assert {name: t.pack for name, t in found.items() if isinstance(t, Struct)} == {
        "A": None, "B": mode, "C": None,
    }  # fmt: skip


def test_pack_mode_of_several_types_in_one_block_and_of_a_union() -> None:
    types = good(
        "TYPE A : STRUCT x : INT; END_STRUCT; {attribute 'pack_mode' := '2'} B : UNION x : INT; END_UNION;"
        " C : INT; END_TYPE"
    )
    a, b = types.named("A"), types.named("B")
    assert isinstance(a, Struct) and isinstance(b, Union)
    assert (a.pack, b.pack) == (None, 2)


def test_a_pack_mode_that_no_compiler_takes_is_told() -> None:
    text = "{attribute 'pack_mode' := '3'} TYPE A : STRUCT x : INT; END_STRUCT END_TYPE"
    assert lines(text) == ["f.st:1:41: found 'STRUCT', expected pack_mode 0, 1, 2, 4 or 8 instead of '3'"]


# -- initial values --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "initial",
    [
        "[3(0), 2([1, 2])]",
        "3(0), 2(1)",
        "(PT := T#5S)",
        "-1, -1, -1",
        "DTL#1970-01-01-00:00:00.5",
        "WSTRING#'x; y'",
        "B#16#FF",
        "F_Sqrt(2.0 * PI) ** 2",
        "Mode.Run",
        "ADR(GVL.a[3]) + SIZEOF(INT)",
        "THIS^.x",
        "NOT (a AND b) <> 5 >= 3",
        "'$'; $00'",
        '"MyConst"',
        "`x`",
    ],
)
def test_initial_values_of_every_form_are_passed_over(initial: str) -> None:
    types = good(
        f"TYPE T : STRUCT a : INT := {initial}; b : BOOL := {initial}; END_STRUCT := {initial}; END_TYPE"
    )
    assert members(types, "T") == {"a": "INT", "b": "BOOL"}


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
    ],
)  # fmt: skip
def test_enumerations(text: str, base: str, is_named: bool, values: list[tuple[str, int | None]]) -> None:
    type_ = good(f"TYPE T : {text}; END_TYPE TYPE E : (A := 4); END_TYPE").named("T")
    assert isinstance(type_, Enumeration)
    assert (type_.base.name, type_.is_named, list(type_.values)) == (base, is_named, values)


def test_the_base_of_an_enumeration_may_be_an_alias_or_a_subrange() -> None:
    types = good("TYPE A : UINT; B : UINT(0..9); T : (x) A; U : B (y := 1); END_TYPE")
    for name in ("T", "U"):
        type_ = types.named(name)
        assert isinstance(type_, Enumeration) and type_.base is ELEMENTARY["UINT"]


def test_named_values_of_other_types_are_those_types() -> None:
    types = good("TYPE Pi : LREAL (HALF := 1.57, WHOLE := 3.14); Name : STRING; END_TYPE")
    assert types.named("Pi") is ELEMENTARY["LREAL"]


# -- EXTENDS, access words -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "head", ["T EXTENDS B :", "T : EXTENDS B :", "T : EXTENDS B", "T EXTENDS Lib.B :", "PUBLIC T EXTENDS b :"]
)
def test_extends_stands_before_or_after_the_colon(head: str) -> None:
    types = good(
        f"TYPE {head} STRUCT x : INT; END_STRUCT END_TYPE TYPE B : STRUCT y : BOOL; END_STRUCT END_TYPE"
    )
    type_ = types.named("T")
    assert isinstance(type_, Struct)
    assert type_.base is types.named("B")


def test_a_union_extends_a_union() -> None:
    types = good(
        "TYPE V EXTENDS U : UNION b : INT; END_UNION END_TYPE TYPE U : UNION a : INT; END_UNION END_TYPE"
    )
    type_ = types.named("V")
    assert isinstance(type_, Union)
    assert type_.base is types.named("U")


@pytest.mark.parametrize("word", ["INTERNAL", "PUBLIC", "PRIVATE", "PROTECTED"])
def test_an_access_word_may_stand_before_a_name_and_be_one(word: str) -> None:
    assert good(f"TYPE {word} T : INT; END_TYPE").names() == ["T"]
    assert good(f"TYPE {word} : INT; END_TYPE").names() == [word]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            "TYPE T EXTENDS Nope : STRUCT END_STRUCT END_TYPE",
            "f.st:1:16: found 'Nope', expected a known type",
        ),
        (
            "TYPE T EXTENDS T : STRUCT END_STRUCT END_TYPE",
            "f.st:1:16: found 'T', which extends this, expected a type that does not extend itself",
        ),
        (
            "TYPE A EXTENDS B : STRUCT END_STRUCT B EXTENDS A : STRUCT END_STRUCT END_TYPE",
            "f.st:1:48: found 'A', which extends this, expected a type that does not extend itself",
        ),
        (
            "TYPE A : INT; T EXTENDS A : STRUCT END_STRUCT END_TYPE",
            "f.st:1:25: found 'A', expected a STRUCT to extend",
        ),
        (
            "TYPE A : STRUCT END_STRUCT T EXTENDS A : UNION END_UNION END_TYPE",
            "f.st:1:38: found 'A', expected a UNION to extend",
        ),
        (
            "TYPE T EXTENDS A : INT; END_TYPE",
            "f.st:1:20: found 'INT', expected STRUCT or UNION after EXTENDS",
        ),
        (
            "TYPE A : STRUCT x : INT; END_STRUCT T EXTENDS A : STRUCT X : INT; END_STRUCT END_TYPE",
            "f.st:1:58: found member 'X' a second time, expected a name that its base has not",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_extended(text: str, line: str) -> None:
    assert lines(text) == [line]


def test_a_long_chain_of_bases_is_refused_and_its_lower_part_kept() -> None:
    chain = "".join(f"T{n} EXTENDS T{n + 1} : STRUCT m{n} : INT; END_STRUCT " for n in range(3000))
    types = types_of(f"TYPE {chain} T3000 : STRUCT END_STRUCT END_TYPE")
    assert len(types.names()) == MOST_NESTED
    assert types.problems
