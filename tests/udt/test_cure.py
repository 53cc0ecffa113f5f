"""The cure for a pair of profiles: whatever can be done at one side makes the values right."""

from __future__ import annotations

import random
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.udt.st_machine import Machine
from tests.udt.test_fit import TELEGRAMS, TYPES, message
from tests.udt.udt_strategies import layout_of, rules, structs, types, types_of
from trcvtui.udt.compare.fit import fit, verdict
from trcvtui.udt.cure.cure import cure, cure_text
from trcvtui.udt.cure.swap import Language
from trcvtui.udt.layout.decode import decode
from trcvtui.udt.layout.layout import Layout, LayoutRules, lay_out, rules_for
from trcvtui.udt.renaming import ST_WORDS
from trcvtui.udt.sources.siemens import read_tia
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.st_write import scl_text, st_text
from trcvtui.udt.type_set import join
from trcvtui.udt.types import Array, Member, Struct

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


def unpacked(ours: Layout, theirs: Layout, content: bytes) -> bytes:
    """Return what the receiver's code makes of a message that it took into the corrective type."""
    found = cure(ours, theirs)
    assert found.unpacking is not None
    unions = types_of(found.unpacking.types)
    variables = {f"u_{name[2:]}": lay_out(unions.named(name), ours.rules) for name in unions.names()}
    receiver = found.receiver.layout
    is_scl, is_raw = ours.rules.name == "s7-standard", isinstance(found.receiver.type, Array)
    msg = receiver
    if is_scl and is_raw:  # the declaration that scl_text makes of it
        msg = lay_out(Struct("T", (Member("raw", found.receiver.type),)), ours.rules)
    machine = Machine(ours.rules, {"msg": msg, "value": ours, **variables})
    machine.memory["msg"][: len(content)] = content
    values = dict(zip((leaf.path for leaf in receiver.leaves()), decode(receiver, content), strict=True))
    for leaf in ours.leaves():  # what lies right is read where it lies
        if leaf.path in values and not isinstance(found.receiver.type, Array):
            place = slice(leaf.offset, leaf.offset + leaf.size)
            lies = receiver.leaf(receiver.number_of(leaf.path))
            machine.memory["value"][place] = content[lies.offset : lies.offset + lies.size]
    machine.run(found.unpacking.code)
    return bytes(machine.memory["value"])


@pytest.mark.parametrize("receiver", ["baosky", "s7-standard"])
@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("name", TELEGRAMS)
def test_what_cannot_be_declared_is_read_out_of_its_bytes(name: str, order: str, receiver: str) -> None:
    theirs = lay_out(TYPES.named(name), rules_for("packed", order))
    ours = lay_out(theirs.type, rules_for(receiver))
    content = message(theirs, random.Random(5))
    found = cure(ours, theirs)
    assert not found.receiver.is_possible
    left_out = found.unpacking.left_out if found.unpacking else ()
    sent = dict(zip((leaf.path for leaf in theirs.leaves()), decode(theirs, content), strict=True))
    got = dict(
        zip((leaf.path for leaf in ours.leaves()), decode(ours, unpacked(ours, theirs, content)), strict=True)
    )
    assert {path: got[path] for path in got if path not in left_out} == {
        path: sent[path] for path in sent if path not in left_out
    }
    assert [
        path for path in left_out if "name" not in path and "label" not in path and "batch" not in path
    ] == []


def test_many_raw_bytes_before_a_member_that_lies_right_do_not_hide_it() -> None:
    theirs = layout_of("s : ARRAY[1..220] OF STRING; m : ARRAY[0..1, 0..1] OF BOOL;")
    theirs = lay_out(theirs.type, rules_for("baosky", text="cstr"))
    found = cure(lay_out(theirs.type, rules_for("baosky", text="s7")), theirs)
    assert found.unpacking is not None
    assert (found.unpacking.code, len(found.unpacking.left_out)) == ("", 220)


def test_bits_are_read_out_of_their_byte() -> None:
    theirs = lay_out(TYPES.named("Flags"), rules_for("s7-standard", "little"))
    ours = lay_out(theirs.type, rules_for("baosky"))
    assert decode(ours, unpacked(ours, theirs, bytes.fromhex("02 00 07 00"))) == (False, True, 7)


@pytest.mark.parametrize("name", ["Weight", "Line"])
def test_a_sender_that_pads_and_swaps_is_read_right(name: str) -> None:
    theirs = lay_out(TYPES.named(name), rules_for("packed", "big"))
    ours = lay_out(theirs.type, rules_for("baosky"))
    found = cure(ours, theirs)
    assert found.sender.is_possible and found.swap is not None
    sender = found.sender.layout
    machine = Machine(
        theirs.rules, {"msg": sender, "wire": lay_out(found.swap.type, theirs.rules)}, found.swap.helpers
    )
    machine.memory["msg"][:] = content = message(sender, random.Random(9))
    machine.run(found.swap.code)
    shown = zip((leaf.path for leaf in sender.leaves()), decode(sender, content), strict=True)
    plain = [value for path, value in shown if "_pad" not in path]
    assert list(decode(ours, bytes(machine.memory["wire"]))) == plain


def test_the_text_says_what_is_for_whom() -> None:
    theirs = lay_out(TYPES.named("Weight"), rules_for("packed", "big"))
    text = cure_text(cure(lay_out(theirs.type, rules_for("baosky")), theirs))
    assert re.findall("^// (?:Rec|Or|Send).*", text, re.M) == [
        "// Receiver, under baosky: lies as packed, 11 bytes",
        "// Or the sender, under packed: lies as baosky, 16 bytes",
        "// Sender: bytes turned round, from big- to little-endian, with the type for the sender",
    ]


def test_a_receiver_that_is_an_s7_gets_a_tia_type_and_scl() -> None:
    theirs = layout_of("a : BYTE; n : DINT; t : TIME;", "packed")
    text = cure_text(cure(lay_out(theirs.type, rules_for("s7-standard")), theirs))
    receiver = text[: text.index("// Or the sender")]
    assert 'TYPE "T_packed"\nVERSION : 0.1\n' in receiver
    assert "UNION" not in receiver
    assert "// msg : T_packed; value : T\n" in receiver
    assert "#value.n := DWORD_TO_DINT(BYTE_TO_DWORD(#msg.raw[1]) OR SHL(IN := " in receiver
    types = join([read_tia(receiver[: receiver.index("// msg")], "x.udt")], "x.udt")
    assert types.problems == ()


def test_the_variables_of_the_code_are_declared_in_its_head() -> None:
    theirs = layout_of("a : BYTE; n : INT; r : REAL;", "packed")
    found = cure(lay_out(theirs.type, rules_for("baosky-pack4")), theirs)
    assert found.unpacking is not None
    assert found.unpacking.code.splitlines()[0] == (
        "// msg : T_packed; value : T; i : DINT; u_INT : U_INT; u_REAL : U_REAL"
    )


def test_legal_names_of_tia_make_legal_text_on_both_sides() -> None:
    types = join([read_tia(ODD_NAMES, "x.udt")], "x.udt")
    type_ = types.named("T")
    for ours, theirs in (("baosky", "natural8"), ("natural8", "codesys-1"), ("s7-standard", "natural8")):
        found = cure(lay_out(type_, rules_for(ours)), lay_out(type_, rules_for(theirs)))
        for side in (found.receiver, found.sender):
            plain = join([read_st(st_text(side.type, side.layout.name), "x.st")], "x.st")
            scl = join([read_tia(scl_text(side.type, side.layout.name), "x.udt")], "x.udt")
            assert plain.problems == scl.problems == ()
            again = lay_out(plain.named(plain.names()[-1]), side.layout.rules)
            assert [leaf[2:4] for leaf in again.leaves()] == [leaf[2:4] for leaf in side.layout.leaves()]
            words = {part for leaf in again.leaves() for part in re.findall(r"[^.\[\]]+", leaf.path)}
            assert not {word for word in words if word.upper() in ST_WORDS}
            assert all(word.isascii() and " " not in word for word in words)


def test_profiles_that_agree_need_no_cure() -> None:
    layout = lay_out(TYPES.named("Report"), rules_for("baosky"))
    found = cure(layout, lay_out(layout.type, rules_for("natural8")))
    assert found.receiver.type is found.sender.type is layout.type
    assert (found.swap, found.unpacking) == (None, None)


@settings(max_examples=40, deadline=None)
@given(
    structs(types, least=1), rules, rules, st.sampled_from(["st", "scl"]), st.lists(st.binary(max_size=60))
)
def test_any_pair_has_a_cure_and_any_bytes_a_ranking(
    type_: Struct, ours: LayoutRules, theirs: LayoutRules, language: Language, messages: list[bytes]
) -> None:
    found = cure(lay_out(type_, ours), lay_out(type_, theirs), language)
    assert cure_text(found, language).startswith("// Receiver, under ")
    fits = fit(type_, messages)
    assert [one.score for one in fits] == sorted((one.score for one in fits), reverse=True)
    assert verdict(fits)
