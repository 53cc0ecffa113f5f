"""The cure for a pair of profiles: a type and swap code at one side make the values right."""

from __future__ import annotations

import random
import re
from itertools import groupby

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.udt.st_machine import Machine
from tests.udt.test_fit import TYPES, message
from tests.udt.udt_strategies import rules, structs, types
from trcvtui.tui.lab.lab_fix import cure_source
from trcvtui.udt.compare.fit import fit, verdict
from trcvtui.udt.cure.padded_type import padded_type
from trcvtui.udt.cure.swap import swap_code
from trcvtui.udt.layout.layout import LayoutRules, lay_out, rules_for
from trcvtui.udt.layout.values import decode
from trcvtui.udt.sources import read_text
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.st_write import ST_WORDS, scl_text, st_text
from trcvtui.udt.type_set import join
from trcvtui.udt.types import ELEMENTARY, Member, Struct

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
    theirs = lay_out(TYPES.named(name), rules_for("packed", "big"))
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
    types = join([read_text(ODD_NAMES, "x.udt", ".udt")], "x.udt")
    type_ = types.named("T")
    for ours, theirs in (("baosky", "natural8"), ("natural8", "codesys-1"), ("s7-standard", "natural8")):
        for wanted, own in ((theirs, ours), (ours, theirs)):
            side = padded_type(lay_out(type_, rules_for(wanted)), rules_for(own))
            plain = join([read_st(st_text(side.type, side.layout.name), "x.st")], "x.st")
            scl = join([read_text(scl_text(side.type, side.layout.name), "x.udt", ".udt")], "x.udt")
            assert plain.problems == scl.problems == ()
            again = lay_out(plain.named(plain.names()[-1]), side.layout.rules)
            assert [leaf[2:4] for leaf in again.leaves()] == [leaf[2:4] for leaf in side.layout.leaves()]
            words = {part for leaf in again.leaves() for part in re.findall(r"[^.\[\]]+", leaf.path)}
            assert not {word for word in words if word.upper() in ST_WORDS}
            assert all(word.isascii() and " " not in word for word in words)


def test_profiles_that_agree_need_no_cure() -> None:
    layout = lay_out(TYPES.named("Report"), rules_for("baosky"))
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
    text = cure_source(lay_out(type_, ours, "T"), lay_out(type_, theirs, "T"), form)
    assert text.startswith(f"// T for {ours.name}, ")
    fits = fit(type_, messages)
    best = [next(group).score for _, group in groupby(fits, key=lambda one: one.rank)]
    assert best == sorted(best, reverse=True)  # readings that find the same values stand together
    assert [one.rank for one in fits] == sorted(one.rank for one in fits)
    assert verdict(fits)
