"""Pane 3 types what its `do` says: the first remedy that was tried, or needs no trial; else it says so."""

from __future__ import annotations

from typing import Any

import pytest

from tests.tui.looking import BOTH, SMALL
from tests.tui.on_a_bench import on_a_bench
from tests.tui.test_doctor_card import FixedJudge, card, finding
from tests.tui.test_stories import Newcomer
from trcvtui.plc.ledger import InputEdge

LEN_20 = {"text": "LEN 20", "command": "set TRCV_C_1 LEN=20", "set": "instance.TRCV_C_1.LEN=20"}
ANEW = {"text": "COM_RST", "command": "pulse TRCV_C_1 COM_RST", "set": None}
BY_HAND = {"text": "members for the 4 bytes", "command": None, "set": None}


def found(*mends: dict[str, Any], tried: bool = True) -> FixedJudge:
    some = [{**mend, "tried": tried} for mend in mends]
    return FixedJudge(finding("frame-short", 0.9, instance="TRCV_C_1", mend=some))


def typed(newcomer: Newcomer) -> str:
    prompt = newcomer.app.main.prompt
    return prompt._input.value if prompt.is_open else ""


def did(newcomer: Newcomer) -> list[str]:
    edges = [line.event for line in newcomer.bench.console.bench.runtime.ledger]
    return [e.pin for e in edges if isinstance(e, InputEdge) and e.pin in ("LEN", "COM_RST")]


@BOTH
async def test_two_steps_that_were_tried_go_one_after_the_other(size: tuple[int, int]) -> None:
    async with card(found(LEN_20, ANEW), size) as (newcomer, _):
        await newcomer.press("escape", "2", "a")
        await newcomer.look(2)
        await newcomer.press("3", "enter")
        newcomer.app.main.show()  # the ✓ of a line before is seen again
        await newcomer.look(2)
        assert typed(newcomer) == "set TRCV_C_1 LEN=20" and did(newcomer) == []
        assert "then pulse TRCV_C_1 COM_RST" in newcomer.words("echo")
        await newcomer.press("enter")
        for _look in range(4):
            await newcomer.look(2)
        assert did(newcomer)[:2] == ["LEN", "COM_RST"]
        await newcomer.press("enter")
        assert "LEN" not in typed(newcomer), "that is done"


WRONG = {**LEN_20, "command": "set TRCV_C_1 LENGTH=20"}


@pytest.mark.parametrize(
    ("first", "keys"),
    [(LEN_20, ("backspace", "1", "enter")), (LEN_20, ("escape",)), (WRONG, ("enter",))],
    ids=["changed", "left", "refused"],
)
async def test_a_first_step_that_is_not_done_takes_no_second_one_along(
    first: dict[str, Any], keys: tuple[str, ...]
) -> None:
    async with card(found(first, ANEW), SMALL) as (newcomer, _):
        await newcomer.press("escape", "3", "enter", *keys)
        for _look in range(3):
            await newcomer.look(2)
        assert "COM_RST" not in did(newcomer)


@pytest.mark.parametrize(
    "judge",
    [found(LEN_20, ANEW, tried=False), found(LEN_20, BY_HAND)],
    ids=["not tried", "tried with what no line does"],
)
async def test_what_may_do_harm_is_never_typed(judge: FixedJudge) -> None:
    async with card(judge, SMALL) as (newcomer, _):
        await newcomer.press("escape", "3", "enter")
        assert typed(newcomer) == "" and "J tries it" in newcomer.words("echo")
        await newcomer.press("2", "l")
        assert typed(newcomer) == "set TRCV_C_1 LEN="


@BOTH
async def test_a_len_that_the_block_refuses_is_mended_from_its_card(size: tuple[int, int]) -> None:
    async with on_a_bench(size) as looker:
        looker.connect()
        looker.bench.do("set TRCV_C_1 LEN=99 EN_R=0", scans=3)
        looker.bench.do("set TRCV_C_1 EN_R=1", scans=5)
        await looker.press("3")
        await looker.pictures()
        assert "ERROR" in looker.line("16#80", "status")
        status = looker.app.main.status
        await looker.press("l")
        assert looker.app.main.prompt._input.value == "set TRCV_C_1 LEN=0"
        await looker.press("escape")
        status.click(9, status._do_rows[0])
        await looker.press("enter")
        assert looker.lines == ["set TRCV_C_1 LEN=0"]
        looker.app.only_looks = True
        await looker.press("enter")
        assert not looker.app.main.prompt.is_open and "sends no commands" in looker.words("echo")
