"""ReceiveData on the screen: pins, frames, gap timer, what it throws away, what is wrong with it."""

from __future__ import annotations

from pathlib import Path

from tests.tui.looking import BOTH, WIDE, same_screen
from tests.tui.looking import typed as typed_keys
from tests.tui.on_a_line import STREAM, LineBench, on_a_line
from tests.tui.test_snapshots import READABLE, contrast

FRAME = "feed RX hex 02 41 42 43 0D 0A"
NOISE = "feed RX hex FF EE"
HALF = "feed RX hex 02 55"


async def typed(shown: LineBench, text: str) -> None:
    for key in typed_keys(f"{text}\r"):
        shown.app.post_message(key)
    await shown.do()
    await shown.do()


# -- the pins ------------------------------------------------------------------------------------------------


async def test_a_prefix_is_typed_as_hex_or_as_text_and_its_length_follows() -> None:
    async with on_a_line(lines=()) as shown:
        await shown.press("2", "f")
        assert shown.app.focused is not None and "prefix RD hex" in shown.text
        await typed(shown, "aa 55")
        assert " AA 55 " in shown.line(" pPrefix") and " 2 " in shown.line("LenPrefix")
        await shown.press("2", "u", "ctrl+u")
        await typed(shown, 'suffix RD text "!"')
        assert " 21 " in shown.line(" pSuffix") and " 1 " in shown.line("LenSuffix")


async def test_reset_is_a_toggle_and_the_size_a_field() -> None:
    async with on_a_line() as shown:
        await shown.press("2", "r")
        await shown.do()
        assert "■ 1" in shown.line(" Reset ")
        await shown.press("s")
        await typed(shown, "8")
        assert " 8 " in shown.line("SizeReceiveData")


async def test_a_pointer_that_is_0_says_where_it_is_wired() -> None:
    async with on_a_line(project=STREAM, lines=()) as shown:
        await shown.press("2", "f")
        assert "pPrefix of RD is 0" in shown.words


async def test_an_error_stands_in_words() -> None:
    async with on_a_line(lines=("suffix RD hex 0A", "set RD SizeReceiveData=2")) as shown:
        await shown.do("feed RX hex 41 42 43")
        await shown.press("3")
        assert "16#0017 ERROR 23 COMERROR_DATASIZEOVERRUN: size reached, suffix not seen" in shown.words
        assert "The sender's frame is longer than SizeReceiveData" in shown.words
        assert "DataReceived is 1 with it: look at the end of the data in hex" in shown.words


# -- frames --------------------------------------------------------------------------------------------------


async def test_prefix_data_and_suffix_are_told_apart_by_sign_and_by_colour() -> None:
    async with on_a_line() as shown:
        await shown.do(FRAME)
        await shown.press("5")
        row = "02›41 42 43‹0d 0a"
        assert row in shown.text
        assert "frame of 6 B · prefix 1 › data 3 ‹ suffix 2 · ended by: suffix" in shown.words
        styles = [shown.style_at(row, place) for place in (0, 3, 12)]
        assert len(set(styles)) == 3, styles


async def test_marks_noise_and_warnings_can_be_read_in_dark_and_in_light() -> None:
    async with on_a_line() as shown:
        await shown.do(NOISE, FRAME, "set RD SizeReceiveData=6", scans=2)
        for theme in ("bench-light", "bench-dark"):
            shown.app.theme = theme
            await shown.press("5")
            row = "02›41 42 43‹0d 0a 00"
            found = [shown.style_at(row, place) for place in (0, 2, 3, 11, 12, 18)]
            await shown.press("H")
            found.append(shown.style_at("ff ee"))
            await shown.press("H")
            assert [style for style in found if contrast(style) < READABLE] == [], theme


async def test_earlier_frames_are_reached_as_jobs_are() -> None:
    async with on_a_line() as shown:
        for byte in ("31", "32"):
            await shown.do(f"feed RX hex 02 {byte} 0D 0A", scans=2)
        await shown.press("5", "H", "left_square_bracket")
        await shown.until("RD frame 2 byte 0, prefix")
        assert "02›31‹0d 0a 02›32‹0d 0a" in shown.text
        await shown.press("left_square_bracket")
        await shown.until("RD frame 1 byte 0, prefix")
        await shown.press("l")
        await shown.until("RD frame 1 byte 1, data")


# -- the gap -------------------------------------------------------------------------------------------------


async def test_the_gap_timer_runs_or_says_why_not() -> None:
    async with on_a_line() as shown:
        await shown.press("2")
        await shown.do(NOISE)
        assert "0 ms of 50 ms · waits for a first byte" in shown.words
        await shown.do(HALF, scans=4)
        assert "30 ms of 50 ms" in shown.words
        await shown.do("set RD Timeout=0")
        assert "Timeout is 0: no gap ends a frame" in shown.words


async def test_the_gap_timer_stands_while_the_scans_are_held_and_while_the_view_is_frozen() -> None:
    async with on_a_line() as shown:
        await shown.do(HALF, scans=2)
        await shown.press("2", "F")
        assert "10 ms of 50 ms · frozen view" in shown.words
        await shown.press("F")
        await shown.do("hold", scans=3)
        assert "10 ms of 50 ms · frozen: the scans are held" in shown.words


# -- what is thrown away -------------------------------------------------------------------------------------


async def test_noise_is_counted_and_each_byte_of_it_can_be_looked_at() -> None:
    async with on_a_line() as shown:
        await shown.do(NOISE)
        await shown.do(FRAME, HALF, scans=2)
        await shown.do("set RD Reset=1")
        await shown.press("2", *["down"] * 8)
        assert "2 B thrown away" in shown.words and "FF EE" in shown.words
        await shown.press("X")
        await shown.press("X")
        assert "ff ee 02›41 42 43‹0d 0a" in shown.text
        assert "noise before the prefix" in shown.words and "scan 2" in shown.words
        await shown.press("X")
        assert "no bytes were thrown away before this place" in shown.words


@BOTH
async def test_no_output_and_no_condition_is_cut_when_the_marks_are_set(size: tuple[int, int]) -> None:
    async with on_a_line(size) as shown:
        assert "waiting for a frame" in shown.line("RD ")
        await shown.do(FRAME, scans=2)
        await shown.press("2")
        box = shown.text.partition("┌")[2].partition("└")[0]
        for name in ("DataReceived", "LenReceiveData", "RxTimeout"):
            assert name in box, shown.text
        await shown.press("4")
        assert "waiting for a frame" in shown.line("  1    0.000")


@BOTH
async def test_help_of_the_block_lists_its_own_letters_and_none_of_another_block(
    size: tuple[int, int],
) -> None:
    async with on_a_line(size) as shown:
        await shown.press("2", "question_mark")
        assert "Here: 2 Block" in shown.text and "t Timeout" in shown.words and "l LenPrefix" in shown.words
        assert "COM_RST" not in shown.text and "write LEN" not in shown.text


async def test_members_of_what_was_thrown_away_are_none_for_it_never_was_in_the_variable() -> None:
    async with on_a_line(WIDE) as shown:
        await shown.do("feed RX hex FF EE 02 41 0D 0A", scans=2)
        await shown.press("X")
        await shown.until("2 B thrown away, never in rx")
        members = [line.rpartition("│")[0].rpartition("│")[2] for line in shown.text.splitlines()]
        shown_members = [line.split()[3] for line in members if line.split()[2:3] == ["BYTE"]]
        assert shown_members and set(shown_members) == {"-"}, shown.text
        assert shown.text.count("recv 1 scan 2") == 1 and "╰recv 1 scan 2" in shown.text
        await shown.press("l", "l")
        await shown.until("job 1 of the past, 4 B")


async def test_a_frame_that_overran_its_size_stands_in_the_history_as_delivered_and_as_an_error() -> None:
    async with on_a_line(lines=("suffix RD hex 0D 0A",)) as shown:
        await shown.do("feed RX hex " + "41 " * 16, scans=2)
        await shown.press("4")
        assert "DONE 16 B, ERROR" in shown.words


async def test_the_fill_of_the_combuffer_and_what_had_no_room_stand_below_the_box() -> None:
    async with on_a_line(lines=("set RD SizeReceiveData=0",)) as shown:
        await shown.do("feed RX random 310")
        await shown.press("2")
        assert "300/300 B" in shown.line("queue") and "10 lost" in shown.line("queue")


# -- warnings ------------------------------------------------------------------------------------------------


async def test_what_goes_wrong_after_a_stream_is_said_beforehand() -> None:
    async with on_a_line(project=STREAM, lines=()) as shown:
        await shown.press("3")
        assert " warn " not in shown.words
        for line, told in (
            ("set RD LenSuffix=0", "No suffix and Timeout = 0: with fewer than 16 bytes it waits forever"),
            ("set RD Timeout=20", "A gap over TCP is a guess"),
            ("set TRCV_C_1 ADHOC=0", "TRCV_C_1 has ADHOC = 0"),
            ("set TRCV_C_1 EN_R=0", "TRCV_C_1 has EN_R = 0: no bytes come"),
        ):
            await shown.do(line)
            assert told in shown.words, shown.text


async def test_marks_longer_than_the_size_are_told_and_a_sound_framing_is_not_warned_of() -> None:
    async with on_a_line() as shown:
        await shown.press("3")
        assert " warn " not in shown.words
        await shown.do("set RD SizeReceiveData=2", scans=2)
        assert "warn prefix and suffix have 1 + 2 bytes, but SizeReceiveData is 2" in shown.words


# -- the line ------------------------------------------------------------------------------------------------


async def test_a_line_is_fed_whole_byte_by_byte_and_its_cable_is_pulled() -> None:
    async with on_a_line() as shown:
        await shown.press("7", "enter")
        await typed(shown, "02 41 0d 0a")
        assert "4 of 4 B fed" in shown.words
        await shown.press("7", "s")
        await shown.do()
        framer = shown.app.view_model.instances[0].framer
        assert framer is not None and framer.tally.good == 2
        await shown.press("right", "right")
        await shown.do()
        assert "02 41›0d 0a 2 of 4 B fed" in shown.words and shown.app.view_model.job_bytes == b"\x02\x41"
        await shown.press("b")
        await shown.do()
        framer = shown.app.view_model.instances[0].framer
        assert framer is not None and framer.tally.reason == "line broken"


# -- advice --------------------------------------------------------------------------------------------------


async def test_the_advice_shows_its_evidence_and_enter_sets_the_block_so() -> None:
    async with on_a_line(lines=("set RD SizeReceiveData=0",)) as shown:
        for text in ("ALPHA 12", "BE 7", "GAMMA 881", "DELTA 5", "EPS 12", "ZETA 7312"):
            await shown.do(f"feed RX hex 02 {text.encode().hex(' ')} 0D 0A", scans=8)
        await shown.press("B")
        assert "Framing advice · RX → RD" in shown.words
        assert "▸ 1 prefix 02 (STX), suffix 0D 0A (CR LF)" in shown.words, shown.text
        assert "02›42 45 20 37‹0d 0a" in shown.text and "6 of 6 frames end in 0D 0A" in shown.words
        assert "set RD LenPrefix=1 LenSuffix=2" in shown.words
        await shown.press("enter")
        await shown.do(scans=2)
        await shown.press("2")
        assert shown.app.screen is shown.app.main
        assert " 02 " in shown.line("pPrefix") and " 0D 0A " in shown.line("pSuffix")


async def test_without_bytes_the_advice_says_so_and_a_project_without_combuffer_has_none() -> None:
    async with on_a_line() as shown:
        await shown.press("B")
        assert "0 bytes recorded: too few to judge" in shown.words
        await shown.press("enter", "escape")
        assert shown.app.screen is shown.app.main
    async with on_a_line(project="passive.toml", lines=(), select="TRCV_C_1") as shown:
        await shown.press("B")
        assert "no ComBuffer in this project" in shown.words


# -- as drawn ------------------------------------------------------------------------------------------------


async def test_it_stands_as_drawn(tmp_path: Path) -> None:
    async with on_a_line(WIDE) as shown:
        await shown.do(NOISE, FRAME, scans=2)
        await shown.do(HALF, scans=3)
        await shown.press("2")
        same_screen(shown.app, "framer-140x45", tmp_path)
