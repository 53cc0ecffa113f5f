"""Pane 5 as a stream (`H`): every byte received so far, with its message, recv call, job, scan and member."""

from __future__ import annotations

import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.tui.on_a_bench import BenchLooker, on_a_bench
from trcvtui.plc.ledger import PeerSent
from trcvtui.tui.widgets.typed_lines import FIND_HINT, FindInput
from trcvtui.udt.byte_text import EXPECTED_SEARCH

WIDE, SMALL, LARGE, MIDDLE = (140, 45), (80, 24), (200, 60), (120, 40)
SIZES = pytest.mark.parametrize("size", [SMALL, MIDDLE, LARGE], ids=["80x24", "120x40", "200x60"])
FRAME = bytes(range(0x40, 0x58))  # 24 bytes: as many as a Telegram has


@asynccontextmanager
async def shifted(size: tuple[int, int]) -> AsyncIterator[BenchLooker]:
    """Let a sender be four bytes short, then EN_R fall in mid frame; the stream is open."""
    async with on_a_bench(size) as looker:
        looker.connect()
        looker.bench.do(f"peer P1 send hex {FRAME[:20].hex()}", scans=4)
        looker.bench.do(f"peer P1 send hex {FRAME.hex()} split=10 gap=T#50ms", scans=12)
        looker.bench.do(f"peer P1 send hex {FRAME.hex()}", scans=5)
        looker.bench.do("set TRCV_C_1 EN_R=0", scans=2)
        looker.bench.do("set TRCV_C_1 EN_R=1", f"peer P1 send hex {FRAME.hex()}", scans=5)
        await looker.press("5", "H")
        await looker.pictures()
        yield looker


async def press(looker: BenchLooker, *keys: str) -> None:
    for key in keys:
        await looker.press(key)
        await looker.pictures(2)


@SIZES
async def test_a_job_that_cuts_a_message_is_marked_by_a_stroke(size: tuple[int, int]) -> None:
    async with shifted(size) as looker:
        await press(looker, "g")
        assert "╱44 45 46 47" in looker.line("00010 ", "received"), "job 2 begins with byte 4 of message 2"
        assert "╱ #2 cut at 4" in looker.text
        assert "▕40 41 42 43" in looker.line("00010 ", "received"), "message 2 begins where message 1 ends"


async def test_dropped_bytes_stand_in_the_stream_with_their_reason() -> None:
    async with shifted((140, 60)) as looker:
        assert "20 B dropped: EN_R fell" in looker.text
        await press(looker, "g", *["down"] * 3)
        assert "dropped · P1 #3 byte 4" in looker.words("origin-line")
        assert "EN_R fell" in looker.words("origin-line")


async def test_the_selected_byte_tells_where_it_came_from() -> None:
    async with shifted(WIDE) as looker:
        await press(looker, "g", "down", *["right"] * 12)
        assert looker.words("origin-line") == (
            "16#48 = 72 (was 38) · P1 #2 byte 8 · TRCV_C_1 job 2 byte 4 · state · recv 3 · scan 17 · 0.160 s"
        ).replace("(was 38)", "(was 44)")


async def test_a_byte_of_the_past_is_decoded_and_a_member_finds_its_bytes() -> None:
    async with shifted(WIDE) as looker:
        await press(looker, "g", "right")
        table, stream = looker.app.main.table, looker.app.main.received.stream
        assert "job 1 of the past, 24 B" in looker.text
        assert table.past == (1, FRAME[:20] + FRAME[:4])
        await press(looker, "6", "down", "down", "down")
        assert stream.cursor == 8
        assert stream.link == range(8, 12)
        await press(looker, "5")
        assert looker.app.focused is stream
        assert "speed" in looker.words("origin-line")


async def test_brackets_jump_from_done_to_done_also_out_of_what_is_in_view() -> None:
    async with on_a_bench(SMALL) as looker:
        looker.connect()
        for _ in range(40):
            looker.bench.do(f"peer P1 send hex {FRAME.hex()}", scans=3)
        await looker.press("5")
        await press(looker, "left_square_bracket")
        stream = looker.app.main.received.stream
        assert (looker.app.focused, stream.cursor) == (stream, 39 * 24), "it opens the stream"
        await press(looker, "left_square_bracket", "left_square_bracket")
        assert stream.cursor == 37 * 24
        await press(looker, "right_square_bracket")
        assert stream.cursor == 38 * 24
        await press(looker, "g", "right_square_bracket")
        assert stream.cursor == 24


@pytest.mark.parametrize(
    ("text", "places"),
    [("50 51 52 53 40", [16]), ('"STUVW"', [39, 63, 87]), ("=1145324356", []), ("=1463828802", [43])],
)
async def test_hex_text_and_numbers_are_found_across_jobs(text: str, places: list[int]) -> None:
    async with shifted(WIDE) as looker:
        await press(looker, "g", "slash")
        await looker.type(text)
        await press(looker, "enter")
        stream = looker.app.main.received.stream
        if not places:
            assert "not found" in looker.words("origin-line")
        for place in places:
            assert stream.cursor == place
            assert place in stream._matched
            await press(looker, "n")
        for place in reversed(places[:-1]):
            await press(looker, "N")
            assert stream.cursor == place


@SIZES
async def test_what_cannot_be_looked_for_says_why_in_whole_while_it_is_typed(size: tuple[int, int]) -> None:
    async with shifted(size) as looker:
        await looker.press("5", "slash")
        assert FIND_HINT in looker.words("received")
        await looker.type("=1x")
        wrong = f"✗ find: found '1x', expected {EXPECTED_SEARCH}"
        assert wrong in looker.words("echo")
        await looker.press("enter")
        assert wrong in looker.words("echo"), "it stays open"
        await looker.press("escape")
        assert looker.app.focused is looker.app.main.received.stream
        assert "✗" not in looker.text


@pytest.mark.parametrize("left", [["enter", "escape"], ["escape"], ["enter", "escape", "escape"]])
async def test_n_is_the_next_hit_after_a_search_was_left_until_another_pane_is_chosen(
    left: list[str],
) -> None:
    async with shifted(SMALL) as looker:
        stream = looker.app.main.received.stream
        await press(looker, "g", "slash", "5", "0", *left)
        assert (stream.patterns, "n N next hit, hit before" in looker.text) == ((), True)
        await press(looker, "n")
        hit = stream.cursor
        await press(looker, "n", "N")
        assert (stream.cursor, hit is not None and hit > 0, looker.lines) == (hit, True, [])
        await press(looker, "H", "n", "colon", "escape", "n")
        assert looker.lines == [], "without H, and after the prompt"
        await press(looker, "6", "5", "n")
        assert (stream.patterns, looker.lines) == ((), [])


@pytest.mark.parametrize("typed", [[], ["equals_sign", "x"]], ids=["nothing", "no value"])
async def test_n_asks_again_after_a_search_for_nothing_and_is_the_next_done_before_any(
    typed: list[str],
) -> None:
    async with shifted(WIDE) as looker:
        stream = looker.app.main.received.stream
        await press(looker, "n")
        newest = stream.cursor
        await press(looker, "N")
        before = stream.cursor
        await press(looker, "n")
        assert before is not None and newest is not None and before < newest == stream.cursor
        await press(looker, "slash", *typed, "escape", "n")
        assert isinstance(looker.app.focused, FindInput) and looker.lines == []


async def test_bytes_are_found_and_compared_in_data_now_as_well() -> None:
    async with on_a_bench(WIDE) as looker:
        looker.connect()
        for payload in (FRAME, FRAME[:8] + b"\x00\xff" + FRAME[10:]):
            looker.bench.do(f"peer P1 send hex {payload.hex()}", scans=4)
        await press(looker, "5", "d")
        assert looker.line("was", "received").split() == ["was", "48", "49"]
        await press(looker, "slash", "f", "f", "enter")
        assert looker.app.main.received.data.cursor == 9
        await press(looker, "n")
        assert "not found further on" in looker.text


async def test_the_stream_follows_the_newest_byte_until_something_is_selected() -> None:
    async with on_a_bench(SMALL) as looker:
        looker.connect()
        await press(looker, "5", "H")
        stream = looker.app.main.received.stream
        for number in range(30):
            looker.bench.do(f"peer P1 send hex {FRAME[:23].hex()} {number:02x}", scans=3)
        await looker.pictures()
        assert stream.window.stop == stream.window.end == 30 * 24
        assert "57" not in looker.pane("stream") and " 1d " in looker.pane("stream")
        await press(looker, "g")
        looker.bench.do(f"peer P1 send hex {FRAME.hex()}", scans=3)
        while stream.window.end == 30 * 24:
            looker.app._refresh_picture()
        assert f" {31 * 24} B kept" in str(looker.app.main.received.border_title), (
            "as many as this picture has"
        )
        assert "00000 " in looker.pane("stream")
        await press(looker, "G")
        assert f"{30 * 24 + 16:05x}" in looker.pane("stream")


async def test_16_mib_scroll_from_end_to_end() -> None:
    async with on_a_bench(SMALL) as looker:
        looker.connect()
        ring = looker.bench.console.bench.runtime.received_ring("C1")
        assert ring is not None
        ring.most, content = 16 * 1024 * 1024, random.Random(1).randbytes(65_536)
        for _ in range(300):
            ring.append(content)
        looker.bench.do(f"peer P1 send hex {FRAME.hex()}", scans=3)
        await press(looker, "5", "H")
        view = looker.app.main.received.stream
        assert view.window.end - view.window.begin <= 16 * 1024 * 1024
        assert view.window.begin > 0
        await press(looker, "g")
        assert view.cursor == view.window.begin
        assert f"{view.cursor:07x}"[:6] in looker.pane("stream")
        await press(looker, "pagedown", "pagedown", "G")
        assert view.cursor == view.window.end - 1
        assert len(view.window.content) < 4096, "only what is in view crosses the pipe"


# -- messages of a partner outside -----------------------------------------------------------------------

MESSAGES = [bytes([1, 2, 200, 254, number, *b"[red]\x1b[1m", *range(6)]) for number in range(3)]


async def from_outside(looker: BenchLooker) -> None:
    """Let three messages of 20 bytes come with pauses into DATA of 24, then a part of one more."""
    del looker.bench.console._ledger.index.listeners[PeerSent]  # what a partner outside does not tell
    looker.connect()
    for content in (*MESSAGES, bytes(20)):
        looker.bench.do(f"peer P1 send hex {content.hex()}", scans=9)
    await looker.press("5", "H")
    await press(looker, "g")


async def test_rows_begin_with_the_messages_that_pauses_part() -> None:
    async with on_a_bench(SMALL) as looker:
        await from_outside(looker)
        rows = [row for row in looker.pane("stream").splitlines() if "01 02 c8 fe" in row]
        assert [row[:5] for row in rows] == ["00000", "00014"]
        assert "[red]•[1m" in rows[0], "bytes are no markup"


async def test_a_byte_is_told_as_numbers_in_both_byte_orders() -> None:
    async with on_a_bench((120, 40)) as looker:
        await from_outside(looker)
        await press(looker, "right", "right")
        assert "u8 200 i8 -56 u16 65224|51454 i16 -312|-14082" in " ".join(looker.text.split())
        await press(looker, "H", "g")
        assert "u8 100 u16 " in looker.words("origin-line"), "in DATA, too"


async def test_messages_are_compared_with_a_marked_one_and_copied() -> None:
    async with on_a_bench(SMALL) as looker:
        await from_outside(looker)
        stream, received = looker.app.main.received.stream, looker.app.main.received
        await press(looker, "m", "down", "down", "d")
        assert looker.words("origin-line").startswith("≠ 1 of 20 bytes: 16#01 = 1 · TRCV_C_1 job 1 byte 20")
        assert (stream._byte_before(24), stream._byte(24), "mark 00" in looker.words("stream")) == (
            0,
            1,
            True,
        )
        assert received.past.bytes_to_copy() == (MESSAGES[1], MESSAGES[0] + b"\x01")
        await press(looker, "g", "m")
        assert stream.marked is None and received.past.bytes_to_copy() == (MESSAGES[0], b"")


async def test_a_search_tells_which_hit_of_how_many_and_places_have_numbers() -> None:
    async with on_a_bench(SMALL) as looker:
        await from_outside(looker)
        stream = looker.app.main.received.stream
        await press(looker, "slash", *"c8 fe".replace(" ", ""), "enter", "n")
        assert (stream.cursor, "hit 2 of 3 · " in looker.words("origin-line")) == (22, True)
        for typed, place in (("#3", 48), ("@45", 45), ("@16#1F", 31)):
            await press(looker, "slash")
            await looker.type(typed)
            await press(looker, "enter")
            assert stream.cursor == place
        await press(looker, "slash")
        await looker.type("@720")
        await press(looker, "enter")
        assert "offset 720 = 16#2D0 is not kept (only bytes 0 to 79 are)" in looker.words("origin-line")
