"""ST text: the position in every error, no text breaks the reader, drawn declarations come back."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests import golden
from tests.udt.st_text import Writer, declarations, placeless
from tests.udt.st_texts import lines, members
from tests.udt.udt_strategies import types_of
from trcvtui.udt.ast import MOST_NESTED, Declaration
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.sources import parse_source, read_files
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import type_text

DATA = Path(__file__).parent / "data"


def test_a_whole_file_as_an_engineer_writes_it() -> None:
    types = read_files([DATA / "telegram.st"])
    assert types.problems == ()
    assert types.names() == ["Mode", "Speed", "Level", "State", "Telegram", "Point"]
    layout = lay_out(types.get_type("Telegram"), rules_for())
    found = [f"{leaf.path}:{type_text(leaf.type)}@{leaf.offset}" for leaf in layout.leaves()]
    assert " ".join(found) == (
        "id:DINT@0 a:LREAL@4 B:LREAL@12 name:STRING[20]@20 short:STRING[5]@42 long:STRING@49 "
        "m[1,-1]:INT@132 m[1,0]:INT@134 m[1,1]:INT@136 m[2,-1]:INT@138 m[2,0]:INT@140 m[2,1]:INT@142 "
        "st.x:BYTE@144 st.mode:Mode@146 speeds[0][0]:REAL@148 speeds[0][1]:REAL@152 "
        "speeds[1][0]:REAL@156 speeds[1][1]:REAL@160 points[2].x:REAL@164 points[2].y:REAL@168 "
        "points[2].ok:BOOL@172 points[3].x:REAL@176 points[3].y:REAL@180 points[3].ok:BOOL@184 "
        "t:TIME@188 at_noon:TOD@192 level:INT(0..10)@196 state:State@198"
    )
    assert layout.size == 200


@pytest.mark.parametrize(
    "gap",
    [
        " ",
        "(* a *)",
        "(* a (* b *) c *)",
        "(**)",
        "(***)",
        "// to the end ' { (*\n",
        "/// doc\r\n",
        "/* a ( * (* */",
        "{pragma}",
        "{text '}' and \"}\"}",
        "{don't}",
        "{two\nlines}",
        "\u00a0",
        "{attribute 'x' := 'y'}",
        '{attribute addProperty Name "a } b"}',
        "{attribute 'pytmc' := '\n    pv: A;\n    field: } INVALID ;\n    io: i;\n'}",
        "{attribute 'text' := 'the valve's state'}",
        '{\n  S7_Access := "ReadOnly := External";\n  S7_Visibility := "Hidden"\n}',
        "{attribute wpf [Container(Layout.Tabs)]}",
    ],
)
def test_comments_and_pragmas_may_stand_anywhere(gap: str) -> None:
    words = "TYPE|T|:|STRUCT|a|,|b|:|ARRAY|[|0|..|1|]|OF|INT|:=|3|;|END_STRUCT|;|END_TYPE"
    types = types_of(gap + words.replace("|", gap) + gap)
    assert types.problems == ()
    assert members(types, "T") == dict.fromkeys("ab", "ARRAY[0..1] OF INT")


def test_a_comment_that_nests_by_accident_ends_at_its_first_end() -> None:
    types = types_of(
        "TYPE A : INT; END_TYPE (* x (* y *) TYPE B : INT; END_TYPE (* (* z *) TYPE C : INT; END_TYPE"
    )
    assert types.names() == ["A", "B", "C"]
    assert types.problems == ()


def test_a_member_may_be_called_type() -> None:
    types = types_of("TYPE T : STRUCT Type : INT; bad INT; type2 : INT; END_STRUCT END_TYPE")
    assert [str(problem) for problem in types.problems] == ["test.st:1:33: found 'INT', expected ':'"]
    types = types_of(
        "TYPE T : STRUCT Type : INT; a, _type : REAL; END_STRUCT; END_TYPE TYPE U : INT; END_TYPE"
    )
    assert list(members(types, "T")) == ["Type", "a", "_type"]
    assert types.names() == ["T", "U"]


def test_every_error_has_its_place_and_what_was_expected() -> None:
    golden.mistakes("types in ST", lambda text: types_of(text, "f.st").problems)


def test_all_mistakes_of_a_file_are_found_in_reading_order() -> None:
    assert [line.partition(" ")[0] for line in lines((DATA / "one_bad.st").read_text())] == [
        "f.st:6:7:",
        "f.st:8:9:",
    ]


@pytest.mark.parametrize(
    "bad",
    [
        "Bad : STRUCT b INT; c : REAL; END_STRUCT;",
        "Bad : STRUCT in STRUCT x : INT; END_STRUCT; y : INT; END_STRUCT",
        "Bad STRUCT a : INT; b : INT; END_STRUCT;",
        "Bad : ARRAY[1..] OF STRUCT a : INT; b : INT; END_STRUCT;",
        "Bad : ARRAY[1..;",
        "Bad : (A, B C);",
        "Bad : ;",
        "Bad : INT INT;",
        ": INT;",
        ";",
        "END_STRUCT;",
        "Bad : Unknown;",
        "Bad : Bad;",
        "Bad : STRUCT a : INT; A : INT; END_STRUCT;",
        "Bad : STRING[0];",
        "Bad : " + "ARRAY[0..1] OF " * 40 + "INT;",
        "Bad : " + "STRUCT a : " * 40 + "INT;" + " END_STRUCT;" * 40,
    ],
)
def test_a_bad_type_never_hides_the_good_ones_beside_it(bad: str) -> None:
    good = "After : STRUCT x : Before; END_STRUCT; END_TYPE TYPE Last : After; END_TYPE"
    types = types_of(f"TYPE Before : INT; {bad} {good}")
    assert types.problems
    assert types.names() == ["Before", "After", "Last"]


def test_nesting_ends_at_its_limit_with_a_line() -> None:
    deep = f"TYPE T : {'ARRAY[0..0] OF ' * MOST_NESTED}INT; END_TYPE"
    expected = f"expected at most {MOST_NESTED} levels of STRUCT and ARRAY"
    assert lines(deep) == [f"f.st:1:{10 + 15 * MOST_NESTED}: found 'INT', {expected}"]
    assert not lines(f"TYPE T : {'ARRAY[0..0] OF ' * (MOST_NESTED - 1)}INT; END_TYPE")


WORDS = """TYPE END_TYPE STRUCT END_STRUCT UNION END_UNION ARRAY OF STRING INT a b T 5 16#F POINTER TO REF_TO
    EXTENDS AT TITLE VERSION NAMESPACE END_NAMESPACE USING VAR_GLOBAL CONSTANT END_VAR PROGRAM END_PROGRAM
    INTERNAL OVERLAP TON"""
SIGNS = r"""[ ] ( ) .. := : ; , # - + * / . (* *) { } ' " // "x" `y` {attribute'pack_mode':='1'}"""
PIECES = st.sampled_from([*WORDS.split(), *SIGNS.split(), "\n"])


@given(st.one_of(st.text(max_size=60), st.lists(PIECES, max_size=60).map(" ".join)))
@example("TYPE a : STRUCT a : a ( a")
@example("TYPE a : a (")
@example("TYPE a : a #")
@example("TYPE a : INT (a")
def test_no_text_breaks_the_reader(text: str) -> None:
    for suffix in (".st", ".udt", ".exp", ".typ"):
        types = join_declarations([parse_source(text, "test", suffix)], "test")
        for problem in types.problems:
            assert problem.where.startswith("test:")
            assert problem.expected


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "{" * 50_000,
        "{'}" * 17_000,
        "(*" * 25_000,
        "(* (* *) " * 6_000,
        "'" * 50_000,
        "TYPE " * 10_000,
        "TYPE T : " + "STRUCT a : " * 5_000,
        "TYPE T : (" + "a," * 20_000,
        "TYPE T : ARRAY[" + "0..1," * 10_000,
        "TYPE T : ARRAY[0.." + "9" * 50_000,
        "{:='" * 12_000,
        "{:= '} " * 8_000,
        "`" * 50_000,
        "PROGRAM " * 6_000,
        "NAMESPACE " * 5_000,
        "VAR_GLOBAL CONSTANT " * 2_500,
        "TYPE T : " + "POINTER TO " * 4_500,
        "TYPE T : STRUCT " + "a : X(" * 8_000,
        "TYPE T : STRUCT " + "a : X(b; " * 5_000,
        "TYPE T : STRUCT " + "a : INT(END_STRUCT " * 2_500,
        "TYPE T : STRUCT a : UNION " + "END_STRUCT END_UNION " * 2_500,
        "TYPE T : ARRAY[0.." + "(" * 50_000,
        "TYPE T : ARRAY[0.." + "-" * 50_000 + "1] OF INT; END_TYPE",
        "TYPE T : ARRAY[0.." + "A+" * 25_000 + "1] OF INT; END_TYPE",
        "TYPE T : ARRAY[0.." + "A." * 25_000 + "A] OF INT; END_TYPE",
        "TYPE " + "T EXTENDS " * 5_000,
        "TYPE T TITLE " * 4_000,
        "TYPE " + "{x} T : Y;" * 5_000 + " END_TYPE",
        "TYPE " + "".join(f"T{n} EXTENDS T{n + 1} : STRUCT " for n in range(2_000)),
        "TYPE " + "".join(f"T{n} : T{n + 1}; " for n in range(5_000)) + "END_TYPE",
        "TYPE " + "".join(f"T{n} : STRUCT a, b : T{n + 1}; END_STRUCT " for n in range(2_000)) + "END_TYPE",
    ],
    ids=lambda text: text[:24].replace("\n", " "),
)
@pytest.mark.timeout(5)
def test_a_hostile_text_of_50_kilobytes_ends_soon(text: str) -> None:
    assert types_of(text).names() == []


@pytest.mark.slow
@given(declarations(), st.data())
def test_what_is_written_as_st_text_comes_back_equal(
    declared: list[Declaration], data: st.DataObject
) -> None:
    text = Writer(data.draw).file(declared)
    read = read_st(text, "f.st")
    assert read.problems == ()
    assert [placeless(found) for found in read.types] == [placeless(known) for known in declared]
