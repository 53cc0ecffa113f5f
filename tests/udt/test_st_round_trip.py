"""Random declarations written as ST text come back equal, whichever of the forms of the grammar is used."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.udt.st_text import Writer, declarations, placeless
from trcvtui.udt.ast import Declaration
from trcvtui.udt.sources.st import Parser, read_st
from trcvtui.udt.sources.st_cursor import Source, StToken


@pytest.mark.slow
@given(declarations(), st.data())
def test_what_is_written_as_st_text_comes_back_equal(
    declared: list[Declaration], data: st.DataObject
) -> None:
    text = Writer(data.draw).file(declared)
    read = read_st(text, "f.st")
    assert read.problems == ()
    assert [placeless(found) for found in read.types] == [placeless(known) for known in declared]


def test_a_file_of_100_kilobytes_is_read_token_by_token_once() -> None:
    """Count what the parser does instead of the time that it takes: about one step a token."""
    members = "".join(
        f"  member_{n} : ARRAY[0..MAX + {n}] OF STRING[20] := ['a', 'b']; // comment\n" for n in range(1400)
    )
    text = f"TYPE T : STRUCT\n{members}END_STRUCT END_TYPE"
    assert len(text) > 100_000
    steps = 0

    class Counting(Parser):
        @property
        def token(self) -> StToken:
            nonlocal steps
            steps += 1
            return super().token

    source = Source("f.st", text)
    assert len(Counting(source).file().types) == 1
    assert steps < 12 * len(source.tokens)
