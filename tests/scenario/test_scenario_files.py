"""Which scenario files are listed, and what is read from each: bounded, whatever a file holds."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.scenario.scenarios import BAOSKY, CONFIGS
from trcvtui.paths import configs_path
from trcvtui.scenario import scenario as scenario_files
from trcvtui.scenario.scenario import find_files, read_scenario_file

BENCH = 'dialect = "baosky"\n'
STORY = '[scenario]\nname = "A story"\nabout = "why"\nsteps = """\n# first\nrun 1\n\nrun 2\n"""\n'


@pytest.fixture(autouse=True)
def _an_empty_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scenario_files, "configs_path", lambda: Path("nowhere"))


def put(path: str, text: str = BENCH + STORY) -> Path:
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


def names(project: str = "site/bench.toml") -> list[str]:
    return [path.as_posix() for path in find_files(Path(project)).paths]


# -- which ---------------------------------------------------------------------------------------------


def test_files_are_found_beside_the_project_below_it_and_in_the_configs_here() -> None:
    for path in (
        "site/bench.toml", "site/b.toml", "site/scenarios/c.toml", "site/scenarios/deep/d.toml",
        "configs/scenarios/baosky/e.toml", "configs/f.toml", "elsewhere/g.toml", "site/other/h.toml",
        "site/scenarios/notes.txt",
    ):  # fmt: skip
        put(path)
    assert names() == [
        "site/b.toml",
        "site/bench.toml",
        "site/scenarios/c.toml",
        "site/scenarios/deep/d.toml",
        "configs/scenarios/baosky/e.toml",
    ]


def test_those_that_came_with_the_program_are_found_from_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenario_files, "configs_path", configs_path)
    found = find_files(put("bench.toml")).paths
    assert set(BAOSKY) <= set(found)
    assert configs_path() == CONFIGS


def test_a_file_that_is_reached_twice_is_listed_once() -> None:
    real = put("configs/scenarios/a.toml")
    Path("configs/scenarios/again.toml").symlink_to(real.resolve())
    Path("configs/scenarios/round").symlink_to(Path("configs").resolve())
    assert names("configs/bench.toml") == ["configs/scenarios/a.toml"]


def test_only_so_many_files_are_looked_at_and_that_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenario_files, "MOST_FILES", 5)
    for number in range(8):
        put(f"site/{number}.toml")
    found = find_files(Path("site/bench.toml"))
    assert (len(found.paths), found.is_cut) == (5, True)


def test_a_folder_with_very_many_entries_is_not_read_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenario_files, "MOST_ENTRIES", 10)
    for number in range(30):
        put(f"site/{number}.txt")
    put("configs/scenarios/a.toml")
    found = find_files(Path("site/bench.toml"))
    assert found.is_cut
    assert names() == ["configs/scenarios/a.toml"], "the other places are looked at all the same"


def test_pipes_and_closed_folders_are_passed_by() -> None:
    put("site/scenarios/a.toml")
    os.mkfifo("site/pipe.toml")
    Path("site/folder.toml").mkdir()
    Path("site/nothing.toml").symlink_to("gone")
    assert names() == ["site/scenarios/a.toml"]


# -- what one says -------------------------------------------------------------------------------------


def test_a_file_says_its_name_and_its_steps_with_comments_and_places() -> None:
    said = read_scenario_file(put("a.toml"))
    assert said is not None
    assert (said.name, said.about, said.problem) == ("A story", "why", "")
    assert [(line.place, line.step, line.text) for line in said.lines] == [
        (6, 0, "# first"),
        (7, 1, "run 1"),
        (8, 0, ""),
        (9, 2, "run 2"),
    ]


@pytest.mark.parametrize(
    "steps",
    [
        '"# first\\nrun 1\\n\\nrun 2"',
        '"""# first\nrun 1\n\nrun 2"""',
        '"""\n# \\u0066irst\nrun 1\n\nrun 2"""',
    ],
)
def test_steps_that_the_file_writes_otherwise_count_from_one(steps: str) -> None:
    said = read_scenario_file(put("a.toml", f"{BENCH}[scenario]\nsteps = {steps}\n"))
    assert said is not None
    assert [(line.place, line.step) for line in said.lines] == [(1, 0), (2, 1), (3, 0), (4, 2)]


@pytest.mark.parametrize(
    "text", ["", BENCH, BENCH + "# a scenario of words only\n", "\x00\xff", "scenario = = 1"]
)
def test_what_is_no_scenario_is_not_listed(text: str) -> None:
    assert read_scenario_file(put("a.toml", text)) is None


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (BENCH + STORY.replace("run 1", "runn 1"), "a.toml: step 1 (runn 1): found 'runn'"),
        (STORY, "a.toml: dialect: found nothing"),
        (BENCH + "[scenario]\n", "a.toml: scenario: steps: found nothing"),
        (BENCH + "[scenario]\nname = = 1\n", "a.toml: line 3, column 8: found bad TOML"),
        (BENCH + "[scenario]\nname = 5\nsteps = 7\n", "a.toml: scenario: name: found 5"),
        (f"scenario = 5\n{BENCH}", "a.toml: scenario: found"),
        ('project = "gone.toml"\n' + STORY, "gone.toml: found 'No such file"),
        (BENCH + STORY + "x = " + "[" * 5000 + "\n", "a.toml: found brackets nested too deeply"),
        (BENCH + STORY + "x" + ".x" * 200 + " = 1\n", ": found a key with 200 dots, expected at most 100"),
    ],
)
def test_a_broken_file_is_listed_with_its_first_problem_in_one_line(text: str, problem: str) -> None:
    said = read_scenario_file(put("a.toml", text))
    assert said is not None
    assert problem in said.problem
    assert "\n" not in said.problem


def test_bytes_that_are_no_text_are_a_problem_and_no_crash() -> None:
    file = put("a.toml")
    file.write_bytes(b"[scenario]\nsteps = 'run \xff'\n")
    said = read_scenario_file(file)
    assert said is not None
    assert "line 2: found byte 16#FF" in said.problem


def test_a_file_that_is_too_large_is_not_read_for_the_list() -> None:
    said = read_scenario_file(put("a.toml", BENCH + STORY + "#" * scenario_files.MOST_BYTES))
    assert said is not None
    assert "a file that is too large" in said.problem and said.lines == ()
    assert read_scenario_file(put("b.toml", BENCH + "#" * scenario_files.MOST_BYTES)) is None


def test_a_file_that_went_away_is_told() -> None:
    said = read_scenario_file(Path("gone.toml"))
    assert said is not None
    assert said.problem == "gone.toml: found 'No such file or directory', expected a file"
