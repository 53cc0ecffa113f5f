"""The cure for a pair of profiles: whatever can be done at one side makes the values right."""

from __future__ import annotations

import random
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.udt.st_machine import Machine
from tests.udt.test_fit import TELEGRAMS, TYPES, message
from tests.udt.udt_strategies import rules, structs, types, types_of
from trcvtui.udt.cure import cure, cure_text
from trcvtui.udt.decode import decode
from trcvtui.udt.fit import fit, verdict
from trcvtui.udt.layout import Layout, LayoutRules, lay_out, rules_for
from trcvtui.udt.swap import Language
from trcvtui.udt.types import Array, Struct


def unpacked(ours: Layout, theirs: Layout, content: bytes) -> bytes:
    """Return what the receiver's code makes of a message that it took into the corrective type."""
    found = cure(ours, theirs)
    assert found.unpacking is not None
    unions = types_of(found.unpacking.types)
    variables = {f"u_{name[2:]}": lay_out(unions.named(name), ours.rules) for name in unions.names()}
    receiver = found.receiver.layout
    machine = Machine(ours.rules, {"msg": receiver, "value": ours, **variables})
    machine.memory["msg"][:] = content
    values = dict(zip((leaf.path for leaf in receiver.leaves()), decode(receiver, content), strict=True))
    for leaf in ours.leaves():  # what lies right is read where it lies
        if leaf.path in values and not isinstance(found.receiver.type, Array):
            place = slice(leaf.offset, leaf.offset + leaf.size)
            lies = receiver.leaf(receiver.number_of(leaf.path))
            machine.memory["value"][place] = content[lies.offset : lies.offset + lies.size]
    machine.run(found.unpacking.code)
    return bytes(machine.memory["value"])


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("name", TELEGRAMS)
def test_what_cannot_be_declared_is_read_out_of_its_bytes(name: str, order: str) -> None:
    theirs = lay_out(TYPES.named(name), rules_for("packed", order))
    ours = lay_out(theirs.type, rules_for("baosky"))
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
