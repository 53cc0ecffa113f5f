"""Panes, prompt, hold and step, palette, help: every action has a key and every change is a command."""

from __future__ import annotations

from typing import Any

import pytest
from rich.color import Color
from textual import events

from tests.tui.fakes import FakeDriver, bench_project, picture
from tests.tui.looking import BOTH, SMALL, WIDE, Looker, follow, looking
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui.app import BenchApp
from trcvtui.tui.prompt import MESSAGE_TIME_S, EchoLine


async def test_a_click_opens_a_tab() -> None:
    async with looking(SMALL) as looker:
        place = looker.line("3 STATUS").index("5 Received")
        await looker.pilot.click("#tabs", offset=(place, 0))
        await looker.settle()
        assert "5 Received · rx, 24 B" in looker.text


@BOTH
async def test_tab_goes_round(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        seen = set()
        for _ in range(16):
            await looker.press("tab")
            seen.add(looker.app.focused.id if looker.app.focused else None)
        assert "instances" in seen
        assert len(seen) >= 2


@pytest.mark.parametrize("key", ["M", "backslash"])
async def test_a_pane_can_have_the_screen_alone(key: str) -> None:
    async with looking(WIDE) as looker:
        await looker.press("4", key)
        assert "4 History" in looker.text
        assert "2 TRCV_C_1" not in looker.text
        assert "1 Instances" not in looker.text
        await looker.press(key)
        assert "2 TRCV_C_1" in looker.text


# -- scans ---------------------------------------------------------------------------------------------


@BOTH
async def test_space_holds_and_lets_go(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("space")
        assert looker.lines == ["hold"]
        await looker.show(picture(holding=True))
        assert "‖ HOLD" in looker.text
        assert "space go" in looker.text
        await looker.press("space")
        assert looker.lines == ["hold", "go"]


async def test_a_full_stop_lets_one_scan_pass_and_holds_first_where_scans_pass() -> None:
    async with looking(SMALL) as looker:
        await looker.press("full_stop")
        assert looker.lines == ["hold", "run 1"]
        await looker.show(picture(holding=True))
        await looker.press("full_stop")
        assert looker.lines == ["hold", "run 1", "run 1"]


# -- prompt --------------------------------------------------------------------------------------------


@BOTH
async def test_a_typed_command_is_sent_and_answered(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("4", "colon")
        await looker.type("plc stop")
        await looker.press("enter")
        assert looker.lines == ["plc stop"]
        assert "… with the next scan" in looker.line(": plc stop")
        await looker.show(picture(answers=[LineAnswer(1, "plc stop", "")]))
        assert "✓" in looker.line(": plc stop")
        assert looker.app.focused is not None
        assert looker.app.focused.id == "history", "the pane has the focus again"


async def test_up_and_down_walk_the_commands_of_toggles_too() -> None:
    async with looking(SMALL) as looker:
        await looker.press("n", "a", "colon", "up", "up", "down", "enter")
        assert looker.lines == ["set TRCV_C_1 EN_R=0", "set TRCV_C_1 ADHOC=1", "set TRCV_C_1 ADHOC=1"]


async def test_markup_and_control_characters_in_an_answer_stay_text() -> None:
    async with looking(SMALL) as looker:
        await looker.show(picture(answers=[LineAnswer(1, "x [red]\x1b[1m", "found [/] \x07")]))
        assert r": x [red]\x1b[1m  ✗ found [/] \x07" in looker.text


def ending(echo: EchoLine) -> Any:
    return echo._end


async def test_a_message_goes_after_ten_seconds_but_not_that_of_an_ended_engine() -> None:
    assert MESSAGE_TIME_S == 10.0
    async with looking(SMALL) as looker:
        await looker.press("K")
        echo = looker.app.main.prompt._echo
        assert "with the next scan" in looker.text and ending(echo) is None, "it waits"
        await looker.show(picture(answers=[LineAnswer(1, "mark", "", "told " * 40)]))
        assert echo.size.height > 1
        ending(echo)._callback()  # as its time comes
        await looker.settle()
        assert "told" not in looker.text and "type a bench command" in looker.text and echo.size.height == 1
        looker.driver.stopped = "killed"
        await follow(looker.app, looker.pilot)
        assert "R restarts the engine" in looker.text and ending(echo) is None


# -- help, palette, end --------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("key", ["question_mark", "f1"])
async def test_help_shows_the_keys_and_then_the_status_table(size: tuple[int, int], key: str) -> None:
    async with looking(size) as looker:
        await looker.press(key)
        first = looker.text
        assert "Here: " in first, "the keys of the pane that had the focus come first"
        await looker.press("pagedown")
        assert "command palette" in first + looker.text
        await looker.press("G")
        last = bench_project().dialect.status[-1]
        assert last.word in looker.text and last.title in looker.text
        await looker.press("escape")
        assert "1 Instances" in looker.text


async def test_the_palette_reaches_everything() -> None:
    async with looking(WIDE) as looker:
        titles = {command.title for command in looker.app.get_system_commands(looker.app.screen)}
    for title in (
        "Hold the scans", "One single scan", "Toggle EN_R", "Pulse COM_RST", "Write LEN", "Peer P1: RST",
        "Peer P2", "Instance TRCV_C_2", "Pane Received", "Zoom the pane", "Command line", "Help", "Theme",
        "PLC to STOP", "Clear all faults", "Screenshot", "Quit", "Delete TRCV_C_1", "Create an instance",
        "Download TRCV_C_1: a new instance", "Resize rx", "Yank members as CSV", "Mark",
        "Save the session as a scenario", "Yank STATUS history as text",
    ):  # fmt: skip
        assert title in titles


async def test_a_key_named_in_the_last_line_can_be_clicked() -> None:
    async with looking(SMALL) as looker:
        place = looker.line("space hold").index("space")
        await looker.pilot.click("#keys", offset=(place, 0))
        await looker.settle()
        assert looker.lines == ["hold"]


async def test_an_engine_that_ends_is_told_and_leaves_the_last_picture() -> None:
    async with looking(SMALL) as looker:
        looker.driver.stopped = "Traceback\n  ...\nAssertionError: two receivers"
        await follow(looker.app, looker.pilot)
        assert "ENGINE ENDED" in looker.text
        assert "✗ AssertionError: two receivers" in looker.text
        assert "7006 receiving" in looker.text
        await looker.press("n")
        assert looker.lines == []


async def test_after_the_end_of_the_engine_the_lamps_are_grey_and_r_starts_it_anew() -> None:
    async with looking(WIDE) as looker:
        lamp = lamp_colour(looker)
        grey = looker.app.main.instances.named_style("faint cursor").color
        assert lamp != grey, "BUSY is 1 and shines"
        looker.driver.stopped = "killed"
        await follow(looker.app, looker.pilot)
        assert lamp_colour(looker) == grey
        assert "R restarts the engine" in looker.text
        await looker.press("R")
        assert looker.driver.restarts == 1
        again = [f"set TRCV_C_{n} EN_R=1 CONT=1 LEN=0 ADHOC=0" for n in (1, 2)]
        assert looker.lines == again, "the inputs are as they were, no edge comes again"
        await looker.show(picture(scan=3))
        assert "ENGINE ENDED" not in looker.text and "scan 3 " in looker.text
        assert lamp_colour(looker) == lamp
        await looker.press("n")
        assert looker.lines == [*again, "set TRCV_C_1 EN_R=0"], "and it commands again"


async def test_keys_wait_for_an_engine_that_starts_and_q_alone_does_not() -> None:
    async with looking(WIDE) as looker:
        looker.driver.stopped = "killed"
        await follow(looker.app, looker.pilot)
        await looker.press("R", "n", "7", "r")
        again = [*looker.lines]
        assert not any(line.endswith("EN_R=0") for line in again) and "engine starts" in looker.text
        await looker.show(picture(scan=3))
        await looker.settle()
        assert looker.lines == [*again, "set TRCV_C_1 EN_R=0", "peer P1 rst"]
        looker.driver.stopped = "killed again"
        await follow(looker.app, looker.pilot)
        await looker.press("R")
        await looker.show(picture(scan=4))
        assert "engine 3 runs" in looker.text
        looker.driver.stopped = "killed again"
        await follow(looker.app, looker.pilot)
        await looker.press("R", "q")
        assert not looker.app.is_running or looker.app._exit


async def test_a_picture_may_come_before_the_panes_stand() -> None:
    app = BenchApp(FakeDriver(), bench_project())
    app.view_model.accept_picture(picture())
    app.main.peer.show()
    assert not app.main.peer.is_attached


async def test_keys_that_waited_for_an_engine_are_obeyed_where_it_ends_at_once() -> None:
    async with looking(WIDE) as looker:
        looker.driver.stopped = "killed"
        await follow(looker.app, looker.pilot)
        await looker.press("R", "7", "R")
        looker.driver.stopped = "killed again"
        await follow(looker.app, looker.pilot)
        assert looker.driver.restarts == 2
        await looker.show(picture(scan=3))
        assert "engine 3 runs" in looker.text and looker.app.main.peer.has_focus_within


def lamp_colour(looker: Looker) -> Color | None:
    strip = looker.app.main.instances.render_line(0)
    segments = [each for each in strip if "B■" in each.text]
    assert len(segments) == 1 and segments[0].style is not None
    return segments[0].style.color


async def test_news_of_a_focus_that_has_gone_on_opens_no_pane() -> None:
    """A key may come before the screen hears of the focus that the key before it has moved."""
    async with looking(SMALL) as looker:
        await looker.press("7")
        former = looker.app.focused
        await looker.press("3")
        assert former is not None and looker.app.focused is not former
        looker.app.main.post_message(events.DescendantFocus(former))
        await looker.settle()
        assert looker.app.main.status.region.height > 0 and looker.app.main.peer.region.height == 0
