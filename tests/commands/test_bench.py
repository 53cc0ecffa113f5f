"""The bench commands: what each line means."""

from __future__ import annotations

import re
from pathlib import Path

from tests import golden
from tests.bench.bench_project import bench_project
from trcvtui.commands import words
from trcvtui.commands.table import format_command, parse_line, parse_script
from trcvtui.project.project import Project

ZEROS = re.compile(r"(?:\\x00){3,}")


def test_each_line_means_its_command_and_comes_back_as_a_line(project: Project) -> None:
    changed = []

    def comes_back(line: str) -> list[str]:
        command = parse_line(line, project, "w")
        again = "no command" if command is None else format_command(command)
        if command is not None and parse_line(again, project, "w") != command:
            changed.append(line)
        return [again]

    def means(line: str) -> list[str]:
        command = parse_line(line, project, "w")
        return [ZEROS.sub(lambda run: f"<{len(run[0]) // 4} zeros>", str(command)), *comes_back(line)]

    golden.answers("lines and their commands", means, "commands")
    golden.answers("lines that come back", comes_back, "commands")
    assert changed == []


def test_a_script_numbers_its_commands_and_nothing_else(project: Project) -> None:
    script = "\n# first\nset X CONT=1\n\n   run 5   # wait\n#\nplc stop\n"
    assert parse_script(script, project, "s.toml") == [
        words.Step(1, "set X CONT=1", words.SetInputs("X", (("CONT", True),))),
        words.Step(2, "run 5   # wait", words.RunScans(5)),
        words.Step(3, "plc stop", words.PlcStop()),
    ]


def test_files_are_looked_for_beside_the_project(tmp_path: Path) -> None:
    project = bench_project(tmp_path)
    (tmp_path / "sub dir").mkdir()
    (tmp_path / "sub dir" / "y.bin").write_bytes(b"y")
    command = parse_line('peer P1 send file "sub dir/y.bin" repeat=2', project, "w")
    assert command == words.PeerSend("P1", b"y", repeat=2)
