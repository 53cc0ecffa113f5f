"""Pane 5 as a table (`D`): each message of the instance, its bytes and members, filtered and as CSV."""

from __future__ import annotations

import csv
import struct
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

from tests.tui.fakes import picture
from tests.tui.looking import SMALL, WIDE, Looker, looking
from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.history.messages import MessageRow, MessagesDelta
from trcvtui.tui.main import MESSAGES_CLASS
from trcvtui.tui.panes.message_list import MessageLines
from trcvtui.tui.widgets.line_view import EMPTY, Part

LARGE, HUGE = (200, 55), (200, 80)
SIZES = pytest.mark.parametrize("size", [SMALL, (100, 30), WIDE, LARGE, HUGE], ids="{0[0]}x{0[1]}".format)
NAN = float("nan")


def telegram(id: int, speed: float, tag: bytes = b"abc", state: int = 1, alarm: int = 1) -> bytes:
    return struct.pack("<ihBxf", id, state, alarm, speed) + bytes((8, len(tag))) + tag.ljust(10, b"\0")


def message(number: int, content: bytes | None, **more: object) -> MessageRow:
    size = len(content) if content is not None else 24
    shown = MessageRow(number, number, number * 10**9, 10**7, size, 0x7008, "C1", 0, "", size, content)
    return shown._replace(**more)  # type: ignore[arg-type]


@asynccontextmanager
async def with_rows(*rows: MessageRow, oldest: int = 0) -> AsyncIterator[Looker]:
    """Open the table on rows that the engine is said to have."""
    async with looking(LARGE) as looker:
        await looker.press("D")
        delta = MessagesDelta("TRCV_C_1", 0, len(rows), rows, oldest)
        await looker.show(replace(picture(), messages=delta))
        yield looker


@asynccontextmanager
async def received(count: int, size: tuple[int, int] = WIDE) -> AsyncIterator[BenchLooker]:
    async with on_a_bench(size) as looker:
        looker.connect()
        for number in range(count):
            looker.bench.do(f"peer P1 send hex {telegram(number, number / 4).hex()}", scans=4)
        await looker.pictures()
        yield looker


async def press(looker: BenchLooker, *keys: str) -> None:
    for key in keys:
        await looker.press(key)
    await looker.pictures()


def numbers(looker: Looker) -> list[int]:
    return [row.number for row in looker.app.main.received.table.messages.rows()]


def table(looker: Looker) -> list[str]:
    """Return the rows of the table that are in view."""
    return [line.rstrip() for line in looker.pane("messages").splitlines() if line.strip(" ▸")]


def title(looker: Looker) -> str:
    return str(looker.app.main.received.border_title)


@SIZES
async def test_d_shows_the_messages_with_bytes_and_members_and_gives_the_screen_back(
    size: tuple[int, int],
) -> None:
    async with received(12, size) as looker:
        await press(looker, "5")
        before, main = looker.text, looker.app.main
        await press(looker, "D")
        assert "0.110 24 7008 0 " in " ".join(table(looker)[0].split()) and "▸" in table(looker)[-1]
        assert ("scan" in looker.words("message-head")) == (size == LARGE)
        assert "B STATUS id state" in looker.words("message-head")
        assert "0b 00 00 00" in looker.words("message"), "the bytes of message 12"
        assert main.has_class(MESSAGES_CLASS) == (size[1] < 80)
        if size != SMALL:
            assert "2.75" in looker.line(" speed ", "udt")
        await press(looker, "up", "up")
        assert "09 00 00 00" in looker.words("message")
        if size == SMALL:
            await press(looker, "6")
        assert "2.25" in looker.line(" speed ", "udt")
        await press(looker, "5", "D")
        assert looker.text == before


async def test_new_rows_are_followed_until_one_is_chosen_and_the_other_panes_go_to_its_scan() -> None:
    async with received(5, HUGE) as looker:
        rows, main = looker.app.main.received.table.messages, looker.app.main
        await press(looker, "D", "up")
        looker.bench.do(f"peer P1 send hex {telegram(5, 9).hex()}", scans=4)
        await looker.pictures()
        chosen = rows.find_current_row()
        assert chosen is not None and (chosen.number, numbers(looker)[-1]) == (4, 6)
        assert main.timing.view.cursor == chosen.scan and f"scan {chosen.scan}, in" in looker.pane("status")
        assert "end follows" in title(looker)
        await press(looker, "F", "end")
        assert "frozen" in title(looker) and "in the past" not in looker.pane("status")
        looker.bench.do(f"peer P1 send hex {telegram(6, 9).hex()}", scans=4)
        await looker.pictures()
        assert numbers(looker)[-1] == 6
        await press(looker, "F")
        chosen = rows.find_current_row()
        assert chosen is not None and chosen.number == 7


async def test_what_is_not_known_of_a_message_is_empty_and_its_reason_is_said() -> None:
    rows = [
        message(1, None, have=24),
        message(2, telegram(2, 2.5)[:10], reason="FIN"),
        message(3, telegram(3, 3.5)[:9]),
        message(4, telegram(4, 4.5)[:6], size=24, reason="hole"),
        message(5, b""),
        message(6, bytes(65_535), status=-1, gap_ns=None),
    ]
    async with with_rows(*rows, oldest=1) as looker:
        lines = [" ".join(line.split()) for line in table(looker)]
        assert lines == [
            "1 1 1.000 10 ms 24 7008", "2 2 2.000 10 ms 10 7008 FIN",
            "3 3 3.000 10 ms 9 7008 3 1 (Running) TRUE", "4 4 4.000 10 ms 24 7008 hole",
            "5 5 5.000 10 ms 0 7008", "▸ 6 6 6.000 65535 0 0 (Idle) FALSE 0.0 '' (head…, not 8)",
        ]  # fmt: skip
        assert "values from 2 on" in title(looker)
        await looker.press("home")
        assert looker.words("origin-line") == "message 1: its values are no longer in the ring"
        assert "00" not in looker.words("message") and "3.5" not in looker.pane("udt")
        await looker.press("n", "n", "n")
        assert "04 00 00 00 01 00 ??" in looker.words("message"), "the rest was never captured"


async def test_hostile_values_stay_text_in_the_table_and_become_no_formula_in_a_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    tags = [b"\x1b[31mred", b"[b]no", b"=1+1", b"@x", b"\tx", b"plain"]
    rows = [message(n, telegram(n, NAN, tag, state=7, alarm=7)) for n, tag in enumerate(tags, 1)]
    async with with_rows(*rows) as looker:
        found = looker.pane("messages")
        assert "\x1b" not in looker.text and "'[b]no'" in found and "NaN" in found and "(no name)" in found
        await looker.press("y")
        await looker.app.workers.wait_for_complete()
        (file,) = (tmp_path / "trcvtui" / "yanks").iterdir()
        with file.open(newline="", encoding="utf-8") as text:
            read = list(csv.DictReader(text))
        assert [line["n"] for line in read] == list("123456") and read[0]["hex"].startswith("01 00 00 00")
        assert [line["tag"] for line in read] == ["\\x1b[31mred", "[b]no", "'=1+1", "'@x", "'\\tx", "plain"]


async def test_a_filter_acts_as_it_is_typed_and_what_cannot_be_read_leaves_the_last_in_force(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    async with received(8) as looker:
        await press(looker, "D", "slash")
        await looker.type("speed > 1")
        assert numbers(looker) == [6, 7, 8] and "3 of 8 with speed > 1" in title(looker)
        await looker.type("x")
        assert numbers(looker) == [6, 7, 8] and "'1x'" in title(looker)
        await press(looker, "backspace", "enter")
        looker.bench.do(f"peer P1 send hex {telegram(1, 0.5).hex()}", scans=4)
        looker.bench.do(f"peer P1 send hex {telegram(1, 50).hex()}", scans=4)
        await looker.pictures()
        await press(looker, "up", "N", "n")
        shown = looker.app.main.received.table.messages.find_current_row()
        assert numbers(looker) == [6, 7, 8, 10] and shown is not None and shown.number == 8
        assert looker.lines == [], "n is not EN_R here"
        await press(looker, "y")
        (file,) = (tmp_path / "trcvtui" / "yanks").iterdir()
        assert [line.split(",")[0] for line in file.read_text().splitlines()] == ["n", "6", "7", "8", "10"]
        await press(looker, "escape")
        assert len(numbers(looker)) == 10 and "with" not in title(looker)
        await press(looker, "slash")
        assert numbers(looker) == [6, 7, 8, 10], "what stands in the line is in force"
        await press(looker, "escape")
        assert len(numbers(looker)) == 10


async def test_messages_that_lose_their_values_leave_a_filter_on_members() -> None:
    rows = [message(number, telegram(number, 9)) for number in (1, 2, 3)]
    async with with_rows(*rows) as looker:
        await looker.press("slash")
        await looker.type("speed > 1\r")
        assert numbers(looker) == [1, 2, 3]
        await looker.show(replace(picture(), messages=MessagesDelta("TRCV_C_1", 3, 3, (), 2)))
        assert numbers(looker) == [3]


async def test_another_instance_and_another_type_are_never_read_by_the_old_one() -> None:
    async with received(3) as looker:
        await press(looker, "D", "slash")
        await looker.type("speed > 0\r")
        assert numbers(looker) == [2, 3]
        looker.app.view_model.known_messages.make_request("TRCV_C_2")
        rows = looker.app.main.received.table.messages
        assert (rows.row_at(0), rows.rows(), rows.find_current_row()) == (EMPTY, [], None), (
            "between two pictures"
        )
        looker.app.view_model.selected = "TRCV_C_2"
        looker.app.main.reset_for_selected()
        assert numbers(looker) == [] and table(looker) == [] and looker.app.main.table.past is None
        await looker.pictures()
        assert "'speed'" in title(looker)
        looker.app.view_model.selected = "TRCV_C_1"
        looker.app.main.reset_for_selected()
        await looker.pictures()
        assert numbers(looker) == [2, 3] and "2 of 3 with speed > 0" in title(looker)
        looker.bench.do("set data rx type=ARRAY[0..3] OF BYTE", "resize rx ARRAY[0..3] OF BYTE", scans=4)
        await looker.pictures()
        assert numbers(looker) == [1, 2, 3] and "'speed'" in title(looker)
        assert looker.words("message-head").endswith("[0] [1] [2] [3]")


async def test_ten_thousand_rows_cost_what_one_page_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, draw = list[MessageRow](), MessageLines._parts

    def count(rows: MessageLines, shown: MessageRow) -> Iterator[Part]:
        drawn.append(shown)
        return draw(rows, shown)

    monkeypatch.setattr(MessageLines, "_parts", count)
    many = [message(number, telegram(number, number)) for number in range(1, 10_001)]
    async with with_rows(*many) as looker:
        assert 20 < len(drawn) <= 8 * LARGE[1] and table(looker)[-1].split()[:2] == ["▸", "10000"]
        await looker.press(*["pageup"] * 3)
        assert len(drawn) <= 20 * LARGE[1]
        await looker.press("home")
        assert table(looker)[0].split()[:2] == ["▸", "1"]


async def test_the_footers_of_status_bytes_and_members_and_the_palette_name_d() -> None:
    async with looking((200, 60)) as looker:
        for digit in "356":
            await looker.press(digit)
            assert "D messages" in looker.pane("keys")
        found = [each.title for each in looker.app.get_system_commands(looker.app.screen)]
        assert any("messages" in each and "table" in each and "CSV" in each for each in found)
