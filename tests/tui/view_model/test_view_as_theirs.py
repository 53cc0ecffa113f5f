"""`V`: DATA is viewed as theirs, in the layout that fits what came; the STATUS card offers it."""

from __future__ import annotations

import struct

import pytest

from tests.tui.looking import SMALL, WIDE
from tests.tui.on_a_bench import LocalLooker, on_local
from tests.tui.view_model.test_explain import SWAPPED, UP, Desk, at_the_desk
from trcvtui.paths import configs_path
from trcvtui.project.project import DataDecl
from trcvtui.scenario.scenario import load_bench_project

SIZES = pytest.mark.parametrize("size", [SMALL, (120, 40), WIDE], ids=["80x24", "120x40", "wide"])
PACKED = struct.pack(">ihBf", 41, 1, 1, 1234.5) + b"\x08\x05hello\x00\x00\x00"


def rx(desk: Desk) -> DataDecl:
    found = desk.app.view_model.project.data_decl("rx")
    assert found is not None
    return found


@SIZES
async def test_swapped_values_are_read_as_theirs_by_a_key_and_as_ours_again(size: tuple[int, int]) -> None:
    async with at_the_desk(size, *UP, f"peer P1 send hex {SWAPPED.hex(' ')}", "run 5") as desk:
        await desk.press("3", "M")
        card = desk.words("status")
        assert "do Press V to read DATA with byte_order=big." in card
        await desk.press("V")
        await desk.do("run 3")
        assert rx(desk).layout.rules.byte_order == "big"
        assert "Press V" not in desk.words("status")
        await desk.press("6")
        assert "1234.5" in desk.text and "big-endian" in desk.text
        await desk.press("V")
        await desk.do("run 3")
        assert rx(desk).layout.rules.byte_order == "little" and str(rx(desk).choice) == ""


@SIZES
async def test_a_packed_sender_is_offered_by_the_size_of_what_came(size: tuple[int, int]) -> None:
    assert len(PACKED) == 21
    send = f"peer P1 send hex {PACKED.hex(' ')}"
    async with at_the_desk(size, *UP, send, "run 300") as desk:
        await desk.press("3", "M")
        card = desk.words("status").replace("│ │ ", "")
        assert "21 bytes came: the size of Telegram in the layout packed" in card
        assert "Press V to read DATA with layout=packed byte_order=big." in card
        await desk.press("V")
        await desk.do("run 3", "set TRCV_C_1 EN_R=0", "run 3", "set TRCV_C_1 EN_R=1", "run 3", send, "run 3")
        assert (rx(desk).size, rx(desk).layout.rules.name) == (21, "packed")
        await desk.press("6")
        assert "1234.5" in desk.text and "packed, big-endian" in desk.text


async def test_where_nothing_speaks_for_another_layout_v_says_so() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.press("V")
        assert "no other layout fits the received bytes: L opens the lab" in desk.text
        assert rx(desk).size == 24


async def test_the_lab_takes_theirs_into_data() -> None:
    async with at_the_desk(WIDE, *UP) as desk:
        await desk.press("L")
        desk.app.screen.run_line("udt theirs natural8 big cstr")  # type: ignore[attr-defined]
        await desk.press("V")
        await desk.do("run 3")
        assert str(rx(desk).choice) == "layout=natural8 byte_order=big text=cstr"


@pytest.mark.parametrize("scans", [105, 215, 333, 1111])
async def test_the_byte_order_is_that_of_whole_messages_wherever_the_running_job_began(scans: int) -> None:
    project = load_bench_project(configs_path() / "guide" / "filler-twincat.toml")
    async with on_local(LocalLooker, project, SMALL) as looker:
        looker.bench.scan(scans)
        await looker.see()
        await looker.press("3", "V")
        looker.bench.scan(20)
        await looker.see()
        decl = looker.bench.bench.project.data_decl("rx")
        assert decl is not None and str(decl.choice) == "layout=baosky"  # which is little-endian, as sent
