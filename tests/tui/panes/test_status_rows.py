"""The places of the panes: what stands beside what, which tabs are marked, heights that nothing moves."""

from __future__ import annotations

import pytest

from tests.tui.looking import SMALL, WIDE, Looker, follow, looking
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.tui.main import LEAST_HEIGHT, LEAST_WIDTH, REST_ROW, TABS_CLASS, row_heights, size_classes
from trcvtui.tui.panes.function_block import FRAMER_ROWS, ROWS

PAIRED = pytest.mark.parametrize("size", [(100, 30), (120, 36), (127, 60)], ids=str)
ROOMY = pytest.mark.parametrize("size", [(100, 30), (128, 38), WIDE, (180, 45), (200, 55)], ids=str)
PANES = ("block", "status", "history", "timing", "received", "udt", "peer")
OF_BYTES = 5  # rows of the bytes, their frame included: less shows nothing
MOST_FRAMES = 50


def heights(looker: Looker) -> dict[str, int]:
    return {id: looker.app.main.query_one(f"#{id}").outer_size.height for id in PANES}


def marked(looker: Looker) -> list[str]:
    parts = looker.app.main.tabs.line().parts
    return [text.strip() for text, style in parts if style == "key cursor strong"]


@PAIRED
async def test_block_and_status_or_bytes_and_members_stand_side_by_side(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        for pane, pair, titles in (
            ("2", ["2", "3"], ("2 TRCV_C_1", "3 STATUS")),
            ("6", ["5", "6"], ("5 Received ·", "6 Telegram")),
            ("3", ["2", "3"], ("2 TRCV_C_1", "3 STATUS")),
            ("5", ["5", "6"], ("5 Received ·", "6 Telegram")),
        ):
            await looker.press(pane)
            assert titles[1] in looker.line(titles[0]), "whichever has the focus"
            assert marked(looker) == pair
        await looker.press("8")
        assert marked(looker) == ["8"]
        await looker.press("5", "M")
        assert not looker.app.main.table.display, "a zoomed pane has the screen for itself"


@PAIRED
async def test_the_peer_stands_below_status_and_is_whole(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("7")
        for _ in range(MOST_FRAMES):  # the peer's fields come when the first frame stands
            if "no reply rules" in looker.pane("peer"):
                break
            await follow(looker.app, looker.pilot)
        assert "no reply rules" in looker.pane("peer")
        assert "why" in looker.pane("status") and marked(looker) == ["3", "7"]


async def test_tabs_stand_in_the_order_of_their_digits_and_status_is_open_first() -> None:
    async with looking(SMALL) as looker:
        tabs = [word for word in looker.line("2 Block").split() if word.isdigit()]
        assert (tabs, marked(looker)) == (["2", "3", "4", "5", "6", "7", "8"], ["3"])
        await looker.press("2")
        assert "RCVD_LEN" in looker.pane("block") and not looker.app.main.status.display


@ROOMY
async def test_long_advice_moves_no_pane_and_all_of_it_can_be_read(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        await looker.press("down", "3")
        short, before = heights(looker), len(looker.app.main.status._rows)
        await fail_four_times(looker)
        assert (heights(looker), len(looker.app.main.status._rows) > before) == (short, True)
        await looker.press("M")
        assert "Check LocalAddress" in looker.words("status"), looker.text


async def fail_four_times(looker: BenchLooker) -> None:
    failures = ("socket EMFILE", "bind EADDRINUSE", "poll_add ENOSPC", "connect ENETUNREACH")
    looker.bench.do("set TRCV_C_2 CONT=1")
    for failure in failures:
        looker.bench.do(f"fault {failure} on C2 times=1", scans=110)
    await looker.pictures()


@pytest.mark.parametrize("size", [WIDE, (200, 55)], ids=str)
async def test_block_has_no_empty_rows_and_why_in_history_has_the_whole_width(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        main = looker.app.main
        assert main.block.size.height - main.block.row_count() in (0, 2)
        assert main.history.outer_size.width == size[0] - (
            main.status.outer_size.width if size[0] > 180 else 0
        )
        assert "…" not in looker.pane("history")


async def test_at_200x55_status_and_timing_are_whole_and_in_a_smaller_window_they_stand_as_before() -> None:
    async with on_a_bench((200, 55)) as looker:
        main = looker.app.main
        await fail_four_times(looker)
        for pane in (main.block, main.status, main.timing):
            assert pane.virtual_size.height <= pane.size.height, pane.id
        beside = main.timing.outer_size.width + main.block.outer_size.width
        assert main.history.outer_size.width == beside and main.status.region.x == beside
        for width, is_broad in ((140, False), (200, True)):
            await looker.pilot.resize_terminal(width, 55)
            await looker.pictures()
            assert (main.timing.region.x < main.status.region.x) == is_broad


@pytest.mark.parametrize("block", [ROWS, FRAMER_ROWS])
@pytest.mark.parametrize("timing", [False, True])
def test_bytes_keep_their_rows_at_every_size(block: int, timing: bool) -> None:
    for width in (LEAST_WIDTH, 140, 180):
        for height, instances in ((h, n) for h in range(LEAST_HEIGHT, 80) for n in (1, 3, 20)):
            holds = size_classes(width, height, instances, block)
            panes = height - min(10, instances + 2) - 3
            rows = row_heights(holds, panes, timing, block, peers=3)
            left = panes - sum(rows)
            assert holds[TABS_CLASS] or (left >= OF_BYTES and rows.count(REST_ROW) == 1), (
                width,
                height,
                instances,
            )


@pytest.mark.parametrize(
    ("label", "is_there"),
    [("why", True), ("do", True), ("check", True), ("usually means", True), ("next", False), ("else", False)],
)
async def test_the_card_has_four_labels(label: str, is_there: bool) -> None:
    async with on_a_bench((140, 60)) as looker:
        await looker.press("down")
        await fail_four_times(looker)
        await looker.press("3", "M")
        labels = [text.strip() for each in looker.app.main.status._rows for text, style in each.parts[:1]
                  if style == "label"]  # fmt: skip
        assert (label in labels) is is_there


async def test_keys_and_commands_to_do_have_the_accent_colour() -> None:
    async with on_a_bench(WIDE) as looker:
        await looker.press("down")
        await fail_four_times(looker)
        looker.bench.do("fault bind EADDRINUSE on C2 times=1", scans=110)
        await looker.pictures()
        parts = [part for each in looker.app.main.status._rows for part in each.parts]
        assert ("fault clear", "key ") in parts and not any("`" in text for text, _ in parts)
