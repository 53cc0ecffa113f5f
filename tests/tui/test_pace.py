"""Eight pictures a second, twenty after a key; what lasts is measured by a clock, not in pictures."""

from __future__ import annotations

import itertools

import pytest
from msgspec.structs import replace
from textual import events

from tests.tui.fakes import picture
from tests.tui.looking import Looker, looking
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.snapshots.bench import Answer
from trcvtui.tui import app
from trcvtui.tui.widgets import line_view
from trcvtui.tui.widgets.line_view import EMPTY


class Clock:
    """Time that passes when the test says so."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        monkeypatch.setattr(app, "AT_WORK_S", 1.0)
        monkeypatch.setattr(app, "FRAME_S", 3600.0)  # no frame but those of this clock
        monkeypatch.setattr(line_view, "BAR_STAYS_S", 5.0)
        for module in (app, line_view):
            monkeypatch.setattr(module, "monotonic", lambda: self.now)
        self._monkeypatch = monkeypatch

    def pictures(
        self, looker: Looker, seconds: float, late: int = 1, shown: BenchUpdate | None = None
    ) -> int:
        """Return how many pictures an engine is asked for that answers after so many frames."""
        self._monkeypatch.setattr(app, "FRAME_S", 0.05)
        asked, due = 0, 0
        for frame in range(round(seconds / 0.05)):
            self.now += 0.05
            if due and frame >= due:
                looker.driver.waiting.append(replace(shown or picture()))
                due = 0
            before = len(looker.driver.requests)
            looker.app._tick()
            if len(looker.driver.requests) > before and not due:
                asked, due = asked + 1, frame + late
        return asked


@pytest.mark.parametrize(
    "event",
    [events.Key("j", "j"), events.Paste("x"), events.MouseMove(None, 5, 5, 0, 0, 0, False, False, False)],
)
async def test_a_bench_is_shown_8_times_a_second_and_20_times_after_a_key_a_paste_or_the_mouse(
    event: events.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock(monkeypatch)
    async with looking() as looker:
        assert clock.pictures(looker, 1) == 20, "the screen has just begun"
        assert clock.pictures(looker, 4) == 32
        assert clock.pictures(looker, 4, late=4) == 20, (
            "a slow engine is asked as soon as its picture is here"
        )
        requests = len(looker.driver.requests)
        looker.app.post_message(event)
        await looker.pilot.pause()
        assert len(looker.driver.requests) == requests + 1, "the first one asks at once"
        assert clock.pictures(looker, 1) in (19, 20)
        assert clock.pictures(looker, 4) in (31, 32), "no picture is owed for those while somebody worked"


async def test_a_line_that_waits_for_its_answer_and_what_is_no_bench_have_20_a_second(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = Clock(monkeypatch)
    async with looking() as looker:
        looker.app.submit("set TRCV_C_1 EN_R=1")
        assert clock.pictures(looker, 4) == 80
        looker.driver.waiting.append(picture(answers=[Answer(1, "set TRCV_C_1 EN_R=1", "")]))
        looker.app._tick()
        assert clock.pictures(looker, 4) == 32
        for kernel in ("tap", "replay", "capture"):
            looker.driver.waiting.append(other := replace(picture(), kernel=kernel))
            looker.app._frame()
            assert clock.pictures(looker, 4, shown=other) == 80


async def test_a_scroll_bar_that_would_come_with_every_second_picture_stays_for_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = Clock(monkeypatch)
    async with looking() as looker:
        pane = looker.app.main.history
        high = pane.size.height + 5

        async def show(rows: int, seconds: float) -> bool:
            clock.now += seconds
            monkeypatch.setattr(pane, "row_count", lambda: rows)
            monkeypatch.setattr(pane, "row_at", lambda y: EMPTY)
            line_view.LineView.show(pane)
            await looker.pilot.pause()
            return pane.show_vertical_scrollbar

        came = [await show(rows, 1.0) for rows in (high, 1, high, 1)]
        assert came == [True, False, True, True], "the second time it stays"
        layouts = list[object]()
        looker.app.screen.screen_layout_refresh_signal.subscribe(looker.app.screen, layouts.append)
        assert all([await show(rows, 1.0) for rows in itertools.islice(itertools.cycle((high, 1)), 10)])
        assert layouts == []
        assert not await show(1, 5.0), "until it has not been wanted for so long"
