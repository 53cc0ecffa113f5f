"""Panes 5 and 6: bytes beside members, linked both ways; bytes are data and nothing else."""

from __future__ import annotations

import re

from tests.tui.fakes import TELEGRAM, connecting, picture, receiving
from tests.tui.looking import BOTH, SMALL, WIDE, looking
from trcvtui.tui.panes.udt_table import UdtTable

ALL = bytes(range(256))


async def test_a_row_drawn_right_after_another_instance_is_chosen_is_of_its_own_data() -> None:
    async with looking(WIDE, picture(receiving(), connecting())) as looker:
        table = looker.app.main.query_one(UdtTable)
        looker.app.view_model.selected = "TRCV_C_2"  # and nothing has been shown since
        assert "[0]" in str(table.row_at(0))


async def test_the_mouse_links_both_ways() -> None:
    async with looking(WIDE) as looker:
        await looker.pilot.click("#data", offset=(6 + 3 * 5, 0))
        await looker.settle()
        assert looker.app.main.table.cursor == 1
        await looker.pilot.click("#udt", offset=(10, 4))
        await looker.settle()
        assert looker.app.main.received.data.link == range(8, 12)


async def test_a_click_in_the_text_column_is_a_byte_too() -> None:
    async with looking(WIDE) as looker:
        text = looker.line(")⋄")
        row = next(n for n, line in enumerate(looker.text.splitlines()) if ")⋄" in line)
        await looker.pilot.click(None, offset=(text.index(")⋄") + 9, row))
        await looker.settle()
        assert looker.app.main.received.data.cursor == 9


async def test_padding_belongs_to_no_member() -> None:
    async with looking(WIDE) as looker:
        await looker.press("5", *["right"] * 8)
        assert looker.app.main.received.data.cursor == 7
        assert looker.app.main.received.data.link == range(0)
        assert "▸   6 alarm" in looker.text, "the member before the padding is marked"


@BOTH
async def test_the_running_job_is_decoded_as_far_as_it_goes(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("6")
        assert "v: job, 17 of 24 B" in looker.text, "the title says that there is more than DATA"
        await looker.press("v")
        assert "job, 17 of 24 B · v: DATA" in looker.text
        assert "5 of 10 B" in looker.line("tag", "udt"), "a member that is partly here is a ghost"
        assert "+ 2 B padding" in looker.line("tag", "udt")
        assert "1234.5" in looker.text
        await looker.press("v")
        assert "'hello'" in looker.line("tag", "udt"), "DATA again"


async def test_a_member_that_is_not_here_at_all_is_a_dash() -> None:
    seen = picture(receiving(have=9), connecting(), partial=TELEGRAM[:9])
    async with looking(WIDE, seen) as looker:
        await looker.press("v")
        assert "1 of 4 B" in looker.line("speed", "udt")
        assert re.search(r"tag +STRING\[8\] +-", looker.line("tag", "udt"))


async def test_a_click_on_the_title_changes_over_to_the_job_and_back() -> None:
    async with looking(WIDE) as looker:
        await looker.pilot.click("#udt", offset=(12, 0))
        await looker.settle()
        assert "5 of 10 B" in looker.line("tag", "udt")
        await looker.pilot.click("#udt", offset=(12, 0))
        await looker.settle()
        assert "'hello'" in looker.line("tag", "udt")


@BOTH
async def test_members_and_bytes_of_the_job_find_each_other(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("v", "6", *["down"] * 4)
        received = looker.app.main.received
        assert (received.job.link, received.data.link) == (range(8, 12), range(0))
        await looker.press("5", *["right"] * 4)
        assert looker.app.focused is received.job
        assert looker.app.main.table.chosen_field() == range(12, 22)
        assert received.job.link == range(12, 22)


async def test_a_job_without_bytes_is_no_news_for_the_title() -> None:
    async with looking(WIDE, picture(receiving(have=0), connecting(), partial=b"")) as looker:
        assert "v: job" not in looker.text


async def test_a_large_variable_is_drawn_from_any_place() -> None:
    large = ALL * 256
    async with looking(SMALL, picture(data=large, partial=b"")) as looker:
        await looker.press("5", "right", "G")
        assert looker.app.main.received.data.cursor == 65535
        assert "fff0  f0 f1" in looker.text
        await looker.press("g")
        assert "0000  00 01" in looker.text
