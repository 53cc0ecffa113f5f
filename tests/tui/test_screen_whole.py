"""The whole bench at 140x45: timing is a strip of its own, every number stands whole, nobody loses a row."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.tui.fakes import armed, connecting, picture, received, receiving, written
from tests.tui.looking import WIDE, looking
from tests.tui.on_a_bench import on_a_bench

LONG = written((880, armed()), (902, received(65535)), (903, armed()))


async def test_timing_stands_beside_history_from_the_first_frame_on() -> None:
    async with on_a_bench() as looker:
        looker.bench.do("set TRCV_C_1 CONT=1 EN_R=1")
        looker.bench.scan(5)
        looker.bench.do("peer P1 connect")
        looker.bench.scan(9)
        await looker.pictures()
        strip = looker.pane("timing").splitlines()
        assert [line.split()[0].lstrip("▸") for line in strip[2:5]] == ["STATUS", "EN_R", "DONE"]
        assert "7006" in strip[2]
        assert "why" in looker.pane("history") and "receiving" in looker.pane("history")
        assert looker.app.main.query_one("#peer").size.height == 8, "ten rows with its frame"
        await looker.press("8")
        assert "codes" in looker.pane("timing"), "with the focus it gets more"
        assert "4 History" in looker.text


@pytest.mark.parametrize("size", [WIDE, (160, 50), (200, 60)])
async def test_all_eight_panes_stand(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        for pane in (
            "1 Instances",
            "2 TRCV",
            "3 STATUS",
            "4 History",
            "5 Received",
            "6 ",
            "7 Peer",
            "8 Timing",
        ):
            assert pane in looker.text


async def test_the_length_of_a_long_job_stands_whole_in_block_and_history() -> None:
    whole = replace(receiving(), last_rcvd_len=65535)
    shown = picture(whole, connecting(), scan=910, t_ns=9_090_000_000, lines=LONG)
    async with looking(WIDE, shown) as looker:
        assert "◂65535" in looker.line("RCVD_LEN", "block")
        assert "■ DONE 65535 B  " in looker.line("65535", "history")


async def test_the_marks_of_pulses_stand_below_each_other() -> None:
    other = replace(connecting(), have=0, need=0)
    lines = written((902, received(24)), (903, replace(received(8), instance="TRCV_C_2")))
    async with looking(
        WIDE, picture(receiving(), other, scan=910, t_ns=9_090_000_000, lines=lines)
    ) as looker:
        marks = [line.index("◂ scan") for line in looker.text.splitlines() if "◂ scan" in line]
        assert len(marks) == 2 and marks[0] == marks[1]


async def test_the_last_error_is_never_cut_in_its_number() -> None:
    late = replace(receiving(), last_error_status=0x80A1, last_error_scan=123456)
    for size in ((80, 24), (200, 60)):
        async with looking(
            size, picture(late, connecting(), lines=LONG, scan=910, t_ns=9_090_000_000)
        ) as looker:
            await looker.press("3")
            assert "last error 16#80A1 in scan 123456" in looker.words("status")
