"""STATUS is seen at every size, and its advice is never cut: panes that leave rows empty give them."""

from __future__ import annotations

import pytest

from tests.tui.looking import SMALL, WIDE, follow, looking
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.tui.main import REST, grown

PAIRED = pytest.mark.parametrize("size", [(100, 30), (120, 36), (127, 60)], ids=str)
ROOMY = [(100, 30), (128, 38), WIDE, (180, 45), (200, 60)]

MOST_FRAMES = 50


@PAIRED
async def test_status_stands_beside_block_from_100x30_on(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        for pane in ("2", "3"):
            await looker.press(pane)
            both = looker.line("3 STATUS ─" if pane == "2" else "3 STATUS ━")
            assert "2 TRCV_C_1" in both, "side by side, whichever has the focus"
            assert "next" in looker.pane("status") and "RCVD_LEN" in looker.pane("block")


@PAIRED
async def test_status_gets_the_rows_that_the_peer_leaves_empty(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("7")
        for _ in range(MOST_FRAMES):  # the peer's fields come when the first frame stands
            if "no reply rules" in looker.pane("peer"):
                break
            await follow(looker.app, looker.pilot)
        assert "next" in looker.pane("status")
        assert "no reply rules" in looker.pane("peer"), "and the peer keeps all of its own"
        await looker.press("5")
        assert not looker.app.main.status.display, "bytes want the whole place"


async def test_status_is_the_first_tab_and_the_open_one_at_80x24() -> None:
    async with looking(SMALL) as looker:
        assert looker.line("2 Block").split()[:4] == ["3", "STATUS", "2", "Block"]
        assert "next" in looker.pane("status")
        await looker.press("2")
        assert "RCVD_LEN" in looker.pane("block") and not looker.app.main.status.display


async def test_a_zoomed_pane_has_the_screen_for_itself() -> None:
    async with looking((100, 30)) as looker:
        await looker.press("3", "M")
        assert "RCVD_LEN" not in looker.text
        await looker.press("M")
        assert "RCVD_LEN" in looker.text


@pytest.mark.parametrize("size", ROOMY, ids=str)
async def test_the_advice_of_a_long_story_is_whole(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        await fail_four_times(looker)
        await looker.press("down", "3")
        card = looker.app.main.status
        advice = "look at LocalAddress"
        assert advice in looker.words("status"), looker.text
        assert card.least_rows <= card.size.height, looker.text


async def fail_four_times(looker: BenchLooker) -> None:
    """Let four attempts of TRCV_C_2 fail, each in another way."""
    failures = ("socket EMFILE", "bind EADDRINUSE", "poll_add ENOSPC", "connect ENETUNREACH")
    looker.bench.do("set TRCV_C_2 CONT=1")
    for failure in failures:
        looker.bench.do(f"fault {failure} on C2 times=1")
        looker.bench.scan(110)
    await looker.pictures()


async def test_rows_come_back_when_status_has_needed_less_for_three_seconds() -> None:
    async with on_a_bench(WIDE) as looker:
        await looker.press("down", "3")
        before = looker.app.main.status.size.height
        await fail_four_times(looker)
        most = looker.app.main.status.size.height
        assert most > before
        looker.bench.do("fault clear", "set TRCV_C_2 CONT=0")
        looker.bench.scan(9)
        await looker.pictures()
        assert looker.app.main.status.size.height == most, "nothing jumps"
        await looker.pictures(70)
        assert looker.app.main.status.size.height == before


def test_the_peer_gives_first_then_the_past_then_the_bytes() -> None:
    assert grown((6, 9, 5, REST, 10), 36, status=7, peer=9) == (7, 9, 5, REST, 9)
    assert grown((6, 9, 5, REST, 10), 36, status=8, peer=9) == (8, 9, 4, REST, 9)
    assert grown((6, 9, 5, REST, 10), 36, status=13, peer=9) == (13, 5, 4, REST, 9)
    assert grown((6, 9, 5, REST, 10), 36, status=5, peer=9) == (6, 9, 5, REST, 10), "none is taken"
    assert sum(grown((6, 9, 5, REST, 10), 36, status=99, peer=9)) == 36 - 5, "five are left for bytes"
