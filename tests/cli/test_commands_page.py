"""Pages of commands and keys are what the program has; each example line of a bench command can be read."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from textual.binding import Binding
from textual.keys import format_key

from tests.certificates import OPENSSL, Certificates
from tests.docs_scripts import DOCS, script
from trcvtui.commands.reader import project_after
from trcvtui.commands.table import COMMANDS, parse_line
from trcvtui.errors import UserError
from trcvtui.project.file import load_project
from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.widgets.help import HELP_SECTIONS
from trcvtui.tui.widgets.theme import THEMES

MADE = {
    "commands": script("make_commands"),
    "bench-commands": script("make_bench_commands"),
    "keys": script("make_key_table"),
}
PROJECT = """
udt = [{ file = "weight.st" }]
data = [
    { name = "rx", type = "ARRAY[0..15] OF BYTE" }, { name = "tx", type = "ARRAY[0..15] OF BYTE" },
    { name = "report", type = "Weight" }, { name = "suffix", type = "ARRAY[0..3] OF BYTE" },
]
connect = [{ name = "C1", LocalPort = 2000%s }, { name = "C2", LocalPort = 2001%s }]
peer = [{ name = "P1", remote = "@C1" }, { name = "P2", active = false, local = "127.0.0.1:2002" }]
message = [{ name = "hello", text = "hex 01" }]
sequence = [{ name = "start", steps = ["hello"] }]
tap = [{ name = "T", listen = "2003", to = "10.0.0.5:2000", connect = "C1" }]
"""
SIEMENS = ', type = "TCON_IP_v4", ID = 1, ActiveEstablished = false'
TRCV_C = '{ name = "TRCV_C_1", block = "TRCV_C", connect = "C1", data = "rx" }'
READER = '{ name = "RD", block = "ReceiveData", RxBuffer = "RX", data = "tx", pPrefix = "suffix", '
READER += 'pSuffix = "suffix", SizeReceiveData = 16 }'
BENCHES = {  # what makes the examples of a vendor readable
    "baosky": f"instance = [{TRCV_C}]",
    "twincat": f'combuffer = [{{ name = "RX", source = "sim" }}]\ninstance = [{TRCV_C}, {READER}]',
    "s7-1500": f"instance = [{TRCV_C}]",
}


def written(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", MADE)
def test_the_page_is_what_the_program_has(name: str) -> None:
    is_in_step = written(name) == MADE[name].page()
    assert is_in_step, f"docs/{name}.md is out of step with the program: run `make atlas`"


def test_each_bench_command_has_an_example() -> None:
    assert MADE["bench-commands"].missing() == []
    assert len(MADE["bench-commands"].examples()) > 100


def test_each_example_of_a_bench_command_can_be_read(tmp_path: Path) -> None:
    struct = "STRUCT state : INT; weight : REAL; speed : INT; END_STRUCT"
    (tmp_path / "types").mkdir()
    (tmp_path / "weight.st").write_text(f"TYPE Weight : {struct} END_TYPE")
    (tmp_path / "types" / "order.st").write_text(f"TYPE Order : {struct} END_TYPE")
    (tmp_path / "x.bin").write_bytes(b"x")
    if OPENSSL is not None:
        Certificates(tmp_path)
    read = set()
    lines = [line for line in MADE["bench-commands"].examples() if line.split()[0] in COMMANDS]
    lines = [line for line in lines if OPENSSL is not None or "certificate" not in line]
    for dialect, more in BENCHES.items():
        path = tmp_path / f"{dialect}.toml"
        of_siemens = SIEMENS if dialect == "s7-1500" else ""
        path.write_text(f'dialect = "{dialect}"\n{PROJECT % (of_siemens, of_siemens)}{more}\n', "utf-8")
        project = load_project(path)
        for line in lines:
            with suppress(UserError):
                command = parse_line(line.replace(" ...", ""), project, dialect)
                read.add(line)
                if command is not None and line.split()[0] in ("add", "create"):
                    project = project_after(command, project)
    assert [line for line in lines if line not in read] == []


@pytest.mark.parametrize("name", [*MADE, "project-file", "serve", "messages", "scenario-output"])
def test_a_cell_has_at_most_200_characters(name: str) -> None:
    cells = [
        cell
        for line in written(name).splitlines()
        if line.startswith("|")
        for cell in line.replace("\\|", "/").strip("|").split("|")
    ]
    assert cells
    assert [cell for cell in cells if len(cell.strip()) > 200] == []


def test_every_action_with_its_key_and_every_theme_stands_in_the_page_of_keys() -> None:
    page = written("keys")
    in_the_help = {key for _, _, table in HELP_SECTIONS for shown, _ in table for key in shown.split(" or ")}
    for binding in (*BenchApp.BINDINGS, *MainScreen.BINDINGS):
        if isinstance(binding, Binding) and binding.id:
            keys = ", ".join(f"`{key}`" for key in binding.key.split(","))
            assert f"| `{binding.id}` | {keys} |" in page
            assert format_key(binding.key.split(",")[0]) in in_the_help, binding.id
    assert all(f"`{name}`" in page for name in THEMES)
