"""Formulas of bounds, and the constants in them: by name, by the end of a name, and never as Python."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests import golden
from tests.udt.udt_strategies import types_of
from trcvtui.errors import UserError
from trcvtui.udt.ast import Formula
from trcvtui.udt.constants import DEEPEST_FORMULA, Constants, evaluate
from trcvtui.udt.literals import parse_integer
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import Enumeration, type_text

KNOWN = {"MAX": 10, "GVL.MAX": 20, "Limits.UPPER": 7, "My const": 3}


def value(text: str) -> int | None:
    plain = parse_integer(text)
    return evaluate(Formula(text.strip(), "here") if plain is None else plain, KNOWN.get)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("5", 5),
        ("-16#FF", -255),
        ("8#17 + 2#101", 20),
        ("1_000", 1000),
        ("UINT#16#F", 15),
        ("INT#-5", -5),
        ("MAX", 10),
        ("GVL.MAX+1", 21),
        ("Limits#UPPER", 7),
        ('"My const"', 3),
        ('"GVL"."MAX"', 20),
        ("2 * (MAX - 3) - -1", 15),
        ("MAX - 3 - 2", 5),
        ("100 / 7 / 2", 7),
        ("-7 / 2", -3),
        ("7 / -2", -3),
        ("+MAX * 2 + MAX", 30),
        ("Nope", None),
        ("MAX * Nope - 1", None),
        ("0 * Nope", None),
    ],
)
def test_the_value_of_a_formula(text: str, expected: int | None) -> None:
    assert value(text) == expected


def test_what_is_no_formula_is_one_line() -> None:
    golden.mistakes("formulas", value)


@given(st.text(st.sampled_from("0129aF#+-*/(). \"`_$'\n"), max_size=40))
@example("((((((((((((((((")
def test_no_text_breaks_the_evaluation(text: str) -> None:
    try:
        value(text)
    except UserError as refused:
        assert len(refused.lines()) == 1


@pytest.mark.parametrize(
    ("known", "asked", "expected"),
    [
        ({"GVL.MAX": 5}, "gvl.max", 5),
        ({"GVL.MAX": 5}, "MAX", 5),
        ({"GVL.MAX": 5}, "Lib.GVL.MAX", 5),
        ({"MAX": 5}, "GVL.MAX", 5),
        ({"GVL.MAX": 5}, "GVL2.MAX", None),
        ({"A.MAX": 5, "B.MAX": 6}, "MAX", None),
        ({"A.MAX": 5, "B.MAX": 6}, "B.MAX", 6),
        ({"A.MAX": 5, "B.MAX": 5}, "MAX", 5),
        ({"A.MAX": 5, "MAX": 6}, "MAX", 6),
    ],
)
def test_a_constant_is_known_by_the_end_of_its_name_unless_that_means_two(
    known: dict[str, int], asked: str, expected: int | None
) -> None:
    unknown: list[str] = []
    assert Constants(known).evaluate_number(Formula(asked, "here"), unknown) == expected
    assert unknown == ([] if expected is not None else [asked])


def test_the_users_constants_win_over_those_of_a_file_and_these_over_enumerations() -> None:
    text = (
        "TYPE E : (N := 1, M := 1, K := 1); T : ARRAY[N..9, M..9, K..9] OF INT; END_TYPE"
        " VAR_GLOBAL CONSTANT N, M : INT := 2; END_VAR"
    )
    types = join_declarations([read_st(text, "f.st")], "f.st", {"n": 3})
    assert type_text(types.get_type("T")) == "ARRAY[3..9,2..9,1..9] OF INT"


def test_constants_made_of_constants_and_of_themselves() -> None:
    chain = "".join(f"C{n + 1} : INT := C{n} + 1; " for n in range(500))
    types = types_of(
        f"VAR_GLOBAL CONSTANT C0 : INT := 0; {chain} A : INT := B; B : INT := A; END_VAR"
        " TYPE T : ARRAY[0..C500] OF INT; U : ARRAY[0..A] OF INT; END_TYPE"
    )
    assert type_text(types.get_type("T")) == "ARRAY[0..500] OF INT"
    assert types.names() == ["T"]
    assert types.unknown_constants in (("A",), ("B",))


def test_a_deep_chain_of_deep_formulas_ends_in_a_line() -> None:
    deep = "(" * DEEPEST_FORMULA + "{}" + ")" * DEEPEST_FORMULA
    chain = "".join(f"C{n} : INT := {deep.format(f'C{n + 1}')}; " for n in range(500))
    types = types_of(
        f"TYPE T : ARRAY[0..C0] OF INT; END_TYPE VAR_GLOBAL CONSTANT {chain} C500 : INT := 1; END_VAR"
    )
    assert len(types.problems) == 1
    assert len(types.unknown_constants) == 1


def test_values_of_an_enumeration_are_made_of_each_other() -> None:
    chain = ", ".join(f"V{n + 1} := V{n} + 1" for n in range(500))
    type_ = types_of(f"TYPE E : (V0 := 0, {chain}, LAST); END_TYPE").get_type("E")
    assert isinstance(type_, Enumeration)
    assert [number for _, number in type_.values] == list(range(502))
