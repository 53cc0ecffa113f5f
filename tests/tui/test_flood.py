"""A flood of 64 KiB jobs: a picture is painted once, costs no layout of the screen, and keys act at once."""

from __future__ import annotations

from tests.tui.fakes import picture, receiving, showing
from tests.tui.looking import looking
from trcvtui.picture.bench_update import BenchUpdate

SIZE = 65_536
PICTURES = 12


def flooded(number: int) -> BenchUpdate:
    between = showing(receiving(0, 0), 0x7006, busy=True, done=True)
    running = receiving(number * 1000, SIZE) if number % 2 else between
    partial = bytes(number * 1000) if number % 2 else b""
    return picture(running, scan=1000 + number, data=bytes([number]) * SIZE, partial=partial)


async def test_a_picture_of_a_flood_costs_no_layout_of_the_screen() -> None:
    async with looking() as looker:
        await looker.show(flooded(1), flooded(2))
        screen, layouts = looker.app.screen, list[object]()
        screen.screen_layout_refresh_signal.subscribe(screen, layouts.append)
        for number in range(3, 3 + PICTURES):
            await looker.show(flooded(number))
            assert f"scan {1000 + number}" in looker.text
        assert layouts == []


async def test_keys_act_at_once_while_pictures_of_a_flood_wait() -> None:
    async with looking() as looker:
        await looker.show(flooded(1))
        looker.driver.waiting.extend(flooded(number) for number in range(2, 2 + PICTURES))
        await looker.at_once("xx")
        assert looker.driver.lines == ["pulse TRCV_C_1 COM_RST"] * 2
