"""Pane 8: pins over scans, on a simulated bench in this process: cursor, markers, searches, files."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.app import App

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import SMALL, WIDE, follow
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project
from trcvtui.tui.panes.timing import LABEL_WIDTH, Timing

SIZES = [(80, 24), (120, 40), (140, 45), (140, 60), (200, 60)]


class Analyser(Stage):
    async def type(self, text: str) -> None:
        await self.press(*[{" ": "space", ".": "full_stop", "/": "slash"}.get(c, c) for c in text])

    async def say(self, line: str, scans: int = 0) -> None:
        self.app.submit(line)
        self.driver.scan(scans)
        await follow(self.app, self.pilot)

    @property
    def pane(self) -> Timing:
        return self.app.main.timing

    def row(self, name: str) -> str:
        return self._drawn(name)[LABEL_WIDTH:].rstrip()

    def value(self, name: str) -> str:
        return self._drawn(name)[13:LABEL_WIDTH].strip()

    def _drawn(self, name: str) -> str:
        region = self.pane.content_region
        lines = [line[region.x : region.right] for line in self.text.splitlines()[region.y : region.bottom]]
        found = [line for line in lines if line[1:].startswith(f"{name:<12}")]
        assert found, f"{name} is not there:\n{self.text}"
        return found[0]


@asynccontextmanager
async def analysing(size: tuple[int, int] = WIDE, jobs: int = 3) -> AsyncIterator[Analyser]:
    """Open pane 8 on duplex.toml: connected in scan 7, a DONE of one scan every 23 scans."""
    async with on_stage(Analyser, load_project(CONFIGS / "duplex.toml"), size) as look:
        look.driver.play("set TRCV_C_1 CONT=1", "run 6")
        look.driver.play("peer P1 connect", "run 4")
        look.driver.submit("set TRCV_C_1 EN_R=1")
        for _ in range(jobs):
            look.driver.scan(10)
            look.driver.play("peer P1 send random 8 seed=1", "run 13")
        await look.press("8")
        yield look


# -- what is drawn ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", SIZES)
async def test_a_done_of_one_scan_stands_out_at_every_size_and_zoom(size: tuple[int, int]) -> None:
    async with analysing(size) as look:
        assert look.row("DONE").count("█") == min(3, look.row("DONE").count("█")) > 0
        beside_the_scrollbar = look.row("EN_R").rstrip(" ▁▂▃▄▅▆▇█")
        assert beside_the_scrollbar.endswith("▔▔▔▔▔")
        assert "╵7008" in look.row("codes")
        for _ in range(15):
            await look.press("minus")
            assert "┃" in look.row("DONE") or "█" in look.row("DONE"), look.text
        for _ in range(20):
            await look.press("plus")
        assert "█" in look.row("DONE")


async def test_a_pulse_between_two_frames_is_drawn_and_the_ghost_row_misses_it() -> None:
    async with analysing(WIDE, jobs=0) as look:
        look.driver.scan(13)
        look.driver.play("peer P1 send random 8 seed=1", "run 30")
        await follow(look.app, look.pilot)
        assert look.row("DONE").count("█") == 1
        assert "▔" not in look.row("watch DONE")
        assert "a 100 ms watch table saw 0 of 1 DONE" in look.text


# -- cursor, markers, searches ------------------------------------------------------------------------------


async def test_the_cursor_goes_scan_by_scan_and_tells_its_exact_time() -> None:
    async with analysing() as look:
        await look.press("left")
        assert "scan 78 at 0.770000 s" in look.text
        await look.press("left", "left", "right")
        assert "scan 77 at 0.760000 s" in look.text
        assert "stays, f follows" in look.text


async def test_n_walks_the_edges_of_the_row_and_two_markers_tell_their_distance() -> None:
    async with analysing() as look:
        await look.press("down", "down", "down", "N", "N")
        assert look.value("DONE") == "1"
        assert look.value("STATUS") == "7008"
        await look.press("m", "N", "N", "m")
        assert look.value("DONE") == "1"
        assert "1 to 2: 23 scans, 230.000 ms" in look.text
        await look.press("n")
        assert look.value("DONE") == "0"


async def test_shift_and_arrows_walk_the_edges_of_all_pins() -> None:
    async with analysing() as look:
        await look.press("home")
        assert "scan 1 at 0.000000 s" in look.text
        await look.press("shift+right", "shift+right")
        at = look.pane.view.cursor
        await look.press("shift+right", "shift+left")
        assert look.pane.view.cursor == at


async def test_an_edge_chosen_here_is_explained_in_the_card_and_chosen_in_the_history_and_back() -> None:
    async with analysing((200, 60)) as look:
        await look.press("down", "down", "down", "N", "N")
        cursor = look.pane.view.cursor
        assert f"scan {cursor}, in the past" in look.text
        assert "the frame is complete" in look.text
        await look.press("4", "down")
        assert look.pane.view.cursor != cursor, "the history has moved the cursor"
        assert f"scan {look.pane.view.cursor}, in the past" in look.text
        await look.press("8", "escape")
        assert "in the past" not in look.text
        assert look.pane.view.cursor is None and look.pane.view.follows


async def test_bang_goes_to_the_newest_error_and_round() -> None:
    async with analysing((140, 60)) as look:
        await look.press("exclamation_mark")
        assert "no ERROR in the known history of TRCV_C_1" in look.text
        for line in ("peer P1 rst", "peer P1 connect", "peer P1 rst"):
            await look.say(line, 8)
        await look.press("exclamation_mark")
        assert look.value("ERROR") == "1"
        newest = look.pane.view.cursor
        assert newest is not None
        await look.press("exclamation_mark")
        assert look.value("ERROR") == "1"
        assert (look.pane.view.cursor or 0) < newest, "from the newest round to the oldest"
        await look.press("exclamation_mark")
        assert look.pane.view.cursor == newest


async def test_slash_asks_for_a_code_and_goes_there() -> None:
    async with analysing() as look:
        await look.press("slash")
        await look.type("7004")
        await look.press("enter")
        assert look.value("STATUS") == "7004"
        await look.press("slash", "enter")
        assert look.value("STATUS") == "7004"
        await look.say("find 70x4")
        assert "four hexadecimal digits" in look.text


async def test_a_view_that_stands_is_not_moved_by_what_comes_in_and_f_follows_again() -> None:
    async with analysing() as look:
        await look.press("left")
        before = look.row("DONE")[:50]
        await look.say("set TRCV_C_1 LEN=0", 30)
        assert look.row("DONE")[:50] == before
        await look.press("f")
        assert look.row("DONE")[:50] != before and "follows" in look.text


async def test_o_draws_the_other_instances_of_this_connect_below() -> None:
    async with analysing(SMALL) as look:
        await look.press("M")
        assert "TSEND_C_1" not in look.text
        await look.press("o")
        await follow(look.app, look.pilot)
        await look.press("o", "o")
        await look.say("set TSEND_C_1 CONT=1", 3)
        await look.press(*["down"] * 30)
        assert "TSEND_C_1" in look.text and look.row("REQ").endswith("▁")


async def test_a_column_of_many_scans_is_said_in_readable_time_and_zoom_ends_where_all_is_in_view() -> None:
    async with analysing() as look:
        look.driver.scan(60_000)
        await follow(look.app, look.pilot)
        await look.press(*["minus"] * 12)
        columns = look.pane.size.width
        assert look.pane.view.zoom * columns >= 60_000 > look.pane.view.zoom * columns / 3
        assert f"{look.pane.view.zoom} scans a column, {look.pane.view.zoom // 100} s" in look.text


# -- mouse --------------------------------------------------------------------------------------------------


async def test_a_click_sets_the_cursor_and_the_wheel_zooms() -> None:
    async with analysing() as look:
        x = look.row("DONE").index("█")
        await look.pilot.click("#timing", offset=(2 + LABEL_WIDTH + x, 1 + 4))
        await follow(look.app, look.pilot)
        assert look.value("DONE") == "1"
        look.pane.post_message(_wheel(look.app, events.MouseScrollDown))
        await follow(look.app, look.pilot)
        assert look.pane.view.zoom == 2 and "2 scans a column, 20 ms" in look.text
        look.pane.post_message(_wheel(look.app, events.MouseScrollUp))
        await follow(look.app, look.pilot)
        assert look.pane.view.zoom == 1


def _wheel(app: App[None], kind: type[events.MouseEvent]) -> events.MouseEvent:
    return kind(None, 5, 5, 0, 0, 0, False, False, False, 5, 5)


async def test_a_click_on_a_wide_column_goes_to_the_edge_inside_it() -> None:
    async with analysing() as look:
        await look.press("minus", "minus", "minus")
        x = look.row("DONE").index("┃")
        await look.pilot.click("#timing", offset=(2 + LABEL_WIDTH + x, 1 + 4))
        await follow(look.app, look.pilot)
        assert look.value("DONE") == "1"


# -- files --------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def _files_stay_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trcvtui.history.waveform_text.export_folder", lambda project: tmp_path)


async def test_e_writes_a_vcd_and_says_where_it_is(tmp_path: Path) -> None:
    async with analysing() as look:
        await look.press("e")
        assert "timing_TRCV_C_1.vcd" in " ".join(look.text.split())
        assert "$timescale 1 ns" in (tmp_path / "timing_TRCV_C_1.vcd").read_text()


async def test_the_prompt_exports_too_and_names_what_is_wrong(tmp_path: Path) -> None:
    async with analysing() as look:
        for line, told in (
            (f"export timing vcd {tmp_path / 'a b.vcd'}", "bytes in"),
            (f"export timing vcd {tmp_path / 'a b.vcd'}", "is there already"),
            ("export timing png", "export timing vcd"),
            ("export everything", "export timing vcd"),
        ):
            await look.say(line)
            assert told in " ".join(look.text.split()), line
        assert (tmp_path / "a b.vcd").read_text().startswith("$")
        assert look.driver.poll_picture() is not None, "the engine was not asked"


# -- edges --------------------------------------------------------------------------------------------------


async def test_every_key_is_harmless_before_the_first_scan_and_without_instances(tmp_path: Path) -> None:
    path = tmp_path / "empty.toml"
    path.write_text('dialect = "baosky"\n', encoding="utf-8")
    for project in (load_project(CONFIGS / "duplex.toml"), load_project(path)):
        async with on_stage(Analyser, project, SMALL) as look:
            moves = "8 left right shift+left shift+right n N exclamation_mark home end pageup pagedown"
            await look.press(*f"{moves} plus minus f m m m c up down e escape e v f".split())
            assert "8 Timing" in look.text
