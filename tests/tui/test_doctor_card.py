"""The Doctor card: the findings of the selected instance, its keys to the scan, the byte, the remedy."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from tests.tui.looking import BOTH
from tests.tui.test_stories import Newcomer, opened
from trcvtui.snapshots.doctor import DoctorSnapshot, Finding, Remedy
from trcvtui.tui.doctor import DoctorScreen, FindingList


def finding(cause: str, confidence: float, **more: Any) -> Finding:
    return Finding(confidence, (f"it is {cause}",), cause=cause, **more)


AT_4 = 510_000_000, 4, 8, 1
TITLE = "messages are shorter than a job expects"
LEN_20 = Remedy("LEN 20", "set TRCV_C_1 LEN=20", "instance.TRCV_C_1.LEN=20")
FOUND = [
    finding(
        "frame-short",
        0.9,
        instance="TRCV_C_1",
        way="to-plc",
        at=AT_4,
        t_ns=510_000_000,
        mend=(LEN_20,),
        title=TITLE,
    ),
    finding("shifted", 0.7, instance="TRCV_C_1", scan=60),
    finding("refused", 0.6, instance="OTHER"),
]


def read(newcomer: Newcomer) -> str:
    view = newcomer.app.screen.query_one(FindingList)
    rows = ("".join(text for text, _ in view.row_at(y).parts) for y in range(view.row_count()))
    return " ".join(" ".join(rows).split())


class FixedJudge:
    looks_again = True
    is_judging = is_recording = False
    progress = ""

    def __init__(self, *findings: Finding, trouble: str = "") -> None:
        self.result_json = msgspec.json.encode(DoctorSnapshot(0, 0, 1, findings, trouble))
        self.looks = 0

    def start_judging(self) -> None:
        self.looks += 1

    def poll_process(self) -> None:
        pass


class PatternSearch(FixedJudge):
    progress = "runs it again, scan 3000 of 12000: 25%"

    def start_judging(self) -> None:
        super().start_judging()
        self.is_judging = True


@asynccontextmanager
async def card(
    judge: FixedJudge | None, size: tuple[int, int] = (100, 30)
) -> AsyncIterator[tuple[Newcomer, DoctorScreen]]:
    async with opened("four_bytes_short", size, 80) as newcomer:
        newcomer.bench.console.files_judge = judge
        await newcomer.press("J")
        await newcomer.look(1)
        screen = newcomer.app.screen
        assert isinstance(screen, DoctorScreen)
        yield newcomer, screen


@BOTH
async def test_the_card_has_the_findings_of_the_instance_the_surest_first(size: tuple[int, int]) -> None:
    async with card(FixedJudge(*FOUND), size) as (newcomer, _screen):
        told = read(newcomer)
        assert "1 conversation looked at, up to scan 80" in told
        assert "▸ 1 frame-short TRCV_C_1 90% sure 2 shifted TRCV_C_1 70% sure" in told
        assert "refused" not in told
        assert "it is frame-short" in told and "enter types `set TRCV_C_1 LEN=20`" in told


@BOTH
async def test_the_first_line_tells_how_far_it_is_at_every_look(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("trcvtui.bench.doctor_requests.LOOK_PAUSE_NS", 0)
    monkeypatch.setattr("trcvtui.bench.doctor_requests.REST_FACTOR", 0)
    judge = PatternSearch(FOUND[2])
    async with card(judge, size) as (newcomer, _screen):
        await newcomer.look(1)
        told = read(newcomer)
        assert re.fullmatch(r"the doctor looks, \d+\.\d s: runs it again, scan 3000 of 12000: 25%", told)
        judge.is_judging = False
        await newcomer.look(2)
        assert judge.looks == 2
        await newcomer.look(1)
        told = read(newcomer)
        assert re.search(r"^healthy: 1 conversation looked at, up to .* · again, \d+\.\d s: 25%$", told)
        assert len(told) <= newcomer.app.screen.query_one(FindingList).line_width


async def test_s_goes_to_the_scan_and_b_to_the_byte() -> None:
    async with card(FixedJudge(*FOUND)) as (newcomer, _screen):
        await newcomer.press("s")
        main = newcomer.app.main
        assert newcomer.app.screen is main and main.timing.view.cursor == 52
    async with card(FixedJudge(*FOUND)) as (newcomer, _screen):
        await newcomer.press("b")
        await newcomer.look(1)
        received = newcomer.app.main.received
        assert received.is_past and received.stream.cursor == 4


async def test_enter_types_the_remedy_and_waits_for_another_enter() -> None:
    async with card(FixedJudge(*FOUND)) as (newcomer, _screen):
        await newcomer.press("enter")
        prompt = newcomer.app.main.prompt
        assert prompt.is_open
        assert prompt._input.value == "set TRCV_C_1 LEN=20"
        await newcomer.press("enter")
        await newcomer.look(2)
        instance = newcomer.app.view_model.instance
        assert instance is not None and instance.pin("LEN") == 20


async def test_a_shows_those_of_all_and_arrows_choose() -> None:
    async with card(FixedJudge(*FOUND)) as (newcomer, screen):
        await newcomer.press("a", "down", "down")
        assert "▸ 3 refused OTHER 60% sure" in read(newcomer)
        assert screen.list.find_target() is None and screen.list.remedy_line() == ""


async def test_a_right_line_is_healthy_and_others_are_not_forgotten() -> None:
    async with card(FixedJudge(FOUND[2])) as (newcomer, _screen):
        assert "healthy: 1 conversation looked at, up to scan 80; 1 finding elsewhere: press a" in read(
            newcomer
        )


def seen_finding(cause: str, instance: str, **more: Any) -> Finding:
    why = ("PLC has 8 bytes, a job waits for 12, in 40 of 40 messages",) * 20
    return Finding(0.9, why, "to-plc", AT_4, instance, cause=cause, connect="C1", t_ns=AT_4[0], **more)


@pytest.mark.parametrize("size", [(80, 24), (100, 30), (140, 45)])
async def test_remarks_stand_last_and_leave_the_verdict_alone(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    short = seen_finding(
        "frame-short", "TRCV_C_1", title="Frames are shorter than LEN",
        status=("80C5", "7006"), packets=tuple(range(1, 40)), filter="tcp.stream eq 3 && tcp.len == 8",
    )  # fmt: skip
    remarks = seen_finding("idle", "TRCV_C_1", title="Nothing for long " * 9), seen_finding("idle", "OTHER")
    seen = DoctorSnapshot(1, 80, 1, (short,), remarks=remarks, qualities=("3 gaps " * 40, "cut"))
    monkeypatch.setattr("trcvtui.bench.doctor_requests.read_result", lambda *_: seen)
    async with card(FixedJudge(), size) as (newcomer, screen):
        told = read(newcomer)
        assert re.search(
            r"up to scan 80 3 gaps .*… ▸ 1 frame-short .* Frames are shorter than LEN ── evid", told
        )
        assert "STATUS 80C5, 7006 packets 1, 2, 3, 4, 5, 6, 7, 8 … · tcp.stream eq 3 && tcp.len == 8" in told
        assert re.search(r"── remarks ─+ Nothing for long [^▸]*…$", told) and "OTHER" not in told
        rows = [screen.list.row_at(y) for y in range(screen.list.row_count())]
        assert max(sum(len(text) for text, _ in each.parts) for each in rows) <= screen.list.line_width
        await newcomer.press("down")
        assert screen.list.chosen_finding == short
        await newcomer.press("pagedown")
        assert screen.list.scroll_offset.y == max(0, len(rows) - screen.list.size.height)
        await newcomer.press("a")
        assert "TRCV_C_1: Nothing" in read(newcomer) and "OTHER: idle" in read(newcomer)
    seen = replace(seen, findings=())
    async with card(FixedJudge(), size) as (newcomer, screen):
        assert read(newcomer).startswith("healthy: 1 conversation") and "── remarks" in read(newcomer)
        assert screen.list.chosen_finding is None


async def test_a_run_that_nobody_keeps_says_so() -> None:
    async with card(None) as (newcomer, _screen):
        assert "this run is not kept" in read(newcomer)


async def test_the_doctor_rests_when_the_card_is_closed() -> None:
    judge = FixedJudge(*FOUND)
    async with card(judge) as (newcomer, _screen):
        await newcomer.press("escape")
        await newcomer.look(5)
        assert judge.looks == 1 and not newcomer.app.view_model.doctor_wanted


async def test_a_line_at_the_prompt_is_answered_when_it_has_looked() -> None:
    async with opened("four_bytes_short", (100, 30), 80) as newcomer:
        newcomer.bench.console.files_judge = FixedJudge(*FOUND)
        await newcomer.press("colon")
        for letter in "doctor C1":
            await newcomer.press("space" if letter == " " else letter)
        await newcomer.press("enter")
        await newcomer.look(1)
        assert "frame-short (90% sure), TRCV_C_1" in newcomer.read("prompt")


async def test_the_status_pane_has_the_verdict_first_and_what_mends_it() -> None:
    async with card(FixedJudge(*FOUND)) as (newcomer, _screen):
        await newcomer.press("escape")
        await newcomer.look(1)
        read = newcomer.read("status")
        assert "Messages are shorter than a job expects (frame-short, 90% sure up to scan 80)." in read
        assert "do · LEN 20" in read and "J shows the evidence" in read
