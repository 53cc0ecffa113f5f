"""Each class of mistake in a bench command: of which kind it is, and which word of the line it names."""

from __future__ import annotations

import re

import pytest

from tests import golden
from trcvtui.commands.table import parse_line, parse_script
from trcvtui.errors import Problem, UserError
from trcvtui.project.project import Project

QUOTED = re.compile("'([^']*)'")


def mistakes(line: str, project: Project) -> tuple[Problem, ...]:
    with pytest.raises(UserError) as caught:
        parse_line(line, project, "w")
    return caught.value.problems


def test_a_line_has_one_mistake_of_its_kind_that_names_a_word_of_it(project: Project) -> None:
    said, wrong = [], []
    for kind, line in golden.cases("mistakes", "bench commands"):
        problems = mistakes(line, project)
        said.append((f"{kind}: {line}", map(str, problems)))
        quoted = QUOTED.search(problems[0].found)
        if [problem.kind for problem in problems] != [kind] or (quoted and quoted[1] not in line):
            wrong.append((line, kind, problems))
    assert wrong == []
    golden.agree("mistakes", "bench commands", said)


def test_later_lines_are_read_as_the_changed_program_will_be(project: Project) -> None:
    script = """
        delete X
        set X CONT=1
        create TSEND_C X connect=C1
        set X REQ=1
        resize raw Telegram
        expect raw.speed 1.5
        expect raw[1] 3
    """
    with pytest.raises(UserError) as caught:
        parse_script(script, project, "s")
    steps = ["s: step 2 (set X CONT=1)", "s: step 7 (expect raw[1] 3)"]
    assert [problem.where for problem in caught.value.problems] == steps


def test_all_wrong_members_of_a_udt_are_told(project: Project) -> None:
    problems = mistakes("peer P1 send udt Telegram {id=x, speed=y}", project)
    places = [("w: Telegram.id", "'x'"), ("w: Telegram.speed", "'y'")]
    assert [(problem.where, problem.found) for problem in problems] == places


def test_a_file_that_is_not_there_is_named(project: Project) -> None:
    (problem,) = mistakes("peer P1 send file nix.bin", project)
    assert (problem.kind, problem.where) == ("file", "w: file")
    assert problem.found.endswith("nix.bin'")


def test_braces_and_lines_beyond_reason_are_refused(project: Project) -> None:
    (nested,) = mistakes("peer P1 send udt Telegram " + "{a=" * 100_000, project)
    (long,) = mistakes("x" * 1_000_001, project)
    assert ("32" in nested.expected, long.found) == (True, "1000001 characters")


def test_all_mistakes_of_a_script_are_told_with_number_and_line(project: Project) -> None:
    script = "set X CONT=1\nset Z CONT=1\n# a comment\nrun x   # all of it\nplc stop\n"
    with pytest.raises(UserError) as caught:
        parse_script(script, project, "s.toml")
    places = ["s.toml: step 2 (set Z CONT=1)", "s.toml: step 3 (run x   # all of it)"]
    assert [problem.where for problem in caught.value.problems] == places


def test_a_long_line_is_cut_in_its_message(project: Project) -> None:
    with pytest.raises(UserError) as caught:
        parse_script("frob " + "x" * 500, project, "s.toml")
    assert len(caught.value.lines()[0]) < 250


def test_control_codes_in_a_line_stay_visible_text(project: Project) -> None:
    with pytest.raises(UserError) as caught:
        parse_script("set \x1b[31mX CONT=1", project, "s.toml")
    assert caught.value.lines()[0].isprintable()


def test_only_the_end_of_a_line_ends_a_command(project: Project) -> None:
    with pytest.raises(UserError) as caught:
        parse_script("run 1\r\nfrob \u2028 \x0b \x85 run 2\nrun x", project, "s.toml")
    assert [line.split(":")[1].split("(")[0] for line in caught.value.lines()] == [" step 2 ", " step 3 "]
