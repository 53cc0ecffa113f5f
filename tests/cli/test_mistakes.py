"""Each mistake of a command line: one line on stderr, exit 2, nothing on stdout."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import Run

TELEGRAM = "TYPE Telegram : STRUCT id : DINT; speed : REAL; flag : BOOL; END_STRUCT END_TYPE\n"
FILES = {
    "telegram.st": TELEGRAM,
    "two.st": TELEGRAM + "TYPE Other : STRUCT a : INT; END_STRUCT END_TYPE\n",
    "types.st": "\nTYPE Mixed : INT; END_TYPE\n\n"
    "TYPE Sized : STRUCT a : ARRAY[1..GVL.MAX] OF INT; END_STRUCT END_TYPE",
    "axis.st": "TYPE Axis : STRUCT kind : BYTE; weight : LREAL; END_STRUCT END_TYPE",
    "t.st": "TYPE T : INT; END_TYPE",
    "list.json": "[1, 2]",
    "broken.json": '{"id": ',
    "values.json": '{"id": 1, "speed": 1.5}',
    "empty.hex": "\n",
}
# A line; what is said begins with what stands after the arrow, there or on the next line.
MISTAKES = """
frob => trcvtui: argument COMMAND: invalid choice: 'frob'
status 80C5 --format xml => trcvtui status: argument --format: invalid choice: 'xml'
status 80C5 --dialekt x => trcvtui: unrecognized arguments: --dialekt x
scenario => trcvtui scenario: the following arguments are required: FILE.toml
scenario --kernel fast x.toml => trcvtui scenario: argument --kernel: invalid choice: 'fast'
udt => trcvtui udt: the following arguments are required: WHAT
udt show --lay packed telegram.st => trcvtui: unrecognized arguments: --lay
scenario --format xml nix.toml => --format: found 'xml', expected one of text, jsonl
status 1234 => CODE: found 16#1234, expected a code in the table
status 80G5 => CODE: found '80G5', expected a STATUS word
status 80C5 --dialect siemnes => --dialect: found 'siemnes', expected one of baosky
status 8085 --dialect baosky => CODE: found 16#8085, expected a code of baosky; it is one of s7-1500, s7
status 80C5 --block TRVC_C => --block: found 'TRVC_C', expected one of ClearComBuffer
status 7006 --block TSEND_C => CODE: found 16#7006, expected a code in the table of TSEND_C
udt show nix.st => nix.st: found No such file or directory
udt show folder.st => folder.st: found Is a directory
udt show garbage.st => garbage.st
udt show values.json => values.json: found suffix '.json'
udt show two.st => two.st: found 2 types: Telegram, Other
udt show telegram.st --type Telegramm => --type: found 'Telegramm', expected a type of telegram.st
udt show telegram.st --layout cap5 => layout: found 'cap5', expected one of baosky
udt show telegram.st --byte-order middle => byte order: found 'middle', expected one of little, big
udt decode telegram.st 0102030G => HEX, position 8: found 'G', expected hex bytes
udt decode telegram.st 01 02 030 => HEX, position 7: found '030' with 3 digits
udt decode telegram.st @nix.hex => nix.hex: found No such file or directory
udt decode telegram.st @folder.st => folder.st: found Is a directory
udt decode telegram.st @garbage.hex => garbage.hex: found binary data
udt decode telegram.st @values.json => values.json, position 1: found '{'
udt decode telegram.st - => stdin: found
udt encode telegram.st nix.json => nix.json: found No such file or directory
udt encode telegram.st folder.st => folder.st: found Is a directory
udt encode telegram.st garbage.json => garbage.json: found binary data
udt encode telegram.st broken.json => broken.json, line 1, column 8: found no JSON
udt encode telegram.st list.json => list.json: found JSON, but a list
udt encode telegram.st - => stdin: found
scenario nix.toml => nix.toml: found
scenario folder.toml => folder.toml: found
scenario garbage.toml => garbage.toml
run nix.toml => nix.toml: found
run folder.toml => folder.toml: found
run garbage.toml => garbage.toml
udt export types.st --type Mixed => trcvtui udt export: the following arguments are required: --to
udt export types.st --type Mixed --to java => --to: found 'java', expected one of lua
udt export types.st --type Mixed --to lua --port 70000 => --port: found 70000, expected a port from 1
udt export types.st --type Mixed --to lua --port x => trcvtui udt export: argument --port: invalid int
udt export types.st --type Mixed --to lua --out folder.st => folder.st: found Is a directory
udt export nix.st --to lua => nix.st: found No such file
udt show types.st --type Sized => types.st:4:34: found 'GVL.MAX', expected a known constant
udt show types.st --type Sized --constant GVL.MAX => --constant: found 'GVL.MAX', expected NAME=VALUE
udt show types.st --type Sized --constant GVL.MAX=ten => --constant: found 'GVL.MAX=ten'
udt show types.st --type Mixed --text pascal => STRING form: found 'pascal', expected one of s7
udt decode types.st --type Mixed --format xml 01 => trcvtui udt decode: argument --format: invalid
udt compare types.st --type Mixed --layout a --layout b => layout: found 'a', expected one of baosky
udt compare types.st --type Mixed --layout cap4 --layout packed --layout natural8 =>
    --layout: found 3 of them, expected one for both sides
udt compare types.st --type Mixed --layout packed 0g => HEX, position 2: found 'g'
udt fit axis.st => trcvtui udt fit: the following arguments are required: HEX|@FILE|-
udt fit axis.st 0g => HEX, position 2: found 'g'
udt fit axis.st @empty.hex => empty.hex: found no bytes, expected a message
udt fit axis.st --layout a 01 => layout: found 'a', expected one of baosky
udt cure axis.st => trcvtui udt cure: the following arguments are required: --as
udt cure axis.st --as java => trcvtui udt cure: argument --as: invalid choice
completion csh => trcvtui completion: argument shell: invalid choice: 'csh'
udt show t.st --pointer-size 2 => --pointer-size: found '2', expected one of 4, 8
udt show t.st --string-even 1 => --string-even: found '1', expected one of yes, no
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    for name in ("folder.st", "folder.toml"):
        (tmp_path / name).mkdir()
    for name in ("garbage.st", "garbage.toml", "garbage.hex", "garbage.json"):
        (tmp_path / name).write_bytes(bytes(range(256)) * 4)
    monkeypatch.chdir(tmp_path)


def test_a_mistake_is_one_line_on_stderr_exit_2_and_nothing_on_stdout(folder: None, run: Run) -> None:
    rows = [row.split(" =>") for row in MISTAKES.strip().replace("=>\n   ", "=>").splitlines()]
    assert len(rows) > 60
    wrong = []
    for words, said in rows:
        code, out, err = run(*words.split())
        if (code, out) != (2, "") or not err.startswith(said.strip()) or err.find("\n") != len(err) - 1:
            wrong.append((words, said.strip(), code, out, err))
    assert wrong == []
