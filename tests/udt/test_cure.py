"""What cures a mismatch: the padded type for our side, swap code for the sender, and both together."""

from __future__ import annotations

import random
import re
from dataclasses import replace
from itertools import groupby

import pytest
from hypothesis import assume, event, example, given, settings
from hypothesis import strategies as st

from tests import golden
from tests.udt.st_machine import Machine
from tests.udt.test_fit import TELEGRAMS, TYPES, message
from tests.udt.udt_strategies import (
    apart,
    forms,
    layout_of,
    orders,
    rules,
    same,
    struct_of,
    structs,
    types,
    types_of,
    values_of,
)
from trcvtui.tui.lab.lab_fix import format_cures
from trcvtui.udt.compare.fit import rank, verdict
from trcvtui.udt.cure.padded_type import PaddedType, list_notes, padded_type, prove_places
from trcvtui.udt.cure.swap import Language, swap_code
from trcvtui.udt.layout.layout import LAYOUTS, MOST_LEAVES, Layout, LayoutRules, lay_out, rules_for
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.placing import Unplaceable
from trcvtui.udt.layout.values import decode, decode_leaves, encode
from trcvtui.udt.sources import parse_source
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.st_write import ST_WORDS, rename_for_st, scl_text, st_text
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import ELEMENTARY, Array, Member, StringType, Struct

INDEX = r"\[[^\]]*\]"


def places(layout: Layout) -> dict[str, tuple[int, int, int | None]]:
    """Return offset, size and bit of every member that is no padding."""
    return {leaf.path: place_of(leaf) for leaf in layout.leaves() if "_pad" not in leaf.path}


def place_of(leaf: Leaf) -> tuple[int, int, int | None]:
    """Return offset, size and bit."""
    return leaf.offset, leaf.size, leaf.bit


def wanted(name: str, layout: str) -> Layout:
    """Return a telegram in the sender's layout."""
    return lay_out(TYPES.get_type(name), rules_for(layout))


def scl_again(found: PaddedType) -> Layout:
    """Return a type as it lies when its SCL is read."""
    text = scl_text(found.type, found.layout.name, found.layout.rules)
    types_again = join_declarations([parse_source(text, "x.udt", ".udt")], "x.udt")
    assert types_again.problems == ()
    return lay_out(types_again.get_type(types_again.names()[-1]), found.layout.rules)


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


def test_what_cannot_be_reached_is_told_with_the_reason() -> None:
    def say(case: str) -> list[str]:
        ours, theirs, members = case.split(" | ")
        return list_notes(padded_type(layout_of(members, theirs), rules_for(ours)))[:1]

    golden.answers("members that cannot be reached", say)


def test_a_member_that_cannot_be_reached_is_raw_bytes_at_its_place() -> None:
    theirs = layout_of("a : BYTE; r : REAL; b : BYTE; i : INT;", "packed")
    found = padded_type(theirs, rules_for("baosky"))
    assert not found.is_possible
    lies = places(found.layout)
    assert [lies[f"r[{n}]"][0] for n in range(4)] == [1, 2, 3, 4]
    assert (lies["b"], lies["i"], found.layout.size) == ((5, 1, None), (6, 2, None), 8)


TEXTS = "codesys-8 ends a STRING with a NUL, baosky begins a STRING with two lengths"


def test_a_union_that_cannot_be_declared_is_the_only_raw_member() -> None:
    theirs = layout_of(
        "a : INT; b : LREAL; u : UNION s : STRING[4]; i : INT; END_UNION; c : INT;", "codesys-8"
    )
    found = padded_type(theirs, rules_for("baosky"))
    assert list_notes(found) == [f"u: not possible: u.s: {TEXTS}"]
    lies = places(found.layout)
    assert (lies["b"], lies["u[0]"], lies["c"]) == ((8, 8, None), (16, 1, None), (22, 2, None))


def test_a_union_in_a_union_in_an_array_is_told_by_the_text_in_it() -> None:
    inner = "UNION i : INT; v : UNION s : STRING[4]; END_UNION; END_UNION"
    theirs = layout_of(f"n : DINT; a : ARRAY[1..2] OF {inner}; c : INT;", "codesys-8")
    found = padded_type(theirs, rules_for("baosky"))
    assert list_notes(found) == [f"a: not possible: a[1].v.s: {TEXTS}"]
    assert places(found.layout)["c"] == place_of(theirs.leaf(theirs.leaf_number("c")))


def test_a_type_with_a_raw_member_may_be_used_twice() -> None:
    text = "TYPE S : STRUCT s : STRING[4]; i : INT; END_STRUCT END_TYPE "
    text += "TYPE T : STRUCT p : S; q : S; c : LREAL; END_STRUCT END_TYPE"
    theirs = lay_out(types_of(text).get_type("T"), rules_for("codesys-8"))
    found = padded_type(theirs, rules_for("baosky"))
    assert list_notes(found) == [f"p.s: not possible: {TEXTS}", f"q.s: not possible: {TEXTS}"]
    assert places(found.layout)["c"] == place_of(theirs.leaf(theirs.leaf_number("c")))


def test_a_member_whose_name_begins_like_that_of_a_raw_one_is_proved() -> None:
    theirs = layout_of("s : STRING[4]; s2 : INT; s_x : DINT;", "codesys-8")
    found = padded_type(theirs, rules_for("baosky"))
    raw = [(id(theirs.root), "s")]
    prove_places(theirs.root, found.layout.root, raw)
    assert isinstance(found.type, Struct)
    s, _, s_x = found.type.members
    gap, small = Member("_pad", ELEMENTARY["BYTE"]), Member("s2", ELEMENTARY["BYTE"])
    for members in ((s, small, s_x), (s, gap, small, s_x)):
        wrong = lay_out(Struct("T", members), rules_for("baosky"))
        with pytest.raises(Unplaceable, match=r"^s2: "):
            prove_places(theirs.root, wrong.root, raw)


def test_a_member_that_makes_the_whole_longer_than_is_sent_stays_and_len_ends_the_message() -> None:
    members = "d : DINT; w : WORD; i : INT; b : WORD;"
    theirs, ours = layout_of(members, "packed"), layout_of(members, "baosky-pack4")
    found = padded_type(theirs, ours.rules)
    assert (found.type, found.is_possible, found.layout.size) == (theirs.type, True, 12)
    assert "\n// LEN := 10 at the receiving block" in format_cures(ours.rules, theirs, "st")
    nested = padded_type(layout_of(f"s : STRUCT {members} END_STRUCT; i : INT;", "packed"), ours.rules)
    assert list_notes(nested) == [
        "s.d: not possible: DINT makes the size of its STRUCT a multiple of 4 under baosky-pack4"
    ]


def test_of_a_struct_that_cannot_be_there_the_members_stand_in_its_place() -> None:
    text = "TYPE S : STRUCT k : BYTE; i : INT; d : DINT; END_STRUCT END_TYPE "
    text += "TYPE T : STRUCT a : BYTE; s : S; s_k : INT; END_STRUCT END_TYPE"
    found = padded_type(lay_out(types_of(text).get_type("T"), rules_for("packed")), rules_for("baosky"))
    assert isinstance(found.type, Struct) and found.type.name == "T_flat"
    assert list_notes(found) == ["s: its members are declared one by one, as s_.."]
    assert places(found.layout) == {
        "a": (0, 1, None), "s_k_": (1, 1, None), "s_i": (2, 2, None), "s_d": (4, 4, None),
        "s_k": (8, 2, None),
    }  # fmt: skip


def test_what_is_raw_as_a_whole_is_told_as_all() -> None:
    theirs = lay_out(Array(((0, 1),), struct_of("INT", "DINT")), rules_for("packed"))
    (one,) = padded_type(theirs, rules_for("baosky")).unreached
    assert one == ("", "[0]: under baosky its size is a multiple of 4, not 6")


def test_a_type_that_fails_in_every_use_is_tried_once() -> None:
    text = "TYPE S0 : STRUCT a : INT; END_STRUCT END_TYPE\n"
    for n in range(1, 17):
        text += f"TYPE S{n} : STRUCT p : S{n - 1}; q : S{n - 1}; END_STRUCT END_TYPE\n"
    theirs = lay_out(types_of(text).get_type("S16"), rules_for("packed"))
    found = padded_type(theirs, rules_for("baosky"))
    assert found.layout.size == theirs.size
    assert 0 < len(found.unreached) <= 1024


def test_a_type_that_lies_right_already_stays_as_it_is() -> None:
    found = padded_type(wanted("Report", "natural8"), rules_for("baosky"))
    assert found.type is TYPES.get_type("Report")


def test_what_a_type_extends_becomes_members_of_its_own() -> None:
    text = "TYPE B : STRUCT x : BYTE; END_STRUCT END_TYPE "
    text += "TYPE T EXTENDS B : STRUCT y : LREAL; END_STRUCT END_TYPE"
    found = padded_type(lay_out(types_of(text).get_type("T"), rules_for("codesys-8")), rules_for("packed"))
    assert places(found.layout) == {"x": (0, 1, None), "y": (8, 8, None)}
    bits = text.replace("BYTE", "BIT").replace("y : LREAL", "y : BIT; z : INT")  # each begins a byte
    found = padded_type(lay_out(types_of(bits).get_type("T"), rules_for("codesys-8")), rules_for("codesys-4"))
    assert [(one.path, one.text[:15]) for one in found.unreached] == [("y", "bit 0 of byte 1")]
    assert places(found.layout)["z"] == (2, 2, None)


@pytest.mark.parametrize("name", TELEGRAMS)
@pytest.mark.parametrize("ours", LAYOUTS)
@pytest.mark.parametrize("theirs", ["natural8", "packed", "codesys-4", "s7-standard"])
def test_the_declaration_is_read_again_and_lies_where_it_shall(name: str, ours: str, theirs: str) -> None:
    found = padded_type(wanted(name, theirs), rules_for(ours))
    types_again = types_of(st_text(found.type, found.layout.name))
    assert types_again.problems == ()
    own = found.type.name if isinstance(found.type, Struct) else found.layout.name
    again = lay_out(types_again.get_type(own), rules_for(ours))
    assert (places(again), again.size) == (places(found.layout), found.layout.size)
    sent, reached = wanted(name, theirs), {one.path for one in found.unreached}
    assert "" not in reached and again.size - sent.size < again.root.align


@pytest.mark.parametrize("name", TELEGRAMS)
def test_the_scl_of_an_s7_sender_is_read_again(name: str) -> None:
    found = padded_type(wanted(name, "baosky"), rules_for("s7-standard"))
    again = scl_again(found)
    assert again.size == found.layout.size
    assert places(again) == places(found.layout) or not found.is_possible


def test_scl_has_gaps_for_a_union_joined_bounds_and_no_string_that_is_too_long() -> None:
    text = "TYPE V : UNION r : REAL; d : DINT; END_UNION END_TYPE TYPE A : STRUCT ok : BOOL; v : V; n : INT;"
    text += (
        "w : ARRAY[0..1] OF V; b : ARRAY[0..1] OF ARRAY[0..2] OF REAL; s : STRING[255]; END_STRUCT END_TYPE"
    )
    cured = format_cures(
        rules_for("packed", text="nul"), lay_out(types_of(text).get_type("A"), rules_for("codesys-8")), "scl"
    )
    assert "no change needed" not in cured
    assert "// s: not possible: STRING[255]: SCL allows at most 254 characters\n" in cured
    assert [line.strip() for line in cured.splitlines()[6:-3]] == [
        "ok : BOOL;",
        "_pad1 : Array[0..2] of BYTE;",
        "v : Array[0..3] of BYTE;",
        "n : INT;",
        "_pad2 : Array[0..1] of BYTE;",
        "w : Array[0..1, 0..3] of BYTE;",
        "b : Array[0..1, 0..2] of REAL;",
        "s : Array[0..255] of BYTE;",
    ]
    bits = layout_of("b : ARRAY[0..1] OF ARRAY[0..2] OF BOOL;", "s7-standard")
    rows = layout_of("b : ARRAY[0..1] OF ARRAY[0..2] OF INT;", "natural8")
    assert "#wire.b[#i1,#i2] := SWAP(" in swap_code(rows, "scl").code
    assert "Array[0..1] of Array[0..2] of BOOL" in format_cures(bits.rules, bits, "scl")  # else they move


packed = st.builds(rules_for, st.just("packed"), orders, forms)


@pytest.mark.slow
@settings(max_examples=250, deadline=None)
@given(structs(types, least=1), st.one_of(st.just(rules_for()), rules), st.one_of(packed, rules), st.data())
def test_every_member_of_a_padded_type_that_is_no_bytes_has_the_senders_value(
    type_: Struct, ours: LayoutRules, theirs: LayoutRules, data: st.DataObject
) -> None:
    sent, own = lay_out(type_, theirs), replace(ours, byte_order=theirs.byte_order)
    assume(sent.size <= MOST_LEAVES)  # a longer member has too many bytes for an ARRAY OF BYTE
    found = padded_type(sent, own)
    event("all" if found.is_possible else "a part")
    event("longer" if found.layout.size > sent.size else "of the size")
    values = {leaf.path: data.draw(values_of(leaf, theirs)) for leaf in apart(sent, most=100)}
    content = encode(sent, values)
    received = content + b"\xa5" * (found.layout.size - sent.size)  # with LEN as told, the rest stays
    cured = lay_out(found.type, own)
    numbers = {leaf.path: number for number, leaf in enumerate(cured.leaves())}
    raw = [re.sub(INDEX, "", one.path) for one in found.unreached]
    assert "" not in raw
    other = {re.sub(INDEX, "", note.path) for note in found.notes}
    for leaf, value in zip(sent.leaves(), decode(sent, content), strict=True):
        name = leaf.path
        for note in found.notes:  # of a STRUCT: its members have names of their own
            name = re.sub(rf"^{re.escape(note.path)}\.", f"{note.path}_", name)
        path = re.sub(INDEX, "", name)
        if any(path == each or path.startswith(each + ".") for each in raw):
            continue
        number = numbers[name]
        assert place_of(cured.leaf(number)) == place_of(leaf)
        assert path in other or same(decode_leaves(cured, received, number, number + 1), (value,))


def test_a_text_in_utf_8_stays_one() -> None:
    sent = lay_out(
        Struct("T", (Member("w", ELEMENTARY["WORD"]), Member("s", StringType(utf8=True)))), rules_for()
    )
    found = padded_type(sent, rules_for("s7-standard"))
    assert found.is_possible
    assert found.layout.leaf(1).type == StringType(80, utf8=True)
    again = types_of(st_text(sent.type))
    (_, text) = lay_out(again.get_type("T"), rules_for()).leaves()
    assert text.type == StringType(utf8=True)


ONE_BOOL = Struct("S", (Member("m0", ELEMENTARY["BOOL"]),))
ODD_NAMES = """TYPE "T"
VERSION : 0.1
STRUCT
    "struct" : Int; "Type" : Byte; "a b" : DInt; a_b : DInt; A_B_2 : Byte; "int" : Real;
    "if" : Array[0..1] of Struct
        "für 1" : LReal; "do" : Bool; "end_struct" : Word;
    END_STRUCT;
END_STRUCT;
END_TYPE
"""


@pytest.mark.parametrize("name", ["Weight", "Line"])
def test_a_sender_that_pads_and_swaps_is_read_right(name: str) -> None:
    theirs = lay_out(TYPES.get_type(name), rules_for("packed", "big"))
    ours = lay_out(theirs.type, rules_for("baosky"))
    found = padded_type(ours, theirs.rules)
    assert found.is_possible
    sender, swap = found.layout, swap_code(found.layout)
    machine = Machine(theirs.rules, {"msg": sender, "wire": lay_out(swap.type, theirs.rules)}, swap.helpers)
    machine.memory["msg"][:] = content = message(sender, random.Random(9))
    machine.run(swap.code)
    shown = zip((leaf.path for leaf in sender.leaves()), decode(sender, content), strict=True)
    plain = [value for path, value in shown if "_pad" not in path]
    assert list(decode(ours, bytes(machine.memory["wire"]))) == plain


def test_legal_names_of_tia_make_legal_text_on_both_sides() -> None:
    types = join_declarations([parse_source(ODD_NAMES, "x.udt", ".udt")], "x.udt")
    type_ = types.get_type("T")
    for ours, theirs in (("baosky", "natural8"), ("natural8", "codesys-1"), ("s7-standard", "natural8")):
        for wanted, own in ((theirs, ours), (ours, theirs)):
            side = padded_type(lay_out(type_, rules_for(wanted)), rules_for(own))
            plain = join_declarations([read_st(st_text(side.type, side.layout.name), "x.st")], "x.st")
            assert plain.problems == () and scl_again(side)
            again = lay_out(plain.get_type(plain.names()[-1]), side.layout.rules)
            assert [leaf[2:4] for leaf in again.leaves()] == [leaf[2:4] for leaf in side.layout.leaves()]
            words = {part for leaf in again.leaves() for part in re.findall(r"[^.\[\]]+", leaf.path)}
            assert not {word for word in words if word.upper() in ST_WORDS}
            assert all(word.isascii() and " " not in word for word in words)


def test_profiles_that_agree_need_no_cure() -> None:
    layout = lay_out(TYPES.get_type("Report"), rules_for("baosky"))
    theirs = lay_out(layout.type, rules_for("natural8"))
    assert padded_type(theirs, layout.rules).type is padded_type(layout, theirs.rules).type is layout.type


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    structs(types, least=1),
    rules,
    rules,
    st.sampled_from(["st", "scl", "padded"]),
    st.lists(st.binary(max_size=60)),
)
@example(ONE_BOOL, rules_for("baosky"), rules_for("baosky"), "st", [b"\0\0"])
def test_any_pair_has_a_cure_and_any_bytes_a_ranking(
    type_: Struct, ours: LayoutRules, theirs: LayoutRules, form: str, messages: list[bytes]
) -> None:
    text = format_cures(ours, lay_out(type_, theirs, "T"), form)
    assert text.startswith(f"// T for {ours.name}, ")
    scl = padded_type(lay_out(rename_for_st(type_), theirs, "T"), ours, is_scl=True)
    assert list(map(place_of, scl_again(scl).leaves())) == list(map(place_of, scl.layout.leaves()))
    fits = rank(type_, messages)
    best = [next(group).score for _, group in groupby(fits, key=lambda one: one.rank)]
    assert best == sorted(best, reverse=True)  # readings that find the same values stand together
    assert [one.rank for one in fits] == sorted(one.rank for one in fits)
    assert verdict(fits)


OTHER = {"little": "big", "big": "little"}


def swapped(sent: Layout, content: bytes, language: Language) -> bytes:
    """Return what the swap code makes of a message."""
    swap = swap_code(sent, language)
    msg = lay_out(rename_for_st(sent.type), sent.rules) if language == "st" else sent
    machine = Machine(sent.rules, {"msg": msg, "wire": lay_out(swap.type, sent.rules)}, swap.helpers)
    machine.memory["msg"][:] = content
    machine.run(swap.code)
    return bytes(machine.memory["wire"])


def test_every_kind_of_number_is_swapped() -> None:
    members = "a : SINT; i : INT; u : UDINT; l : LINT; w : WORD; d : DWORD; q : LWORD; r : REAL; lr : LREAL;"
    members += (
        "t : TIME; lt : LTIME; dt : DATE; tod : TOD; c : CHAR; e : (A := 1, B := 258) DINT; s : INT(0..999);"
    )
    members += "m : ARRAY[1..2, 0..1] OF STRUCT x : ARRAY[3..4] OF INT; b : BOOL; END_STRUCT;"
    values: dict[str, object] = {
        "a": -3, "i": -300, "u": 70000, "l": -5_000_000_000, "w": 258, "d": 0x01020304,
        "q": 0x0102030405060708, "r": -1.5, "lr": 1234.5678, "t": "T#1h", "lt": "LTIME#5s",
        "dt": "DATE#2026-02-03", "tod": "TOD#12:30:00", "c": "x", "e": 258, "s": 513,
        "m[1,0].x[3]": 300, "m[2,1].x[4]": -400, "m[2,0].b": True,
    }  # fmt: skip
    for layout in ("natural8", "s7-standard"):
        sent = layout_of(members, layout)
        ours = lay_out(sent.type, rules_for(layout, OTHER[sent.rules.byte_order]))
        for language in ("st", "scl"):
            assert swap_code(sent, language).left_out == ()
            content = encode(sent, values)
            assert decode(ours, swapped(sent, content, language)) == decode(sent, content)


def test_the_code_reads_as_an_engineer_would_write_it() -> None:
    sent = lay_out(TYPES.get_type("Line"), rules_for("natural8"))
    assert swap_code(sent).code == (
        "// msg : Line; wire : Line_swapped; i1 : DINT; send wire\n"
        "wire.head := msg.head;\n"
        "wire.seq := SWAP2(UINT_TO_WORD(msg.seq));\n"
        "FOR i1 := 1 TO 3 DO\n"
        "    wire.axis[i1].is_on := msg.axis[i1].is_on;\n"
        "    wire.axis[i1].pos := SWAP8(LREAL_BITS(msg.axis[i1].pos));\n"
        "END_FOR;\n"
        "wire.label := msg.label;\n"
        "wire.temp := SWAP4(REAL_BITS(msg.temp));\n"
    )
    assert "#wire.temp := SWAP(REAL_TO_DWORD(#msg.temp));\n" in swap_code(sent, "scl").code


def test_the_swapped_telegram_is_a_declaration_that_is_read_again() -> None:
    sent = lay_out(TYPES.get_type("Line"), rules_for("s7-standard"))
    st, scl = swap_code(sent), swap_code(sent, "scl")
    for declared in (
        types_of(st.types),
        join_declarations([parse_source(scl.types, "x.udt", ".udt")], "x.udt"),
    ):
        assert declared.problems == ()
        again = lay_out(declared.get_type("Line_swapped"), sent.rules)
        assert [leaf[2:4] for leaf in again.leaves()] == [leaf[2:4] for leaf in sent.leaves()]


@pytest.mark.parametrize("language", ["st", "scl"])
def test_names_that_are_keywords_or_hold_blanks_are_written_as_the_language_takes_them(
    language: Language,
) -> None:
    type_ = join_declarations([parse_source(ODD_NAMES, "x.udt", ".udt")], "x.udt").get_type("T")
    sent = lay_out(type_, rules_for("natural8"))
    swap = swap_code(sent, language)
    wanted = {
        "st": [
            "wire.struct_ := SWAP2(INT_TO_WORD(msg.struct_));",
            "wire.a_b_2 := SWAP4(",
            "wire.A_B_2_2 := ",
        ],
        "scl": ['#wire."a b" := SWAP(DINT_TO_DWORD(#msg."a b"));', '#wire."if"[#i1]."für 1" := SWAP('],
    }
    assert all(line in swap.code for line in wanted[language])
    content = bytes(range(1, sent.size + 1))
    ours = lay_out(type_, rules_for("natural8", "big"))
    assert decode(ours, swapped(sent, content, language)) == decode(sent, content)


def test_what_is_no_single_number_is_left_out_and_told() -> None:
    swap = swap_code(
        layout_of("a : INT; name : WSTRING[5]; at : DTL; u : UNION i : INT; r : REAL; END_UNION;")
    )
    assert swap.left_out == (
        "name: WSTRING[5]",
        "at: DTL",
        "u: a UNION; swap the member that is in use",
    )
    assert "// wire.name is not swapped here: WSTRING[5]" in swap.code
