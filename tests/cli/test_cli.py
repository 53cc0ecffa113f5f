"""The command line: what is data, what is talk, and how each mistake of the user ends."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import trcvtui
from tests.cli.conftest import Run
from trcvtui.cli.main import COMMANDS, main, parser_of

TELEGRAM = "TYPE Telegram : STRUCT id : DINT; speed : REAL; flag : BOOL; END_STRUCT END_TYPE\n"
TWO_TYPES = TELEGRAM + "TYPE Other : STRUCT a : INT; END_STRUCT END_TYPE\n"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder with good and bad files."""
    (tmp_path / "telegram.st").write_text(TELEGRAM)
    (tmp_path / "two.st").write_text(TWO_TYPES)
    (tmp_path / "values.json").write_text('{"id": 1, "speed": 1.5}')
    (tmp_path / "wrong.json").write_text('{"id": "x", "sped": 1}')
    (tmp_path / "rx.hex").write_text("01 00 00 00\n00 00 c0 3f\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def process(*argv: str, code: str = "") -> list[str]:
    return [sys.executable, *(("-c", code) if code else ("-m", "trcvtui")), *argv]


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(trcvtui.__file__).parent.parent)}


# -- mistakes: one line on stderr, exit 2, nothing on stdout ---------------------------------------------


@pytest.mark.parametrize("argv", [["\x1b[2J"], ["status", "\x1b[2J"], ["udt", "show", "\x1b[2J\n.st"]])
def test_escape_codes_in_an_argument_are_shown_not_sent(argv: list[str], run: Run) -> None:
    code, out, err = run(*argv)
    assert (code, out) == (2, "")
    assert "\x1b" not in err
    assert err.count("\n") == 1


# -- status ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spelling", ["80C5", "16#80C5", "W#16#80C5", "0x80c5"])
def test_status_of_a_code_is_json_with_the_keys_of_the_contract(spelling: str, run: Run) -> None:
    code, out, err = run("status", spelling, "--format", "json", "--dialect", "baosky")
    assert (code, err) == (0, "")
    [one] = json.loads(out)
    assert list(one)[:7] == ["code", "dialect", "blocks", "error", "title", "causes", "checks"]
    assert "configs/scenarios/baosky/80c5-partner-closes.toml" in one["scenarios"]
    assert (one["code"], one["dialect"], one["error"]) == ("16#80C5", "baosky", True)


@pytest.mark.parametrize("spelling", ["80C5", "80c5", "16#80C5", "W#16#80C5", "word#16#80c5", "0x80C5"])
def test_status_of_a_code_is_a_card_of_the_default_dialect_and_names_the_others(
    spelling: str, run: Run
) -> None:
    code, out, err = run("status", spelling)
    assert (code, err) == (0, "")
    assert out.startswith("16#80C5  The partner closed")
    assert "look at" in out
    assert out.count("16#80C5") == 1
    *_, last = out.splitlines()
    assert last == "also in: s7-1500, s7-1200, s7-1200-legacy, twincat (--dialect NAME, or --all)"
    assert run("status", spelling, "--dialect", "Baosky") == (0, out, "")
    _, everywhere, _ = run("status", spelling, "--all")
    assert everywhere.startswith(out.removesuffix(f"{last}\n")) and "also in" not in everywhere
    assert [line for line in everywhere.splitlines() if line.endswith((" · twincat", " · s7-1500"))]


def test_a_code_that_the_default_dialect_lacks_is_explained_by_one_that_has_it(run: Run) -> None:
    code, out, err = run("status", "80C9")
    assert (code, err) == (0, "")
    first, _, card, *_, last = out.splitlines()
    assert first.startswith("baosky has no such code") and "s7-1500" in first
    assert card.startswith("16#80C9")
    assert last.startswith("also in: s7-1200, ")
    _, named, _ = run("status", "80C9", "--dialect", "s7-1500")
    assert out.endswith(named), "without the first line where the dialect was named"
    assert run("status", "23")[1].splitlines()[2].startswith("16#0017  23 COMERROR")


def test_status_alone_is_the_table_of_the_default_dialect_and_with_all_the_whole_one(run: Run) -> None:
    _, own, _ = run("status")
    assert {line.split()[0] for line in own.splitlines()} == {"baosky"}
    code, text, _ = run("status", "--all")
    assert code == 0
    assert [line.split()[:2] for line in text.splitlines() if line.startswith("baosky")] == [
        line.split()[:2] for line in own.splitlines()
    ]
    _, as_json, _ = run("status", "--format", "json")
    codes = [one["code"] for one in json.loads(as_json)]
    assert [line.split()[1] for line in text.splitlines()] == codes
    assert {"16#0000", "16#7006", "16#80C5"} <= set(codes)


def test_each_command_stands_in_a_group_of_the_help_with_an_example_that_can_be_read(run: Run) -> None:
    code, out, err = run("--help")
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    shown = [line.split("  ")[1] for line in out.partition("options:")[0].splitlines() if line[:2] == "  "]
    assert [line.split()[0] for line in shown] == list(COMMANDS)
    _, _, refused = run("frob")
    assert re.findall("'([a-z]+)'", refused)[1:] == list(COMMANDS)
    for line in shown:
        assert parser_of(line.split()).parse_args(line.split()).command is not None


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_commands_options_and_files(shell: str, run: Run) -> None:
    code, out, err = run("completion", shell)
    assert (code, err) == (0, "")
    assert {*COMMANDS, "decode", "dialect"} <= {*re.findall("[a-z]+", out)}
    if shell == "bash":
        ask = 'COMP_WORDS=(trcvtui scenario --d); COMP_CWORD=2; _shtab_trcvtui; echo "${COMPREPLY[@]}"'
        done = subprocess.run(["bash", "-c", f"{out}\n{ask}"], capture_output=True, text=True, check=True)
        assert done.stdout == "--dialect\n"


# -- udt ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("given", ["01000000 0000c03f", "0x01,0x00,0x00,0x00, 16#0000C03F", "@rx.hex"])
def test_udt_decode_takes_hex_as_people_write_it_as_far_as_it_goes(given: str, files: Path, run: Run) -> None:
    code, out, err = run("udt", "decode", "telegram.st", "--format", "json", given)
    assert (code, err) == (0, "")
    decoded = json.loads(out)
    assert decoded["values"] == {"id": 1, "speed": 1.5, "flag": None}
    assert decoded["complete"] is False


def test_the_help_names_what_only_an_import_can_tell(run: Run) -> None:
    for words, said in (("status", "dialects: baosky"), ("udt decode", "layouts: baosky")):
        code, out, err = run(*words.split(), "--help")
        assert (code, err) == (0, "") and said in out


# -- exit codes and streams -------------------------------------------------------------------------------


def test_version_is_data(run: Run) -> None:
    assert run("--version") == (0, f"trcvtui {trcvtui.__version__}\n", "")


def test_ctrl_c_is_130_without_a_word(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*args: object) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr("trcvtui.dialects.status_report.find_explanations", interrupted)
    assert run("status") == (130, "", "")


def test_a_reader_that_goes_away_ends_the_command_quietly() -> None:
    command = subprocess.Popen(
        process("status", "--format", "json"),
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert command.stdout is not None and command.stderr is not None
    command.stdout.close()
    with command.stderr:
        assert command.stderr.read() == b""
    assert command.wait() == 141


def test_a_full_disk_after_stdout_is_one_line() -> None:
    with open("/dev/full", "wb") as full:
        done = subprocess.run(process("status"), env=ENVIRONMENT, stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 2
    assert done.stderr == b"stdout: found 'No space left on device', expected room for the output\n"


# -- run ------------------------------------------------------------------------------------------------


def test_the_demo_needs_a_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    code = main([])
    captured = capfd.readouterr()
    assert (code, captured.out) == (2, "")
    assert (
        captured.err == "trcvtui run: found no terminal, expected a terminal; `trcvtui scenario` needs none\n"
    )


STARTED = """
import os, sys
import trcvtui.engine.driver as driver
from trcvtui.cli.main import main
os.isatty = lambda number: True
def started(path, kernel, netns=False, read_only=False, record=None):
    print(path.name, kernel, "textual" in sys.modules)
    raise KeyboardInterrupt
driver.EngineDriver = started
sys.exit(main(sys.argv[1:]))
"""


def test_the_demo_starts_the_live_engine_before_the_screen_library_is_imported() -> None:
    done = subprocess.run(process(code=STARTED), env=ENVIRONMENT, capture_output=True, text=True)
    assert (done.stdout, done.stderr, done.returncode) == ("demo.toml live False\n", "", 130)
