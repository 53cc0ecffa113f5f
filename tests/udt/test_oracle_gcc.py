"""Random types agree with gcc under the matching #pragma pack, offset for offset.

`make oracle` compares 10,000 types, `make test` a few hundred in one compilation.
"""

from __future__ import annotations

import os
import shutil
from itertools import islice
from pathlib import Path

import pytest

from tests.udt.oracle_gcc import Case, Measured, cases, classes, header, measured, measured_header
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.layout.layout_tree import PlacedStruct
from trcvtui.udt.sources.c_header import read_c_header
from trcvtui.udt.sources.c_source import LONG_SIZE
from trcvtui.udt.type_set import join_declarations

COUNT = int(os.environ.get("TRCVTUI_ORACLE", "300"))
BATCH = 500
SEED = 5


def ours(case: Case) -> Measured:
    layout = lay_out(case.type, rules_for(f"codesys-{case.pack}"))
    return Measured(layout.size, layout.root.align, [leaf.offset for leaf in layout.leaves()])


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed: nothing to compare with")
def test_random_types_lie_where_gcc_puts_them(tmp_path: Path) -> None:
    random_types = cases(COUNT, SEED)
    leaves = compared = 0
    while batch := list(islice(random_types, BATCH)):
        for case, theirs in zip(batch, measured(batch, tmp_path), strict=True):
            assert ours(case) == theirs, f"pack {case.pack}: {case.type}"
            leaves += len(theirs.offsets)
        compared += len(batch)
    assert compared == COUNT
    assert leaves > 5 * COUNT, "small types only would prove little"
    print(f"{compared} types, {leaves} leaves: equal")


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed: nothing to compare with")
def test_headers_with_bit_fields_longs_and_packing_lie_where_gcc_puts_them(tmp_path: Path) -> None:
    given = header(COUNT, SEED)
    before = LONG_SIZE.set(8)
    types = join_declarations([read_c_header(given.text, "H")], "H")
    LONG_SIZE.reset(before)
    assert [str(problem) for problem in types.problems] == []
    for (name, members), theirs in zip(given.members.items(), measured_header(given, tmp_path), strict=True):
        root = lay_out(types.get_type(name), rules_for("c"), name).root
        assert isinstance(root, PlacedStruct)
        assert list(root.names) == members
        assert Measured(root.size, root.align, list(root.offsets)) == theirs, f"{name} of\n{given.text}"


@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed: nothing to compare with")
def test_classes_of_cpp_lie_where_gpp_puts_them_or_are_refused(tmp_path: Path) -> None:
    given = classes(COUNT, SEED)
    types = join_declarations([read_c_header(given.header.text, "H.hpp")], "H.hpp")
    assert getattr(types.get_type("E16"), "values", ()) == (("A", 0), ("TWO", 7))
    theirs = measured_header(given.header, tmp_path, "g++")
    refused = given.header.members.keys() - set(types.names())
    assert refused <= given.unsure and len(refused) < len(given.unsure) * 0.7, len(given.unsure)
    for (name, members), found in zip(given.header.members.items(), theirs, strict=True):
        if name in refused:
            continue
        root = lay_out(types.get_type(name), rules_for("c"), name).root
        assert isinstance(root, PlacedStruct)
        parts = [*root.flat_members(0)]
        assert [part.name for part in parts] == members
        assert Measured(root.size, root.align, [part.offset for part in parts]) == found, name
    bad = join_declarations(
        [read_c_header(given.header.text + "".join(given.refused.values()), "H.hpp")], "H.hpp"
    )
    assert not given.refused.keys() & set(bad.names()), given.refused
    assert given.refused.keys() <= {name.upper() for name in bad.broken}
