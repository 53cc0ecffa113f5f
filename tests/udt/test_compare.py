"""Two profiles side by side: what differs, on the same bytes."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.udt.udt_strategies import layout_of, rules, structs, types, types_of
from trcvtui.udt.compare.compare import ComparedRow, Comparison, comparison_json, comparison_text, is_equal
from trcvtui.udt.layout.layout import LayoutRules, lay_out, layout_shape, rules_for
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode
from trcvtui.udt.report import place_text
from trcvtui.udt.types import Member, StringType, Struct

MEMBERS = "kind : BYTE; weight : LREAL; count : INT;"
CONTENT = bytes.fromhex("01 00000000000000 0000000000002940 0700 000000000000")


def told(row: ComparedRow) -> str:
    """Return a row in one line."""
    sides = [
        f"{place_text(cell.leaf)} {cell.type} {cell.value}" if cell else "-"
        for cell in (row.ours, row.theirs)
    ]
    return f"{row.path}: {sides[0]} | {sides[1]} {', '.join(row.differs)}".rstrip()


def test_a_profile_does_not_differ_from_itself() -> None:
    both = Comparison(layout_of(MEMBERS), layout_of(MEMBERS))
    assert str(both.summary(both.rows(CONTENT))) == "ours 16 bytes, theirs 16; none of 3 members differs"


def test_members_in_another_order_and_case_are_the_same_members() -> None:
    ours = types_of(
        "TYPE T : STRUCT a : INT; b : REAL; s : STRUCT x : INT; y : INT; END_STRUCT END_STRUCT END_TYPE"
    )
    theirs = types_of(
        "TYPE T : STRUCT B : REAL; A : INT; new : BOOL; S : STRUCT y : DINT; END_STRUCT END_STRUCT END_TYPE"
    )
    both = Comparison(lay_out(ours.get_type("T"), rules_for()), lay_out(theirs.get_type("T"), rules_for()))
    assert [told(row) for row in both.rows(bytes(20))] == [
        "a: 0 INT 0 | 4 INT 0 place",
        "b: 4 REAL 0.0 | 0 REAL 0.0 place",
        "s.x: 8 INT 0 | - only ours",
        "s.y: 10 INT 0 | 8 DINT 0 place, type",
        "new: - | 6 BOOL FALSE only theirs",
    ]


def test_arrays_of_other_bounds_meet_at_the_same_index() -> None:
    both = Comparison(layout_of("a : ARRAY[0..2] OF INT;"), layout_of("a : ARRAY[1..3] OF INT;"))
    assert [told(row) for row in both.rows(bytes.fromhex("0100 0200 0300"))] == [
        "a[0]: 0 INT 1 | - only ours",
        "a[1]: 2 INT 2 | 0 INT 1 place, value",
        "a[2]: 4 INT 3 | 2 INT 2 place, value",
        "a[3]: - | 4 INT 3 only theirs",
    ]


def test_what_is_not_there_any_more_is_told_on_both_sides() -> None:
    both = Comparison(layout_of(MEMBERS), layout_of(MEMBERS, "natural8"))
    assert [told(row) for row in both.rows(CONTENT[:14], 2, 3)] == [
        "count: 12 INT 0 | 16 INT no data place, value"
    ]


@pytest.mark.parametrize(
    ("members", "ours", "theirs", "said"),
    [
        ("s : STRING;", ("baosky", "little", "s7"), ("baosky", "little", "cstr"), ["s"]),
        ("i : INT; t : TIME; lt : LTIME;", ("baosky",), ("codesys-4",), ["t", "lt"]),
        ("d : DATE; i : INT;", ("baosky",), ("codesys-4",), ["d"]),
        ("a : ARRAY[1..2] OF TIME;", ("baosky",), ("codesys-4",), ["a[1]", "a[2]"]),
        ("i : INT; r : REAL; b : ARRAY[0..3] OF BYTE;", ("baosky",), ("codesys-4",), []),
    ],
)
def test_layouts_that_differ_only_in_how_a_member_is_stored_are_not_equal(
    members: str, ours: tuple[str, ...], theirs: tuple[str, ...], said: list[str]
) -> None:
    a = layout_of(members)
    both = Comparison(lay_out(a.type, rules_for(*ours)), lay_out(a.type, rules_for(*theirs)))
    assert [(row.path, row.differs) for row in both.rows(b"") if row.differs] == [
        (path, ("form",)) for path in said
    ]
    assert is_equal(both, both.rows(b"")) is (not said)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(structs(types, least=1), rules, rules)
def test_layouts_are_equal_exactly_when_profiles_call_them_one(
    type_: Struct, ours: LayoutRules, theirs: LayoutRules
) -> None:
    a, b = lay_out(type_, ours), lay_out(type_, theirs)
    both = Comparison(a, b)
    if is_equal(both, both.rows(b"")):
        assert layout_shape(a) == layout_shape(b)
    elif a.rules.byte_order == b.rules.byte_order:
        assert layout_shape(a) != layout_shape(b)


@pytest.mark.slow
def test_text_json_and_exit_code_agree_however_far_the_first_difference_is() -> None:
    members = "a : ARRAY[1..70000] OF BYTE; t : TIME;"
    both = Comparison(layout_of(members), layout_of(members, "codesys-4"))
    rows = list(both.rows(b""))
    assert not is_equal(both, rows)
    assert (
        comparison_text(both, rows, b"")
        .splitlines()[-1]
        .endswith("; 1 of 70001 members differs, the first at byte 70000")
    )
    assert json.loads(comparison_json(both, rows, b""))["equal"] is False


@settings(max_examples=60, deadline=None)
@given(structs(types, least=1), rules, rules, st.binary(max_size=200), st.data())
def test_rows_agree_with_two_decodes_of_their_own(type_, ours, theirs, content, data) -> None:  # type: ignore[no-untyped-def]
    a, b = lay_out(type_, ours), lay_out(type_, theirs)
    both = Comparison(a, b)
    start = data.draw(st.integers(0, both.row_count))
    rows = list(both.rows(content, start, start + 7))
    leaves = zip(a.leaves(), b.leaves(), decode(a, content), decode(b, content), strict=True)
    expected = list(leaves)[start : start + 7]
    assert len(rows) == len(expected)
    for row, (our, their, our_value, their_value) in zip(rows, expected, strict=True):
        assert row.ours is not None and row.theirs is not None
        assert (row.path, row.ours.leaf[:4], row.theirs.leaf[:4]) == (our.path, our[:4], their[:4])
        assert row.ours.value == value_text(our, our_value, content[our.offset : our.offset + our.size])
        assert row.theirs.value == value_text(their, their_value, content[their.offset :][: their.size])
        assert ("place" in row.differs) == (
            (our.offset, our.size, our.bit) != (their.offset, their.size, their.bit)
        )


def test_a_text_in_utf_8_and_one_in_latin_1_are_stored_in_two_forms() -> None:
    plain, marked = (Struct("T", (Member("s", StringType(8, utf8=utf8)),)) for utf8 in (False, True))
    both = Comparison(lay_out(plain, rules_for()), lay_out(marked, rules_for()))
    assert [row.differs for row in both.rows(b"")] == [("form",)]
