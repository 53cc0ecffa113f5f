"""The palette: each key of each pane has an entry, and the entry does there what the key does."""

from __future__ import annotations

import pytest
from textual.app import SystemCommand
from textual.command import CommandList
from textual.keys import format_key

from tests.tui.looking import WIDE, Looker, looking
from tests.tui.on_a_bench import on_a_bench
from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.palette import OrderedCommands, own_bindings, pane_keys


def entries(looker: Looker) -> list[SystemCommand]:
    return list(looker.app.get_system_commands(looker.app.screen))


async def test_each_binding_of_each_pane_has_an_entry_with_a_name() -> None:
    async with looking(WIDE) as looker:
        found = entries(looker)
        ends = [command.help for command in found]
        keys = list(pane_keys(looker.app.main))
        now = {button.letter for button in looker.app.main.peer._buttons_now()}
    assert {key.digit for key in keys} == {*range(1, 9)}
    for key in keys:
        if key.action == "button" and key.binding.key not in now:
            continue  # its button is not there now
        wanted = f"pane {key.digit}, key {key.key}"
        assert any(end.endswith(wanted) for end in ends), f"no entry ends in {wanted!r}"
    assert all(command.title.strip(" :") == command.title for command in found)


async def test_the_palette_opens_with_what_is_asked_for_most() -> None:
    async with looking(WIDE) as looker:
        await looker.press("F", "ctrl+p")
        await looker.app.workers.wait_for_complete()
        await looker.settle()
        options = looker.app.screen.query_one(CommandList).options
        assert [str(option.prompt).splitlines()[0] for option in options[:10]] == [
            "Save the project", "Save the session as a scenario", "Doctor", "Yank …", "View live again",
            "Trigger", "Scenarios", "UDT lab", "History: the ERROR before", "Help",
        ]  # fmt: skip


async def test_each_key_of_the_whole_screen_has_an_entry() -> None:
    async with looking(WIDE) as looker:
        helps = [command.help for command in entries(looker)]
        pins = {pin.letter for pin in looker.app.main.block.drawing().inputs}
    for binding in (*own_bindings(MainScreen), *own_bindings(BenchApp)):
        if binding.action == "calm" or (binding.action.startswith("pin(") and binding.key not in pins):
            continue
        key = "1" if binding.key == "1" else format_key(binding.key)
        assert any(end.endswith(f"key {key}") for end in helps), (binding.key, binding.action)


@pytest.mark.parametrize(
    ("title", "pane", "shown"),
    [
        ("Received: all received bytes as a stream, or DATA now", "received", "Received so far"),
        ("Received: rulers of the stream: all, fewer, none", "received", "Received so far"),
        ("Received: find bytes, text or a number", "received", "29 00 ·"),
        ("Timing: the other instances of this CONNECT, too", "timing", "Timing"),
        ("Timing: follow the newest scan, or stay", "timing", "stays, f follows"),
        ("Timing: next ERROR", "timing", "no ERROR"),
        ("Peer: payload as hex, text or udt", "peer", "send"),
        ("Peer P1: Check …", "open-line", "peer P1 check on size=64 every=T#100ms on TRCV_C_1"),
    ],
)
async def test_an_entry_goes_to_its_pane_and_does_what_the_key_does(
    title: str, pane: str, shown: str
) -> None:
    async with on_a_bench() as looker:
        looker.bench.do("peer P1 connect", scans=8)
        await looker.pictures()
        await looker.press("ctrl+p")
        await looker.at_once(title)
        await looker.app.workers.wait_for_complete()  # it searches
        await looker.press("enter")
        await looker.pictures()
        assert shown in looker.pane(pane), looker.text


@pytest.mark.parametrize(
    ("words", "title"),
    [
        ("search", "Received: find bytes, text or a number"),
        ("search", "History: find a code"),
        ("copy", "Yank bytes as hex"),
        ("export csv", "Yank members as CSV"),
        ("export", "Timing: write as VCD (GTKWave, PulseView)"),
        ("open", "Scenarios"),
        ("value", "Write LEN"),
        ("graph", "Pane Timing"),
        ("type", "UDT lab"),
        ("structure", "Members of DATA or of the job"),
        ("record", "Save the recording up to now"),
        ("stop", "Hold the scans"),
        ("delete", "Remove instance TRCV_C_1"),
    ],
)
async def test_an_action_is_found_by_its_search_words(words: str, title: str) -> None:
    async with on_a_bench() as looker:
        hits = [hit async for hit in OrderedCommands(looker.app.screen).search(words)]
        best = sorted(hits, key=lambda hit: hit.score, reverse=True)
        assert title in [hit.text for hit in best[:25]]


async def test_ctrl_s_saves_the_project_but_not_where_a_screen_only_looks() -> None:
    async with looking(WIDE) as looker:
        await looker.press("7", "ctrl+s")
        assert looker.lines == ["save project"]
        looker.app.only_looks = True
        await looker.press("ctrl+s")
        assert looker.lines == ["save project"] and "read-only" in looker.text


async def test_self_checking_traffic_is_switched_on_and_off_by_a_button() -> None:
    async with on_a_bench() as looker:
        looker.bench.do("peer P1 connect", scans=8)
        await looker.press("7", "b", "enter")
        looker.bench.scan(2)
        await looker.pictures()
        assert looker.lines == ["peer P1 check on size=64 every=T#100ms on TRCV_C_1"]
        assert "[b Check off]" in looker.pane("peer")
        await looker.press("b")
        assert looker.lines[-1] == "peer P1 check off"
