"""Random types, values of a type, and small builders for tests of the UDT floor."""

from __future__ import annotations

import struct
from collections.abc import Callable

from hypothesis import strategies as st

from trcvtui.udt.layout.coding import Value, coding_of
from trcvtui.udt.layout.layout import LAYOUTS, Layout, LayoutRules, Leaf, lay_out, rules_for
from trcvtui.udt.layout.layout_tree import LeafValues
from trcvtui.udt.layout.rules import TEXT_FORMS
from trcvtui.udt.literals import date_and_time_text, format_duration, format_literal
from trcvtui.udt.sources import parse_type
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import TypeSet, join_declarations
from trcvtui.udt.types import (
    DAY,
    ELEMENTARY_ROWS,
    MS,
    Array,
    Elementary,
    Enumeration,
    Member,
    Pointer,
    StringType,
    Struct,
    Subrange,
    Type,
    Union,
    ValueKind,
)


def types_of(text: str, name: str = "test.st") -> TypeSet:
    """Return the types that a text declares."""
    return join_declarations([read_st(text, name)], name)


def struct_of(*types: str) -> Struct:
    """Return a STRUCT of members m0, m1, ... of these types."""
    return Struct("S", tuple(Member(f"m{n}", parse_type(text)) for n, text in enumerate(types)))


def layout_of(text: str, layout: str = "baosky", byte_order: str | None = None) -> Layout:
    """Return the layout of the members of a STRUCT, or of a type in one line."""
    if ":" not in text:
        return lay_out(parse_type(text), rules_for(layout, byte_order))
    types = types_of(f"TYPE T : STRUCT {text} END_STRUCT END_TYPE")
    return lay_out(types.get_type("T"), rules_for(layout, byte_order))


def places_of(layout: Layout) -> str:
    """Return path and offset of every leaf, such as `id@0 st.x@4`."""
    return " ".join(f"{leaf.path}@{leaf.offset}" for leaf in layout.leaves())


rows = st.sampled_from(ELEMENTARY_ROWS)
integers = st.sampled_from([row for row in ELEMENTARY_ROWS if row.kind is ValueKind.INTEGER])
texts = st.builds(StringType, st.one_of(st.none(), st.integers(1, 254)), st.booleans())
enumerations = st.builds(
    lambda base, is_named: Enumeration("Mode", base, (("Off", 0), ("On", 1)), is_named),
    integers,
    st.booleans(),
)
subranges = st.builds(lambda base: Subrange(base, 0, 10), integers)
pointers = st.sampled_from([Pointer("POINTER TO BYTE"), Pointer("REFERENCE TO Axis")])
bounds = st.lists(
    st.tuples(st.integers(-3, 3), st.integers(0, 3)).map(lambda b: (b[0], b[0] + b[1])),
    min_size=1,
    max_size=3,
)
packs = st.sampled_from([None, None, 0, 1, 2, 4, 8])


def arrays(elements: st.SearchStrategy[Type]) -> st.SearchStrategy[Type]:
    """Return arrays of up to three dimensions."""
    return st.builds(lambda b, element: Array(tuple(b), element), bounds, elements)


def members_of(types: list[Type], prefix: str = "m") -> tuple[Member, ...]:
    """Return members m0, m1, ... of these types."""
    return tuple(Member(f"{prefix}{n}", type_) for n, type_ in enumerate(types))


def structs(members: st.SearchStrategy[Type], least: int = 0) -> st.SearchStrategy[Struct]:
    """Return structures with up to six members, some with a pack_mode, some that extend another."""
    of = st.lists(members, min_size=least, max_size=6)
    bases = st.one_of(
        st.none(), st.none(), st.lists(members, max_size=3).map(lambda b: Struct("B", members_of(b, "b")))
    )
    return st.builds(lambda m, base, pack: Struct("S", members_of(m), base, pack), of, bases, packs)


def unions(members: st.SearchStrategy[Type]) -> st.SearchStrategy[Union]:
    """Return unions with up to three members."""
    of = st.lists(members, max_size=3)
    return st.builds(lambda m, pack: Union("U", members_of(m, "u"), None, pack), of, packs)


bools = st.sampled_from(
    [row for row in ELEMENTARY_ROWS if row.kind is ValueKind.BOOL]
)  # often: they are bits in some layouts
leaf_types: st.SearchStrategy[Type] = st.one_of(rows, bools, texts, enumerations, subranges, pointers)
types: st.SearchStrategy[Type] = st.recursive(
    leaf_types, lambda inner: st.one_of(arrays(inner), structs(inner), unions(inner)), max_leaves=6
)
names = st.sampled_from(sorted(LAYOUTS))
orders = st.sampled_from(["little", "big"])
forms = st.sampled_from([None, *TEXT_FORMS])
rules = st.builds(
    lambda name, order, form, size, even: rules_for(name, order, form, pointer_size=size, string_even=even),
    names,
    orders,
    forms,
    st.sampled_from([4, 8]),
    st.sampled_from([None, False]),
)


@st.composite
def layouts(draw: Callable[[st.SearchStrategy[Layout]], Layout]) -> Layout:
    """Return a random structure under random rules."""
    return draw(st.builds(lay_out, structs(types, least=1), rules))


def apart(layout: Layout, most: int = 12) -> list[Leaf]:
    """Return leaves of which no two share a bit: of the members of a union, the first."""
    taken: set[tuple[int, int]] = set()
    found: list[Leaf] = []
    for leaf in layout.leaves(0, 4 * most):
        place = bits_of(leaf)
        if not taken & place and len(found) < most:
            taken |= place
            found.append(leaf)
    return found


def bits_of(leaf: Leaf) -> set[tuple[int, int]]:
    """Return byte and bit of every bit that the leaf covers."""
    bits = range(8) if leaf.bit is None else (leaf.bit,)
    return {(byte, bit) for byte in range(leaf.offset, leaf.offset + leaf.size) for bit in bits}


def values_of(leaf: Leaf, rules: LayoutRules) -> st.SearchStrategy[Value]:
    """Return values that the leaf can hold."""
    if isinstance(leaf.type, StringType):
        return _texts(leaf.type, rules)
    return _elementary(rules.storage(leaf.type))


def _texts(type_: StringType, rules: LayoutRules) -> st.SearchStrategy[Value]:
    most, least = rules.text.length(type_), 0 if rules.text.header else 1
    if type_.wide:
        plane = st.characters(min_codepoint=least, max_codepoint=0xFFFF, exclude_categories=["Cs"])
        return st.text(plane, max_size=most)
    return st.text(st.characters(min_codepoint=least, max_codepoint=255), max_size=most)


def _elementary(row: Elementary) -> st.SearchStrategy[Value]:
    if (row.name, row.code) in OWN_VALUES:
        return OWN_VALUES[row.name, row.code]
    match row.kind:
        case ValueKind.BOOL:
            return st.booleans()
        case ValueKind.REAL:
            return st.floats(width=32 if row.size == 4 else 64, allow_nan=False)
        case ValueKind.CHARACTER:
            return st.integers(0, row.limits[1]).map(chr)
        case ValueKind.INTEGER | ValueKind.BITS:
            return st.integers(*row.limits)
        case ValueKind.ADDRESS:
            return st.integers(*row.limits).map(lambda address: f"16#{address:0{2 * row.size}X}")
        case ValueKind.DATE:
            to_value = coding_of(row, rules_for()).to_value
            assert to_value is not None
            return st.integers(*row.limits).map(to_value)
        case _:
            return st.integers(*row.limits).map(lambda count: format_literal(row, count))


# Nanoseconds since 1970 of the years that each of them holds.
_BCD_FIRST, _BCD_LAST = 7305 * DAY // MS, 43_829 * DAY // MS
OWN_VALUES: dict[tuple[str, str], st.SearchStrategy[Value]] = {
    ("DT", "8s"): st.integers(_BCD_FIRST, _BCD_LAST - 1).map(lambda ms: date_and_time_text("DT#", ms * MS)),
    ("DTL", "12s"): st.integers(-719_000 * DAY, 23_000_000 * DAY).map(
        lambda n: date_and_time_text("DTL#", n)
    ),
    ("S5TIME", "H"): st.tuples(st.integers(0, 999), st.sampled_from([10, 100, 1000, 10_000])).map(
        lambda s: format_duration(s[0] * s[1] * MS, "S5T#")
    ),
}


def same(found: LeafValues, expected: LeafValues) -> bool:
    """Return whether two decodes agree, NaN with NaN too."""
    return list(map(_key, found)) == list(map(_key, expected))


def _key(value: Value | None) -> object:
    return struct.pack("<d", value) if isinstance(value, float) else value
