"""The exported ImHex pattern, measured by a reader of its own: every member where the layout has it."""

from __future__ import annotations

import re
from typing import NamedTuple

import pytest
from hypothesis import given, settings

from tests.udt.export_types import EVERY_LAYOUT, plant
from tests.udt.udt_strategies import layout_of, layouts
from trcvtui.udt.exports import export
from trcvtui.udt.exports.outline import fields_of, structs_of
from trcvtui.udt.layout.layout import Layout, lay_out, rules_for
from trcvtui.udt.types import ELEMENTARY, Member, Struct

SIZES = {
    "bool": 1, "char": 1, "char16": 2, "float": 4, "double": 8, "padding": 1,
    **{f"{sign}{8 * size}": size for sign in "us" for size in (1, 2, 4, 8)},
}  # fmt: skip
TYPE = re.compile(r"^(struct|union|enum|bitfield) (\w+)(?: : (\w+))? \{$(.*?)^\};$", re.MULTILINE | re.DOTALL)
MEMBER = re.compile(r"^    (\w+)(?: (\w+))?(?:\[(\d+)\])?(?: \[\[.*\]\])?;$", re.MULTILINE)
BIT = re.compile(r"^    (\w+) : (\d);$|^    (\w+) : (\d) \[\[.*\]\];$", re.MULTILINE)


class Measured(NamedTuple):
    """A type of the pattern: its size, and offset and size of each member."""

    size: int
    members: dict[str, tuple[int, int]]


def measured(text: str) -> dict[str, Measured]:
    """Return every type of the pattern; one that is used before it stands there is a KeyError."""
    types: dict[str, Measured] = {}
    for kind, name, base, body in TYPE.findall(text):
        assert name not in types and name not in SIZES
        if kind == "enum":
            types[name] = Measured(SIZES[base], {})
        elif kind == "bitfield":
            bits = [int(first or second) for _, first, _, second in BIT.findall(body)]
            assert sum(bits) == 8 and len(bits) == body.count(";")
            types[name] = Measured(1, {})
        else:
            types[name] = _composed(types, kind == "union", base, body)
    [(top, variable)] = re.findall(r"^(\w+) (\w+)(?:\[\d+\])? @ 0x00", text, re.MULTILINE)
    assert top in types or top in SIZES
    assert variable not in types
    return types


def _composed(types: dict[str, Measured], is_union: bool, base: str, body: str) -> Measured:
    end, members = (types[base].size if base else 0), {}
    found = MEMBER.findall(body)
    assert len(found) == len(body.strip().splitlines())
    for type_, name, count in found:
        size = (types[type_].size if type_ in types else SIZES[type_]) * int(count or 1)
        assert name not in members or not name
        members[name] = (0 if is_union else end, size)
        end = max(end, size) if is_union else end + size
    return Measured(end, members)


def assert_same(layout: Layout) -> None:
    types = measured(export(layout, "imhex"))
    ours = [
        (node.size, {(f.offset, f.node.size) for f in fields_of(type_, node) if f.name})
        for type_, node in structs_of(layout.type, layout.root)
    ]
    theirs = [(found.size, set(found.members.values())) for found in types.values()]
    for size, places in ours:
        assert any(size == their_size and places <= their_places for their_size, their_places in theirs)


@pytest.mark.parametrize(("name", "more"), EVERY_LAYOUT)
def test_every_member_lies_where_the_layout_has_it(name: str, more: dict[str, str]) -> None:
    layout = plant(name, **more)
    assert_same(layout)
    found = measured(export(layout, "imhex"))["Plant"]
    assert found.size == layout.size
    for path in ("id", "state", "t", "q", "sub"):
        leaf = layout.leaf(layout.number_of(path))
        assert found.members[path] == (leaf.offset, leaf.size)


@pytest.mark.slow
@given(layouts())
@settings(max_examples=60, deadline=None)
def test_any_type_under_any_rules_keeps_its_sizes(layout: Layout) -> None:
    if layout.size and layout.leaf_count:
        assert_same(layout)


def test_words_of_the_language_are_escaped_and_kept_as_shown_name() -> None:
    text = export(layout_of("padding : INT; größe : WORD; fn : BOOL;"), "imhex")
    assert '    s16 padding_ [[name("padding")]];' in text
    assert '    u16 gro_e [[name("größe"), comment("WORD")]];' in text
    assert '    bool fn_ [[name("fn")]];' in text


def test_the_byte_order_is_that_of_the_layout() -> None:
    assert "#pragma endian big" in export(layout_of("a : INT;", "s7-standard"), "imhex")
    assert "#pragma endian little" in export(layout_of("a : INT;", "baosky"), "imhex")


def test_a_name_that_got_a_number_is_kept_as_shown_name() -> None:
    members = tuple(Member(name, ELEMENTARY["INT"]) for name in ("Größe", "Gro_e"))
    pattern = export(lay_out(Struct("S", members), rules_for()), "imhex")
    assert 's16 Gro_e [[name("Größe")]];' in pattern
    assert 's16 Gro_e_2 [[name("Gro_e")]];' in pattern
