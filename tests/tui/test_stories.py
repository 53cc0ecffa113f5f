"""The three prepared faults as a newcomer meets them: opened, a key or two, the screen names the cause."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import BOTH
from tests.tui.on_a_bench import LocalLooker, on_local
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.paths import demo_path
from trcvtui.plc.ledger import StatusEdge
from trcvtui.scenario.scenario import load_bench_project

Size = tuple[int, int]


class Newcomer(LocalLooker):
    def read(self, pane: str) -> str:
        return " ".join(re.sub("[─-╿▁-█]", " ", self.words(pane)).split())

    def value(self, member: str) -> str:
        line = re.sub("[─-╿▁-█]", " ", self.line(f" {member} ", "udt"))
        return line.split()[-1]

    async def look(self, scans: int) -> None:
        self.bench.scan(scans)
        await self.see()


@asynccontextmanager
async def opened(story: str | Path, size: Size, scans: int) -> AsyncIterator[Newcomer]:
    project = load_bench_project(story if isinstance(story, Path) else CONFIGS / "stories" / f"{story}.toml")
    async with on_local(Newcomer, project, size) as newcomer:
        await newcomer.look(scans)
        yield newcomer


@BOTH
async def test_four_bytes_short_is_named_and_so_is_the_member_that_is_missing(size: Size) -> None:
    async with opened("four_bytes_short", size, 600) as newcomer:
        assert "7006 receiving" in newcomer.text
        await newcomer.press("3")
        card = newcomer.read("status")
        assert "Stuck: 20 of 24 bytes received, the last one" in card
        assert "LEN is 0 and DATA (screw) has 24 bytes. Station's only message had 20 bytes" in card
        assert "4 bytes too large for this sender" in card
        assert "The last whole member is program; tool is missing" in card
        assert "do · Match the message: press l (LEN=20), or give DATA 20 bytes; then press x" in card
        await newcomer.press("6", "v")
        assert newcomer.value("program") == "3"
        assert newcomer.value("tool") == "-"


@BOTH
async def test_a_look_back_at_where_en_r_fell_touches_no_input_and_goes_from_hit_to_hit(
    size: Size, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with opened("en_r_dropped", size, 960) as newcomer:
        sent: list[str] = []
        monkeypatch.setattr(newcomer.bench, "submit", sent.append)
        inputs = [instance.inputs for instance in newcomer.app.view_model.instances]
        await newcomer.press("4", "slash")
        await newcomer.type("7004\r")
        scans = []
        for key in ("", "n", "n", "N", "exclamation_mark"):
            await newcomer.press(*[key] * bool(key))
            chosen = newcomer.app.main.history.find_chosen_line()
            scans.append(chosen.scan if chosen is not None else None)
        assert scans[::2][:2] == [672, 672] and scans[1] == scans[3] and (scans[1] or 672) < 672
        assert "no ERROR" in newcomer.text
        await newcomer.press("escape", "n")
        assert newcomer.app.main.history.find_chosen_line() is None, "without a code n looks for an ERROR"
        assert sent == [] and inputs == [instance.inputs for instance in newcomer.app.view_model.instances]


STARTS = [*sorted(CONFIGS.glob("*.toml")), *sorted((CONFIGS / "stories").glob("*.toml")), demo_path()]


@pytest.mark.parametrize("path", STARTS, ids=[path.stem for path in STARTS])
async def test_a_shipped_project_starts_without_an_error_and_its_program_comes_to_its_end(path: Path) -> None:
    console = Controller(fresh_bench(load_bench_project(path), "sim"))
    for scan in range(1000):
        console.scan()
        for peer in console.bench.peers.values() if scan == 50 else ():
            if peer.decl.active and not peer.is_in("connected"):
                console.handle_line(scan, f"peer {peer.decl.name} connect")
    edges = [line.event for line in console.bench.runtime.ledger if isinstance(line.event, StatusEdge)]
    assert [edge for edge in edges if edge.outputs.error and not edge.cause.is_expected] == []
    assert not any("gave up" in str(line.event) for line in console.bench.runtime.ledger)
    waits = [edge.cause for edge in edges if edge.cause.is_expected]
    assert not waits or path.stem == "twincat-stream"
    console.bench.close()


@asynccontextmanager
async def from_nothing(folder: Path, size: Size) -> AsyncIterator[Newcomer]:
    path = folder / "new.toml"
    path.write_text('dialect = "baosky"\n')
    async with opened(path, size, 2) as newcomer:
        await newcomer.press("A", "enter")
        await newcomer.look(2)
        await newcomer.press("t")
        await newcomer.look(5)
        yield newcomer


@BOTH
async def test_an_en_r_before_the_first_connection_is_no_error_to_look_after(
    tmp_path: Path, size: Size
) -> None:
    async with from_nothing(tmp_path, size) as newcomer:
        await newcomer.press("n", "3")
        await newcomer.look(20)
        card = newcomer.read("status")
        assert "note 16#80A1 expected: EN_R came before the connection; once that is up, it receives" in card
        assert "last error" not in newcomer.text and "ERROR □" in card and "ERROR ◆" not in card
        assert "E□" in newcomer.pane("instances")
        newcomer.bench.submit("add peer P1 remote=@C1")
        newcomer.bench.scan(2)
        newcomer.bench.submit("peer P1 connect")
        await newcomer.look(20)
        assert "16#7006" in newcomer.text and "16#80A1" not in newcomer.read("status")


@BOTH
async def test_an_en_r_after_a_connection_was_lost_is_an_error(tmp_path: Path, size: Size) -> None:
    async with from_nothing(tmp_path, size) as newcomer:
        newcomer.bench.submit("add peer P1 remote=@C1")
        newcomer.bench.scan(2)
        for line in ("peer P1 connect", "peer P1 rst", "set TRCV_C_1 EN_R=1"):
            newcomer.bench.submit(line)
            newcomer.bench.scan(20)
        await newcomer.look(100)
        await newcomer.press("3")
        assert "last error 16#80A1 in scan" in newcomer.read("status")
        assert "expected" not in newcomer.read("status")
