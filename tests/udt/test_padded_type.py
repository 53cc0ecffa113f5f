"""The padded type: laid out by our rules, every member lies where the other side has it."""

from __future__ import annotations

import re

import pytest
from hypothesis import event, given, settings

from tests.udt.test_fit import TELEGRAMS, TYPES
from tests.udt.udt_strategies import layout_of, rules, structs, types, types_of
from trcvtui.udt.cure.padded_type import padded_type, prove, told
from trcvtui.udt.layout.layout import LAYOUTS, Layout, LayoutRules, lay_out, rules_for
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.placing import Unreachable
from trcvtui.udt.sources import read_text
from trcvtui.udt.st_write import scl_text, st_text
from trcvtui.udt.type_set import join
from trcvtui.udt.types import ELEMENTARY, Member, StringType, Struct

INDEX = r"\[[^\]]*\]"


def places(layout: Layout) -> dict[str, tuple[int, int, int | None]]:
    """Return offset, size and bit of every member that is no padding."""
    return {leaf.path: place_of(leaf) for leaf in layout.leaves() if "_pad" not in leaf.path}


def place_of(leaf: Leaf) -> tuple[int, int, int | None]:
    """Return offset, size and bit."""
    return leaf.offset, leaf.size, leaf.bit


def wanted(name: str, layout: str) -> Layout:
    """Return a telegram in the sender's layout."""
    return lay_out(TYPES.named(name), rules_for(layout))


def test_a_natural_sender_is_received_under_cap4_with_padding_members() -> None:
    found = padded_type(wanted("Weight", "natural8"), rules_for("baosky"))
    assert found.is_possible
    assert st_text(found.type) == (
        "TYPE Weight_natural8 :\n"
        "STRUCT\n"
        "    kind : BYTE;\n"
        "    _pad1 : ARRAY[0..6] OF BYTE;\n"
        "    weight : LREAL;\n"
        "    count : INT;\n"
        "    _pad2 : ARRAY[0..5] OF BYTE;\n"
        "END_STRUCT\n"
        "END_TYPE\n"
    )
    assert places(found.layout) == {"kind": (0, 1, None), "weight": (8, 8, None), "count": (16, 2, None)}


def test_an_s7_sender_is_received_by_codesys_with_bits_and_without_gaps() -> None:
    theirs = layout_of("a : BOOL; b : BOOL; n : BYTE; r : REAL; c : BOOL; i : INT;", "s7-standard")
    found = padded_type(theirs, rules_for("codesys-8"))
    assert found.is_possible
    assert st_text(found.type).startswith("{attribute 'pack_mode' := '1'}\nTYPE T_s7_standard :\n")
    assert "a : BIT;" in st_text(found.type)
    assert places(found.layout) == {leaf.path: place_of(leaf) for leaf in theirs.leaves()}


@pytest.mark.parametrize(
    ("members", "ours", "theirs", "said"),
    [
        (
            "a : BYTE; r : REAL; b : BYTE; i : INT;",
            "baosky",
            "packed",
            "r: not reached: REAL at byte 1: under baosky only at a multiple of 4",
        ),
        (
            "a : INT; b : DINT;",
            "baosky",
            "packed",
            "ARRAY[0..5] OF BYTE: not reached: 6 bytes: under baosky the size is a multiple of 4",
        ),
        (
            "i : INT; a : BOOL; b : BOOL;",
            "baosky",
            "s7-standard",
            "a: not reached: one bit in s7-standard, and baosky has no member of one bit",
        ),
        (
            "s : STRING[4]; i : INT;",
            "baosky",
            "codesys-8",
            "s: not reached: a STRING with a NUL after its characters in codesys-8, "
            "with two lengths before them in baosky",
        ),
        (
            "d : DATE; i : INT;",
            "baosky",
            "s7-standard",
            "d: DATE is stored in its own way in s7-standard: here WORD, to convert",
        ),
    ],
)
def test_what_cannot_be_reached_is_told_with_the_reason(
    members: str, ours: str, theirs: str, said: str
) -> None:
    assert told(padded_type(layout_of(members, theirs), rules_for(ours)))[0] == said


def test_a_member_that_cannot_be_reached_is_raw_bytes_at_its_place() -> None:
    theirs = layout_of("a : BYTE; r : REAL; b : BYTE; i : INT;", "packed")
    found = padded_type(theirs, rules_for("baosky"))
    assert not found.is_possible
    lies = places(found.layout)
    assert [lies[f"r[{n}]"][0] for n in range(4)] == [1, 2, 3, 4]
    assert (lies["b"], lies["i"], found.layout.size) == ((5, 1, None), (6, 2, None), 8)


TEXTS = "a STRING with a NUL after its characters in codesys-8, with two lengths before them in baosky"


def test_a_union_that_cannot_be_declared_is_the_only_raw_member() -> None:
    theirs = layout_of(
        "a : INT; b : LREAL; u : UNION s : STRING[4]; i : INT; END_UNION; c : INT;", "codesys-8"
    )
    found = padded_type(theirs, rules_for("baosky"))
    assert told(found) == [f"u: not reached: u.s: {TEXTS}"]
    lies = places(found.layout)
    assert (lies["b"], lies["u[0]"], lies["c"]) == ((8, 8, None), (16, 1, None), (22, 2, None))


def test_a_union_in_a_union_in_an_array_is_told_by_the_text_in_it() -> None:
    inner = "UNION i : INT; v : UNION s : STRING[4]; END_UNION; END_UNION"
    theirs = layout_of(f"n : DINT; a : ARRAY[1..2] OF {inner}; c : INT;", "codesys-8")
    found = padded_type(theirs, rules_for("baosky"))
    assert told(found) == [f"a: not reached: a[1].v.s: {TEXTS}"]
    assert places(found.layout)["c"] == place_of(theirs.leaf(theirs.number_of("c")))


def test_a_type_with_a_raw_member_may_be_used_twice() -> None:
    text = "TYPE S : STRUCT s : STRING[4]; i : INT; END_STRUCT END_TYPE "
    text += "TYPE T : STRUCT p : S; q : S; c : LREAL; END_STRUCT END_TYPE"
    theirs = lay_out(types_of(text).named("T"), rules_for("codesys-8"))
    found = padded_type(theirs, rules_for("baosky"))
    assert told(found) == [f"p.s: not reached: {TEXTS}", f"q.s: not reached: {TEXTS}"]
    assert places(found.layout)["c"] == place_of(theirs.leaf(theirs.number_of("c")))


def test_a_member_whose_name_begins_like_that_of_a_raw_one_is_proved() -> None:
    theirs = layout_of("s : STRING[4]; s2 : INT; s_x : DINT;", "codesys-8")
    found = padded_type(theirs, rules_for("baosky"))
    raw = [(id(theirs.root), "s")]
    prove(theirs.root, found.layout.root, raw)
    assert isinstance(found.type, Struct)
    s, _, s_x = found.type.members
    gap, small = Member("_pad", ELEMENTARY["BYTE"]), Member("s2", ELEMENTARY["BYTE"])
    for members in ((s, small, s_x), (s, gap, small, s_x)):
        wrong = lay_out(Struct("T", members), rules_for("baosky"))
        with pytest.raises(Unreachable, match=r"^s2: "):
            prove(theirs.root, wrong.root, raw)


def test_a_member_that_would_make_the_whole_too_long_is_the_one_that_is_raw() -> None:
    theirs = layout_of("d : DINT; w : WORD; i : INT; b : WORD;", "packed")
    found = padded_type(theirs, rules_for("baosky-pack4"))
    assert told(found) == [
        "d: not reached: DINT makes the size of its STRUCT a multiple of 4 under baosky-pack4"
    ]
    assert found.layout.size == 10


def test_what_is_raw_as_a_whole_is_told_as_all() -> None:
    (one,) = padded_type(layout_of("a : INT; b : DINT;", "packed"), rules_for("baosky")).unreached
    assert one == ("", "6 bytes: under baosky the size is a multiple of 4")


def test_a_type_that_fails_in_every_use_is_tried_once() -> None:
    text = "TYPE S0 : STRUCT a : INT; END_STRUCT END_TYPE\n"
    for n in range(1, 17):
        text += f"TYPE S{n} : STRUCT p : S{n - 1}; q : S{n - 1}; END_STRUCT END_TYPE\n"
    theirs = lay_out(types_of(text).named("S16"), rules_for("packed"))
    found = padded_type(theirs, rules_for("baosky"))
    assert found.layout.size == theirs.size
    assert 0 < len(found.unreached) <= 1024


def test_a_type_that_lies_right_already_stays_as_it_is() -> None:
    found = padded_type(wanted("Report", "natural8"), rules_for("baosky"))
    assert found.type is TYPES.named("Report")


def test_what_a_type_extends_becomes_members_of_its_own() -> None:
    text = "TYPE B : STRUCT x : BYTE; END_STRUCT END_TYPE "
    text += "TYPE T EXTENDS B : STRUCT y : LREAL; END_STRUCT END_TYPE"
    found = padded_type(lay_out(types_of(text).named("T"), rules_for("codesys-8")), rules_for("packed"))
    assert places(found.layout) == {"x": (0, 1, None), "y": (8, 8, None)}


@pytest.mark.parametrize("name", TELEGRAMS)
@pytest.mark.parametrize("ours", LAYOUTS)
@pytest.mark.parametrize("theirs", ["natural8", "packed", "codesys-4", "s7-standard"])
def test_the_declaration_is_read_again_and_lies_where_it_shall(name: str, ours: str, theirs: str) -> None:
    found = padded_type(wanted(name, theirs), rules_for(ours))
    types_again = types_of(st_text(found.type, found.layout.name))
    assert types_again.problems == ()
    own = found.type.name if isinstance(found.type, Struct) else found.layout.name
    again = lay_out(types_again.named(own), rules_for(ours))
    assert (places(again), again.size) == (places(found.layout), wanted(name, theirs).size)


@pytest.mark.parametrize("name", TELEGRAMS)
def test_the_scl_of_an_s7_sender_is_read_again(name: str) -> None:
    found = padded_type(wanted(name, "baosky"), rules_for("s7-standard"))
    types_again = join([read_text(scl_text(found.type, found.layout.name), "x.udt", ".udt")], "x.udt")
    assert types_again.problems == ()
    again = lay_out(types_again.named(types_again.names()[-1]), rules_for("s7-standard"))
    assert again.size == found.layout.size
    assert places(again) == places(found.layout) or not found.is_possible


@pytest.mark.slow
@settings(max_examples=250, deadline=None)
@given(structs(types, least=1), rules, rules)
def test_a_padded_type_that_is_called_possible_gives_the_others_offsets(
    type_: Struct, ours: LayoutRules, theirs: LayoutRules
) -> None:
    sent = lay_out(type_, theirs)
    found = padded_type(sent, ours)
    event("possible" if found.is_possible else "not reached")
    assert found.layout.size == sent.size or sent.size == 0
    laid_out = lay_out(found.type, ours)
    if found.is_possible:
        lies = {leaf.path: place_of(leaf) for leaf in laid_out.leaves()}
        assert {leaf.path: place_of(leaf) for leaf in sent.leaves()}.items() <= lies.items()
    else:
        assert all(one.why for one in found.unreached)
        lies = {leaf.path: place_of(leaf) for leaf in laid_out.leaves()}
        raw = [re.sub(INDEX, "", one.path) for one in found.unreached]
        for leaf in sent.leaves():
            path = re.sub(INDEX, "", leaf.path)
            if not any(path == each or not each or path.startswith(each + ".") for each in raw):
                assert lies[leaf.path] == place_of(leaf)


def test_a_text_in_utf_8_stays_one() -> None:
    sent = lay_out(
        Struct("T", (Member("w", ELEMENTARY["WORD"]), Member("s", StringType(utf8=True)))), rules_for()
    )
    found = padded_type(sent, rules_for("s7-standard"))
    assert found.is_possible
    assert found.layout.leaf(1).type == StringType(80, utf8=True)
    again = types_of(st_text(sent.type))
    (_, text) = lay_out(again.named("T"), rules_for()).leaves()
    assert text.type == StringType(utf8=True)
