"""The tree of the lab: its rows as they stand open; both layouts stand in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.tui.lab.collapsible_tree import FoldTree
from trcvtui.udt.layout.layout import Layout, lay_out, rules_for
from trcvtui.udt.sources import read_files

SOURCE = """
TYPE Point : STRUCT a : BYTE; b : LREAL; c : BYTE; END_STRUCT END_TYPE
TYPE Both : UNION whole : DWORD; parts : ARRAY[0..3] OF BYTE; END_UNION END_TYPE
TYPE Base : STRUCT kind : BYTE; END_STRUCT END_TYPE
TYPE Everything EXTENDS Base :
STRUCT
    first : INT;
    long  : ARRAY[0..332] OF Point;
    short : ARRAY[1..3] OF Point;
    bits  : ARRAY[0..9] OF BOOL;
    grid  : ARRAY[0..2,0..1] OF INT;
    both  : Both;
    last  : BYTE;
END_STRUCT
END_TYPE
"""


@pytest.fixture(scope="module")
def sides(tmp_path_factory: pytest.TempPathFactory) -> tuple[Layout, Layout]:
    path = Path(tmp_path_factory.mktemp("types")) / "all.st"
    path.write_text(SOURCE, encoding="utf-8")
    type_ = read_files([path]).get_type("Everything")
    ours, theirs = (lay_out(type_, rules_for(name), "Everything") for name in ("baosky", "s7-standard"))
    return ours, theirs


def tree_of(sides: tuple[Layout, Layout]) -> FoldTree:
    return FoldTree(*sides)


def test_a_row_is_the_leaf_that_both_layouts_say(sides: tuple[Layout, Layout]) -> None:
    ours, theirs = sides
    tree = tree_of(sides)
    tree.set_all_open(True)
    for leaf in range(ours.leaf_count):
        row = tree.rows[tree.row_of_leaf(leaf)]
        mine, other = ours.leaf(leaf), theirs.leaf(leaf)
        assert row.is_leaf and row.leaf == leaf
        assert row.ours == (mine.offset, mine.size, mine.bit)
        assert row.theirs == (other.offset, other.size, other.bit)


def test_every_byte_of_padding_is_a_row_with_its_size(sides: tuple[Layout, Layout]) -> None:
    ours, theirs = sides
    tree = tree_of(sides)
    tree.set_all_open(True)
    tree.toggle((3,))  # the long one
    shown = [row for row in tree.rows if row.is_gap]
    assert sum(row.ours.size for row in shown) < sum(size for _, size in ours.padding())
    for side, layout in (("ours", ours), ("theirs", theirs)):
        places = [getattr(row, side) for row in shown if getattr(row, side).size]
        assert places and all(layout.leaf_number_at(place.offset) is None for place in places)


def test_a_long_array_stands_closed_until_it_is_opened(sides: tuple[Layout, Layout]) -> None:
    tree = tree_of(sides)
    before = len(tree.rows)
    y = next(y for y in range(before) if tree.rows[y].name == "long")
    assert tree.rows[y].is_open is False
    tree.toggle(tree.rows[y].key)
    assert len(tree.rows) == before + 333 * 6, "itself, three members, two gaps"
    tree.toggle(tree.rows[y].key)
    assert len(tree.rows) == before


def test_a_leaf_in_a_closed_branch_is_shown_by_opening_what_is_around_it(
    sides: tuple[Layout, Layout],
) -> None:
    tree = tree_of(sides)
    leaf = sides[0].leaf_number("long[200].b")
    assert tree.rows[tree.row_of_leaf(leaf)].name == "long", "closed: the branch stands for it"
    y = tree.row_of_leaf(leaf, opens=True)
    found = tree.rows[y]
    assert (found.name, found.leaf) == ("b", leaf)


def test_what_a_type_extends_is_a_branch_of_that_name(sides: tuple[Layout, Layout]) -> None:
    tree = tree_of(sides)
    assert [tree.rows[y].name for y in range(1, 3)] == ["EXTENDS Base", "kind"]


@given(data=st.data())
def test_rows_and_keys_are_inverse_whatever_was_folded(
    sides: tuple[Layout, Layout], data: st.DataObject
) -> None:
    tree = tree_of(sides)
    tree.set_all_open(data.draw(st.sampled_from([None, True, False])))
    for _ in range(data.draw(st.integers(0, 6))):
        found = tree.rows[data.draw(st.integers(0, len(tree.rows) - 1))]
        if found.is_open is not None:
            tree.toggle(found.key)
    for y in data.draw(st.lists(st.integers(0, len(tree.rows) - 1), max_size=20)):
        assert tree.row_of_key(tree.rows[y].key) == y
        if tree.rows[y].is_leaf:
            assert tree.row_of_leaf(tree.rows[y].leaf) == y
