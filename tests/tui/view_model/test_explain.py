"""Pane 3 on a true bench: three faults are named with their numbers; the view freezes by key or trigger."""

from __future__ import annotations

import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from msgspec.structs import replace

from tests.tui.fakes import bench_project, connecting, picture, receiving, showing
from tests.tui.looking import BOTH, SMALL, WIDE, looking
from tests.tui.on_a_bench import LocalLooker, on_local
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.snapshots.bench import TriggerEvent

SIZES = pytest.mark.parametrize("size", [SMALL, (120, 40), (200, 60)], ids=["80x24", "120x40", "200x60"])
UP = ("set TRCV_C_1 CONT=1 EN_R=1", "run 4", "peer P1 connect", "run 4")
SWAPPED = struct.pack(">ihBxf", 41, 1, 1, 1234.5) + b"\x08\x05hello\x00\x00\x00\x00\x00"


class Desk(LocalLooker):
    async def do(self, *lines: str) -> None:
        """Carry out bench commands; `run` lets scans pass. Then wait until the screen shows it."""
        self.bench.play(*lines)
        await self.see()

    @property
    def header(self) -> str:
        return self.text.splitlines()[0]

    @property
    def scan(self) -> int:
        return self.bench.bench.runtime.scans


@asynccontextmanager
async def at_the_desk(size: tuple[int, int], *lines: str) -> AsyncIterator[Desk]:
    async with on_local(Desk, bench_project(), size) as desk:
        await desk.do(*lines)
        yield desk


# -- why: three faults ---------------------------------------------------------------------------------


FAULTS = {
    "short": (("peer P1 send random 20 seed=1", "run 300"), "Stuck: 20 of 24 bytes received"),
    "swapped": ((f"peer P1 send hex {SWAPPED.hex(' ')}", "run 5"), "speed = 1234.5 and id = 41"),
    "dropped": (
        ("peer P1 send random 24 seed=1 split=4 gap=T#100ms", "run 3", "set TRCV_C_1 EN_R=0", "run 2",
         "set TRCV_C_1 EN_R=1", "run 200"),
        "EN_R fell in scan 12 with 4 of 24 bytes collected",
    ),
}  # fmt: skip


@SIZES
async def test_a_fault_is_named_with_its_numbers(size: tuple[int, int]) -> None:
    for lines, numbers in FAULTS.values():
        async with at_the_desk(size, *UP, *lines) as desk:
            await desk.press("3", "M")
            assert numbers in desk.words("status")


async def test_an_edge_of_the_past_is_explained_with_its_own_numbers() -> None:
    lost = ("peer P1 send random 20 seed=1", "run 3", "peer P1 close", "run 300")
    async with at_the_desk(WIDE, *UP, *lost) as desk:
        await desk.press("4", "M", "down", "down", "3")
        card = desk.words("status")
        assert "in the past" in card
        assert "closed the connection (FIN) when the job had 20 of 24 bytes" in card
        assert "messages had 20 bytes, but a frame has 24; missing: 4 bytes" in card


async def test_the_newest_edge_is_explained_with_the_numbers_of_now() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.press("4", "M", "down", "3")
        assert "none received yet" in desk.words("status")
        await desk.do("peer P1 send random 20 seed=1", "run 300")
        assert "Stuck: 20 of 24 bytes received" in desk.words("status")
        await desk.do("peer P1 send random 4 seed=1", "run 9")
        assert "20 of 24 bytes had been received" in desk.words("status"), (
            "up to the last scan in which it showed"
        )


async def test_words_from_outside_are_never_markup() -> None:
    cause = Cause(CauseKind.PARTNER, "the partner reset", peer="[red]x\x1b[31m", have=1, need=8)
    lost = replace(showing(receiving(), 0x80AA), need=0, condition=str(Condition.RECEIVE_FAILED), cause=cause)
    async with looking(WIDE, picture(lost, connecting())) as looker:
        await looker.press("3", "M")
        assert "[red]x" in looker.words("status")
        assert "\x1b" not in looker.text


# -- the frozen view -----------------------------------------------------------------------------------


@BOTH
async def test_f_freezes_the_view_while_the_plc_runs_on(size: tuple[int, int]) -> None:
    async with at_the_desk(size, *UP) as desk:
        await desk.press("3", "F")
        assert "FROZEN at scan 8" in desk.header
        await desk.do("peer P1 send random 24 seed=1", "run 100")
        assert "FROZEN at scan 8" in desk.header
        assert desk.scan == 108, "the PLC has run on"
        assert "none received yet" in desk.words("status")
        assert "none received yet. The last" not in desk.words("status")
        await desk.press("F")
        await desk.see()
        assert "FROZEN" not in desk.header
        assert "was delivered in scan 9, 0.9 s ago" in desk.words("status")


@BOTH
async def test_another_instance_of_a_frozen_view_shows_its_own_bytes_of_then(size: tuple[int, int]) -> None:
    lines = "write small hex 0102030405060708", "set TRCV_C_2 CONT=1"
    async with at_the_desk(size, *UP, *lines, "run 1") as desk:
        await desk.press("F")
        await desk.do("write small hex FFFFFFFFFFFFFFFF", "run 100")
        await desk.press("1", "down", "5")
        assert desk.app.view_model.selected == "TRCV_C_2"
        assert "01 02 03 04 05 06 07 08" in desk.words("data")
        assert "FROZEN at scan 9" in desk.header
        await desk.press("F")
        await desk.see()
        assert "ff ff ff ff ff ff ff ff" in desk.words("data")


async def test_a_frozen_view_says_whose_bytes_it_has_not_kept() -> None:
    async with looking(WIDE) as looker:
        await looker.press("F", "1", "down", "5")
        assert looker.app.view_model.selected == "TRCV_C_2"
        assert "the view froze without these bytes: F goes back to live" in looker.pane("received")
        await looker.press("1", "up", "5")
        assert "not kept" not in looker.pane("received")


async def test_what_comes_along_for_a_frozen_view_is_bounded() -> None:
    many = [replace(receiving(), name=f"R{n}", data="rx") for n in range(300)]
    large = replace(receiving(), name="L", data="small")
    async with looking(WIDE, picture(receiving(), large, *many)) as looker:
        looker.app.view_model._sizes["small"] = 65_535
        assert looker.app.view_model.make_request().data == ("rx",)
        assert looker.app.view_model.make_request().partial_of == ("TRCV_C_1", *(f"R{n}" for n in range(16)))


async def test_no_edge_of_a_frozen_time_is_lost() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.press("F")
        for _ in range(300):
            desk.bench.submit("peer P1 send random 24 seed=1")
            desk.bench.scan(4)
        await desk.see()
        frozen = len(desk.app.view_model.history.list_edges("TRCV_C_1"))
        await desk.press("F")
        await desk.see()
        assert len(desk.app.view_model.history.list_edges("TRCV_C_1")) == frozen + 600
        assert desk.app.view_model.history.skipped == 0


async def test_a_command_is_answered_while_the_view_is_frozen() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.press("F", "colon")
        await desk.type("set TRCV_C_1 LEN=9")
        await desk.press("enter")
        await desk.see()
        assert "set TRCV_C_1 LEN=9  ✓" in desk.text


@BOTH
async def test_a_trigger_freezes_the_view_in_its_scan_and_the_header_names_it(size: tuple[int, int]) -> None:
    async with at_the_desk(size, *UP) as desk:
        await desk.press("T")
        await desk.type("TRCV_C_1 RCVD_LEN=24")
        await desk.press("enter")
        await desk.see()
        assert "trigger armed: TRCV_C_1 RCVD_LEN=24" in desk.header
        await desk.do("peer P1 send random 24 seed=1", "run 50")
        assert "TRIGGER TRCV_C_1 RCVD_LEN=24" in desk.header
        assert "FROZEN at scan 9" in desk.header
        assert desk.scan == 58
        await desk.press("3")
        assert "16#7008" in desk.line("Frame received", "status"), "what shows for one scan stands still"
        await desk.press("F")
        await desk.see()
        assert "TRIGGER" not in desk.header
        assert "16#7006" in desk.line("Receiving", "status")


async def test_a_trigger_with_hold_stops_the_scans_and_a_single_scan_goes_on_from_there() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.do("trigger TRCV_C_1 STATUS=7008 hold", "peer P1 send random 24 seed=1", "run 50")
        assert desk.scan == 9
        assert "HOLD" in desk.header
        assert "FROZEN at scan 9" in desk.header
        await desk.press("full_stop")
        await desk.do("run 1")
        assert desk.scan == 10
        assert "FROZEN" not in desk.header
        assert "scan 10" in desk.header


async def test_a_fresh_bench_is_not_frozen() -> None:
    async with looking(WIDE, picture(fired_at := receiving(), connecting())) as looker:
        fired = TriggerEvent(1, "TRCV_C_1 STATUS=7006", 920, 0)
        await looker.show(replace(picture(fired_at, connecting()), fired=fired))
        assert looker.app.view_model.is_frozen
        await looker.show(replace(picture(), bench=1))
        assert not looker.app.view_model.is_frozen
