"""The whole bench at 140x45: timing is a strip of its own, every number stands whole, no pane loses a row."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from tests.tui.fakes import armed, connecting, edge, picture, received, receiving, written
from tests.tui.looking import WIDE, looking
from tests.tui.on_a_bench import on_a_bench
from trcvtui.blocks.conditions import Condition

LONG = written((880, armed()), (902, received(65535)), (903, armed()))


async def test_timing_stands_beside_history_from_the_first_frame_on() -> None:
    async with on_a_bench() as looker:
        looker.bench.do("set TRCV_C_1 CONT=1 EN_R=1", scans=5)
        looker.bench.do("peer P1 connect", scans=9)
        await looker.pictures()
        strip = looker.pane("timing").splitlines()
        assert [line.split()[0].lstrip("▸") for line in strip[2:5]] == ["STATUS", "EN_R", "DONE"]
        assert "7006" in strip[2]
        assert "why" in looker.pane("history") and "receiving" in looker.pane("history")
        assert looker.app.main.query_one("#peer").size.height == 7, "nine rows with its frame"
        await looker.press("8")
        assert "codes" in looker.pane("timing"), "with the focus it gets more"
        assert "4 History" in looker.text


async def test_the_length_of_a_long_job_stands_whole_in_block_and_history() -> None:
    whole = replace(receiving(), last_rcvd_len=65535)
    shown = picture(whole, connecting(), scan=910, t_ns=9_090_000_000, lines=LONG)
    async with looking(WIDE, shown) as looker:
        assert "65535 B" in looker.line("RCVD_LEN", "block")
        assert "■ DONE 65535 B  " in looker.line("65535", "history")


async def test_the_last_error_is_never_cut_in_its_number() -> None:
    late = replace(receiving(), last_error_status=0x80A1, last_error_scan=123456)
    for size in ((80, 24), (200, 60)):
        async with looking(
            size, picture(late, connecting(), lines=LONG, scan=910, t_ns=9_090_000_000)
        ) as looker:
            await looker.press("3")
            assert "last error 16#80A1 in scan 123456" in looker.words("status")


async def test_at_40x10_one_pane_stands_with_content_and_the_lamps_are_there() -> None:
    async with looking((40, 10)) as looker:
        assert all(lamp in looker.text.splitlines()[1] for lamp in ("TRCV_C_1", "7006", "B■", "D", "E"))
        for key, pane, word in (
            ("3", "status", "Receiving"),
            ("5", "received", "0000"),
            ("6", "udt", "speed"),
        ):
            await looker.press(key)
            assert looker.app.main.query_one(f"#{pane}").size.height >= 4
            assert word in looker.pane(pane)
        assert " 6 Members" in looker.text.splitlines()[2] and looker.text.splitlines()[2].endswith(" 8")


async def test_the_history_goes_to_the_error_before_and_asks_for_a_code() -> None:
    edges = written((4, edge(0x80A1, Condition.NOT_CONNECTED, error=True)), (9, armed()), (12, received(24)))
    async with looking(WIDE, picture(lines=edges)) as looker:
        await looker.press("4", "exclamation_mark")
        assert "scan 4, in the past" in looker.text and "80A1" in looker.pane("status")
        await looker.press("3")
        assert "esc now" in looker.text.splitlines()[-1]
        await looker.press("4", "slash")
        assert "find" in looker.pane("open-line")


async def test_what_is_wrong_in_the_settings_stands_in_the_help_one_by_one(tmp_path: Path) -> None:
    (tmp_path / "config" / "trcvtui").mkdir(parents=True)
    (tmp_path / "config" / "trcvtui" / "config.toml").write_text("foo = 1\nbar = 2\n")
    async with looking(WIDE) as looker:
        assert "(and 1 more: ? lists all)" in " ".join(looker.text.split())
        await looker.press("question_mark")
        assert "found 'foo', expected theme" in looker.text and "found 'bar', expected theme" in looker.text
