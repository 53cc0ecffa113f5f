"""One table has all keys by pane: it names what is bound, and only what it names writes to PLC or peer."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from string import ascii_lowercase
from typing import Final

import pytest
from textual.keys import format_key

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import SMALL
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project
from trcvtui.tui.panes.timing import Timing
from trcvtui.tui.widgets.help import FEED, PEER_ACTS, SECTIONS, TAKEN, KeyTable
from trcvtui.tui.widgets.line_view import ARROW_MOVES, MOVES

BENCHES: Final = [
    Path(__file__).parent / "bench.toml",  # TRCV_C, two peers
    CONFIGS / "twincat-line.toml",  # ReceiveData, no peer but a simulated line
    CONFIGS / "udp.toml",  # USEND_C
]
PLACES: Final = [*"123456", "5H", "5D", "7", "8"]
PIN_PANES: Final = {"1", "2", "3"}
OF_A_LIST: Final = {key for move in (*MOVES, *ARROW_MOVES) for key in move.key.split(",")}  # type: ignore[union-attr]


class KeyBench(Stage):
    """Keeps what goes to the engine."""

    sent: list[str]

    async def go(self, place: str) -> None:
        """Close what is open, and put the focus into a pane, of pane 5 into one of its faces."""
        main = self.app.main
        while self.app.screen is not main:
            self.app.pop_screen()
            await self.pilot.pause()
        if main.prompt.is_open:
            main.prompt.close()
        main.action_pane(int(place[0]))
        await self.pilot.pause()
        received = main.received
        face = {"H": received.past, "D": received.table}.get(place[1:], received.now)
        if place[0] == "5" and received.face is not face:
            await self.press("D" if received.table in (face, received.face) else "H")
            if received.face is not face:
                await self.press("H")
        assert place[0] != "5" or (received.face is face and received.has_focus_within)
        self.sent.clear()

    @property
    def inputs(self) -> list[object]:
        return [each.inputs for each in self.app.view_model.instances]

    @property
    def opened(self) -> str:
        prompt = self.app.main.prompt
        return prompt._input.value if prompt._input is not None and prompt.is_open else ""


@asynccontextmanager
async def on_keys(path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[KeyBench]:
    monkeypatch.setattr(Timing, "write", lambda *_: (Path("w"), 0))
    async with on_stage(KeyBench, load_project(path), SMALL) as bench:
        bench.sent = []
        submit = bench.driver.submit
        monkeypatch.setattr(bench.driver, "submit", lambda line: bench.sent.append(line) or submit(line))
        await bench.scan(3)
        yield bench


def tokens(table: KeyTable) -> set[str]:
    return {token for keys, _ in table for token in keys.replace(",", " ").split()}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("path", BENCHES, ids=lambda path: path.stem)
async def test_a_letter_writes_to_the_plc_in_panes_1_to_3_and_to_the_peer_in_pane_7_alone(
    path: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with on_keys(path, monkeypatch) as bench:
        pins = {pin.letter: pin for pin in bench.app.main.block.drawing().inputs if pin.letter}
        has_peers = bool(bench.app.view_model.project.peers)
        acts = tokens(PEER_ACTS if has_peers else FEED) if place == "7" else set()
        for key in (*ascii_lowercase, "N", "H", "D"):
            if key == "q":
                continue
            await bench.go(place)
            before, own = bench.inputs, keys_of(bench)
            await bench.pilot.press(key)
            await bench.pilot.pause()
            sent, opened = [*bench.sent], bench.opened
            if sent or place not in PIN_PANES:
                await bench.scan()
            case = f"{key} in {place}: {sent} {opened!r}"
            if place in PIN_PANES and key in pins:
                pin = pins[key]
                if pin.is_bool:
                    assert [line.split()[2].partition("=")[0] for line in sent] == [pin.name], case
                    assert bench.inputs != before, case
                else:
                    assert sent == [] and (opened or "✗" in bench.text), case
                await bench.do(*(line.replace("=1", "=0") for line in sent if line.startswith("set ")))
                continue
            assert bench.inputs == before, case
            assert key in acts or (sent == [] and opened in ("", "find ")), case
            if key in pins and place in ("4", "6", "7") and "no peer" not in bench.text:
                assert key in own or f"{pins[key].name} is a key of panes 1 to 3" in bench.words, case


def keys_of(bench: Stage) -> set[str]:
    """Return the keys of what has the focus and of the pane around it; without a peer those of a line."""
    main = bench.app.main
    above = (main, bench.app, *[main.peer] * (not bench.app.view_model.project.peers))
    return {key for key, found in bench.app.screen.active_bindings.items() if found.node not in above}


AS_FOCUSED: Final = {"+", "-", "←", "→", "↑", "↓"}  # of the cuts and buttons of pane 7
SECTION_OF: Final = {
    "1": "1 Instances", "2": "2 Block", "3": "3 STATUS", "4": "4 History", "5": "5 Received",
    "5H": "5 Received", "5D": "5 Messages", "6": "6 Members", "7": "7 Peer", "8": "8 Timing",
}  # fmt: skip


@pytest.mark.parametrize("path", BENCHES[:2], ids=lambda path: path.stem)
async def test_the_table_names_each_key_that_a_pane_has_and_no_other(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = {title: table for title, _, table in SECTIONS}
    async with on_keys(path, monkeypatch) as bench:
        for place, title in SECTION_OF.items():
            await bench.go(place)
            is_feed = place == "7" and not bench.app.view_model.project.peers
            named = tokens(tables["7 Simulated line" if is_feed else title])
            here = {format_key(key) for key in bench.app.screen.active_bindings}
            assert {key for key in named if len(key) == 1} <= here | AS_FOCUSED, place
            if place == "5D":
                named |= tokens(tables["5 Received"])
            assert {format_key(key) for key in keys_of(bench) - OF_A_LIST} - named <= {"tab", "esc", "⏎", "shift+left", "shift+right"}, place


