"""Each mistake of a command line: one line on stderr, exit 2, nothing on stdout."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests import golden
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
    wrong = []

    def told(line: str) -> list[str]:
        code, out, err = run(*line.split())
        if (code, out, err.find("\n")) != (2, "", len(err) - 1):
            wrong.append((line, code, out, err))
        return [re.split(r" \(choose from |, expected one of |: found pytest", err.rstrip())[0]]

    golden.answers("command line", told)
    assert wrong == []
