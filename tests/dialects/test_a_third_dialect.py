"""A new vendor is one file (nordwind.py here) and one line in the registry; nothing else knows of it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.dialects.nordwind import NORDWIND
from trcvtui.cli.main import main
from trcvtui.dialects import DIALECTS

PACKAGE = Path(__file__).parents[2] / "trcvtui"

PROJECT = """
dialect = "nordwind"

[[data]]
name = "rx"
type = "ARRAY[0..3] OF BYTE"

[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"

[[instance]]
name = "R"
block = "TRCV_C"
connect = "C1"
data = "rx"

[[peer]]
name = "P1"
remote = "@C1"
"""
RECEIVING = """
set R CONT=1 EN_R=1
run 3
peer P1 connect
wait R STATUS=0050
expect R BUSY=1 DONE=0 ERROR=0
set R EN_R=0
run 2
peer P1 send hex 01 02 03 04
wait R STATUS=0051
expect R BUSY=0 DONE=1 RCVD_LEN=4
run 2
expect R trace 0020+ 0030 0050+ 0051 0030+
peer P1 close
wait R STATUS=E002
run 2
expect R trace 0030* E002! 0020+
set R CONT=0
run 3
expect R trace 0060 0010+
"""
SENDING = """
set R CONT=1 REQ=1
run 5
peer P1 connect
wait R STATUS=0041
run 2
expect R trace 0020+ 0030* 0040+ 0041 0030+
expect peer P1 received hex 00 00 00 00 within T#1s
"""


@pytest.fixture(autouse=True)
def the_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(DIALECTS, NORDWIND.name, NORDWIND)


def scenario(folder: Path, steps: str, project: str = PROJECT) -> Path:
    file = folder / "story.toml"
    file.write_text(f'{project}\n[scenario]\nname = "story"\nsteps = """{steps}"""\n', encoding="utf-8")
    return file


def test_a_receiver_shows_its_codes_and_its_course(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scenario", str(scenario(tmp_path, RECEIVING))]) == 0, capsys.readouterr().out


def test_a_request_that_waits_for_the_connection_sends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = PROJECT.replace('"TRCV_C"', '"TSEND_C"')
    assert main(["scenario", str(scenario(tmp_path, SENDING, project))]) == 0, capsys.readouterr().out


def test_its_switches_and_models_are_checked_like_any_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = PROJECT.replace('"nordwind"', '"nordwind"\nmodel = "N2"\n[options]\nqueue = 1')
    assert main(["scenario", str(scenario(tmp_path, RECEIVING, project))]) == 2
    model, queue = capsys.readouterr().err.splitlines()
    assert model.endswith("model: found 'N2', expected N1")
    assert queue.endswith("options.queue: found an unknown switch, expected a switch of nordwind: retry")


def test_its_codes_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status", "E002", "--dialect", "nordwind"]) == 0
    told = capsys.readouterr().out
    assert "16#E002" in told and "The partner is gone" in told


def test_it_stands_beside_baosky(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["scenario", str(scenario(tmp_path, RECEIVING)), "--dialect", "nordwind", "--dialect", "baosky"]
    assert main(argv) == 1
    where, head, *rows = capsys.readouterr().out.splitlines()
    assert "first differ in scan 1: 0020 vs 0001" in where and head.split() == ["scan", "nordwind", "baosky"]
    assert any(row.split()[1:3] == ["≠", "E002"] for row in rows)


# -- nothing else names a vendor -----------------------------------------------------------------------------

VENDOR = re.compile(r"baosky|tianxing|siemens|s7[-_]1|nordwind", re.IGNORECASE)
# Defaults, the layouts that bear a vendor's name because its manual is all that describes them, and the file
# formats of a vendor's tool: none of them says what a block does.
ALLOWED = {
    "capture/plc_end.py": {"Siemens"},  # whose network card it is
    "engine/project_edits.py": {"baosky"},  # what a new project is proposed
    "cli/udt.py": {"layout of the type; default: baosky, for Siemens sources s7-standard"},  # --layout
    "udt/command.py": {": the source is Siemens, so the layout is "},
    "udt/sources/__init__.py": {"Siemens Openness"},
    "udt/other_files.py": {  # whose files are not read
        "a Siemens SIMATIC SD text file (.s7res)",
        "a Siemens TIA Portal project (.zap, .ap)",
    },
    "udt/layout/rules.py": {"BAOSKY", "baosky", "baosky-slot4", "baosky-pack4", "BAOSKY_UNVERIFIED"},
}


def code_words(path: Path) -> Iterator[str]:
    """Yield the names and texts of a file's code: comments and docstrings may say where a rule comes from."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.value
        elif isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.arg | ast.keyword):
            yield node.arg or ""
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""
        elif isinstance(node, ast.alias | ast.FunctionDef | ast.ClassDef):
            yield node.name


@pytest.mark.slow
def test_no_code_outside_the_dialects_names_a_vendor() -> None:
    named = {
        path.relative_to(PACKAGE).as_posix(): words
        for path in PACKAGE.rglob("*.py")
        if "dialects" not in path.relative_to(PACKAGE).parts
        if (words := {word for word in code_words(path) if VENDOR.search(word)})
    }
    assert named == ALLOWED


@pytest.mark.slow
def test_nothing_outside_the_dialects_imports_one_vendor() -> None:
    modules = {path.stem for path in (PACKAGE / "dialects").iterdir()}
    shared = {"__init__", "dialect", "status_report"}
    imports = {
        node.module.split(".")[2]
        for path in PACKAGE.rglob("*.py")
        if "dialects" not in path.relative_to(PACKAGE).parts
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("trcvtui.dialects.")
        if node.module is not None
    }
    assert imports <= shared < modules
