"""Where members lie at CODESYS and S7: vectors of each, and a worked example."""

from __future__ import annotations

import pytest

from tests.udt.answers import show_json
from tests.udt.udt_strategies import places_of, types_of
from trcvtui.errors import UserError
from trcvtui.udt.layout.layout import Layout, LayoutRules, lay_out, rules_for
from trcvtui.udt.layout.values import decode, decode_leaves, encode
from trcvtui.udt.report import layout_table
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Enumeration,
    Member,
    Pointer,
    RawType,
    StringType,
    Struct,
    Subrange,
    Type,
    Union,
)

T = ELEMENTARY


def members(*types: Type | str) -> tuple[Member, ...]:
    """Return members m0, m1, ... of these types; a text is the name of an elementary one."""
    return tuple(Member(f"m{n}", T[t] if isinstance(t, str) else t) for n, t in enumerate(types))


def struct(*types: Type | str, base: Struct | None = None, pack: int | None = None) -> Struct:
    """Return a STRUCT of these members."""
    return Struct("S", members(*types), base, pack)


def array(element: Type | str, *bounds: tuple[int, int]) -> Array:
    """Return an ARRAY."""
    return Array(bounds, T[element] if isinstance(element, str) else element)


def places(layout: Layout, whole: bool = False) -> list[str]:
    """Return the place of every member, as `2` or `2.7`: of its first leaf, with `whole` of all leaves."""
    numbers = range(layout.leaf_count) if whole else layout.root.firsts  # type: ignore[union-attr]
    leaves = [layout.leaf(number) for number in numbers]
    return [str(leaf.offset) if leaf.bit is None else f"{leaf.offset}.{leaf.bit}" for leaf in leaves]


ENUM = Enumeration("E", T["INT"], (("A", 0), ("B", 1)), is_named=False)
ENUM_DWORD = Enumeration("F", T["DWORD"], (("A", 0),))
PACKS = (8, 4, 2, 1)
# Per P = 8, 4, 2, 1 the size and the places of the members; the last one holds for the P that are left.
CODESYS_VECTORS: list[tuple[str, Struct, str]] = [
    ("C1", struct("BYTE", "DINT", "BYTE", "INT"), "12: 0 4 8 10 | 12: 0 4 8 10 | 10: 0 2 6 8 | 8: 0 1 5 6"),
    ("C2", struct("BYTE", "LREAL"), "16: 0 8 | 12: 0 4 | 10: 0 2 | 9: 0 1"),
    ("C3", struct("LREAL", "BYTE"), "16: 0 8 | 12: 0 8 | 10: 0 8 | 9: 0 8"),
    ("C4", struct("BYTE", "WORD", "DWORD", "LREAL"), "16: 0 2 4 8 | 16: 0 2 4 8 | 16: 0 2 4 8 | 15: 0 1 3 7"),
    ("C5", struct("SINT", "LREAL", "DINT"), "24: 0 8 16 | 16: 0 4 12 | 14: 0 2 10 | 13: 0 1 9"),
    ("C6", struct("BOOL", "INT", "BOOL", "BOOL"), "6: 0 2 4 5 | 6: 0 2 4 5 | 6: 0 2 4 5 | 5: 0 1 3 4"),
    ("C7", struct(StringType(3), "DINT"), "8: 0 4"),
    ("C8", struct(StringType(), StringType(2, wide=True)), "88: 0 82 | 88: 0 82 | 88: 0 82 | 87: 0 81"),
    (
        "C9",
        struct("BYTE", array(struct("DINT", "BYTE"), (0, 2)), "BYTE"),
        "32: 0 4 28 | 32: 0 4 28 | 22: 0 2 20 | 17: 0 1 16",
    ),
    ("C10", struct("BYTE", struct("BYTE", "DINT", pack=1), "DINT"), "12: 0 1 8 | 12: 0 1 8 | 10: 0 1 6"),
    ("C11", struct("BYTE", struct("BYTE", "LREAL"), pack=1), "17: 0 1 | 13: 0 1 | 11: 0 1 | 10: 0 1"),
    (
        "C12",
        struct("BYTE", Union("U", members("REAL", array("BYTE", (0, 4)))), "BYTE"),
        "16: 0 4 12 | 16: 0 4 12 | 10: 0 2 8 | 7: 0 1 6",
    ),
    ("C13", struct(*["BIT"] * 9, "BYTE", "BIT", "INT"), "6: 0.0 0.1 0.2 0.3 0.4 0.5 0.6 0.7 1.0 2 3.0 4"),
    ("C14", struct("BYTE", ENUM, ENUM_DWORD), "8: 0 2 4 | 8: 0 2 4 | 8: 0 2 4 | 7: 0 1 3"),
    ("C15", struct("BYTE", array("INT", (1, 3), (0, 2))), "20: 0 2 | 20: 0 2 | 20: 0 2 | 19: 0 1"),
    (
        "C16",
        struct("BYTE", "INT", base=struct("DINT", "BYTE")),
        "12: 0 8 10 | 12: 0 8 10 | 10: 0 6 8 | 8: 0 5 6",
    ),
    (
        "C17",
        struct("BOOL", Subrange(T["INT"], -5, 5), "TIME", "LTIME"),
        "16: 0 2 4 8 | 16: 0 2 4 8 | 16: 0 2 4 8 | 15: 0 1 3 7",
    ),
    ("C18", struct("BOOL", Pointer("POINTER TO BYTE")), "16: 0 8 | 12: 0 4 | 10: 0 2 | 9: 0 1"),
    ("C19", struct("BOOL"), "1: 0"),
    ("C20", struct("INT", "BOOL"), "4: 0 2 | 4: 0 2 | 4: 0 2 | 3: 0 2"),
    (
        "C21",
        struct("DINT", struct("BYTE", "LREAL"), "BYTE"),
        "32: 0 8 24 | 20: 0 4 16 | 16: 0 4 14 | 14: 0 4 13",
    ),
]


@pytest.mark.parametrize(("name", "type_", "expected"), CODESYS_VECTORS, ids=[v[0] for v in CODESYS_VECTORS])
def test_the_codesys_vectors_at_every_pack(name: str, type_: Struct, expected: str) -> None:
    layouts = [lay_out(type_, rules_for(f"codesys-{pack}")) for pack in PACKS]
    lies = expected.split(" | ")
    lies += lies[-1:] * (len(PACKS) - len(lies))
    assert [f"{layout.size}: {' '.join(places(layout))}" for layout in layouts] == lies


def test_the_bytes_of_the_manual_for_c2() -> None:
    data = {"m0": 0xFF, "m1": 1234.5678}
    wide, tight = (lay_out(struct("BYTE", "LREAL"), rules_for(f"codesys-{pack}")) for pack in (8, 1))
    assert encode(wide, data) == bytes.fromhex("FF00000000000000 ADFA5C6D454A9340")
    assert encode(tight, data) == bytes.fromhex("FF ADFA5C6D454A9340")
    assert decode(wide, bytes.fromhex("FFEEEEEEEEEEEEEE ADFA5C6D454A9340")) == (0xFF, 1234.5678)


# udt.md 3.4: size and places of all leaves, byte.bit.
S7_VECTORS: list[tuple[str, Struct, str]] = [
    ("S1", struct("BOOL", "BOOL", "BYTE", "BOOL", "INT"), "6: 0.0 0.1 1 2.0 4"),
    ("S2", struct("BYTE", "BYTE", "BYTE", "WORD"), "6: 0 1 2 4"),
    ("S3", struct("BOOL", "DINT"), "6: 0.0 2"),
    ("S4", struct("BYTE", "REAL", "LREAL"), "14: 0 2 6"),
    (
        "S5",
        struct(array("BOOL", (0, 9)), "BOOL"),
        "4: 0.0 0.1 0.2 0.3 0.4 0.5 0.6 0.7 1.0 1.1 2.0",
    ),
    ("S6", struct(array("BYTE", (1, 3)), "BYTE"), "6: 0 1 2 4"),
    ("S7", struct("BOOL", struct("BOOL"), "BOOL"), "6: 0.0 2.0 4.0"),
    ("S8", struct(StringType(5), "BYTE", "INT"), "12: 0 8 10"),
    ("S9", struct(StringType(), "BOOL"), "258: 0 256.0"),
    ("S10", struct(array(struct("INT", "BOOL"), (1, 2)), "BYTE"), "10: 0 2.0 4 6.0 8"),
    ("S11", struct(array("BOOL", (0, 1), (0, 2))), "2: 0.0 0.1 0.2 1.0 1.1 1.2"),
    ("S12", struct("USINT", "DTL", StringType(3, wide=True)), "24: 0 2 14"),
    ("S13", struct("CHAR", "DATE", "TIME_OF_DAY", "DATE_AND_TIME"), "16: 0 2 4 8"),
    ("S14", struct(array(StringType(3), (0, 1)), "BOOL"), "14: 0 6 12.0"),
    ("S15", struct("INT", array("BYTE", (1, 8)), "INT", "INT"), "14: 0 2 3 4 5 6 7 8 9 10 12"),
]


@pytest.mark.parametrize(("name", "type_", "expected"), S7_VECTORS, ids=[v[0] for v in S7_VECTORS])
def test_the_vectors_of_s7_standard(name: str, type_: Struct, expected: str) -> None:
    layout = lay_out(type_, rules_for("s7-standard"))
    assert f"{layout.size}: {' '.join(places(layout, whole=True))}" == expected


def test_s16_an_array_of_three_dimensions() -> None:
    layout = lay_out(struct(array("INT", (0, 67), (0, 16), (1, 2))), rules_for("s7-standard"))
    assert (layout.size, layout.leaf_count) == (4624, 68 * 17 * 2)


def test_s8_without_string_even_goes_on_directly_after_the_string() -> None:
    layout = lay_out(struct(StringType(5), "BYTE", "INT"), rules_for("s7-standard", string_even=False))
    assert f"{layout.size}: {' '.join(places(layout))}" == "10: 0 7 8"


WORKED = types_of("""TYPE Worked : STRUCT
    bReady : BOOL; bFault : BOOL; byMode : BYTE; bAck : BOOL; iCount : INT; rTemp : REAL; sName : STRING[5];
    byTail : BYTE; aFlags : ARRAY[0..9] OF BOOL; aRaw : ARRAY[0..2] OF BYTE; usi : USINT;
    stIn : STRUCT x : BOOL; y : DINT; END_STRUCT; dtl : DTL; lr : LREAL; bEnd : BOOL;
END_STRUCT END_TYPE""").get_type("Worked")


def test_the_worked_example_of_the_siemens_page() -> None:
    layout = lay_out(WORKED, rules_for("s7-standard"))
    assert " ".join(places(layout)) == "0.0 0.1 1 2.0 4 6 10 18 20.0 22 26 28.0 34 46 54.0"
    assert layout.leaf(layout.leaf_number("stIn.y")).offset == 30
    assert layout.leaf(layout.leaf_number("aFlags[9]"))[2:4] == (21, 1)
    assert layout.leaf(layout.leaf_number("aFlags[9]")).bit == 1
    assert (layout.size, layout.align, layout.rules.byte_order) == (56, 2, "big")
    assert list(layout.padding()) == [(3, 1), (17, 1), (19, 1), (25, 1), (27, 1), (29, 1), (55, 1)]


# -- bits ----------------------------------------------------------------------------------------------------


def test_bits_are_decoded_by_page_at_once_and_as_far_as_bytes_go() -> None:
    layout = lay_out(WORKED, rules_for("s7-standard"))
    data = bytes([0b10, 7, 1]) + bytes(17) + bytes([0b1010_0101, 0b10]) + bytes(34)
    flags = (True, False, True, False, False, True, False, True, False, True)
    assert decode(layout, data)[:4] == (False, True, 7, True)
    assert decode(layout, data)[8:18] == flags
    assert decode_leaves(layout, data, 13, 18) == flags[5:]
    assert decode(layout, data[:21])[8:18] == (*flags[:8], None, None), "a bit whose byte is there is there"
    assert layout.leaf_number_at(20) == 8


def test_a_bit_is_written_beside_its_neighbours() -> None:
    layout = lay_out(struct("BOOL", "BOOL", "BOOL", "BYTE"), rules_for("s7-standard"))
    assert encode(layout, {"m0": True, "m2": True, "m3": 255}) == bytes([0b101, 255])
    assert encode(layout, {"m0": True, "m1": False}) == bytes([1, 0])


def test_bits_in_json_have_a_byte_and_a_bit() -> None:
    layout = lay_out(struct("BIT", "BIT", "INT"), rules_for("codesys-8"))
    assert show_json(layout)["members"] == [
        {"path": "m0", "type": "BIT", "offset": 0, "bit": 0, "size": 1},
        {"path": "m1", "type": "BIT", "offset": 0, "bit": 1, "size": 1},
        {"path": "m2", "type": "INT", "offset": 2, "size": 2},
    ]
    assert show_json(layout)["padding"] == [{"offset": 1, "size": 1}]
    assert layout_table(layout).splitlines()[2:5] == [
        "   0.0     1  BIT   m0",
        "   0.1     1  BIT   m1",
        "     1     1        (padding)",
    ]


def test_each_bit_of_a_union_is_the_first_bit() -> None:
    union = Union("U", members("BIT", "BIT", "BYTE"))
    layout = lay_out(union, rules_for("codesys-8"))
    assert places(layout, whole=True) == ["0.0", "0.0", "0"]
    assert decode(layout, b"\x05") == (True, True, 5)


def test_bits_are_an_eighth_of_as_many_bytes() -> None:
    layout = lay_out(array("BOOL", (0, 131_071)), rules_for("s7-standard"))
    data = bytes([0b1]) * 16_384
    assert layout.size == len(data)
    assert sum(map(bool, decode(layout, data))) == len(data)
    assert decode_leaves(layout, data, 80_000, 80_009) == (True, *[False] * 7, True)


# -- what is extended, overlaid, or cannot be laid out -------------------------------------------------------


def test_what_a_type_extends_comes_first_without_a_name_in_front() -> None:
    base = Struct("Base", (Member("id", T["DINT"]), Member("kind", T["BYTE"])))
    middle = Struct("Middle", (Member("a", T["BYTE"]),), base)
    type_ = Struct("Top", (Member("b", T["INT"]), Member("in", middle)), middle)
    layout = lay_out(type_, rules_for("codesys-8"))
    assert places_of(layout) == ("id@0 kind@4 a@8 b@12 in.id@16 in.kind@20 in.a@24")
    assert layout.leaf_number("Kind") == 1
    assert layout.leaf_number("in.KIND") == 5
    with pytest.raises(UserError, match="expected a member"):
        layout.leaf_number("in.b")


def test_members_of_a_union_share_their_bytes() -> None:
    types = types_of("""TYPE U : UNION
        real : REAL; pair : STRUCT a : BYTE; b : DINT; END_STRUCT; raw : ARRAY[0..1] OF WORD; END_UNION;
        S : STRUCT n : INT; u : U; end : BYTE; END_STRUCT; END_TYPE""")
    type_ = types.get_type("S")
    layout = lay_out(type_, rules_for("codesys-8"))
    assert layout.size == 16
    assert places_of(layout) == ("n@0 u.real@4 u.pair.a@4 u.pair.b@8 u.raw[0]@4 u.raw[1]@6 end@12")
    assert list(layout.padding()) == [(2, 2), (13, 3)], "the gap in one member is data of another"
    assert [layout.leaf_number_at(place) for place in (2, 4, 7, 8, 12)] == [None, 1, 1, 3, 6]
    data = bytes.fromhex("0100 EEEE 00509A44 07000000 09 EEEEEE")
    assert decode(layout, data) == (1, 1234.5, 0, 7, 0x5000, 0x449A, 9)
    assert decode(layout, data[:6]) == (1, None, 0, None, 0x5000, None, None)
    assert decode_leaves(layout, data[:6], 1, 6) == (None, 0, None, 0x5000, None)
    offsets = [member["offset"] for member in show_json(layout)["members"]]
    assert offsets == sorted(offsets)


@pytest.mark.parametrize("type_", [Struct("E", ()), Union("E", ())])
def test_an_empty_type_has_no_size_and_moves_nothing(type_: Type) -> None:
    for name in ("codesys-8", "s7-standard", "baosky"):
        layout = lay_out(struct("BYTE", type_, array(type_, (0, 3)), "BYTE"), rules_for(name))
        assert lay_out(type_, rules_for(name)).size == 0
        assert [leaf.path for leaf in layout.leaves()] == ["m0", "m3"]
        assert len(decode(layout, bytes(layout.size))) == 2


def test_what_cannot_be_laid_out_is_named_with_its_path_and_the_reason() -> None:
    inner = Struct("Inner", (Member("t", array(RawType("TON", "an FB instance"), (0, 1))),))
    type_ = Struct("S", (Member("a", T["INT"]), Member("in", inner)))
    with pytest.raises(UserError) as refused:
        lay_out(type_, rules_for("codesys-8"))
    assert refused.value.lines() == [
        "S.in.t: found TON, an FB instance, expected a type that can be laid out"
    ]


def test_pack_mode_counts_at_codesys_only() -> None:
    type_ = struct("BYTE", "DINT", pack=0)
    sizes = {name: lay_out(type_, rules_for(name)).size for name in ("codesys-8", "baosky", "s7-standard")}
    assert sizes == {"codesys-8": 5, "baosky": 8, "s7-standard": 6}


# -- settings ------------------------------------------------------------------------------------------------


def test_the_settings_of_a_layout_replace_its_own() -> None:
    def size(type_: Type, rules: LayoutRules) -> int:
        return lay_out(type_, rules).size

    pointer = Pointer("POINTER TO BYTE")
    assert size(pointer, rules_for("codesys-8")) == 8
    assert size(pointer, rules_for("codesys-8", pointer_size=4)) == 4
    assert size(T["XWORD"], rules_for("codesys-4", pointer_size=4)) == 4
    for form, bytes_of_9 in (("nul", 10), ("s7", 11), ("cstr", 11)):
        assert size(StringType(9), rules_for("codesys-8", None, form)) == bytes_of_9
    for name, bytes_of_text in (("baosky", 82), ("codesys-8", 81), ("s7-standard", 256)):
        assert size(StringType(), rules_for(name)) == bytes_of_text
    assert size(StringType(None, wide=True), rules_for("s7-standard")) == 2 * 254 + 4
    assert rules_for("s7-standard", "little").byte_order == "little"


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"layout": "cap5"}, "layout: found 'cap5', expected one of baosky, baosky-slot4"),
        ({"byte_order": "middle"}, "byte order: found 'middle', expected one of little, big"),
        ({"text": "pascal"}, "STRING form: found 'pascal', expected one of s7, cstr, nul"),
        ({"pointer_size": 6}, "pointer size: found 6, expected 4 or 8"),
    ],
)
def test_an_unknown_setting_is_refused_with_the_known_ones(settings: dict[str, object], line: str) -> None:
    with pytest.raises(UserError) as refused:
        rules_for(**settings)  # type: ignore[arg-type]
    assert str(refused.value).startswith(line)


def test_a_wstring_of_an_s7_may_have_16382_characters() -> None:
    assert lay_out(StringType(16382, wide=True), rules_for("s7-standard")).size == 32768
    with pytest.raises(UserError, match="at most 16382 characters"):
        lay_out(StringType(16383, wide=True), rules_for("s7-standard"))
