"""Pane 2: the pins are the toggles; every toggle is a bench command."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.tui.fakes import connecting, picture, receiving
from tests.tui.looking import BOTH, SMALL, WIDE, looking


@BOTH
@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("n", "set TRCV_C_1 EN_R=0"),
        ("t", "set TRCV_C_1 CONT=0"),
        ("a", "set TRCV_C_1 ADHOC=1"),
        ("x", "pulse TRCV_C_1 COM_RST"),
    ],
)
async def test_one_key_toggles_a_pin(size: tuple[int, int], key: str, line: str) -> None:
    async with looking(size) as looker:
        await looker.press("2", key)
        assert looker.lines == [line]
        assert line in looker.text, "the command of a toggle stands in the prompt's line"


@BOTH
async def test_a_click_on_an_output_does_nothing(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("2")
        await looker.pilot.click("#block", offset=(34, 3))
        await looker.settle()
        assert looker.lines == []


async def test_a_toggle_is_marked_as_pending_until_a_scan_took_it() -> None:
    async with looking(WIDE) as looker:
        await looker.press("n")
        assert "□ 0…" in looker.line("EN_R ─┤")
        off = replace(receiving(), inputs=(("EN_R", False), *receiving().inputs[1:]))
        await looker.show(picture(off, connecting(), scan=921))
        assert "□ 0 " in looker.line("EN_R ─┤")


async def test_two_quick_toggles_go_there_and_back() -> None:
    async with looking(WIDE) as looker:
        await looker.press("n", "n")
        assert looker.lines == ["set TRCV_C_1 EN_R=0", "set TRCV_C_1 EN_R=1"]


async def test_a_toggle_that_was_refused_falls_back() -> None:
    async with looking(WIDE) as looker:
        await looker.press("n")
        await looker.show(picture(scan=922))
        assert "■ 1 " in looker.line("EN_R ─┤")


@BOTH
async def test_the_cursor_walks_the_pins_and_enter_toggles(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("2", "down", "down", "down", "enter")
        assert looker.lines == ["set TRCV_C_1 ADHOC=1"]
        assert "0 static: exact length" in looker.text, "the pin under the cursor is explained"


async def test_the_largest_len_is_never_cut() -> None:
    huge = replace(
        receiving(), inputs=(*receiving().inputs[:2], ("LEN", 4294967295), *receiving().inputs[3:])
    )
    async with looking(SMALL, picture(huge, connecting())) as looker:
        await looker.press("2")
        assert "4294967295" in looker.line("LEN ─┤")


async def test_an_instance_without_data_says_so() -> None:
    bare = replace(receiving(), data=None)
    async with looking(WIDE, picture(bare, connecting())) as looker:
        assert "not wired" in looker.text
        assert "no DATA" in looker.text
