"""Pane 7: the composer's fields and every button are bench commands, judged before they are sent."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.tui.fakes import picture
from tests.tui.looking import BOTH, SMALL, WIDE, looking
from tests.tui.on_a_bench import on_a_bench


@BOTH
@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("c", "peer P1 connect"),
        ("f", "peer P1 close"),
        ("r", "peer P1 rst"),
        ("h", "peer P1 shutdown"),
        ("z", "peer P1 stall"),
    ],
)
async def test_one_key_presses_a_button(size: tuple[int, int], key: str, line: str) -> None:
    async with looking(size) as looker:
        await looker.press("7", key)
        assert looker.lines == [line]


async def test_a_key_of_a_peer_that_no_project_has_says_how_one_comes() -> None:
    async with looking(SMALL, replace(picture(), peers=())) as looker:
        project = looker.app.view_model.project
        looker.app.view_model.project = replace(project, peers=())
        await looker.press("3", "c")
        assert looker.lines == [] and looker.line("✗ no peer: A adds one")
        await looker.press("7")
        assert looker.text.splitlines()[-1].startswith(" A add  : command")


async def test_a_button_that_is_not_there_now_says_so_and_a_listening_peer_has_its_word() -> None:
    async with looking(SMALL) as looker:
        await looker.press("7", "d")
        assert looker.lines == [] and looker.line("✗ d does nothing: P1 has no such button now")
        await looker.press("j")
        await looker.show(picture())
        assert looker.text.splitlines()[-1].startswith(" c listen  s send  i edit  m mode")


@BOTH
async def test_messages_of_a_line_and_of_every_are_listed_with_their_bytes(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        looker.connect()
        looker.bench.do("peer P1 send hex 01 02 split=1 gap=T#10ms", scans=4)
        looker.bench.do("peer P1 send hex 0A 0B {n} every=T#20ms repeat=2", scans=4)
        await looker.press("7", "M")
        await looker.pictures()
        rows = [line.split() for line in looker.pane("peer").splitlines() if line.startswith("sent ")]
        assert [row[1:3] for row in rows] == [["3", "3"], ["2", "3"], ["1", "2"]]
        assert [" ".join(row[4:]) for row in rows] == ["0A 0B 01", "0A 0B 00", "01 02"]


@BOTH
async def test_a_key_that_several_peers_or_panes_have_is_named(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        for key, way in (
            ("c", "c is a key of pane 7: press 7, then c"),
            ("r", "TRCV_C has no REQ; r is a key of pane 7: press 7, then r"),
            ("u", "u is a key of panes 5 and 7: press 5 or 7, then u"),
        ):
            await looker.press("1", key)
            assert f"✗ {way}" in looker.text and looker.lines == []


@BOTH
async def test_a_key_of_one_pane_that_only_shows_opens_it_and_acts_once(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("1", "H")
        assert looker.app.focused is looker.app.main.received.stream
        await looker.press("1", "colon", "H")
        assert looker.app.main.prompt.is_open and "H" in looker.line(" : ")


@BOTH
async def test_a_payload_is_typed_and_sent_with_its_options(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("7", "i")
        await looker.type("01 02 0A")
        await looker.press("tab")
        await looker.type("1,1")
        await looker.press("tab")
        await looker.type("T#20ms")
        await looker.press("tab")
        await looker.type("2")
        assert "▸ peer P1 send hex 01 02 0A split=1,1 gap=T#20ms repeat=2" in looker.text
        await looker.press("enter")
        assert looker.lines == ["peer P1 send hex 01 02 0A split=1,1 gap=T#20ms repeat=2"]


@BOTH
async def test_a_payload_that_is_none_says_what_is_wrong_and_is_not_sent(size: tuple[int, int]) -> None:
    async with looking(size) as looker:
        await looker.press("7", "i")
        await looker.type("01 zz")
        assert "✗" in looker.text
        assert "'z'" in looker.line("✗")
        assert looker.app.main.query_one("#payload").has_class("-bad")
        await looker.press("enter")
        assert looker.lines == []


async def test_a_wrong_option_is_marked_and_the_payload_is_not() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "i")
        await looker.type("01 02")
        await looker.press("tab", "tab")
        await looker.type("20 ms")
        assert looker.app.main.query_one("#option-gap").has_class("-bad")
        assert not looker.app.main.query_one("#payload").has_class("-bad")


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("abc", 'peer P1 send text "abc"'),
        ('say "x"', r'peer P1 send text "say \"x\""'),
        (r"end\r\n", r'peer P1 send text "end\r\n"'),
    ],
)
async def test_a_text_payload_is_quoted(typed: str, line: str) -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "m")  # the focus is in the payload
        await looker.type(typed)
        await looker.press("enter")
        assert looker.lines == [line]


async def test_a_button_shows_its_command_before_it_is_pressed() -> None:
    async with looking(WIDE) as looker:
        looker.app.main.query_one("#buttons").focus()
        await looker.press("right", "right", "right")
        assert "▸ peer P1 rst" in looker.text
        await looker.press("enter")
        assert looker.lines == ["peer P1 rst"]


async def test_a_click_presses_a_button() -> None:
    async with looking(WIDE) as looker:
        place = looker.line("[s Send]").index("[f FIN]") - looker.line("[s Send]").index("[s Send]")
        await looker.pilot.click("#buttons", offset=(place + 2, 0))
        await looker.settle()
        assert looker.lines == ["peer P1 close"]


async def test_a_fault_is_completed_by_hand_and_cleared_by_the_same_key() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "u", "enter")
        assert looker.lines == ["fault recv ECONNRESET on C1"]
        await looker.show(picture(faults=("recv ECONNRESET on C1",)))
        await looker.press("7")
        assert "u Clear faults" in looker.text
        await looker.press("u")
        assert looker.lines[-1] == "fault clear"
