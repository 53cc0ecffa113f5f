"""Panes 1, 3 and 4: STATUS, why, what next; pulses of one scan stay visible; the past can be asked."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.tui.fakes import (
    MS,
    SECOND,
    armed,
    connecting,
    edge,
    picture,
    received,
    receiving,
    showing,
    story,
    written,
)
from tests.tui.looking import BOTH, SMALL, WIDE, looking
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.plc.ledger import BenchNote, Line


@BOTH
async def test_j_selects_the_next_instance_for_all_panes(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("1", "j", "2")
        assert "2 TRCV_C_2" in looker.text
        await looker.settle()
        assert looker.driver.requests[-1].partial_of == ("TRCV_C_2", "TRCV_C_1")
        assert looker.driver.requests[-1].data == ("small", "rx")


async def test_a_click_selects_an_instance() -> None:
    async with looking(WIDE) as looker:
        await looker.pilot.click("#instances", offset=(8, 2))
        await looker.settle()
        assert "▸ TRCV_C_2" in looker.text


@BOTH
async def test_an_active_connect_tells_its_attempts(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("1", "j", "3")
        why = "Waiting for 10.0.0.7:2001; 7 attempts so far, the next in 0.4 s"
        assert why in looker.words("status")


@BOTH
async def test_an_injected_error_is_called_injected(size: tuple[int, int]) -> None:
    cause = Cause(CauseKind.KERNEL, "bind failed", call="bind", error="EADDRINUSE", injected=True)
    wrong = replace(
        showing(receiving(0, 0), 0x8083, error=True),
        condition=str(Condition.BIND_FAILED),
        cause=cause,
    )
    event = edge(0x8083, Condition.BIND_FAILED, error=True, cause=cause)
    async with looking(size, picture(wrong, connecting(), lines=written((910, event)))) as looker:
        await looker.press("3")
        assert "Injected fault: bind gave EADDRINUSE" in looker.line("why")
        assert "ERROR" in looker.line("16#8083", "status"), "the word stands beside the colour"
        await looker.press("4")
        assert "injected" in looker.line("910", "history")


# -- pulses of one scan --------------------------------------------------------------------------------


@BOTH
async def test_a_done_of_one_scan_glows_with_its_scan_for_a_second(size: tuple[int, int]) -> None:
    pulse = written((900, armed()), (902, received(24)), (903, armed()))
    async with looking(size, picture(lines=pulse, scan=903, t_ns=9_020 * MS)) as looker:
        await looker.press("2")
        assert "D◆" in looker.line("TRCV_C_1 ")
        assert "scan 902" in looker.line("DONE ", "block")
        assert "24 B" in looker.line("RCVD_LEN", "block")
        await looker.press("3")
        assert "DONE ◆ 24 B in scan 902" in looker.text
        await looker.show(picture(scan=1003, t_ns=10_020 * MS))
        assert "D□" in looker.line("TRCV_C_1 ")
        assert "◆" not in looker.text


@BOTH
async def test_an_error_of_one_scan_glows_with_its_status(size: tuple[int, int]) -> None:
    pulse = written((902, edge(0x80C5, Condition.PARTNER_CLOSED, error=True)), (903, armed()))
    async with looking(size, picture(lines=pulse)) as looker:
        await looker.press("2")
        assert "E◆" in looker.line("TRCV_C_1 ")
        assert "scan 902" in looker.line("ERROR ", "block")
        assert "was 80C5" in looker.line("STATUS", "block")


async def test_two_pulses_between_two_pictures_are_both_in_the_history() -> None:
    both = written((902, received(8)), (903, armed()), (904, received(8)), (905, armed()))
    async with looking((140, 60), picture(lines=both)) as looker:
        for scan in ("902", "903", "904", "905"):
            assert scan in looker.text
        assert looker.text.count("■ DONE 8 B") == 2


async def test_a_held_plc_glows_on() -> None:
    pulse = written((902, received(24)), (903, armed()))
    async with looking(WIDE, picture(lines=pulse, scan=903, t_ns=9_020 * MS)) as looker:
        for _ in range(3):
            await looker.show(picture(scan=903, t_ns=9_020 * MS, holding=True))
        assert "D◆" in looker.text


async def test_a_pulse_whose_line_was_skipped_glows_from_the_snapshot() -> None:
    late = replace(receiving(), last_done_scan=915, last_rcvd_len=24)
    async with looking(WIDE, picture(late, connecting(), skipped=7)) as looker:
        assert "scan 915" in looker.line("DONE ", "block")
        assert "7 lines came too fast" in looker.text


@BOTH
@pytest.mark.parametrize("what", ["deleted", "downloaded"])
async def test_a_new_instance_of_the_same_name_does_not_glow_with_the_pulses_of_the_old(
    size: tuple[int, int], what: str
) -> None:
    error = edge(0x80C5, Condition.PARTNER_CLOSED, error=True)
    pulse = *written((900, error), (902, received(24))), Line(3, 902, 9_010 * MS, BenchNote("TRCV_C_1", what))
    async with looking(size, picture(lines=pulse, scan=903, t_ns=9_020 * MS)) as looker:
        assert "◆" not in looker.line("TRCV_C_1 ")
        assert "scan 902" not in looker.text


async def test_a_new_instance_does_not_glow_where_the_end_of_the_old_one_was_skipped() -> None:
    pulse = written((902, received(24)), (903, armed()))
    async with looking(WIDE, picture(lines=pulse, scan=903, t_ns=9_020 * MS)) as looker:
        fresh = replace(receiving(), last_done_scan=None, last_rcvd_len=None, jobs_done=0)
        await looker.show(picture(fresh, connecting(), scan=904, t_ns=9_030 * MS, skipped=7))
        assert "scan 902" not in looker.line("DONE ", "block")


# -- the past ------------------------------------------------------------------------------------------


@BOTH
async def test_a_chosen_edge_is_explained_and_escape_returns_to_now(size: tuple[int, int]) -> None:
    async with looking(size, picture(lines=story())) as looker:
        await looker.press("4", "down", "down", "down", "down")
        await looker.press("3")
        assert "scan 640, in the past" in looker.text
        assert "Injected fault: buffer gave ENOBUFS" in looker.line("why")
        await looker.press("4", "escape", "3")
        assert "in the past" not in looker.text


async def test_a_chosen_edge_stays_chosen_while_newer_ones_come_in() -> None:
    async with looking(SMALL, picture(lines=story())) as looker:
        await looker.press("4", "down", "down")
        more = written((921, received(24)), (922, armed()), first=14)
        await looker.show(picture(lines=more, scan=922, t_ns=10 * SECOND))
        await looker.press("3")
        assert "scan 811, in the past" in looker.text


async def test_the_history_is_bounded() -> None:
    flood = written(*((n, received(8) if n % 2 else armed()) for n in range(1, 3001)))
    async with looking(WIDE, picture(lines=flood, scan=3000, t_ns=30 * SECOND)) as looker:
        assert len(looker.app.view_model.history.list_edges("TRCV_C_1")) == 1000
        await looker.press("4", "end")
        assert "2001" in looker.text


async def test_stop_and_faults_stand_in_the_header() -> None:
    async with looking(SMALL, picture(running=False, faults=("recv",))) as looker:
        header = looker.text.splitlines()[0]
        assert "■ STOP" in header
        assert "1 FAULT ARMED" in header
