"""TSEND_C on the screen: how far its bytes have come, its dead link, its call in Structured Text."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.tui.fakes import connections, peers, picture, receiving
from tests.tui.looking import BOTH, WIDE, looking
from trcvtui.rig.picture import Picture


def sending(unacknowledged: int | None = 4000, have: int = 0, need: int = 0) -> Picture:
    """Return an instance of TSEND_C on C1, whose partner is the peer P1."""
    block = replace(
        receiving(),
        block="TSEND_C",
        inputs=(("REQ", False), ("CONT", True), ("LEN", 0), ("COM_RST", False)),
        have=have,
        need=need,
    )
    up = replace(
        connections()[0], bytes_sent=12000, unacknowledged=unacknowledged, keep_alive_s=10, receivers=()
    )
    shown = picture(block)
    peer = replace(peers()[0], local=up.remote, remote=up.local, received_here=7777)
    return replace(shown, snapshot=replace(shown.snapshot, connections=(up,)), peers=(peer,))


@BOTH
async def test_it_shows_what_is_accepted_what_is_unacknowledged_and_what_the_peer_has_read(
    size: tuple[int, int],
) -> None:
    async with looking(size, sending()) as looker:
        await looker.press("5")
        assert "5 Sent" in looker.text
        assert "12000 B accepted · 4000 unacknowledged · 7777 read by P1" in looker.text


@BOTH
async def test_a_running_job_shows_what_the_stack_has_of_it(size: tuple[int, int]) -> None:
    async with looking(size, sending(have=300, need=1200)) as looker:
        await looker.press("5")
        assert "300 of 1200 B in the stack" in looker.text


async def test_what_the_system_does_not_say_is_left_out() -> None:
    async with looking(WIDE, sending(unacknowledged=None)) as looker:
        assert "12000 B accepted · 7777 read by P1" in looker.text


@pytest.mark.parametrize(("interval", "range_"), [(1, "2–3"), (10, "20–30")])
async def test_beside_the_keep_alive_stands_when_a_dead_link_shows(interval: int, range_: str) -> None:
    shown = sending()
    up = replace(shown.snapshot.connections[0], keep_alive_s=interval)
    shown = replace(shown, snapshot=replace(shown.snapshot, connections=(up,)))
    async with looking(WIDE, shown) as looker:
        assert f"keep-alive {interval} s: dead link in {range_} s" in looker.text


async def test_y_yanks_the_call_with_the_inputs_of_now() -> None:
    async with looking(WIDE) as looker:
        await looker.press("y", "c")
        await looker.app.workers.wait_for_complete()
        await looker.settle()
        text = looker.app.clipboard
        assert "TRCV_C_1(" in text and "EN_R:=TRUE" in text and "CONNECT:=C1" in text
        assert "yanked the call in Structured Text" in looker.text
