"""Pictures that come below a dialog: they do not paint the whole screen each time, and none is lost."""

from __future__ import annotations

from typing import Any

import pytest
from textual.renderables.background_screen import BackgroundScreen

from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.tui.main import MainScreen


async def frames(screen: BenchLooker, count: int) -> None:
    for _ in range(count):
        screen.bench.scan(3)
        screen.app._refresh_picture()
        await screen.pilot.pause()


async def test_the_panes_below_a_dialog_are_not_shown_with_every_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("trcvtui.tui.main.BELOW_DIALOG_DELAY_S", 1000.0)
    async with on_a_bench() as screen:
        screen.app.action_add("connect")
        await screen.settle()
        shown: list[object] = []
        monkeypatch.setattr(MainScreen, "show", lambda main: shown.append(main))
        painted: list[object] = []
        paint = BackgroundScreen.process_segments

        def counted(*about: Any) -> Any:
            painted.append(about)
            return paint(*about)

        monkeypatch.setattr(BackgroundScreen, "process_segments", counted)
        await frames(screen, 20)
        assert (shown, painted) == ([], [])


async def test_panes_show_the_newest_picture_when_the_dialog_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trcvtui.tui.main.BELOW_DIALOG_DELAY_S", 1000.0)
    async with on_a_bench() as screen:
        screen.app.action_add("connect")
        await frames(screen, 5)
        screen.driver.poll_picture = lambda: None  # type: ignore[method-assign]  # no further one comes
        assert screen.app.view_model.picture is not None
        scan = f"scan {screen.app.view_model.picture.snapshot.scan}"
        await screen.press("escape")
        await screen.settle()
        assert scan in screen.text


async def test_panes_below_an_open_dialog_show_the_last_picture_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trcvtui.tui.main.BELOW_DIALOG_DELAY_S", 0.001)
    async with on_a_bench() as screen:
        screen.app.action_add("connect")
        await frames(screen, 5)
        screen.driver.poll_picture = lambda: None  # type: ignore[method-assign]  # no further one comes
        for _ in range(100):
            if screen.app.main._owed is None:
                break
            await screen.pilot.pause()
        assert screen.app.main._owed is None
