"""Types joined: duplicates, recursion and unknown types together, and what a bad type tells."""

from __future__ import annotations

import pytest

from tests import golden
from tests.udt.udt_strategies import types_of
from trcvtui.errors import UserError
from trcvtui.udt.ast import MOST_NESTED
from trcvtui.udt.sources import parse_type
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import ELEMENTARY, Array, StringType


def lines_of(call: object) -> list[str]:
    with pytest.raises(UserError) as refused:
        call()  # type: ignore[operator]
    return refused.value.lines()


def test_a_circle_of_types_is_found_wherever_it_is_entered() -> None:
    circle = "P : STRUCT q : Q; END_STRUCT Q : STRUCT p : P; END_STRUCT"
    types = types_of(f"TYPE Outside : STRUCT p : P; END_STRUCT {circle} END_TYPE")
    assert len(types.problems) == 1
    assert types.names() == []
    for name in ("P", "Q", "Outside"):
        assert lines_of(lambda name=name: types.get_type(name)) == [str(types.problems[0])]


def test_who_uses_a_bad_type_is_told_what_is_wrong_with_it() -> None:
    types = types_of("TYPE Good : INT; User : ARRAY[0..1] OF Bad; Bad : STRUCT x : Nope; END_STRUCT END_TYPE")
    assert types.get_type("good") is ELEMENTARY["INT"]
    assert lines_of(lambda: types.get_type("User")) == ["test.st:1:62: found 'Nope', expected a known type"]


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    types = types_of("TYPE A : INT; B : INT; END_TYPE")
    assert lines_of(lambda: types.get_type("C", "--type")) == [
        "--type: found 'C', expected a type of test.st: A, B"
    ]


def test_the_only_type_needs_no_name() -> None:
    def only(text: str) -> str:
        file = read_st(text, "test.st")
        return join_declarations([file], "test.st").only_name([file])

    assert only("TYPE A : INT; END_TYPE") == "A"
    assert lines_of(lambda: only("TYPE A : INT; B : INT; END_TYPE")) == [
        "test.st: found 2 types: A, B, expected one type, or --type NAME"
    ]
    assert lines_of(lambda: only("")) == ["test.st: found no type, expected TYPE ... END_TYPE"]
    assert lines_of(lambda: only("TYPE A : INT; B : Nope; END_TYPE")) == [
        "test.st:1:19: found 'Nope', expected a known type"
    ]


def test_a_chain_of_structures_deeper_than_the_limit_is_refused_and_its_lower_part_kept() -> None:
    chain = "".join(f"T{n} : STRUCT x : T{n + 1}; END_STRUCT " for n in range(MOST_NESTED + 8))
    types = types_of(f"TYPE {chain} T{MOST_NESTED + 8} : INT; END_TYPE")
    assert types.names() == [f"T{n}" for n in range(8, MOST_NESTED + 9)]
    assert "nested 33 deep" in str(types.problems[0])


def test_an_alias_chain_has_no_depth() -> None:
    chain = "".join(f"T{n} : T{n + 1}; " for n in range(3000))
    assert types_of(f"TYPE {chain} T3000 : INT; END_TYPE").get_type("T0") is ELEMENTARY["INT"]


def test_a_type_in_one_line_as_in_a_project_file() -> None:
    types = types_of("TYPE Telegram : STRUCT a : INT; END_STRUCT; Bad : Nope; END_TYPE")
    assert parse_type("INT") is ELEMENTARY["INT"]
    assert parse_type(" string[20] ") == StringType(20)
    assert parse_type("ARRAY[0..99] OF BYTE") == Array(((0, 99),), ELEMENTARY["BYTE"])
    assert parse_type("TELEGRAM", types) is types.get_type("Telegram")
    assert parse_type("ARRAY[1..2] OF Telegram", types) == Array(((1, 2),), types.get_type("Telegram"))


def test_a_type_in_one_line_that_is_none() -> None:
    golden.mistakes("types in one line", lambda text: parse_type(text, where="data.rx.type"))


def test_a_bad_udt_in_one_line_tells_where_its_file_is_wrong() -> None:
    types = types_of("TYPE Bad : STRUCT x : Nope; END_STRUCT END_TYPE")
    assert lines_of(lambda: parse_type("ARRAY[0..1] OF bad", types)) == [
        "test.st:1:23: found 'Nope', expected a known type"
    ]


def test_a_type_in_a_namespace_is_named_with_it_or_without() -> None:
    types = types_of("NAMESPACE A.B TYPE T : INT; Bad : Nope; END_TYPE END_NAMESPACE")
    assert types.get_type("A.B.T") is types.get_type("t") is ELEMENTARY["INT"]
    assert "Nope" in lines_of(lambda: types.get_type("a.b.bad"))[0]
