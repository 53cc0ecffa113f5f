"""Pane 7 as a workbench: cuts drawn on the message, every split in a table, a UDT as a form, reply rules."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.scenario.scenarios import CONFIGS
from tests.tui.fakes import peers, picture
from tests.tui.looking import BOTH, SMALL, SNAPSHOTS, UPDATE, WIDE, Looker, looking, screen_text
from tests.tui.stage import Stage, on_stage
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import PeerSend
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import ReplyRuleSnapshot
from trcvtui.tui.formatting import MS
from trcvtui.tui.panes.composer import Splits, read_splits

SIZES = pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 60)], ids=["80x24", "120x40", "200x60"])
RULE = ReplyRuleSnapshot("contains hex 05 send hex 06 {n:2:big}", 12, 3)


def with_rules() -> BenchUpdate:
    one, two = peers()
    return replace(picture(), peers=(replace(one, replies=(RULE,), link="C1"), replace(two, link="C1")))


async def compose(looker: Looker, payload: str) -> None:
    await looker.press("7", "i")
    await looker.type(payload)
    await looker.press("escape", "x")


# -- cuts ------------------------------------------------------------------------------------------------


@BOTH
async def test_space_cuts_the_message_and_the_command_shows_it(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await compose(looker, "01 02 03 04 05")
        await looker.press("right", "space")
        assert "01 02╂03 04 05" in looker.text
        assert "▸ peer P1 send hex 01 02 03 04 05 split=2 gap=T#20ms" in looker.text
        await looker.press("enter")
        assert looker.lines == ["peer P1 send hex 01 02 03 04 05 split=2 gap=T#20ms"]


async def test_each_cut_has_its_own_pause() -> None:
    async with looking(WIDE) as looker:
        await compose(looker, "01 02 03 04 05")
        await looker.press("space", "right", "right", "space", "plus", "plus")
        assert "split=1,2 gap=T#20ms,T#50ms" in looker.text
        assert "cut at 3, pause T#50ms" in looker.line("05  5 bytes")
        await looker.press("minus", "minus")
        assert "split=1,2 gap=T#20ms" in looker.text and "T#20ms," not in looker.text


async def test_space_again_joins_and_delete_takes_all_cuts() -> None:
    async with looking(WIDE) as looker:
        await compose(looker, "01 02 03 04")
        await looker.press("space", "right", "space", "space")
        assert "split=1 gap" in looker.text
        await looker.press("right", "space", "delete")
        assert "split=" not in looker.text


async def test_a_click_between_two_bytes_cuts_there() -> None:
    async with looking(WIDE) as looker:
        await compose(looker, "01 02 03 04")
        await looker.press("7")
        column = looker.line("01 02 03 04  4 bytes").index(" 03") - looker.line("01 02 03 04  4 bytes").index(
            "01"
        )
        await looker.pilot.click("#cuts", offset=(column + 1, 0))
        await looker.settle()
        assert "split=2 gap=T#20ms" in looker.text


async def test_cuts_typed_by_hand_are_drawn() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "i")
        await looker.type("010203040506")
        await looker.press("tab")
        await looker.type("1,2,9")
        assert "01┃02 03┃04 05 06" in looker.text
        assert "in 3 pieces" in looker.text


async def test_a_long_message_scrolls_with_the_cursor() -> None:
    async with looking(SMALL) as looker:
        await compose(looker, "".join(f"{n:02x}" for n in range(100)))
        assert "63" not in looker.line("00╎01")
        await looker.press("end", "space")
        assert "62╂63" in looker.text and "split=99" in looker.text


async def test_a_text_and_a_udt_are_drawn_as_their_bytes() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "m")
        await looker.type(r"ab\r\n")
        assert "61 62 0D 0A  4 bytes" in looker.text
        await looker.press("escape", "m")
        await looker.type("id=5")
        assert "05 00 00 00" in looker.text


@given(st.binary(min_size=2, max_size=40), st.data())
def test_drawn_cuts_come_back_from_the_command_that_they_make(payload: bytes, data: st.DataObject) -> None:
    places = data.draw(st.sets(st.integers(1, len(payload) - 1), max_size=6))
    cuts = Splits({place: data.draw(st.sampled_from([0, 20 * MS, 50 * MS])) for place in sorted(places)})
    gap = f" gap={cuts.gap_option}" if cuts.gap_option else ""
    split = f" split={cuts.split_option}" if cuts.split_option else ""
    project = load_project(CONFIGS / "passive.toml")
    send = parse_line(f"peer P1 send hex {payload.hex()}{split}{gap}", project, "w")
    assert isinstance(send, PeerSend) and read_splits(send) == cuts


# -- every split -----------------------------------------------------------------------------------------


@asynccontextmanager
async def bench(size: tuple[int, int], *lines: str) -> AsyncIterator[Stage]:
    async with on_stage(Stage, load_project(CONFIGS / "passive.toml"), size) as stage:
        await stage.do("set TRCV_C_1 CONT=1 EN_R=1", *lines, scans=3)
        await stage.do("peer P1 connect", scans=3)
        yield stage


@SIZES
async def test_every_split_is_tried_and_tabled(size: tuple[int, int]) -> None:
    async with bench(size, "set TRCV_C_1 ADHOC=1") as stage:
        await stage.press("7", "i", *"0102030405060708", "escape", "e")
        await stage.scan(20)
        await stage.press()
        assert "running" in stage.text
        await stage.scan(80)
        await stage.press()
        seen = stage.app.view_model.picture
        trial = seen.trial if seen is not None else None
        assert trial is not None and (trial.state, trial.differing) == ("finished", 7)
        await stage.press("y")
        assert stage.app.clipboard.count("DONE") == len(trial.rows)


async def test_a_trial_can_be_left_and_stopped_by_its_command() -> None:
    async with bench(SMALL) as stage:
        await stage.press("7", "i", *"0102030405060708", "escape", "e")
        await stage.scan(10)
        await stage.press("escape")
        await stage.do("peer P1 try-splits stop", scans=10)
        await stage.press()
        assert "cancelled" in stage.line("every split")


# -- the form of a UDT -----------------------------------------------------------------------------------


@BOTH
async def test_the_members_of_a_udt_are_fields_and_make_the_payload(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("7", "o")
        text = screen_text(looker.app)
        for words in ("Telegram: 5 members", "id", "DINT", "speed", "REAL", "tag", "STRING[8]"):
            assert words in text
        await looker.type("42")
        await looker.press("tab", "tab", "tab")
        await looker.type("1.5")
        await looker.press("tab")
        await looker.type("a, b")
        assert "▸ udt Telegram {id=42, speed=1.5, tag='a, b'}" in screen_text(looker.app)
        await looker.press("enter")
        assert "▸ peer P1 send udt Telegram {id=42, speed=1.5, tag='a, b'}" in looker.text


async def test_a_member_that_is_none_says_so_and_is_not_taken() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "o")
        await looker.type("4x")
        text = screen_text(looker.app)
        assert "✗" in text and "'4x'" in text
        await looker.press("enter")
        assert "Telegram: 5 members" in screen_text(looker.app)
        await looker.press("escape")
        assert "peer P1 send …" in looker.text


async def test_the_form_opens_with_what_the_payload_holds() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "m", "escape", "m")
        await looker.type("speed=2.5, tag='x'")
        await looker.press("escape", "o", "enter")
        assert "▸ peer P1 send udt Telegram {speed=2.5, tag='x'}" in looker.text


# -- replies and the wire --------------------------------------------------------------------------------


async def test_a_rule_is_completed_by_hand_and_all_end_by_one_key() -> None:
    async with looking(WIDE, with_rules()) as looker:
        await looker.press("7", "a", "enter", "7", "d")
        assert looker.lines == ["peer P1 reply on contains hex 05 send hex 06", "peer P1 reply off"]


async def test_the_wire_of_a_peer_goes_silent_and_speaks_again() -> None:
    async with bench(SMALL) as stage:
        await stage.press("7", "l")
        await stage.press()
        assert "l Wire up" in stage.text and "SILENT" in stage.line("▸ P1")
        await stage.press("l")
        await stage.press()
        assert "l Silence" in stage.text and "SILENT" not in stage.line("▸ P1")


async def test_the_workbench_stands_as_drawn(tmp_path: Path) -> None:
    async with looking((120, 40), with_rules()) as looker:
        await compose(looker, "01 02 0A FF 05 06 07")
        await looker.press("space", "right", "right", "space", "plus")
        path, found = SNAPSHOTS / "workbench-120x40.txt", looker.pane("peer")
        if os.environ.get(UPDATE):
            path.write_text(found + "\n", encoding="utf-8")
        assert found + "\n" == path.read_text(encoding="utf-8")
