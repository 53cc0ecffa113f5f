"""Swap code for the sender's side: what it makes reads right in the other byte order."""

from __future__ import annotations

import random

import pytest

from tests.udt.st_machine import Machine
from tests.udt.test_cure import ODD_NAMES
from tests.udt.test_fit import TELEGRAMS, TYPES, message
from tests.udt.udt_strategies import layout_of, types_of
from trcvtui.udt.cure.swap import Language, swap_code
from trcvtui.udt.layout.layout import Layout, lay_out, rules_for
from trcvtui.udt.layout.values import decode, encode
from trcvtui.udt.sources import read_text
from trcvtui.udt.st_write import st_renamed
from trcvtui.udt.type_set import join

OTHER = {"little": "big", "big": "little"}


def swapped(sent: Layout, content: bytes, language: Language) -> bytes:
    """Return what the swap code makes of a message."""
    swap = swap_code(sent, language)
    msg = lay_out(st_renamed(sent.type), sent.rules) if language == "st" else sent
    machine = Machine(sent.rules, {"msg": msg, "wire": lay_out(swap.type, sent.rules)}, swap.helpers)
    machine.memory["msg"][:] = content
    machine.run(swap.code)
    return bytes(machine.memory["wire"])


@pytest.mark.parametrize("language", ["st", "scl"])
@pytest.mark.parametrize("layout", ["baosky", "natural8", "packed", "codesys-8", "s7-standard"])
@pytest.mark.parametrize("name", TELEGRAMS)
def test_swapped_bytes_decode_to_the_senders_values_in_the_other_order(
    name: str, layout: str, language: Language
) -> None:
    for order in ("little", "big"):
        sent = lay_out(TYPES.named(name), rules_for(layout, order))
        content = message(sent, random.Random(7))
        ours = lay_out(sent.type, rules_for(layout, OTHER[order]))
        assert decode(ours, swapped(sent, content, language)) == decode(sent, content)


def test_every_kind_of_number_is_swapped() -> None:
    members = "a : SINT; i : INT; u : UDINT; l : LINT; w : WORD; d : DWORD; q : LWORD; r : REAL; lr : LREAL;"
    members += (
        "t : TIME; lt : LTIME; dt : DATE; tod : TOD; c : CHAR; e : (A := 1, B := 258) DINT; s : INT(0..999);"
    )
    members += "m : ARRAY[1..2, 0..1] OF STRUCT x : ARRAY[3..4] OF INT; b : BOOL; END_STRUCT;"
    values: dict[str, object] = {
        "a": -3,
        "i": -300,
        "u": 70000,
        "l": -5_000_000_000,
        "w": 258,
        "d": 0x01020304,
        "q": 0x0102030405060708,
        "r": -1.5,
        "lr": 1234.5678,
        "t": "T#1h",
        "lt": "LTIME#5s",
        "dt": "DATE#2026-02-03",
        "tod": "TOD#12:30:00",
        "c": "x",
        "e": 258,
        "s": 513,
        "m[1,0].x[3]": 300,
        "m[2,1].x[4]": -400,
        "m[2,0].b": True,
    }
    for layout in ("natural8", "s7-standard"):
        sent = layout_of(members, layout)
        ours = lay_out(sent.type, rules_for(layout, OTHER[sent.rules.byte_order]))
        for language in ("st", "scl"):
            assert swap_code(sent, language).left_out == ()
            content = encode(sent, values)
            assert decode(ours, swapped(sent, content, language)) == decode(sent, content)


def test_the_code_reads_as_an_engineer_would_write_it() -> None:
    sent = lay_out(TYPES.named("Line"), rules_for("natural8"))
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
    sent = lay_out(TYPES.named("Line"), rules_for("s7-standard"))
    st, scl = swap_code(sent), swap_code(sent, "scl")
    for types in (types_of(st.types), join([read_text(scl.types, "x.udt", ".udt")], "x.udt")):
        assert types.problems == ()
        again = lay_out(types.named("Line_swapped"), sent.rules)
        assert [leaf[2:4] for leaf in again.leaves()] == [leaf[2:4] for leaf in sent.leaves()]


@pytest.mark.parametrize("language", ["st", "scl"])
def test_names_that_are_keywords_or_hold_blanks_are_written_as_the_language_takes_them(
    language: Language,
) -> None:
    type_ = join([read_text(ODD_NAMES, "x.udt", ".udt")], "x.udt").named("T")
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
        "u: a UNION: swap the member that is in use",
    )
    assert "// wire.name is not swapped here: WSTRING[5]" in swap.code
