"""Random types, values of a type, and small builders for tests of the UDT floor."""

from __future__ import annotations

import struct
from collections.abc import Callable

from hypothesis import strategies as st

from trcvtui.udt.codec import Values
from trcvtui.udt.coding import Value
from trcvtui.udt.formats.st import read_st
from trcvtui.udt.iec_type import parse_type
from trcvtui.udt.layout import LAYOUTS, Layout, Leaf, lay_out, rules_for
from trcvtui.udt.literals import format_literal
from trcvtui.udt.type_set import TypeSet, join
from trcvtui.udt.types import ROWS, Array, Elementary, Enumeration, Kind, Member, Struct, Text, Type


def types_of(text: str, name: str = "test.st") -> TypeSet:
    """Return the types that a text declares."""
    return join([read_st(text, name)], name)


def struct_of(*types: str) -> Struct:
    """Return a STRUCT of members m0, m1, ... of these types."""
    return Struct("S", tuple(Member(f"m{n}", parse_type(text)) for n, text in enumerate(types)))


def layout_of(text: str, layout: str = "baosky", byte_order: str | None = None) -> Layout:
    """Return the layout of the members of a STRUCT, or of a type in one line."""
    if ":" not in text:
        return lay_out(parse_type(text), rules_for(layout, byte_order))
    types = types_of(f"TYPE T : STRUCT {text} END_STRUCT END_TYPE")
    return lay_out(types.named("T"), rules_for(layout, byte_order))


rows = st.sampled_from(ROWS)
texts = st.builds(Text, st.one_of(st.none(), st.integers(1, 254)), st.booleans())
enumerations = st.builds(
    lambda base: Enumeration("Mode", base, (("Off", 0), ("On", 1))),
    st.sampled_from([row for row in ROWS if row.kind is Kind.INTEGER]),
)
bounds = st.lists(
    st.tuples(st.integers(-3, 3), st.integers(0, 3)).map(lambda b: (b[0], b[0] + b[1])),
    min_size=1,
    max_size=3,
)


def arrays(elements: st.SearchStrategy[Type]) -> st.SearchStrategy[Type]:
    """Return arrays of up to three dimensions."""
    return st.builds(lambda b, element: Array(tuple(b), element), bounds, elements)


def structs(members: st.SearchStrategy[Type], least: int = 0) -> st.SearchStrategy[Struct]:
    """Return structures with up to six members."""
    return st.lists(members, min_size=least, max_size=6).map(
        lambda types: Struct("S", tuple(Member(f"m{n}", t) for n, t in enumerate(types)))
    )


leaf_types: st.SearchStrategy[Type] = st.one_of(rows, texts, enumerations)
types: st.SearchStrategy[Type] = st.recursive(
    leaf_types, lambda inner: st.one_of(arrays(inner), structs(inner)), max_leaves=6
)
rules = st.builds(rules_for, st.sampled_from(sorted(LAYOUTS)), st.sampled_from(["little", "big"]))


@st.composite
def layouts(draw: Callable[[st.SearchStrategy[Layout]], Layout]) -> Layout:
    """Return a random structure under random rules."""
    return draw(st.builds(lay_out, structs(types, least=1), rules))


def values_of(leaf: Leaf) -> st.SearchStrategy[Value]:
    """Return values that the leaf can hold."""
    if isinstance(leaf.type, Text):
        return _texts(leaf)
    return _elementary(leaf.type.base if isinstance(leaf.type, Enumeration) else leaf.type)


def _texts(leaf: Leaf) -> st.SearchStrategy[Value]:
    assert isinstance(leaf.type, Text)
    most = 80 if leaf.type.length is None else leaf.type.length
    if leaf.type.wide:
        return st.text(st.characters(max_codepoint=0xFFFF, exclude_categories=["Cs"]), max_size=most)
    return st.text(st.characters(max_codepoint=255), max_size=most)


def _elementary(row: Elementary) -> st.SearchStrategy[Value]:
    match row.kind:
        case Kind.BOOL:
            return st.booleans()
        case Kind.REAL:
            return st.floats(width=32 if row.size == 4 else 64, allow_nan=False)
        case Kind.CHARACTER:
            return st.integers(0, row.limits[1]).map(chr)
        case Kind.INTEGER | Kind.BITS:
            return st.integers(*row.limits)
        case Kind.DATE:
            days = 86_400_000_000_000 // row.unit_ns
            low, high = row.limits
            return st.integers(-(-low // days), high // days).map(lambda n: format_literal(row, n * days))
        case _:
            return st.integers(*row.limits).map(lambda count: format_literal(row, count))


def same(found: Values, expected: Values) -> bool:
    """Return whether two decodes agree, NaN with NaN too."""
    return list(map(_key, found)) == list(map(_key, expected))


def _key(value: Value | None) -> object:
    return struct.pack("<d", value) if isinstance(value, float) else value
