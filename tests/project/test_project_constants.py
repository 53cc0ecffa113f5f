"""[constants] of a project: bounds of UDTs and of variables, from the file and from --set."""

from __future__ import annotations

from pathlib import Path

import pytest

from trcvtui.errors import UserError
from trcvtui.project.file import load_project

UDT = """
TYPE Telegram : STRUCT
    values : ARRAY[1..GVL.MAX] OF INT;
    name : STRING[Limits#LENGTH - 1];
END_STRUCT END_TYPE
"""
PROJECT = """
dialect = "baosky"
[[udt]]
file = "telegram.st"
[[data]]
name = "rx"
type = "Telegram"
"""


@pytest.fixture(autouse=True)
def _work_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("telegram.st").write_text(UDT)


def size_of(text: str, *overrides: str) -> int:
    Path("p.toml").write_text(text)
    (data,) = load_project("p.toml", overrides).data
    return data.size


def lines_of(text: str) -> list[str]:
    with pytest.raises(UserError) as refused:
        size_of(text)
    return refused.value.lines()


@pytest.mark.parametrize(
    "constants",
    [
        '"GVL.MAX" = 4\n"Limits.LENGTH" = 11',
        "GVL.MAX = 4\nLimits.LENGTH = 11",
        '"gvl.max" = 4\n"Limits#LENGTH" = 0xB',
        "MAX = 4\nLENGTH = 11",
    ],
)
def test_constants_of_the_project_stand_in_bounds_and_lengths(constants: str) -> None:
    assert size_of(f"{PROJECT}[constants]\n{constants}") == 4 * 2 + 12


def test_set_gives_a_constant_and_wins_over_the_file() -> None:
    assert size_of(f"{PROJECT}[constants]\nLENGTH = 11", "constants.GVL.MAX=16#4") == 20
    assert size_of(f'{PROJECT}[constants]\nLENGTH = 11\n"GVL.MAX" = 9', "constants.GVL.MAX=4") == 20


def test_a_variable_may_have_constants_in_its_type_too() -> None:
    text = 'dialect = "baosky"\n[constants]\nN = 3\n[[data]]\nname = "rx"\ntype = "ARRAY[0..N] OF BYTE"'
    assert size_of(text) == 4


def test_unknown_constants_are_told_together_and_where_to_put_them() -> None:
    assert lines_of(PROJECT) == [
        "telegram.st:3:23: found 'GVL.MAX', expected a known constant; "
        'add "GVL.MAX" = VALUE to [constants] of the project, or --constant GVL.MAX=VALUE',
        "telegram.st:4:19: found 'Limits.LENGTH', expected a known constant; "
        'add "Limits.LENGTH" = VALUE to [constants] of the project, or --constant Limits.LENGTH=VALUE',
    ]


def test_what_is_no_constant_is_one_line() -> None:
    limits = "a whole number from -9223372036854775808 to 9223372036854775807"
    assert lines_of(f'{PROJECT}[constants]\nLENGTH = 11\n"GVL.MAX" = "4"')[0] == (
        f"p.toml: constants: GVL.MAX: found '4', expected {limits}"
    )
    assert lines_of(f"{PROJECT}[constants]\nGVL.MAX = true\nLENGTH = 11")[0] == (
        f"p.toml: constants: GVL.MAX: found true, expected {limits}"
    )
    assert lines_of(f"constants = 5\n{PROJECT}")[0] == (
        "p.toml: constants: found 5, expected a table [constants]"
    )


def test_a_bad_udt_that_no_variable_has_is_no_mistake_of_the_project() -> None:
    Path("telegram.st").write_text("TYPE Bad : ARRAY[0..N] OF Nope; Telegram : DINT; END_TYPE")
    assert size_of(PROJECT) == 4
    assert lines_of(PROJECT.replace('"Telegram"', '"Bad"'))[0] == (
        "telegram.st:1:27: found 'Nope', expected a known type"
    )
