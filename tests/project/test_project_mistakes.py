"""Each class of mistake in a project file: of which kind it is, and the place that it names."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests import golden
from trcvtui.errors import Problem, UserError
from trcvtui.project.file import load_project
from trcvtui.project.tables import parse_toml

GOOD = """
dialect = "baosky"
[[data]]
name = "rx"
type = "ARRAY[0..3] OF BYTE"
[[connect]]
name = "C1"
%CONNECT%
[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "rx"
%INSTANCE%
[[peer]]
name = "P1"
active = true
remote = "@C1"
"""
ALONE = 'dialect = "baosky"\n'
LONG = "TYPE Long : STRUCT text : STRING[300]; END_STRUCT END_TYPE"


@pytest.fixture(autouse=True)
def _work_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def mistakes(text: str | bytes) -> tuple[Problem, ...]:
    Path("b.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(UserError) as caught:
        load_project("b.toml")
    return caught.value.problems


def with_line(part: str, line: str) -> str:
    text = GOOD
    for place in ("CONNECT", "INSTANCE"):
        text = text.replace(f"%{place}%", line if place == part else "")
    return text


def document(case: str) -> tuple[str, str]:
    """Return the document of a case and the place that its mistake has to name.

    `connect | LINE` and `instance | LINE` add a line, `alone | TABLES` and `only | TEXT` are all there is,
    `OLD => NEW` changes the good project.
    """
    part, bar, text = case.replace("\\n", "\n").partition(" | ")
    key = text.partition(" = ")[0]
    if part in ("connect", "instance"):
        name = {"connect": "C1", "instance": "TRCV_C_1"}[part]
        return with_line(part.upper(), text), f"b.toml: {part} {name}: {key}"
    if bar:
        return (ALONE * (part == "alone") + text), ""
    old, _, new = part.partition(" =>")
    assert old in GOOD
    return with_line("", "").replace(old, new.removeprefix(" ")), ""


def test_a_mistake_is_one_of_its_kind_at_its_place() -> None:
    Path("long.st").write_text(LONG, encoding="utf-8")
    said, wrong = [], []
    for kind, case in golden.cases("mistakes", "project files"):
        text, where = document(case)
        problems = mistakes(text)
        said.append((f"{kind}: {case}", map(str, problems)))
        if [problem.kind for problem in problems] != [kind] or (where and problems[0].where != where):
            wrong.append((case, kind, problems))
    assert wrong == []
    golden.agree("mistakes", "project files", said)


@pytest.mark.parametrize(
    ("content", "place"),
    [
        ("a = " + "[" * 100_000, ""),
        ("a = " + "9" * 5000, ""),
        (b"# \xff\n\xff", ": line 1"),
        ('a = """x', ": end of document"),
    ],
    ids=["nested too deeply", "5000 digits", "no UTF-8", "ends too early"],
)
def test_what_is_no_toml_is_a_mistake_with_its_place(content: str | bytes, place: str) -> None:
    assert [problem.where for problem in mistakes(content)] == [f"b.toml{place}"]


KEY = "a" + ".a" * 101
LONG_KEYS = {
    "bare": f"{KEY} = 1",
    "with blanks": KEY.replace(".", " . ") + " = 1",
    "in quotes": KEY.replace("a", '"a.b"') + " = 1",
    "a header": f"[{KEY}]",
    "an array's": f"[[{KEY}]]",
    "inline": f"x = [1, {{y = 2, {KEY} = 1}}]",
    "after a text": f'x = """a"b\\""""" # {KEY[:99]}\n{KEY} = 1',
    "of seconds": f"a{'.a' * 20_000} = 1",
}
NO_KEYS = {
    "a hundred": f"{KEY[:-2]} = 1",
    "dots in quotes": f"""'{KEY}'."{KEY}".b = 1""",
    "a text": f'x = "\\"{KEY}"\ny = \'"{KEY}\'',
    "texts of lines": f'x = """\n{KEY}\n"{KEY}\\""" {KEY}"""""\ny = \'\'\'\n{KEY} = 1\n\'\'\'',
    "a comment": f"x = 1 # {KEY} = 1\n# '\n# {KEY}",
    "values": f"x = [{'1.5, ' * 300}]\ny = [{'07:32:00.5, ' * 300}]",
}


@pytest.mark.parametrize("text", LONG_KEYS.values(), ids=LONG_KEYS)
def test_a_key_with_more_than_a_hundred_dots_is_refused_before_it_is_parsed(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(tomllib, "loads")
    with pytest.raises(UserError) as caught:
        parse_toml(text, "b.toml")
    (problem,) = caught.value.problems
    assert (
        problem.where == f"b.toml: line {text.count(chr(10)) + 1}" and problem.expected == "at most 100 dots"
    )


@pytest.mark.parametrize("text", NO_KEYS.values(), ids=NO_KEYS)
def test_dots_that_part_no_key_are_not_counted(text: str) -> None:
    assert parse_toml(text, "b.toml") == tomllib.loads(text)


@pytest.mark.parametrize("path", ["nix.toml", "."])
def test_a_file_that_cannot_be_read(path: str) -> None:
    with pytest.raises(UserError) as caught:
        load_project(path)
    assert [problem.kind for problem in caught.value.problems] == ["file"]


def test_all_mistakes_are_told_together() -> None:
    text = with_line("CONNECT", 'LocalPort = 70000\nLocalAddress = "x"').replace('"rx"', '"r x"')
    places = [problem.where for problem in mistakes(text)]
    assert "b.toml: connect C1: LocalAddress" in places
    assert "b.toml: connect C1: LocalPort" in places
    assert len(places) == 3


def test_a_bad_udt_is_told_once_however_many_variables_have_it() -> None:
    Path("t.st").write_text("TYPE T : STRUCT a : NIX; END_STRUCT END_TYPE")
    data = "".join(f'[[data]]\nname = "d{n}"\ntype = "T"\n' for n in range(3))
    (problem,) = mistakes(f'dialect = "baosky"\n[[udt]]\nfile = "t.st"\n{data}')
    assert (problem.where, problem.found) == ("t.st:1:21", "'NIX'")


def test_control_codes_of_a_file_stay_visible_text() -> None:
    (problem,) = mistakes(with_line("CONNECT", 'LocalAddress = "\\u001b[31m\\n"'))
    assert str(problem).isprintable()
    assert r"\x1b[31m\n" in str(problem)
