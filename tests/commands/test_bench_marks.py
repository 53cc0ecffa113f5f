"""`prefix RD hex 02`, `suffix RD none`: bytes and length of a mark take effect in one scan."""

from __future__ import annotations

import pytest

from tests import golden
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import format_command, parse_line
from trcvtui.errors import UserError
from trcvtui.project.file import load_project

PROJECT = load_project(CONFIGS / "twincat-line.toml")


@pytest.mark.parametrize("line", ["prefix RD hex 02", 'suffix RD text "\\r\\n"', "prefix RD none"])
def test_a_mark_is_written_as_it_was_read(line: str) -> None:
    command = parse_line(line, PROJECT, "x")
    assert command is not None and format_command(command) == line


def test_the_bytes_and_their_number_are_there_in_the_next_scan() -> None:
    bench = Bench(PROJECT, "sim")
    for line, data, length in (("prefix RD hex AA 55", b"\xaa\x55", 2), ("prefix RD none", b"\xaa\x55", 0)):
        command = parse_line(line, PROJECT, "x")
        assert command is not None and bench.do(command) == ""
        bench.step()
        assert bench.runtime.data("prefix", 2) == data
        assert bench.runtime.inputs("RD")["LenPrefix"] == length
    bench.close()


def test_a_pointer_that_is_0_has_no_mark() -> None:
    with pytest.raises(UserError, match="pPrefix of 'RD', which is 0"):
        parse_line("prefix RD hex 02", load_project(CONFIGS / "twincat-stream.toml"), "x")


def test_what_is_no_mark_is_refused() -> None:
    golden.mistakes("marks", lambda line: parse_line(line, PROJECT, "x"))
