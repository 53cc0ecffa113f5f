"""The function block with the pins of its dialect, and the connection description byte for byte."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

from tests.scenario.scenarios import CONFIGS
from tests.tui.looking import BOTH, SMALL, WIDE, same_screen
from tests.tui.stage import Stage, on_stage
from trcvtui.net.connection.description import Description, pack
from trcvtui.project.project import Project
from trcvtui.scenario.scenario import load_scenario
from trcvtui.tui.forms.description import DescriptionScreen

SCENARIOS = CONFIGS / "scenarios"
SINGLE, UDP = "siemens/1-10-single-instructions.toml", "siemens/udp-send-and-receive.toml"


class Bench(Stage):
    def cells(self, field: str) -> list[str]:
        found = re.search(rf"\d+ +{field} [^│]*", self.text)
        assert found is not None, self.text
        return found[0].split()

    def offset_of(self, connect: str, field: str) -> int:
        config = self.app.view_model.project.connect(connect)
        assert config is not None and config.description is not None
        found = config.description.structure.field(field)
        assert found is not None
        return found.offset


def project_of(scenario: str) -> Project:
    return load_scenario(SCENARIOS / scenario).project


@asynccontextmanager
async def bench(scenario: str, size: tuple[int, int] = SMALL) -> AsyncIterator[Bench]:
    async with on_stage(Bench, project_of(scenario), size) as shown:
        await shown.do()
        yield shown


# -- the pins of the dialect ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "instance", "there", "missing"),
    [
        ("siemens/1-5-trcv_c-cont-then-en_r.toml", "TRCV_C_1", ["ADHOC", "├─ DONE (NDR)", "RCVD_LEN"], []),
        ("siemens-legacy/1-11-receiver.toml", "TRCV_C_1", ["LEN", "├─ DONE (NDR)", "RCVD_LEN"], ["ADHOC"]),
        (SINGLE, "TRCV_1", ["EN_R", "├─ NDR", "RCVD_LEN"], ["├─ DONE"]),
        (SINGLE, "TSEND_1", ["REQ ▷┤", "├─ DONE", "LEN ─┤"], ["NDR", "RCVD_LEN"]),
        (SINGLE, "T_DIAG_1", ["REQ ▷┤", "├─ DONE", " RESULT "], ["LEN", " DATA "]),
        (UDP, "TURCV_1", ["EN_R", "├─ NDR", "CONFIG", "SOURCE"], ["ADHOC"]),
        (UDP, "TUSEND_1", ["REQ ▷┤", "├─ DONE", "CONFIG", "TARGET"], ["NDR"]),
        ("baosky/7004-idle.toml", "TRCV_C_1", ["ADHOC", "├─ DONE "], ["NDR"]),
    ],
)  # fmt: skip
async def test_a_block_is_drawn_with_the_pins_that_its_manual_draws(
    scenario: str, instance: str, there: list[str], missing: list[str]
) -> None:
    async with bench(scenario) as shown:
        await shown.select(instance)
        box = shown.text.partition("┌")[2]
        assert all(pin in box for pin in there), shown.text
        assert not any(pin in box for pin in missing), shown.text


@BOTH
async def test_a_single_instruction_shows_the_id_of_its_connection_and_lets_nobody_change_it(
    size: tuple[int, int],
) -> None:
    async with bench(SINGLE, size) as shown:
        await shown.select("TSEND_1")
        assert re.search(r"REQ ▷┤.*\n.*  ID ─┤ 1 .*\n.*LEN ─┤ 0", shown.text)
        await shown.press("down", "enter")
        assert "ID is 1: the description of C1 sets it (C)" in shown.words
        await shown.select("TCON_1")
        assert "ID ─┤ 1" in shown.text and "CONNECT C1" in shown.words
        assert " ID ─┤" not in shown.text.replace("ID ─┤ 1", "")


async def test_a_block_with_connect_alone_has_no_id() -> None:
    async with bench("siemens/1-5-trcv_c-cont-then-en_r.toml") as shown:
        await shown.select("TRCV_C_1")
        assert "ID ─┤" not in shown.text


async def test_done_keeps_its_scan_where_its_whole_name_has_no_room() -> None:
    async with bench("siemens/1-5-trcv_c-cont-then-en_r.toml", WIDE) as shown:
        await shown.select("TRCV_C_1")
        await shown.do("set TRCV_C_1 CONT=1 EN_R=1", scans=3)
        await shown.do("peer P1 connect", scans=4)
        await shown.do("peer P1 send hex " + "01 " * 8, scans=2)
        await shown.do(scans=3)
        assert "├─ DONE scan 9 " in shown.text, shown.text
        assert "(NDR)" not in shown.text


# -- the connection description byte for byte ----------------------------------------------------------------


@BOTH
async def test_a_description_stands_there_byte_for_byte(size: tuple[int, int]) -> None:
    async with bench("siemens/1-5-trcv_c-cont-then-en_r.toml", size) as shown:
        await shown.press("2", "C")
        assert "C1 · 14 bytes" in shown.text and "TCON_IP_v4 · TCP, passive on" in shown.text
        assert shown.cells("InterfaceId") == ["0", "InterfaceId", "00", "40", "64", "(16#40)"]
        assert shown.cells("ConnectionType")[:3] == ["4", "ConnectionType", "0b"]
        assert shown.cells("RemoteAddress")[0] == "6"
        await shown.press("escape")
        assert shown.app.screen is shown.app.main


@BOTH
async def test_what_a_cpu_finds_wrong_is_named_at_its_field(size: tuple[int, int]) -> None:
    async with bench("siemens/description-faults.toml", size) as shown:
        wrong = next(each for each in shown.app.view_model.project.connects if each.flaw and each.flaw.field)
        assert wrong.flaw is not None
        await shown.select(next(i.name for i in shown.app.view_model.instances if i.connect == wrong.name))
        await shown.press("C")
        assert f"✗ {wrong.flaw.text}"[:50] in shown.words
        assert f"✗ {shown.offset_of(wrong.name, wrong.flaw.field):>4}   {wrong.flaw.field} " in shown.text
        await shown.press("right")
        assert f"─ {wrong.name} · " not in shown.text, "another CONNECT of the project"


async def test_a_long_name_takes_as_many_lines_as_it_needs_and_its_zeros_one() -> None:
    async with bench("siemens/80d3-names.toml") as shown:
        await shown.press("2", "C")
        assert "RemoteQDN" in shown.text and "00 × " in shown.text
        assert "LocalPort" in shown.text, "a structure of 266 bytes fits a small screen"


async def test_a_long_value_goes_on_below_instead_of_being_cut() -> None:
    name = "a-rather-long-host-name.of-a-line.in-a-hall.of-a-plant.example."
    async with bench("siemens/80d3-names.toml") as shown:
        config = shown.app.view_model.project.connects[0]
        assert config.description is not None
        values = {**config.description.values(), "RemoteQDN": name}
        structure = config.description.structure
        longer = replace(config, description=Description(structure, pack(structure, values)))
        await shown.app.push_screen(DescriptionScreen([longer], longer.name, {}))
        await shown.press()
        column = shown.line("RemoteQDN").index("a-rather")
        shown_name = "".join(line[column:].split("│")[0].strip() for line in shown.text.splitlines()[1:])
        assert name in shown_name and "…" not in shown_name


async def test_a_description_is_yanked_as_hex_and_as_scl(state: Path) -> None:
    async with bench("siemens/1-5-trcv_c-cont-then-en_r.toml") as shown:
        await shown.press("C", "y")  # from any pane
        await shown.app.workers.wait_for_complete()
        await shown.press("s")
        await shown.app.workers.wait_for_complete()
        kept = {path.suffix: path.read_text(encoding="utf-8") for path in state.rglob("yanks/*")}
        assert kept[".txt"].startswith("00 40 00 01 0b 00 ")
        assert "C1 : TCON_IP_v4 := (" in kept[".scl"] and "ConnectionType := 11" in kept[".scl"]


async def test_a_dialect_without_descriptions_says_so() -> None:
    async with bench("baosky/7004-idle.toml") as shown:
        await shown.press("2", "C")
        assert "no CONNECT of this project has a connection description" in shown.words


async def test_it_stands_as_drawn(tmp_path: Path) -> None:
    async with bench("siemens/description-faults.toml", WIDE) as shown:
        await shown.press("2", "C")
        same_screen(shown.app, "description-140x45", tmp_path)
