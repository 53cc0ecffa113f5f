"""Where members lie: vectors, and what holds for every layout."""

from __future__ import annotations

import ctypes
import pickle
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from tests.udt.udt_strategies import bits_of, layout_of, layouts, places_of, struct_of, types_of
from trcvtui.errors import UserError
from trcvtui.udt.layout.layout import LAYOUTS, MOST_LEAVES, Layout, lay_out, rules_for
from trcvtui.udt.layout.values import decode
from trcvtui.udt.types import (
    ELEMENTARY,
    ELEMENTARY_ROWS,
    Array,
    Elementary,
    Member,
    RawType,
    StringType,
    Struct,
    ValueKind,
)

READINGS = ("baosky", "baosky-slot4", "natural8", "baosky-pack4")
Vector = tuple[int, list[int]]

# The pages of baosky: (size, offsets) in the order of READINGS; the reference has the first three.
VECTORS: list[tuple[tuple[str, ...], list[Vector]]] = [
    (("BOOL",), [(4, [0]), (4, [0]), (4, [0]), (1, [0])]),
    (
        ("BOOL", "BOOL", "INT", "BOOL"),
        [(8, [0, 1, 2, 4]), (16, [0, 4, 8, 12]), (8, [0, 1, 2, 4]), (6, [0, 1, 2, 4])],
    ),
    (("BOOL", "INT", "LREAL"), [(12, [0, 2, 4]), (16, [0, 4, 8]), (16, [0, 2, 8]), (12, [0, 2, 4])]),
    (("DINT", "DINT", "CHAR"), [(12, [0, 4, 8])] * 4),
    (("BOOL", "DINT"), [(8, [0, 4])] * 3),
    (("BOOL", "BOOL", "INT"), [(4, [0, 1, 2]), (12, [0, 4, 8]), (4, [0, 1, 2])]),
    (("CHAR", "INT", "CHAR"), [(8, [0, 2, 4]), (12, [0, 4, 8]), (8, [0, 2, 4])]),
    (("BYTE", "LREAL"), [(12, [0, 4]), (12, [0, 4]), (16, [0, 8])]),
    (("STRING[80]", "DINT"), [(88, [0, 84])] * 3),
    (("STRING", "DINT"), [(88, [0, 84])] * 3),
]


def placed(layout: Layout) -> Vector:
    return layout.size, [leaf.offset for leaf in layout.leaves()]


@pytest.mark.parametrize(("members", "expected"), VECTORS)
def test_the_readings_of_the_baosky_pages(members: tuple[str, ...], expected: list[Vector]) -> None:
    readings = READINGS[: len(expected)]
    assert [placed(lay_out(struct_of(*members), LAYOUTS[name])) for name in readings] == expected


ALONE = {
    "BOOL": 1, "CHAR": 1, "INT": 2, "TIME": 4, "DATE": 4, "DT": 4, "LTIME": 8, "LREAL": 8, "LWORD": 8,
    "STRING": 82, "STRING[20]": 22, "STRING[254]": 256,
    "ARRAY[0..2] OF BYTE": 3, "ARRAY[0..2] OF STRING[3]": 15,
    "ARRAY[0..69999] OF BYTE": 70_000, "ARRAY[0..131071] OF BOOL": 131_072,
}  # fmt: skip


def test_alone_a_basic_type_is_tight() -> None:
    assert {text: layout_of(text).size for text in ALONE} == ALONE


def test_a_nested_structure_keeps_its_own_gaps_and_starts_on_four() -> None:
    layout = layout_of("a : BYTE; in : STRUCT x : BYTE; y : INT; z : BYTE; END_STRUCT b : BYTE;")
    assert places_of(layout) == ("a@0 in.x@4 in.y@6 in.z@8 b@12")
    assert layout.padding() == [(1, 3), (5, 1), (9, 3), (13, 3)]
    assert layout.size == 16


def test_the_alias_cap4_is_baosky_and_little_endian() -> None:
    assert rules_for("cap4") is rules_for() is LAYOUTS["baosky"]
    assert rules_for().byte_order == "little"
    assert rules_for("packed", "big").byte_order == "big"


def test_what_is_too_large_is_refused_in_one_line() -> None:
    golden.mistakes("sizes", layout_of)


def test_doubling_forty_times_is_refused_without_walking_it() -> None:
    type_ = struct_of("BYTE")
    for _ in range(40):
        type_ = Struct("S", (Member("a", type_), Member("b", type_)))
    with pytest.raises(UserError, match=f"at most {MOST_LEAVES} elements"):
        lay_out(type_, rules_for())


def test_forty_times_two_empty_structures_are_still_empty() -> None:
    type_ = Struct("Empty", ())
    for _ in range(40):
        type_ = Struct("S", (Member("a", type_), Member("b", type_)))
    layout = lay_out(Array(((0, 10**9),), type_), LAYOUTS["packed"])
    assert (layout.size, layout.leaf_count, layout.leaves(), decode(layout, b"")) == (0, 0, (), ())


@pytest.mark.slow
@given(layouts())
def test_offsets_grow_and_leaves_and_gaps_fill_the_type_exactly(layout: Layout) -> None:
    places = [(leaf.offset, leaf.bit or 0) for leaf in layout.leaves()]
    assert layout.leaf_count == len(places)
    bits = [bit for leaf in layout.leaves() for bit in bits_of(leaf)]
    assert layout.root.overlaps or (places == sorted(places) and len(bits) == len({*bits}))
    gaps = [byte for offset, size in layout.padding() for byte in range(offset, offset + size)]
    assert {byte for byte, _ in bits}.isdisjoint(gaps)
    assert sorted({*gaps, *(byte for byte, _ in bits)}) == list(range(layout.size))
    ends = [(offset, offset + size) for offset, size in layout.padding()]
    assert all(before < after for (_, before), (after, _) in pairwise(ends)), "each gap is told once, whole"


@pytest.mark.slow
@given(layouts())
def test_members_lie_on_their_alignment(layout: Layout) -> None:
    rules = layout.rules
    assert layout.size % layout.align == 0
    for leaf in layout.leaves():
        natural = 1 if isinstance(leaf.type, StringType) else rules.storage(leaf.type).align
        # A pack_mode may place members closer; what it does to them is compared with gcc.
        assert rules.takes_pack or leaf.offset % min(natural, rules.cap) == 0


@pytest.mark.slow
@given(layouts().filter(lambda layout: layout.size <= 2000))
def test_a_byte_finds_its_leaf_and_a_path_finds_it_too(layout: Layout) -> None:
    covered: dict[tuple[int, int], int] = {}
    for number, leaf in enumerate(layout.leaves()):
        assert layout.leaf_number(leaf.path) == layout.leaf_number(leaf.path.upper()) == number
        assert layout.leaf(number) == leaf
        for byte, bit in bits_of(leaf):
            covered.setdefault((byte, bit), number)
    for place in range(-1, layout.size + 2):
        of_byte = [covered[place, bit] for bit in range(8) if (place, bit) in covered]
        assert layout.leaf_number_at(place) == min(of_byte, default=None)


PLAIN = [row for row in ELEMENTARY_ROWS if row.kind is not ValueKind.BOOL and len(row.code) == 1]


@given(st.lists(st.sampled_from(PLAIN), min_size=1))
def test_plain_pack_agrees_with_the_c_compiler_rules_of_ctypes(rows: list[Elementary]) -> None:
    codes = {"B": ctypes.c_uint8, "H": ctypes.c_uint16, "I": ctypes.c_uint32, "Q": ctypes.c_uint64}
    codes |= {"b": ctypes.c_int8, "h": ctypes.c_int16, "i": ctypes.c_int32, "q": ctypes.c_int64}
    kinds = {**codes, "f": ctypes.c_float, "d": ctypes.c_double}
    struct = Struct("S", tuple(Member(f"m{n}", row) for n, row in enumerate(rows)))
    for name, pack in (("baosky-pack4", 4), ("packed", 1), *((f"codesys-{p}", p) for p in (8, 4, 2, 1))):
        fields = [(f"m{n}", kinds[row.code]) for n, row in enumerate(rows)]
        oracle = type("Oracle", (ctypes.Structure,), {"_pack_": pack, "_fields_": fields})
        layout = lay_out(struct, LAYOUTS[name])
        assert layout.size == ctypes.sizeof(oracle)
        assert [leaf.offset for leaf in layout.leaves()] == [getattr(oracle, f).offset for f, _ in fields]


def test_a_quoted_name_is_quoted_in_its_path_and_found_by_it() -> None:
    named = ("a.b", "a", 'x"y', "Pump data", "[1]", "größe")
    inner = Struct("", (Member("b", ELEMENTARY["INT"]), Member("c d", ELEMENTARY["INT"])))
    members = tuple(Member(name, inner if name == "a" else ELEMENTARY["INT"]) for name in named)
    layout = lay_out(Struct("S", members), rules_for())
    paths = [leaf.path for leaf in layout.leaves()]
    assert paths == ['"a.b"', "a.b", "a.c d", '"x""y"', "Pump data", '"[1]"', "größe"]
    assert [layout.leaf_number(path) for path in paths] == list(range(len(paths)))


def test_everything_that_cannot_be_laid_out_is_told_at_most_ten_of_it() -> None:
    types = types_of("TYPE T : STRUCT a : FB(1); b : INT; c : ARRAY[0..1] OF FC(x := 2); END_STRUCT END_TYPE")
    with pytest.raises(UserError) as refused:
        lay_out(types.get_type("T"), rules_for(), "T")
    assert [line.split(",")[0] for line in refused.value.lines()] == ["T.a: found FB", "T.c: found FC"]
    many = Struct("M", tuple(Member(f"m{n}", types.get_type("T")) for n in range(50)))
    wide = Struct("W", tuple(Member(f"m{n}", RawType(f"F{n}", "no")) for n in range(50)))
    for type_, count in ((many, 2), (wide, 10)):
        with pytest.raises(UserError) as refused:
            lay_out(type_, rules_for())
        assert len(refused.value.problems) == count


def test_an_unknown_path_names_the_step_that_fails() -> None:
    layout = layout_of("st : STRUCT arr : ARRAY[1..2] OF INT; END_STRUCT")
    for path, step in [
        ("st.brr[1]", ".brr"),
        ("st.arr[3]", "[3]"),
        ("st.arr[1,1]", "[1,1]"),
        ("st.arr[--1]", "[--1]"),
    ]:
        with pytest.raises(UserError) as refused:
            layout.leaf_number(path)
        assert refused.value.problems[0].found == f"'{step}'"
    with pytest.raises(UserError, match="which has members of its own"):
        layout.leaf_number("st.arr")


def test_the_declared_spelling_names_the_layout() -> None:
    types = types_of("TYPE Telegram : STRUCT a : INT; END_STRUCT; Speed : REAL; END_TYPE")
    assert lay_out(types.get_type("telegram"), rules_for(), "TELEGRAM").name == "Telegram"
    assert lay_out(types.get_type("Speed"), rules_for(), "Speed").name == "Speed"
    assert lay_out(types.get_type("Speed"), rules_for()).name == "REAL"


@pytest.mark.slow
@given(layouts())
def test_a_layout_crosses_a_process_border(layout: Layout) -> None:
    data = bytes(n % 251 for n in range(layout.size))
    decode(layout, data)
    there = pickle.loads(pickle.dumps(layout))
    assert (there.name, there.size, there.rules) == (layout.name, layout.size, layout.rules)
    assert [leaf.path for leaf in there.leaves()] == [leaf.path for leaf in layout.leaves()]


def test_bits_after_the_last_byte_that_came_are_not_within() -> None:
    members = tuple(
        Member(name, ELEMENTARY[type_]) for name, type_ in (("a", "BOOL"), ("b", "BIT"), ("c", "BIT"))
    )
    layout = lay_out(Struct("S", members), rules_for("codesys-8"))
    assert [layout.count_leaves_within(length) for length in range(3)] == [0, 1, 3]
