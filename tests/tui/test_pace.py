"""Eight pictures a second, twenty after a key; what lasts is measured by a clock, not in pictures."""

from __future__ import annotations

import pytest
from msgspec.structs import replace
from textual import events

from tests.tui.fakes import picture
from tests.tui.looking import Looker, looking
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui import app
from trcvtui.tui.widgets import line_view


class Clock:
    """Time that passes when the test says so."""

    now = 1000.0

    def pictures(self, looker: Looker, seconds: int, late: int = 1, kernel: str = "live") -> int:
        """Return how many pictures an engine is asked for that answers after so many frames."""
        driver, asked, due = looker.driver, 0, 0
        for frame in range(20 * seconds):
            self.now += 0.05
            if asked and frame == due:
                driver.waiting.append(replace(picture(), kernel=kernel))
            before = len(driver.requests)
            looker.app._tick()
            if len(driver.requests) > before and frame >= due:
                asked, due = asked + 1, frame + late
        return asked


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(app.BenchApp, "set_interval", lambda *_: None)  # no frame but those of this clock
    monkeypatch.setattr(app, "FRAME_S", 0.05)
    monkeypatch.setattr(app, "ACTIVE_S", 1.0)
    monkeypatch.setattr(line_view, "BAR_KEPT_S", 5.0)
    for module in (app, line_view):
        monkeypatch.setattr(module, "monotonic", lambda: clock.now)
    return clock


@pytest.mark.parametrize(
    "event",
    [events.Key("j", "j"), events.Paste("x"), events.MouseMove(None, 5, 5, 0, 0, 0, False, False, False)],
)
async def test_a_bench_is_shown_8_times_a_second_and_20_times_after_a_key_a_paste_or_the_mouse(
    event: events.Event, clock: Clock
) -> None:
    async with looking() as looker:
        assert clock.pictures(looker, 1) == 20, "the screen has just begun"
        assert clock.pictures(looker, 4) == 32
        assert clock.pictures(looker, 4, late=4) == 20, "a slow engine is asked when its picture is here"
        requests = len(looker.driver.requests)
        looker.app.post_message(event)
        await looker.pilot.pause()
        assert len(looker.driver.requests) == requests + 1, "the first one asks at once"
        assert clock.pictures(looker, 1) in (19, 20)
        assert clock.pictures(looker, 4) in (31, 32), "no picture is owed for those while somebody worked"


async def test_a_line_that_waits_for_its_answer_and_what_is_no_bench_have_20_a_second(clock: Clock) -> None:
    async with looking() as looker:
        looker.app.submit("set TRCV_C_1 EN_R=1")
        assert clock.pictures(looker, 4) == 80
        looker.driver.waiting.append(picture(answers=[LineAnswer(1, "set TRCV_C_1 EN_R=1", "")]))
        looker.app._tick()
        assert clock.pictures(looker, 4) == 32
        for kernel in ("tap", "replay", "capture"):
            looker.driver.waiting.append(replace(picture(), kernel=kernel))
            looker.app._refresh_picture()
            assert clock.pictures(looker, 4, kernel=kernel) == 80


async def test_a_scroll_bar_that_would_come_with_every_second_picture_stays_for_a_time(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with looking() as looker:
        pane, layouts = looker.app.main.history, list[object]()
        monkeypatch.setattr(pane, "row_at", lambda y: line_view.EMPTY)

        async def show(is_high: bool, seconds: float = 1.0) -> bool:
            clock.now += seconds
            monkeypatch.setattr(pane, "row_count", lambda: pane.size.height + 5 if is_high else 1)
            line_view.LineView.show(pane)
            await looker.pilot.pause()
            return pane.show_vertical_scrollbar

        came = [await show(is_high) for is_high in (True, False, True, False)]
        assert came == [True, False, True, True], "the second time it stays"
        looker.app.screen.screen_layout_refresh_signal.subscribe(looker.app.screen, layouts.append)
        assert all([await show(is_high) for is_high in [True, False] * 5])
        assert layouts == []
        assert not await show(False, 5.0), "until it has not been wanted for so long"
