"""The whole screen as text, at both sizes that the product promises."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.tui.fakes import armed, connecting, picture, received, receiving, story, written
from tests.tui.looking import SMALL, WIDE, looking, same_as_snapshot

PULSE = written((880, armed()), (902, received(8)), (903, armed()))


@pytest.mark.parametrize(("size", "name"), [(WIDE, "bench-140x45"), (SMALL, "bench-80x24")])
async def test_the_bench_stands_on_the_screen_as_drawn(
    size: tuple[int, int], name: str, tmp_path: Path
) -> None:
    async with looking(size, picture(lines=story())) as looker:
        same_as_snapshot(looker, name, tmp_path)


@pytest.mark.parametrize("digit", "234567")
async def test_each_tab_of_a_small_screen_stands_as_drawn(digit: str, tmp_path: Path) -> None:
    async with looking(SMALL, picture(lines=story())) as looker:
        await looker.press(digit)
        same_as_snapshot(looker, f"tab-{digit}-80x24", tmp_path)


@pytest.mark.parametrize(("size", "name"), [(WIDE, "pulse-140x45"), (SMALL, "pulse-80x24")])
async def test_a_pulse_stands_on_the_screen_as_drawn(
    size: tuple[int, int], name: str, tmp_path: Path
) -> None:
    job = replace(receiving(have=1, need=8), data="small", last_done_scan=902, last_rcvd_len=8)
    seen = picture(job, connecting(), lines=PULSE, data=bytes(range(8)), partial=b"A")
    async with looking(size, seen) as looker:
        same_as_snapshot(looker, name, tmp_path)


@pytest.mark.parametrize(("size", "name"), [(WIDE, "help-140x45"), (SMALL, "help-80x24")])
async def test_the_help_stands_on_the_screen_as_drawn(
    size: tuple[int, int], name: str, tmp_path: Path
) -> None:
    async with looking(size) as looker:
        await looker.press("question_mark")
        same_as_snapshot(looker, name, tmp_path)


@pytest.mark.parametrize("size", [(w, h) for w in (80, 100, 116, 140, 200) for h in (24, 34, 45, 60)])
async def test_no_word_is_cut_without_a_sign_at_any_size(size: tuple[int, int]) -> None:
    async with looking(size, picture(lines=story())) as looker:
        text = looker.text
    assert max(len(line) for line in text.splitlines()) <= size[0]
    for words in ("TRCV_C_1", "7006 receiving", "RUN", "scan 920", "EN_R ─┤", "RCVD_LEN", "? help", "q quit"):
        assert words in text, f"{words!r} is not whole at {size}:\n{text}"
