"""The screen's tests run on the loop that the real screen has."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import textual.app
import textual.pilot
from textual._compositor import Compositor
from textual._context import active_app, visible_screen_stack
from textual.css.model import RuleSet
from textual.css.stylesheet import Stylesheet
from textual.message_pump import MessagePump
from textual.pilot import Pilot, WaitForScreenTimeout

from trcvtui.scenario import scenario as scenario_files
from trcvtui.tui import app, prompt, terminal_app
from trcvtui.tui.widgets import line_view


@pytest.fixture(autouse=True)
def bars_that_go_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no scroll bar stay: how many pictures come while a test waits is chance."""
    monkeypatch.setattr(line_view, "BAR_KEPT_S", 0.0)


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the user's own config, state and clipboard out of the tests."""
    for name in ("STATE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name.lower()))
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("COLORTERM", "truecolor")  # whatever terminal the tests are started in
    monkeypatch.setenv("TERM", "xterm-256color")


@pytest.fixture(autouse=True)
def frames_when_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tests call the frames (`follow`, `settle`); Pilot waits for a process that rests.

    Twenty frames a second leave it none. The real screen keeps its objects from the collector to its end;
    tests open hundreds of screens.
    """
    monkeypatch.setattr(app, "FRAME_S", 0.5)
    monkeypatch.setattr(app, "ACTIVE_S", 3600.0)  # no key asks for a picture of its own
    monkeypatch.setattr(prompt, "MESSAGE_TIME_S", 3600.0)  # on a busy machine no message goes by itself
    monkeypatch.setattr(terminal_app, "limit_garbage_collector", lambda: None)


_parsed: dict[object, list[RuleSet]] = {}
_parse_rules = Stylesheet._parse_rules


def _parsed_once(sheet: Stylesheet, css: str, *place: object, **told: object) -> list[RuleSet]:
    """Read the styles of a widget once for all tests: it is a fifth of a screen's start."""
    key = css, *place, *told.items(), *sheet._variables.items()
    if key not in _parsed:
        _parsed[key] = _parse_rules(sheet, css, *place, **told)  # type: ignore[arg-type]
    return _parsed[key]


@pytest.fixture(autouse=True)
def styles_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the parsed styles from test to test; rules are hashed as Textual does, but not by Python code."""
    monkeypatch.setattr(Stylesheet, "_parse_rules", _parsed_once)
    monkeypatch.setattr(RuleSet, "__hash__", object.__hash__)


async def _wait_for_the_busy(pilot: Any, timeout: float = 240.0) -> bool:
    """Wait as Pilot does, but for the busy widgets only: it asks each of two hundred, each time."""
    app, screen = pilot.app, pilot.app.screen
    busy = (one for one in screen.walk_children() if one._message_queue.qsize() or one._next_callbacks)
    answers = []
    for pump in (app, screen, *busy):
        answered = asyncio.Event()
        if pump.call_later(answered.set):
            answers.append(answered)
    done = asyncio.gather(*(answered.wait() for answered in answers))
    ends = [asyncio.ensure_future(done), asyncio.ensure_future(app._exception_event.wait())]
    ended, left = await asyncio.wait(ends, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
    for end in left:
        end.cancel()
    if not ended:
        raise WaitForScreenTimeout("the screen has not done what was asked")
    return all(answered.is_set() for answered in answers)


MOMENT_S = 0.05  # Textual holds a screen as long after a palette


async def _wait_until_nothing_is_left(min_sleep: float = 0.0, max_sleep: float = 1.0) -> None:
    """Wait as `wait_for_idle` does, but look at what is left: it judges by a clock that a busy machine slows.

    A repaint that is due is made at once; a thread and a moment (of a resize) are waited for. `max_sleep`: of
    processor time.
    """
    loop: Any = asyncio.get_running_loop()
    end = time.process_time() + max_sleep
    while time.process_time() < end:
        await asyncio.sleep(0)
        if loop._ready:
            continue
        app: Any = active_app.get()
        screen: Any = app.screen if app.screen_stack and not app._exit else None
        if screen is not None and screen._update_timer._active.is_set():
            screen._on_timer_update()
        elif _threads_work(loop) or _moments_pass(app, *app.screen_stack):
            await asyncio.sleep(0.001)
        else:
            return


def _moments_pass(*pumps: MessagePump) -> bool:
    """Whether something is to be done once, a moment from now."""
    timers = [timer for pump in pumps for timer in pump._timers]
    soon = [timer._task for timer in timers if timer._repeat == 0 and timer._interval <= MOMENT_S]
    return any(task is not None and not task.done() for task in soon)


def _threads_work(loop: Any) -> bool:
    """Whether a thread of `asyncio.to_thread` has something to do."""
    pool = loop._default_executor
    return pool is not None and pool._idle_semaphore._value < len(pool._threads)


@pytest.fixture(autouse=True)
def idle_widgets_are_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Pilot wait for the app, the screen and the widgets that have messages, and not for the clock."""
    monkeypatch.setattr(Pilot, "_wait_for_screen", _wait_for_the_busy)
    for module in (textual.app, textual.pilot):
        monkeypatch.setattr(module, "wait_for_idle", _wait_until_nothing_is_left)


PAINTED = ("snapshots", "edges", "hostile_bytes", "doctor_card", "flood", "stories")


_render_update = Compositor.render_update


def _render_what_is_kept(compositor: Compositor, full: bool = False, **asked: Any) -> Any:
    """Paint screenshots alone; a picture that a test asks for (`screen_text`) shows the screens below too."""
    if full:
        return _render_update(compositor, full, **asked)
    visible_screen_stack.set(asked["screen_stack"])
    compositor._dirty_regions.clear()
    return None


@pytest.fixture(autouse=True)
def pictures_when_asked_for(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paint what a test reads: the headless terminal throws its pictures away."""
    if request.path.stem.removeprefix("test_") not in PAINTED:
        monkeypatch.setattr(Compositor, "render_update", _render_what_is_kept)


@pytest.fixture
def state(tmp_path: Path) -> Path:
    (tmp_path / "state").mkdir(exist_ok=True)
    return tmp_path / "state"


@pytest.fixture
def own_scenarios_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open the project beside tests/tui/scenarios, away from ./configs; nothing has come with the program."""
    monkeypatch.chdir(Path(__file__).parent)
    monkeypatch.setattr(scenario_files, "configs_path", lambda: Path("nowhere"))


def _eager_loop() -> asyncio.AbstractEventLoop:
    """Return a loop with eager tasks from Python 3.12 on: `App.run()` has them, `run_test()` has not."""
    loop = asyncio.new_event_loop()
    if sys.version_info >= (3, 12):
        loop.set_task_factory(asyncio.eager_task_factory)
    return loop


@pytest.hookimpl(optionalhook=True)
def pytest_asyncio_loop_factories(
    config: pytest.Config, item: pytest.Item
) -> dict[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Give every test of the screen the eager loop."""
    return {"eager": _eager_loop}
