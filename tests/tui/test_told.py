"""What does nothing says why, what fails is marked as failed, and the last line names keys that work."""

from __future__ import annotations

from pathlib import Path

from tests.tui.looking import WIDE, looking
from tests.tui.on_a_bench import BenchLooker, on_a_bench


async def connected(looker: BenchLooker) -> None:
    looker.connect()
    await looker.pictures()


def last_line(looker: BenchLooker) -> str:
    return looker.text.rstrip("\n").splitlines()[-1].strip()


# -- the last line -------------------------------------------------------------------------------------


async def test_in_a_text_field_the_last_line_names_no_key_that_would_be_typed() -> None:
    async with on_a_bench() as looker:
        await looker.press("7", "i")
        assert last_line(looker) == "enter send  tab next  shift+tab mode  esc leave  ctrl+p palette  F1 help"
        await looker.press("escape", "colon")
        line = last_line(looker)
        assert line.startswith("enter send  tab complete") and "space" not in line
        await looker.press("escape", "f1")
        assert "Here: 7 Peer" in looker.text


# -- nothing to send, split, cut -----------------------------------------------------------------------


async def test_an_empty_payload_is_told_and_the_cursor_stands_in_it() -> None:
    async with on_a_bench() as looker:
        for key, what in (("s", "send"), ("e", "split"), ("x", "cut"), ("w", "keep")):
            await looker.press("7", key)
            assert f"✗ the payload is empty, there is nothing to {what}" in looker.text, key
            assert looker.app.focused is looker.app.main.peer.composer._payload
            await looker.press("escape")
        await looker.press("i", *"0A")
        await looker.press("escape", "x")
        assert "✗ a message of one byte cannot be cut" in looker.text


# -- a trial that does not run -------------------------------------------------------------------------


async def test_a_trial_that_is_refused_says_why_in_the_prompt() -> None:
    async with on_a_bench() as looker:
        await connected(looker)
        await looker.press("7", "i", *"01", "escape", "e")
        await looker.pictures()
        assert looker.app.screen is looker.app.main
        assert "✗" in looker.text and "expected" in looker.text


async def test_a_trial_under_hold_says_that_the_scans_are_held() -> None:
    async with on_a_bench() as looker:
        await connected(looker)
        looker.bench.do("hold")
        await looker.pictures()
        await looker.press("7", "i", *"010203", "escape", "e")
        await looker.pictures()
        assert "the scans are held" in looker.text


# -- failures ------------------------------------------------------------------------------------------


async def test_a_picture_that_cannot_be_written_is_marked_as_failed(state: Path) -> None:
    (state / "trcvtui").write_text("in the way")
    async with looking(WIDE) as looker:
        await looker.press("P")
        assert "✗ no picture of the screen was written: " in looker.text and "✓" not in looker.line("✗")


async def test_a_yank_without_its_file_says_clipboard_yes_and_file_no(state: Path) -> None:
    (state / "trcvtui").write_text("in the way")
    async with looking(WIDE) as looker:
        await looker.press("y", "y")
        await looker.settle()
        line = looker.line("✗")
        assert "to the terminal (OSC 52); no file was written: " in line


# -- what a command does other than one might think ----------------------------------------------------


async def test_com_rst_without_a_connection_says_that_it_has_no_effect() -> None:
    async with on_a_bench() as looker:
        await looker.press("x")
        looker.bench.scan()
        await looker.pictures()
        assert "without effect: CONT is 0, and the edge is not remembered" in looker.pane("prompt")
        looker.bench.do("set TRCV_C_1 CONT=1", scans=5)
        await looker.pictures()
        await looker.press("x")
        await looker.pictures()
        assert "without effect: C1 is not connected" in looker.pane("prompt")


async def test_com_rst_of_a_connection_that_stands_says_nothing() -> None:
    async with on_a_bench() as looker:
        await connected(looker)
        await looker.press("x")
        await looker.pictures()
        assert "without effect" not in looker.text
        looker.bench.scan()
        snapshot = looker.bench.console.bench.runtime.snapshot()
        assert snapshot.instances[0].outputs.status == 0x8000, "it resets"


async def test_len_changed_under_a_job_says_that_it_counts_from_the_next_one() -> None:
    async with on_a_bench() as looker:
        await connected(looker)
        await looker.type(":set TRCV_C_1 LEN=4\r")
        await looker.pictures()
        assert "from the next job on: the running job continues with 24 bytes" in looker.pane("prompt")
        await looker.type(":set TRCV_C_1 EN_R=0\r")
        looker.bench.scan(2)
        await looker.type(":set TRCV_C_1 LEN=8\r")
        await looker.pictures()
        assert "from the next job" not in looker.pane("prompt"), "no job runs"
