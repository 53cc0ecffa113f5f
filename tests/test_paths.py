"""An example that came with the program is found by its name, from any folder; one's own file comes first."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.paths import configs_path, resolve_path

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_scenario_is_found_by_its_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenario", "80c5-partner-closes"]) == 0
    assert capsys.readouterr().out.startswith("passed  80C5: ")


def test_each_example_is_found_as_the_readme_writes_it() -> None:
    for path in configs_path().rglob("*.*"):
        written = f"configs/{path.relative_to(configs_path()).as_posix()}"
        assert resolve_path(written) == path
    assert resolve_path("passive") == configs_path() / "passive.toml"


def test_ones_own_file_comes_first() -> None:
    Path("configs").mkdir()
    Path("configs/passive.toml").write_text("mine")
    Path("passive").write_text("mine, too")
    assert resolve_path("configs/passive.toml") == Path("configs/passive.toml")
    assert resolve_path("passive") == Path("passive")


def test_what_is_no_example_stays_as_it_was_given() -> None:
    for text in (
        "new.toml",
        "passive.toml",
        "a/passive",
        "configs/../passive.toml",
        "nothing",
        "*",
        "",
        "[a",
    ):
        assert resolve_path(text) == Path(text)


def test_a_name_of_two_examples_names_both() -> None:
    with pytest.raises(UserError) as refused:
        resolve_path("udt-mismatch")
    both = "configs/scenarios/stories/udt-mismatch.toml and configs/udt-mismatch.toml"
    assert str(refused.value) == f"udt-mismatch: found the name of {both}, expected one of them"


def readme_commands() -> list[str]:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line.strip()]


@pytest.mark.slow
@pytest.mark.parametrize("command", readme_commands())
def test_an_installed_user_runs_each_command_of_the_readme_from_any_folder(command: str) -> None:
    program = str(Path(sys.executable).with_name("trcvtui"))
    done = subprocess.run([program, *shlex.split(command)[1:]], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
