"""Fifty and 250 instances: found by words, by ERROR, by scrolling; the selection stays where it is."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.tui.fakes import NO_CAUSE, SECOND, connecting, picture, receiving, showing
from tests.tui.looking import BOTH, SMALL, WIDE, Looker, looking
from trcvtui.blocks.conditions import Condition
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.panes.instance_list import ListColumns
from trcvtui.tui.widgets.line_view import Row


def bench(count: int, *failed: int) -> BenchUpdate:
    """Return a bench of receivers named TRCV_C_1 ..; every fifth connects, the failed ones show 80C5."""
    return picture(*(one(n, n in failed) for n in range(1, count + 1)), selected="TRCV_C_1")


def one(n: int, failed: bool) -> InstanceSnapshot:
    instance = replace(receiving() if n % 5 else connecting(), name=f"TRCV_C_{n}")
    if failed:
        instance = replace(
            showing(instance, 0x80C5, error=True),
            condition=str(Condition.PARTNER_CLOSED),
            cause=NO_CAUSE,
        )
    return instance


def listed(looker: Looker) -> list[str]:
    return [line.split()[0] for line in looker.pane("instances").replace("▸", " ").splitlines()[1:-1]]


@BOTH
@pytest.mark.parametrize("count", [50, 250])
async def test_a_filter_lists_the_names_that_have_its_words(size: tuple[int, int], count: int) -> None:
    async with looking(size, bench(count)) as looker:
        await looker.type("/_4\r")
        assert listed(looker)[:2] == ["TRCV_C_4", "TRCV_C_40"]
        assert f"of {count} with _4, esc: all" in looker.text
        assert "2 TRCV_C_4" in looker.text or "▸ TRCV_C_4" in looker.text, "the first one is selected now"
        await looker.press("down")
        assert looker.app.view_model.selected == "TRCV_C_40"
        await looker.press("escape")
        assert len(looker.app.main.instances._listed) == count
        assert looker.app.view_model.selected == "TRCV_C_40", "and stays so"


@BOTH
async def test_a_filter_takes_a_code_or_an_address(size: tuple[int, int]) -> None:
    async with looking(size, bench(250, 77, 203)) as looker:
        await looker.type("/80c5\r")
        assert listed(looker) == ["TRCV_C_77", "TRCV_C_203"]
        await looker.press("escape")
        await looker.type("/10.0.0.7\r")
        assert listed(looker)[:2] == ["TRCV_C_5", "TRCV_C_10"]


async def test_while_it_is_typed_a_filter_moves_no_selection() -> None:
    async with looking(SMALL, bench(50)) as looker:
        await looker.press("down", "down")
        await looker.type("/_1")
        assert looker.app.view_model.selected == "TRCV_C_3"
        await looker.press("escape")
        assert looker.app.view_model.selected == "TRCV_C_3" and listed(looker)[0] == "TRCV_C_1"


async def test_words_that_no_instance_has_say_so() -> None:
    async with looking(SMALL, bench(50)) as looker:
        await looker.type("/zzz\r")
        assert "no instance has these words" in looker.pane("instances")
        assert looker.app.view_model.selected == "TRCV_C_1"


@BOTH
async def test_the_exclamation_mark_goes_from_error_to_error(size: tuple[int, int]) -> None:
    async with looking(size, bench(250, 77, 203)) as looker:
        assert "2 with ERROR" in looker.text
        seen = []
        for _ in range(3):
            await looker.press("exclamation_mark")
            assert f"▸ {looker.app.view_model.selected}" in looker.pane("instances"), "it is in view"
            seen.append(looker.app.view_model.selected)
        assert seen == ["TRCV_C_77", "TRCV_C_203", "TRCV_C_77"]


async def test_an_error_of_one_scan_long_ago_is_reached_too() -> None:
    old = replace(one(33, False), last_error_status=0x80C5, last_error_scan=5)
    seen = bench(50)
    instances = tuple(old if each.name == old.name else each for each in seen.snapshot.instances)
    later = replace(seen.snapshot, instances=instances, t_ns=99 * SECOND)
    async with looking(SMALL, replace(seen, snapshot=later)) as looker:
        await looker.press("exclamation_mark")
        assert looker.app.view_model.selected == "TRCV_C_33"


@BOTH
async def test_m_gives_a_long_list_the_whole_screen(size: tuple[int, int]) -> None:
    async with looking(size, bench(250)) as looker:
        await looker.press("M")
        assert len(listed(looker)) > size[1] - 8
        assert "2 TRCV_C_1 ·" not in looker.text
        await looker.press("end", "2")
        assert "2 TRCV_C_250 ·" in looker.text, "a pane takes its place back"


async def test_a_picture_of_250_instances_draws_only_the_rows_in_view() -> None:
    async with looking(WIDE, bench(250)) as looker:
        pane, drawn = looker.app.main.instances, list[str]()
        row = pane._row

        def counted(instance: InstanceSnapshot, columns: ListColumns) -> Row:
            drawn.append(instance.name)
            return row(instance, columns)

        pane._row = counted  # type: ignore[method-assign]
        pane.show()
        assert len(drawn) <= pane.size.height


async def test_the_selection_stays_when_pictures_come() -> None:
    async with looking(SMALL, bench(250)) as looker:
        await looker.press("end")
        await looker.show(bench(250, 7), bench(250))
        assert looker.app.view_model.selected == "TRCV_C_250"
        assert "▸ TRCV_C_250" in looker.pane("instances")
