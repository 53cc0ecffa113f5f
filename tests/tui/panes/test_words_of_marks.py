"""Words and colours of marks: a passive 7002 listens, DONE is green, old bytes of DATA are dim."""

from __future__ import annotations

from msgspec.structs import replace

from tests.tui.fakes import picture, receiving
from tests.tui.looking import WIDE, looking
from tests.tui.on_a_bench import on_a_bench
from trcvtui.plc.snapshot import DataSummary


async def test_a_passive_7002_is_listening_and_without_its_port_or_an_active_one_is_connecting() -> None:
    async with on_a_bench((140, 60)) as looker:
        looker.bench.do("set TRCV_C_1 CONT=1", scans=5)
        looker.bench.do("set TRCV_C_2 CONT=1", scans=5)
        await looker.pictures()
        assert "7002 listening" in looker.line("TRCV_C_1 ") and "7002 connecting" in looker.line("TRCV_C_2 ")
        assert "passive, listening" in looker.line("CONNECT", "block")
        assert "7002 listening" in looker.pane("history")
        looker.bench.do("set TRCV_C_1 CONT=0", scans=5)
        looker.bench.do("fault bind EADDRINUSE on C1")
        looker.bench.do("set TRCV_C_1 CONT=1", scans=20)
        await looker.pictures()
        assert "listening" not in looker.line("TRCV_C_1 ") and "listening" not in looker.line(
            "CONNECT", "block"
        )


async def test_bytes_of_data_that_the_newest_job_did_not_write_are_dim_and_counted() -> None:
    shown = picture(replace(receiving(), data="rx"), data=b"9031101733931" + bytes(11))
    known = DataSummary("rx", "Telegram", 24, 2, newest=8, longest=13)
    shown = replace(shown, snapshot=replace(shown.snapshot, data=(known,)))
    async with looking(WIDE, shown) as looker:
        await looker.press("5")
        assert "rx · 8 of 13 B are new" in looker.text
        parts = looker.app.main.received.data.row_at(0).parts
        dim = [text for text, style in parts if style == "faint" and len(text) == 2]
        assert dim[:5] == ["33", "33", "39", "33", "31"]


async def test_the_header_tells_of_lateness_only_while_it_is_bad() -> None:
    good = picture()
    async with looking(WIDE, good) as looker:
        assert "late" not in looker.text and "overrun" not in looker.text
        await looker.show(replace(good, timing=replace(good.timing, overruns=2, late_ns=7_000_000)))
        assert "7 ms late" in looker.text and "2 overruns" in looker.text
