"""Random declarations written as ST text come back equal, whichever of the forms of the grammar is used."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.udt.st_text import Writer, declarations, placeless
from trcvtui.udt.ast import Declaration
from trcvtui.udt.sources.st import read_st


@pytest.mark.slow
@given(declarations(), st.data())
def test_what_is_written_as_st_text_comes_back_equal(
    declared: list[Declaration], data: st.DataObject
) -> None:
    text = Writer(data.draw).file(declared)
    read = read_st(text, "f.st")
    assert read.problems == ()
    assert [placeless(found) for found in read.types] == [placeless(known) for known in declared]
