"""From an empty folder to a first DONE of an outside client: a real terminal, real keys, a real client."""

from __future__ import annotations

import io
import re
import socket
import subprocess
from pathlib import Path

import pytest

from tests.e2e.terminal import TRCVTUI, Terminal
from trcvtui.dialects import DIALECTS
from trcvtui.engine.project_edits import is_wanting, offer
from trcvtui.project.file import load_project

MOST_KEYS = 12
PORT = re.compile(r"127\.0\.0\.1:(\d+)")


def test_twelve_keys_from_an_empty_folder_to_the_first_done_at_each_size(tmp_path: Path) -> None:
    # One after the other: two benches at once would look for a free port in the same moment.
    for columns, rows in ((80, 24), (100, 30), (140, 45)):
        folder = tmp_path / f"{columns}x{rows}"
        folder.mkdir()
        terminal = Terminal(columns, rows, f"cd {folder}; exec {TRCVTUI} run new.toml")
        try:
            assert keys_to_the_first_done(terminal, folder / "new.toml") <= MOST_KEYS
        finally:
            terminal.close()


def keys_to_the_first_done(terminal: Terminal, path: Path) -> int:
    pressed: list[str] = []

    def press(key: str) -> None:
        pressed.append(key)
        terminal.keys(key)

    terminal.wait("enter: create it for baosky")
    assert not path.exists(), "nothing is written before a yes"
    press("Enter")
    terminal.wait("empty: press A, then enter")
    press("A")
    terminal.wait("with CONNECT C1 at")
    press("Enter")
    terminal.wait("▸ TRCV_C_1")
    press("t")
    screen = terminal.wait(lambda seen: "7002" in seen and PORT.search(seen) is not None)
    found = PORT.search(screen)
    assert found is not None and int(found[1]) >= 2000
    with socket.create_connection(("127.0.0.1", int(found[1]))) as client:
        terminal.wait("7004")
        press("n")
        terminal.wait("7006")
        client.sendall(b"hello")
        terminal.wait("5 B in scan")
    return len(pressed)


def answered(path: Path, text: str) -> bool:
    return offer(path, io.StringIO(text), io.StringIO())


@pytest.mark.parametrize("yes", ["\n", "y\n", "1\n", "baosky\n", "what\n\n"])
def test_a_yes_writes_a_project_of_the_proposed_dialect(tmp_path: Path, yes: str) -> None:
    path = tmp_path / "new.toml"
    assert is_wanting(path) and answered(path, yes)
    assert load_project(path).dialect.name == "baosky"


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_can_be_chosen_by_its_name(tmp_path: Path, dialect: str) -> None:
    path = tmp_path / "new.toml"
    path.write_text("")
    assert is_wanting(path) and answered(path, f"{dialect}\n")
    assert load_project(path).dialect.name == dialect


@pytest.mark.parametrize("no", ["n\n", "", "no\n", "x\n" * 9])
def test_nothing_is_written_before_a_yes(tmp_path: Path, no: str) -> None:
    path = tmp_path / "new.toml"
    assert not answered(path, no)
    assert not path.exists()


def test_what_is_there_or_has_no_folder_is_not_offered(tmp_path: Path) -> None:
    full = tmp_path / "full.toml"
    full.write_text('dialect = "baosky"\n')
    assert not is_wanting(full)
    assert not is_wanting(tmp_path / "away" / "new.toml")
    assert not is_wanting(tmp_path / "new.txt")
    assert not is_wanting(tmp_path)


def test_without_a_terminal_it_stays_one_line_and_exit_2(tmp_path: Path) -> None:
    ran = subprocess.run(
        [TRCVTUI, "run", "new.toml"], cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1 and "new.toml" in ran.stderr
    assert list(tmp_path.iterdir()) == []
