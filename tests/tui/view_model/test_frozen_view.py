"""A frozen view: every pane shows the one moment, whatever is looked at and whatever is done after it."""

from __future__ import annotations

import pytest

from tests.tui.looking import BOTH, WIDE
from tests.tui.view_model.test_explain import UP, Desk, at_the_desk
from trcvtui.history import waveform_recorder as waves

LARGE = (200, 60)  # pane 8 is in sight


def border(desk: Desk) -> str:
    return str(desk.app.main.timing.border_subtitle)


def level(desk: Desk, pin: str, scan: int) -> int | None:
    return desk.app.main.timing.wave.lanes[pin].value_at(scan)


async def test_the_wave_of_an_instance_seen_before_goes_up_to_the_frozen_scan_and_no_further() -> None:
    async with at_the_desk(LARGE, *UP) as desk:
        await desk.press("1", "down")
        await desk.see()
        assert desk.app.view_model.selected == "TRCV_C_2"
        seen = desk.app.main.timing.wave.until_scan
        await desk.press("up")
        await desk.do("set TRCV_C_2 LEN=3", "run 50")
        frozen = desk.scan
        await desk.press("8", "F")
        await desk.do("set TRCV_C_2 LEN=5", "run 40")
        await desk.press("1", "down")
        await desk.see()
        wave = desk.app.main.timing.wave
        assert wave.instance == "TRCV_C_2" and seen < wave.until_scan == frozen
        assert level(desk, "LEN", frozen) == 3
        assert border(desk) == "1 scan a column, 10 ms · frozen"
        await desk.press("F")
        await desk.do("run 1")
        assert level(desk, "LEN", desk.scan) == 5
        assert border(desk).endswith("follows")


async def test_a_wave_that_is_no_longer_kept_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waves, "KEPT_CHANGES", 4)
    monkeypatch.setattr(waves, "LEAST_CHANGES", 4)
    async with at_the_desk(LARGE, *UP) as desk:
        await desk.press("F")
        await desk.do("set TRCV_C_2 CONT=blink", "run 40")
        await desk.press("1", "down")
        await desk.see()
        assert "its wave begins after the frozen scan" in desk.words("timing")
        await desk.press("F")
        await desk.see()
        assert "begins after" not in desk.words("timing")


@BOTH
async def test_the_evidence_of_a_trigger_stays_when_its_instance_is_deleted(size: tuple[int, int]) -> None:
    async with at_the_desk(size, *UP) as desk:
        desk.bench.submit("trigger TRCV_C_1 STATUS=7008")
        await desk.do("peer P1 send random 24 seed=1", "run 20")
        assert "FROZEN at scan 9" in desk.header
        await desk.do("delete TRCV_C_1", "run 5")
        assert desk.app.view_model.selected == "TRCV_C_1"
        await desk.press("3")
        assert "16#7008" in desk.line("Frame received", "status")
        assert level(desk, "DONE", 9) == 1 and desk.app.main.timing.wave.until_scan == 9
        await desk.press("F")
        await desk.see()
        assert desk.app.view_model.selected == "TRCV_C_2"


async def test_a_trigger_whose_instance_was_gone_when_it_was_told_shows_it() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        desk.bench.submit("trigger TRCV_C_1 STATUS=7008")
        desk.bench.submit("peer P1 send random 24 seed=1")
        desk.bench.scan(4)
        desk.bench.submit("delete TRCV_C_1")
        desk.bench.scan(2)
        await desk.see()
        assert desk.app.view_model.selected == "TRCV_C_1"
        assert "FROZEN at scan 9" in desk.header


async def test_an_instance_of_the_same_name_does_not_show_the_one_that_was_deleted() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.do("delete TRCV_C_1", "run 3")
        await desk.do("create TRCV_C TRCV_C_1 connect=C1 data=rx", "run 6")
        await desk.press("F", "1", "end")
        await desk.see()
        assert desk.app.view_model.selected == "TRCV_C_1"
        assert desk.app.main.timing.wave.until_scan == desk.scan
        assert level(desk, "CONT", desk.scan) == 0


async def test_no_edge_of_the_selected_instance_is_lost_where_lines_come_too_fast() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        before = len(desk.app.view_model.history.list_edges("TRCV_C_1"))
        for _ in range(200):
            desk.bench.submit("peer P1 send random 24 seed=1")
            desk.bench.scan(4)
        await desk.see()
        assert desk.app.view_model.history.skipped > 0
        edges = [line.seq for line in desk.app.view_model.history.list_edges("TRCV_C_1")]
        assert len(edges) == before + 400 and edges == sorted(edges)
