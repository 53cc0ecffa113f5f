"""The screen on programs of every kind: inner blocks, tasks, long names, and one that is taken apart."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from tests.tui.looking import BOTH, SMALL, WIDE
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project

CONFIGS = Path(__file__).parents[2] / "configs"
LONG = "GVL_Receive_fbTrcvConveyorLine"


@asynccontextmanager
async def opened(project: Path, size: tuple[int, int] = WIDE) -> AsyncIterator[Stage]:
    async with on_stage(Stage, load_project(project), size) as bench:
        await bench.scan(1)
        yield bench


async def says(bench: Stage, *lines: str) -> None:
    for line in lines:
        await bench.press("colon", *line, "enter")
        await bench.scan(4)


@BOTH
async def test_when_the_last_instance_is_deleted_its_bytes_go_with_it(size: tuple[int, int]) -> None:
    async with opened(CONFIGS / "duplex.toml", size) as bench:
        await says(bench, "write rx hex 01 02 03 04", "delete TSEND_C_1")
        await bench.press("5")
        assert "01 02 03 04" in bench.text
        await says(bench, "delete TRCV_C_1")
        assert "01 02 03 04" not in bench.text
        await bench.press("3")
        assert "this bench has no instance" in bench.text
        await says(bench, "create TRCV_C TRCV_C_9 connect=C1 data=rx")
        assert "16#7000" in bench.text
        await bench.press("5")
        assert "01 02 03 04" in bench.text


async def test_a_send_job_speaks_of_the_stack_and_of_no_byte_that_came() -> None:
    async with opened(CONFIGS / "duplex.toml") as bench:
        await says(bench, "set TSEND_C_1 CONT=1", "peer P1 connect", "delete TRCV_C_1")
        await bench.press("r")
        await bench.scan(1)
        assert "16#7005  Sending" in bench.text
        why = next(line for line in bench.text.splitlines() if " why    The local stack" in line)
        assert "…" not in why, "the scrollbar that has come takes a column: the lines break anew"
        await bench.press("3", "M")
        assert "The local stack has taken 8 of 8 bytes" in bench.text
        assert "the last one came" not in bench.text


async def test_a_block_without_data_misses_none() -> None:
    async with opened(CONFIGS / "inner-passive.toml") as bench:
        await says(bench, "set TCON_1 REQ=1", "peer P1 connect")
        await bench.scan(4)
        assert "DATA    none" in bench.text
        assert "DONE in scan" in bench.text


@BOTH
async def test_long_names_keep_the_end_that_tells_them_apart(size: tuple[int, int], tmp_path: Path) -> None:
    text = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
    one = f'[[instance]]\nname = "{LONG}_{{}}"\nblock = "TRCV_C"\nconnect = "C1"\n'
    project = tmp_path / "long.toml"
    project.write_text(text + one.format(11) + one.format(12), encoding="utf-8")
    async with opened(project, size) as bench:
        await says(bench, f"set {LONG}_11 CONT=1", "peer P1 connect")
        await bench.scan(4)
        rows = [line for line in bench.text.splitlines() if "_11 " in line or "_12 " in line]
        assert len(rows) >= 2
        assert all("← 127.0.0.1:" in line for line in rows[:2]), "the partner is there in full"


async def test_an_instance_says_which_of_several_tasks_calls_it(tmp_path: Path) -> None:
    text = (CONFIGS / "duplex.toml").read_text(encoding="utf-8")
    tasks = '[[task]]\nname = "FAST"\ninterval = "T#10ms"\npriority = 1\n'
    tasks += '[[task]]\nname = "SLOW"\ninterval = "T#40ms"\npriority = 2\n'
    text = text.replace('data = "rx"\n', 'data = "rx"\ntask = "FAST"\n')
    text = text.replace('data = "tx"\n', 'data = "tx"\ntask = "SLOW"\n')
    project = tmp_path / "tasks.toml"
    project.write_text(text + tasks, encoding="utf-8")
    async with opened(project, SMALL) as bench:
        await bench.press("2")
        assert "TRCV_C · FAST T#10ms priority 1" in bench.text
        await bench.press("1", "down", "2")
        assert "TSEND_C · SLOW T#40ms priority 2" in bench.text
