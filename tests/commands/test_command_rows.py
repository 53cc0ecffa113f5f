"""A bench command is one row: a made-up one, added in one place, works everywhere."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.bench.bench_project import bench_project
from tests.docs_scripts import script
from trcvtui.bench.bench import Bench
from trcvtui.commands.conditions import parse_instance
from trcvtui.commands.table import COMMANDS, RecordRow, VerbRow, format_command, parse_line
from trcvtui.commands.tokens import Words
from trcvtui.errors import UserError
from trcvtui.plc.commands import SetInput
from trcvtui.project.project import Project
from trcvtui.tui.completion import complete


@dataclass(frozen=True)
class Zero:
    """`zero X`: LEN of an instance is 0."""

    instance: str


def read_zero(words: Words, project: Project) -> Any:
    return Zero(parse_instance(words, project).name)


def its_instances(words: list[str], project: Project) -> Iterable[str]:
    return [decl.name for decl in project.instances]


ROW = VerbRow(
    "zero",
    read_zero,
    its_instances,
    (
        RecordRow(
            Zero,
            lambda c: f"zero {c.instance}",
            lambda bench, c: bench.submit(SetInput(c.instance, "LEN", 0)),
        ),
    ),
)


def test_a_made_up_command_is_read_written_completed_carried_out_and_missed_in_the_page(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    project = bench_project(tmp_path)
    with pytest.raises(UserError, match="found 'zero'"):
        parse_line("zero X", project, "w")
    monkeypatch.setitem(COMMANDS, "zero", ROW)

    command: Any = parse_line("zero X", project, "w")
    assert command == Zero("X")
    assert format_command(command) == "zero X"
    assert complete("ze", project) == "zero"
    assert complete("zero ", project) == "zero X"
    assert script("make_bench_commands").missing() == ["zero"]

    bench = Bench(project, "sim")
    for line in ("set X LEN=7", "zero X"):
        given = parse_line(line, project, "w")
        assert given is not None
        assert bench.do(given) == ""
        bench.step()
    assert dict(bench.runtime.snapshot().instances[0].inputs)["LEN"] == 0
    bench.close()


def test_what_lets_scans_pass_is_no_act_of_the_bench() -> None:
    passing = {known.record.__name__ for row in COMMANDS.values() for known in row.records if not known.act}
    assert passing == {"RunScans", "RunFor", "Wait", "Expect", "ExpectTrace", "TrySplits", "AskDoctor"}
