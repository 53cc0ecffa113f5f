"""One table has all keys by pane: it names what is bound, and only what it names writes to PLC or peer."""

from __future__ import annotations

from pathlib import Path
from string import ascii_lowercase
from typing import Final, cast

import pytest
from textual.binding import Binding
from textual.keys import format_key

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import SMALL
from tests.tui.stage import Stage, on_stage
from trcvtui.project.file import load_project
from trcvtui.tui.panes.timing import Timing
from trcvtui.tui.widgets.help import FEED_KEYS, HELP_SECTIONS, PEER_COMMAND_KEYS, KeyTable
from trcvtui.tui.widgets.line_view import MOVES

TRCV_C, FRAMER = Path(__file__).parent / "bench.toml", CONFIGS / "twincat-line.toml"
BENCHES: Final = (TRCV_C, FRAMER, CONFIGS / "udp.toml")  # two peers; no peer, a simulated line; USEND_C
SECTION_OF: Final = {
    "1": "1 Instances", "2": "2 Block", "3": "3 STATUS", "4": "4 History", "5": "5 Received",
    "5H": "5 Received", "5D": "5 Messages", "6": "6 Members", "7": "7 Peer", "8": "8 Timing",
}  # fmt: skip
OF_A_LIST: Final = {key for move in MOVES for key in cast(Binding, move).key.split(",")}
WHERE_FOCUSED: Final = {"+", "-", "←", "→", "↑", "↓"}  # on the cuts and buttons of pane 7
IN_WORDS: Final = {"tab", "esc", "⏎", "shift+left", "shift+right"}


class KeyBench(Stage):
    async def go(self, place: str) -> None:
        """Close what is open, and put the focus into a pane, of pane 5 into one of its faces."""
        main, received = self.app.main, self.app.main.received
        while self.app.screen is not main:
            self.app.pop_screen()
            await self.pilot.pause()
        if main.prompt.is_open:
            main.prompt.close()
        main.action_pane(int(place[0]))
        await self.pilot.pause()
        face = {"H": received.past, "D": received.table}.get(place[1:], received.now)
        if place[0] == "5" and received.face is not face:
            await self.press("D" if received.table in (face, received.face) else "H")
            await self.press(*["H"] * (received.face is not face))
        assert place[0] != "5" or (received.face is face and received.has_focus_within)

    @property
    def inputs(self) -> list[object]:
        return [each.inputs for each in self.app.view_model.instances]

    @property
    def own_keys(self) -> set[str]:
        """Return the keys of what has the focus and of the pane around it; without a peer those of a line."""
        main = self.app.main
        above = (main, self.app, *[main.peer] * (not self.app.view_model.project.peers))
        return {key for key, found in self.app.screen.active_bindings.items() if found.node not in above}


def tokens(table: KeyTable) -> set[str]:
    return {token for keys, _ in table for token in keys.replace(",", " ").split()}


@pytest.mark.parametrize("place", SECTION_OF)
@pytest.mark.parametrize("path", BENCHES, ids=lambda path: path.stem)
async def test_a_letter_writes_to_the_plc_in_panes_1_to_3_and_to_the_peer_in_pane_7_alone(
    path: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Timing, "write_vcd", lambda *_: (Path("w"), 0))
    async with on_stage(KeyBench, load_project(path), SMALL) as bench:
        sent: list[str] = []
        submit, prompt = bench.driver.submit, bench.app.main.prompt

        def keep(line: str) -> int:
            sent.append(line)
            return submit(line)

        monkeypatch.setattr(bench.driver, "submit", keep)
        await bench.scan(3)
        pins = {pin.letter: pin for pin in bench.app.main.block.drawing().inputs if pin.letter}
        acts = (
            tokens(PEER_COMMAND_KEYS if bench.app.view_model.project.peers else FEED_KEYS)
            if place == "7"
            else set()
        )
        for key in sorted({*ascii_lowercase, "N", "H", "D"} - {"q"}):
            await bench.go(place)
            before, own = bench.inputs, bench.own_keys
            sent.clear()
            await bench.pilot.press(key)
            await bench.pilot.pause()
            lines, opened = [*sent], prompt._input.value if prompt._input and prompt.is_open else ""
            await bench.scan()
            case = f"{key} in {place}: {lines} {opened!r}"
            if place not in "123" or key not in pins:
                assert bench.inputs == before, case
                assert key in acts or (lines == [] and opened in ("", "find ")), case
                is_told = place in "467" and key in pins and key not in own and "no peer" not in bench.text
                assert not is_told or f"{pins[key].name} is a key of panes 1 to 3" in bench.words, case
            elif pins[key].is_bool:
                assert [line.split()[2].partition("=")[0] for line in lines] == [pins[key].name], case
                assert bench.inputs != before, case
                await bench.scan()  # a pulse is over
            else:
                assert lines == [] and (opened or "✗" in bench.text), case


@pytest.mark.parametrize("path", [TRCV_C, FRAMER], ids=["peers", "line"])
async def test_the_table_names_each_key_that_a_pane_has_and_no_other(path: Path) -> None:
    tables = {title: tokens(table) for title, _, table in HELP_SECTIONS}
    async with on_stage(KeyBench, load_project(path), SMALL) as bench:
        await bench.scan(3)
        for place, title in SECTION_OF.items():
            await bench.go(place)
            named = tables["7 Simulated line" if place == "7" and path == FRAMER else title]
            here = {format_key(key) for key in bench.app.screen.active_bindings}
            assert {key for key in named if len(key) == 1} <= here | WHERE_FOCUSED, place
            named = named | (tables["5 Received"] if place == "5D" else set())
            assert {format_key(key) for key in bench.own_keys - OF_A_LIST} - named <= IN_WORDS, place
