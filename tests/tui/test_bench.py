"""The screen on a bench that really scans, stepped by hand: from a key to a kernel call and back."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from tests.tui.looking import WIDE
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project

EIGHT = Path(__file__).parent / "eight.toml"


class Stepped(Stage):
    async def send(self, payload: str) -> None:
        await self.press("7", "i", "ctrl+a", "ctrl+k", *payload, "enter", "escape")
        await self.scan(6)


@asynccontextmanager
async def stepped(size: tuple[int, int]) -> AsyncIterator[Stepped]:
    async with on_stage(Stepped, load_project(EIGHT), size) as bench:
        await bench.scan(1)
        await bench.press("t", "n")
        await bench.scan(4)
        await bench.press("7", "c")
        await bench.scan(120)
        yield bench


async def test_a_pin_goes_from_the_key_to_the_ledger_and_back() -> None:
    async with stepped(WIDE) as bench:
        await bench.press("n")
        await bench.scan(2)
        assert "16#7004 connected" in bench.text
        assert "EN_R is 0" in bench.text
        assert ": set TRCV_C_1 EN_R=0  ✓" in bench.text


async def test_a_fin_in_a_job_is_explained() -> None:
    async with stepped(WIDE) as bench:
        await bench.send("01 02 03")
        await bench.press("7", "f")
        await bench.scan(4)
        assert "E◆" in bench.text
        assert "80A6" in bench.text
        assert "80C5" in bench.text
        assert "the partner closed" in bench.text


async def test_hold_and_single_scans_are_the_benchs_own() -> None:
    async with stepped(WIDE) as bench:
        before = bench.app.view_model.snapshot
        await bench.press("space")
        await bench.scan(5)
        held = bench.app.view_model.snapshot
        await bench.press("full_stop")
        await bench.scan(5)
        after = bench.app.view_model.snapshot
        assert before and held and after
        assert (held.scan, after.scan) == (before.scan, before.scan + 1)
        assert "‖ HOLD" in bench.text


async def test_a_byte_tells_the_recv_call_and_the_message_it_came_with() -> None:
    async with stepped(WIDE) as bench:
        await bench.send("01 02 03 04 05")
        await bench.send("06 07 08")
        await bench.press("5", *["right"] * 7)
        assert "byte 6 = 16#07 = 7 · job 1 · recv 2, scan" in bench.text
        assert "P1 #2 byte 1" in bench.text
