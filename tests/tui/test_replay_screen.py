"""The main screen on a recording: the keys that move, the position at each size, what is refused."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import cast

import pytest
from textual.binding import Binding, BindingType
from textual.widgets import Input

from tests.replay.journals import InMemory, recorded
from tests.replay.test_all_messages import scenario_of_many
from tests.replay.test_time_line import ERRORS, LAST, Stood
from tests.tui.fakes import FakeDriver
from tests.tui.looking import SMALL, WIDE, Looker, looking, same_as_snapshot
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.replay.time_line import ReplayNavigator
from trcvtui.snapshots.replay import ReplayPosition
from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.messages import MessageChosen
from trcvtui.tui.replay import ReplayScreen, position_bar
from trcvtui.tui.settings import FIXED_KEYS
from trcvtui.tui.widgets.help import LETTERS, RESERVED

MIDDLE = (100, 30)
MARK = "a recording cannot be changed"


class TimeLineDriver(FakeDriver):
    def __init__(self, stood: Stood | None = None) -> None:
        super().__init__()
        self.stood = stood or Stood()
        self._request: UpdateRequest | None = None

    def submit(self, line: str) -> int:
        number = super().submit(line)
        self.stood.line.handle_line(number, line)
        return number

    def request(self, request: UpdateRequest) -> None:
        super().request(request)
        self._request = request

    def poll_picture(self) -> BenchUpdate | None:
        if self._request is None:
            return None
        request, self._request = self._request, None
        if not self.stood.line.is_playing:
            self.stood.settle()
        return self.stood.line.make_picture(request)


class ReplayLooker(Looker):
    stood: Stood

    async def go(self, *keys: str) -> None:
        await self.press(*keys)
        for _ in range(3):
            self.app._refresh_picture()
            await self.pilot.pause()

    @property
    def scan(self) -> int:
        picture = self.app.view_model.picture
        assert picture is not None and picture.position is not None
        assert picture.snapshot.scan == picture.position.scan
        return picture.snapshot.scan

    @property
    def position(self) -> str:
        return self.line("scan ", "position")


@asynccontextmanager
async def on_a_recording(
    size: tuple[int, int] = WIDE, stood: Stood | None = None
) -> AsyncIterator[ReplayLooker]:
    driver = TimeLineDriver(stood)
    app = BenchApp(driver, driver.stood.line.controller.bench.project, replay=True)
    with closing(driver.stood.line):
        async with app.run_test(size=size) as pilot:
            looker = ReplayLooker(app, driver, pilot)
            looker.stood = driver.stood
            await looker.go()
            yield looker


async def test_arrows_errors_and_edges_go_where_they_say() -> None:
    async with on_a_recording() as looker:
        edges = list(looker.stood.line.survey.edges[looker.app.view_model.selected])
        for keys, scan in (
            ("right", 2), ("left", 1), ("exclamation_mark", ERRORS[0]), ("exclamation_mark", ERRORS[1]),
            ("quotation_mark", ERRORS[0]), ("home", 1), ("shift+right", edges[1]), ("end", LAST),
            ("shift+left", edges[-2]), ("full_stop", edges[-2] + 1), ("comma", edges[-2]),
        ):  # fmt: skip
            await looker.go(keys)
            assert looker.scan == scan, keys
        assert f"scan {looker.scan} of {LAST}" in looker.position


@pytest.mark.parametrize("size", [SMALL, WIDE], ids=["80x24", "140x45"])
async def test_home_end_and_g_go_there_from_each_pane_and_the_last_line_names_what_works(
    size: tuple[int, int],
) -> None:
    async with on_a_recording(size) as looker:
        for digit in "123456789":
            await looker.go(digit)
            focused, keys = looker.app.focused, looker.line("q quit", "keys").strip()
            for key, scan in (("end", LAST), ("left", 0), ("home", 1)):
                if key != "left" or "←→ scan" in keys:
                    await looker.go(key)
                    assert looker.scan == (scan or (LAST if digit == "8" else LAST - 1)), (digit, key)
            assert not {"A add", "E change", "enter toggle", "m mode"} & {*keys.split("  ")}
            assert ("! error" in keys) != (digit in "148") or size == SMALL
            assert looker.app.focused is focused
            await looker.go("g")
            assert looker.app.main.prompt.is_open
            await looker.go("escape")


async def test_a_field_that_is_typed_into_keeps_g_home_and_end() -> None:
    async with on_a_recording() as looker:
        await looker.go("7", "tab", "1", "g", "home", "2", "end", "3")
        field = looker.app.focused
        assert isinstance(field, Input) and field.value == "21g3" and looker.scan == 1


async def test_all_messages_are_known_and_one_that_is_chosen_moves_the_time_line(tmp_path: Path) -> None:
    entries = recorded(scenario_of_many(tmp_path))[1]
    async with on_a_recording(stood=Stood(line=ReplayNavigator(InMemory(entries), "R"))) as looker:
        await looker.go()
        known = looker.app.view_model.known_messages
        rows = [*known.rows]
        assert (len(rows), looker.scan) == (500, 1)
        for row in (rows[299], rows[5], None):
            looker.app.main.received.post_message(MessageChosen(row))
            await looker.go()
            assert looker.scan == (row or rows[5]).scan
            assert looker.app.view_model.known_messages is known and known.rows == rows
        table = looker.app.main.received.table.messages
        for keys, row, scan in (
            ("D", rows[5], rows[5].scan), ("down", rows[6], rows[6].scan), ("left", rows[5], rows[6].scan - 1)
        ):  # fmt: skip
            await looker.go(keys)
            assert (table.find_current_row(), looker.scan) == (row, scan), keys
        await looker.go("9", "home")
        await looker.go("5", "up")
        assert (table.find_current_row(), looker.scan) == (None, 1), "all are still to come"
        known.share = 0.4
        assert "reading … 40%" in table.describe_rows()
        await looker.go("D", "9")
        for keys, has_sparks in (("home", False), ("end", True)):
            await looker.go(keys)
            assert bool(set("▁▂▃▄▅▆▇█") & set(looker.pane("udt"))) is has_sparks


async def test_the_table_of_messages_keeps_g_home_and_end_and_the_arrows_are_the_time_lines() -> None:
    async with on_a_recording() as looker:
        await looker.go("end", "D")
        assert "g go to" not in looker.line("q quit", "keys")
        rows, first = looker.app.main.received.table.messages, looker.app.view_model.known_messages.rows[0]
        for keys, is_followed in (("home", False), ("end", True), ("g", False)):
            await looker.go(keys)
            assert (rows.follows_newest, looker.app.main.prompt.is_open) == (is_followed, False)
        assert looker.scan == first.scan < LAST
        await looker.go("left")
        assert looker.scan == first.scan - 1
        await looker.go("9", "home")
        assert looker.scan == 1


async def test_g_takes_a_time_or_a_scan() -> None:
    async with on_a_recording(SMALL) as looker:
        await looker.press("g")
        await looker.type("T#1s\r")
        await looker.go()
        assert looker.scan == 101
        await looker.press("g")
        await looker.type("scan 62\r")
        await looker.go()
        assert looker.scan == 62


async def test_space_plays_and_stops_and_the_speed_is_seen() -> None:
    async with on_a_recording() as looker:
        await looker.go("minus", "minus", "minus")
        assert "‖ 0.1x" in looker.position
        seen = [looker.stood.line.is_playing]
        await looker.go("space")
        seen.append(looker.stood.line.is_playing)
        assert "▶ 0.1x" in looker.position
        await looker.go(*["plus"] * 8)
        assert "▶ fastest" in looker.position
        await looker.go("space")
        assert [*seen, looker.stood.line.is_playing] == [False, True, False]
        assert "‖ fastest" in looker.position


@pytest.mark.parametrize("keys", ["n", "A", "E", "ctrl+z", "S", "K", "R", "t"])
async def test_a_key_that_changes_the_bench_says_that_nothing_can_be_changed(keys: str) -> None:
    async with on_a_recording() as looker:
        before = looker.scan
        await looker.go(keys)
        words = " ".join(looker.text.split())
        assert MARK in words or (keys == "R" and "the engine runs" in words)
        assert looker.app.screen is looker.app.main and looker.scan == before


async def test_what_only_reads_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    async with on_a_recording() as looker:
        await looker.go("exclamation_mark")
        await looker.press("colon")
        await looker.type("export timing vcd out.vcd\r")
        assert (tmp_path / "out.vcd").exists()
        await looker.go("y")
        assert "ank" in looker.text
        await looker.go("escape")
        await looker.press("colon")
        await looker.type("trigger TRCV_C_1 STATUS=7006\r")
        await looker.go()
        assert MARK not in looker.text


async def test_help_and_footer_name_the_keys_of_a_replay_on_a_replay_alone() -> None:
    async with on_a_recording() as looker:
        assert "go to" in looker.text.splitlines()[-1]
        await looker.go("question_mark")
        assert "Time line of the recording" in looker.text
    async with looking() as looker_of_a_bench:
        assert "go to" not in looker_of_a_bench.text.splitlines()[-1]
        await looker_of_a_bench.press("question_mark")
        assert "Time line" not in looker_of_a_bench.text


def _keys(bindings: Iterable[BindingType]) -> set[str]:
    return {key for row in bindings for key in cast(Binding, row).key.split(",")}


def test_the_keys_of_a_replay_are_no_keys_of_the_bench() -> None:
    own = _keys(ReplayScreen.BINDINGS)
    taken = _keys((*MainScreen.BINDINGS, *BenchApp.BINDINGS))
    pins = {letter for keys, _ in LETTERS for letter in keys.split()} - RESERVED
    assert not own & (taken | pins)
    assert own & FIXED_KEYS <= {"left", "right", "9"}


@pytest.mark.parametrize("size", [SMALL, MIDDLE, WIDE], ids=lambda size: f"{size[0]}x{size[1]}")
async def test_the_position_stands_at_each_size_as_drawn(size: tuple[int, int], tmp_path: Path) -> None:
    async with on_a_recording(size) as looker:
        await looker.go("exclamation_mark")
        assert "!" in looker.pane("position") and "█" in looker.pane("position")
        if size == WIDE:
            same_as_snapshot(looker, "replay-140x45", tmp_path)


def test_the_bar_has_the_width_and_each_error_at_any_width() -> None:
    marks = bytearray(1000)
    marks[0] = marks[500] = marks[999] = 1
    for width in (1, 7, 78, 400, 2000):
        drawn = position_bar(ReplayPosition(2, 3, 0, 0, True, 2, "1x", 3, bytes(marks)), width)
        assert len(drawn) == width and drawn.count("█") == 1
        if width > 7:
            assert drawn[0] == drawn[-1] == "!" and "!" in drawn[1:-1]
    assert position_bar(ReplayPosition(0, 0, 0, 0, False, 0, "1x", 0, b""), 5) == "█────"


async def test_both_runs_are_seen_on_a_small_terminal(tmp_path: Path) -> None:
    async with on_a_recording(SMALL) as looker:
        await looker.go("W")
        await looker.type("LEN=1\r")
        await looker.go()
        names = [row.strip("│ ▸").split(" ")[0] for row in looker.pane("timing").splitlines()]
        assert names[2:10] == ["STATUS", "codes", "what-if", "codes", "EN_R", "what-if", "DONE", "what-if"]


async def test_w_asks_for_another_value_and_draws_both_runs(tmp_path: Path) -> None:
    async with on_a_recording() as looker:
        await looker.go("W")
        await looker.type("LEN=1\r")
        await looker.go()
        assert looker.scan == 91
        assert "first difference at scan 91" in looker.pane("position")
        assert "what-if" in looker.pane("timing")
        assert "≠" in looker.pane("position") or "█" in looker.pane("position")
        same_as_snapshot(looker, "replay-what-if-140x45", tmp_path)
        await looker.press("colon")
        await looker.type("if off\r")
        await looker.go()
        assert "what-if" not in looker.pane("timing") and "part" not in looker.pane("position")
