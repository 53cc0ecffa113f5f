"""Which profile fits: what was encoded in a profile ranks it first, and a tie is told as one."""

from __future__ import annotations

import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import golden
from tests.udt.udt_strategies import layout_of, rules, structs, types, types_of
from trcvtui.udt.compare.compare import describe_difference
from trcvtui.udt.compare.fit import rank, tied_readings, verdict
from trcvtui.udt.layout.layout import (
    Layout,
    LayoutRules,
    Leaf,
    Profile,
    group_same_layouts,
    has_text,
    lay_out,
    layout_shape,
    profiles_for,
    rules_for,
)
from trcvtui.udt.layout.values import encode
from trcvtui.udt.types import Elementary, Enumeration, StringType, Struct, ValueKind

TYPES = types_of("""
TYPE E_Mode : (Idle := 0, Run := 1, Fault := 2) INT; END_TYPE
TYPE Axis : STRUCT is_on : BOOL; pos : LREAL; END_STRUCT END_TYPE
TYPE Weight : STRUCT kind : BYTE; weight : LREAL; count : INT; END_STRUCT END_TYPE
TYPE Report : STRUCT
    ready : BOOL; fault : BOOL; mode : E_Mode; id : DINT; speed : REAL; name : STRING[9]; total : LREAL;
END_STRUCT END_TYPE
TYPE Line : STRUCT
    head : USINT; seq : UINT; axis : ARRAY[1..3] OF Axis; label : STRING[5]; temp : REAL;
END_STRUCT END_TYPE
TYPE Batch : STRUCT
    flag : BOOL; serial : UDINT; batch : STRING[12]; state : INT;
    items : ARRAY[0..3] OF STRUCT code : BYTE; amount : REAL; END_STRUCT;
END_STRUCT END_TYPE
TYPE Flags : STRUCT a : BOOL; b : BOOL; n : INT; END_STRUCT END_TYPE
""")
TELEGRAMS = ("Weight", "Report", "Line", "Batch")


def ordinary(leaf: Leaf, chance: random.Random) -> object:
    """Return a value as machines send it."""
    if isinstance(leaf.type, StringType):
        return "".join(chance.choices("ABCDEF0123456789-", k=chance.randint(1, leaf.type.length or 9)))
    if isinstance(leaf.type, Enumeration):
        return chance.randrange(3)
    assert isinstance(leaf.type, Elementary)
    if leaf.type.kind is ValueKind.BOOL:
        return chance.random() < 0.5
    if leaf.type.kind is ValueKind.REAL:
        return chance.choice([round(chance.uniform(-500, 500), 2), chance.uniform(0.1, 3000), 2.5])
    return chance.randint(0, 255) if leaf.type.size == 1 else chance.randint(1, 9999)


def message(layout: Layout, chance: random.Random) -> bytes:
    """Return a message of ordinary values."""
    return encode(layout, {leaf.path: ordinary(leaf, chance) for leaf in layout.leaves()})


every = [(name, profile) for name in TELEGRAMS for profile in profiles_for(TYPES.get_type(name))]


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.sampled_from(every), st.integers(0, 10_000), st.integers(1, 3), st.booleans())
def test_the_profile_of_the_sender_ranks_first(
    sent: tuple[str, Profile], seed: int, count: int, framed: bool
) -> None:
    name, profile = sent
    layout = lay_out(TYPES.get_type(name), profile.rules)
    chance = random.Random(seed)
    fits = rank(layout.type, [message(layout, chance) for _ in range(count)], framed=framed)
    assert any(profile in best.profiles for best in tied_readings(fits)), verdict(fits)


def test_a_natural_sender_is_told_from_cap4_with_the_reasons() -> None:
    content = struct.pack("<B7xdh6x", 1, 12.5, 7)
    fits = rank(TYPES.get_type("Weight"), [content])
    assert [str(profile) for profile in fits[0].profiles] == [
        "natural8, little-endian",
        "codesys-8, little-endian",
    ]
    assert [(reason.points, reason.text) for reason in fits[0].reasons] == [
        (8.0, "24 bytes came, the type has 24"),
        (4.46, "weight = 12.5: a sensible LREAL of few digits"),
        (2.55, "padding at bytes 1 to 7 is 0"),
        (2.5, "padding at bytes 18 to 23 is 0"),
        (1.85, "count = 7: small; 1792 with bytes swapped"),
        (1.82, "kind = 1 (16#01): bits"),
    ]
    assert verdict(fits).startswith(
        "natural8, little-endian (+21.2; the same for these bytes: codesys-8, little-endian) fits best; next"
    )


def test_a_swapped_sender_is_told_by_its_numbers() -> None:
    content = struct.pack(">B3xdh2x", 1, 12.5, 7)
    best = rank(TYPES.get_type("Weight"), [content])[0]
    assert str(best.profile) == "baosky, big-endian"


def test_zeros_cannot_be_told_apart_and_the_difference_is_named() -> None:
    fits = rank(TYPES.get_type("Weight"), [bytes(16)])
    assert verdict(fits) == (
        "these bytes do not decide between 'baosky, little-endian' and 'baosky, big-endian': "
        "the first two differ only in the byte order"
    )


def test_a_sign_makes_another_reading_only_where_a_value_has_one() -> None:
    type_ = types_of("TYPE T : STRUCT a : DINT; t : TIME; END_STRUCT END_TYPE").get_type("T")
    asked = [Profile("baosky", "little"), Profile("codesys-4", "little")]
    assert list(rank(type_, [bytes.fromhex("01000000 05000000")], profiles=asked)[0].profiles) == asked
    assert rank(type_, [bytes.fromhex("01000000 FBFFFFFF")], profiles=asked)[0].profiles == (asked[0],)


def test_a_tie_is_told_with_what_differs_and_with_nothing_else() -> None:
    type_ = types_of("TYPE T : STRUCT d : DATE; i : INT; k : INT; END_STRUCT END_TYPE").get_type("T")
    asked = [Profile("baosky", "little"), Profile("codesys-4", "little")]
    fits = rank(type_, [bytes(8)], profiles=asked)
    told = describe_difference(*(lay_out(type_, one.rules) for one in asked))
    both = "'baosky, little-endian' and 'codesys-4, little-endian'"
    assert verdict(fits) == (f"these bytes do not decide between {both}: the first two differ only in {told}")


def test_the_difference_is_looked_for_in_the_whole_declaration() -> None:
    def say(case: str) -> list[str]:
        theirs, members = case.split(" | ")
        ours = layout_of(members)
        return [describe_difference(ours, lay_out(ours.type, Profile(*theirs.split()).rules))]

    golden.answers("differences of layouts", say)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(structs(types, least=1), rules, rules)
def test_two_readings_that_are_not_one_have_a_difference(
    type_: Struct, ours: LayoutRules, theirs: LayoutRules
) -> None:
    a, b = lay_out(type_, ours), lay_out(type_, theirs)
    told = describe_difference(a, b)
    assert ("STRING form" not in told) or has_text(type_)
    assert (told == "nothing") <= (layout_shape(a) == layout_shape(b))


def test_two_bools_of_which_the_second_is_false_may_be_bits() -> None:
    type_ = TYPES.get_type("Flags")
    told = [str(best.profile) for best in tied_readings(rank(type_, [bytes.fromhex("01 00 07 00")]))]
    assert told == ["baosky, little-endian", "s7-standard, little-endian"]
    both = tied_readings(rank(type_, [bytes.fromhex("03 00 07 00")]))
    assert [str(best.profile) for best in both] == ["s7-standard, little-endian"]
    assert verdict(rank(type_, [bytes.fromhex("01 00 07 00")])).endswith(
        "the first two differ only in the place of a (0 and 0.0), b (1 and 0.1)"
    )


def test_pieces_of_a_stream_are_cut_in_the_size_of_each_profile() -> None:
    chance = random.Random(3)
    layout = lay_out(TYPES.get_type("Weight"), rules_for("natural8"))
    stream = b"".join(message(layout, chance) for _ in range(4))
    pieces = [stream[at : at + 16] for at in range(0, len(stream), 16)]  # as a receiver of 16 bytes cuts them
    fits = rank(layout.type, pieces, framed=False)
    assert fits[0].profile.layout == "natural8"
    assert any("steady" in reason.text for reason in fits[0].reasons)


@pytest.mark.parametrize("size", [0, 1, 5, 24])
def test_noise_fits_nothing(size: int) -> None:
    fits = rank(TYPES.get_type("Report"), [random.Random(1).randbytes(size)])
    assert verdict(fits).startswith("no layout fits these bytes well")


def test_a_string_header_that_says_another_length_is_evidence() -> None:
    rules = rules_for("baosky", text="cstr")
    layout = lay_out(TYPES.get_type("Report"), rules)
    content = encode(layout, {"ready": True, "id": 3, "speed": 1.5, "name": "Line-1", "total": 4.25})
    fits = rank(layout.type, [content])
    assert fits[0].profile.text != "s7"
    headed = next(one for one in fits if one.profile == Profile("baosky", "little", "s7"))
    assert "its header says at most 76 characters, the type has 9" in str(headed.reasons)


def test_no_messages_say_nothing() -> None:
    assert {one.score for one in rank(TYPES.get_type("Report"), [])} == {0.0}


def test_profiles_are_one_where_the_type_is_the_same_in_both() -> None:
    type_ = TYPES.get_type("Flags")
    merged = group_same_layouts(type_, profiles_for(type_))
    sizes = sorted((layout.size, len(same)) for same, layout in merged)
    assert sum(count for _, count in sizes) == len(profiles_for(type_)) == 20
    assert len(merged) == len(
        {(layout.size, layout.rules.byte_order, *_bits(layout)) for _, layout in merged}
    )


def _bits(layout: Layout) -> list[tuple[int, int | None]]:
    return [(leaf.offset, leaf.bit) for leaf in layout.leaves()]


def test_a_string_that_a_layout_cannot_hold_leaves_that_layout_out() -> None:
    type_ = types_of("TYPE T : STRUCT a : STRING[400]; b : INT; END_STRUCT END_TYPE").get_type("T")
    assert {one.profile.text for one in rank(type_, [bytes(404)])} == {"cstr", "nul"}


def test_a_drift_beside_bools_that_are_bits_is_compared() -> None:
    type_ = types_of(
        "TYPE T : STRUCT a : BOOL; b : BOOL; n : INT; r : REAL; k : INT; END_STRUCT END_TYPE"
    ).get_type("T")
    layout = lay_out(type_, rules_for("s7-standard"))
    sent = [encode(layout, {"a": True, "b": True, "n": 7 + at, "r": 2.5, "k": 300}) for at in range(3)]
    assert rank(type_, sent)[0].profile.layout == "s7-standard"


SENSOR = types_of("""
TYPE V : UNION r : REAL; d : DINT; END_UNION END_TYPE
TYPE Sensor : STRUCT
    id : UINT; mode : INT; v : V; count : UDINT; speed : REAL; limit : DINT;
END_STRUCT END_TYPE
""").get_type("Sensor")


def sensor(number: int, count: bytes = b"", limit: bytes = b"") -> bytes:
    """Return a message of a little-endian sender of which the UNION has a DINT in each second message."""
    value = struct.pack("<i", 3 * number + 1) if number % 2 else struct.pack("<f", number + 0.5)
    count, limit = count or struct.pack("<I", 5000 + number), limit or struct.pack("<i", 1234)
    return struct.pack("<Hh", 17 + number, 3) + value + count + struct.pack("<f", 120.5 + number) + limit


@pytest.mark.parametrize(
    ("messages", "is_sure", "said"),
    [
        ([sensor(n) for n in range(6)], True, ""),
        ([sensor(n, limit=struct.pack(">i", 1234)) for n in range(6)], False, "limit = -771489792"),
        ([sensor(n, count=struct.pack("<HH", 0, 5000 + n)) for n in range(6)], False, "count = 328007680"),
        ([sensor(n) + b"\r" for n in range(6)], True, ""),
        ([struct.pack(">HH", 1, 24) + sensor(n) + b"\r\n" for n in range(6)], True, ""),
    ],
    ids=["plain", "one number in the other byte order", "one of exchanged words", "CR", "length and CR LF"],
)
def test_a_number_in_another_byte_order_is_a_doubt_and_a_known_frame_is_none(
    messages: list[bytes], is_sure: bool, said: str
) -> None:
    best = rank(SENSOR, messages, "Sensor")[0]
    assert best.fits_best == is_sure
    assert best.doubt.startswith(said)
