"""A capture on the main screen: shadows, holes, packets; bytes and names of others are data, never markup."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.line.test_watch import project, stream
from tests.recording.wire import ACK, FIN, RST, answer, capture, handshake, tcp, udp
from tests.replay.test_time_line import Stood
from tests.tui.looking import SMALL, WIDE
from tests.tui.test_replay_screen import MIDDLE, ReplayLooker, on_a_recording
from trcvtui.line.on_screen import _play_shadows

HOSTILE = b"[red]\x1b[2J[/]\x07\r\n\x9b31m\xe2\x80\xae[@click=app.quit]x"


@asynccontextmanager
async def on_a_capture(
    folder: Path, packets: list[bytes], bench: Path | None, size: tuple[int, int] = WIDE, name: str = "c.pcap"
) -> AsyncIterator[ReplayLooker]:
    file = folder / name
    file.write_bytes(capture(packets, step_ns=60_000_000))
    line = _play_shadows([str(file)], (bench, None, None), folder / "shadows.pcapng")
    async with on_a_recording(size, Stood(line=line)) as looker:
        yield looker


def with_a_hole() -> list[bytes]:
    """Return two frames of 12 bytes; of the second one 5 bytes are not in the capture."""
    first, acked, _, *rest = stream(12, 5, 7)
    end = [tcp(seq=125, ack=501, flags=FIN | ACK), answer(seq=501, ack=126, flags=FIN | ACK)]
    return [*handshake(), first, acked, *rest, *end]


async def test_what_the_capture_has_not_is_a_hole_in_data_in_the_stream_and_in_the_members(
    tmp_path: Path,
) -> None:
    async with on_a_capture(tmp_path, with_a_hole(), project(tmp_path)) as looker:
        await looker.go("end")
        assert "?? ?? ?? ?? ??" in looker.line("0000 ", "data")
        assert "│?????" in looker.line("0000 ", "data")
        assert "? missing in the capture" in looker.pane("udt")
        assert "C1: ? 5 bytes missing in the capture" in looker.pane("position")
        await looker.go("5", "y")
        assert "12 bytes (5 not captured, shown as 00) of d" in looker.text
        await looker.go("escape", "H")
        assert "0b▕?? ?? ?? ?? │" in looker.pane("stream")
        assert "#2" in looker.line("packet", "stream")


@pytest.mark.parametrize("size", [SMALL, MIDDLE, WIDE], ids=["80x24", "100x30", "140x45"])
async def test_shadows_are_marked_and_keys_go_from_edge_to_edge(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    packets = [*handshake(), *stream(12, 12), answer(seq=501, ack=125, flags=RST | ACK)]
    async with on_a_capture(tmp_path, packets, project(tmp_path), size) as looker:
        assert "◌R1" in looker.pane("instances")
        assert "◌ shadow" in looker.pane("instances")
        edges = list(looker.stood.line.survey.edges["R1"])
        await looker.go("shift+right")
        assert looker.scan == edges[1]
        await looker.go("exclamation_mark")
        assert looker.scan == looker.stood.line.survey.errors[0]
        assert "2023-11-14T22:13:20" in looker.position
        await looker.press("g")
        await looker.type("T#400ms\r")
        await looker.go()
        assert looker.scan == 41


async def test_bytes_and_names_of_others_are_shown_as_they_are(tmp_path: Path) -> None:
    packets = [udp(HOSTILE), *handshake(), tcp(HOSTILE, 101, 501), answer(seq=501, ack=101 + len(HOSTILE))]
    name = "[red]\x1b[2J[b]x.pcap"
    async with on_a_capture(tmp_path, packets, None, WIDE, name) as looker:
        await looker.go("end")
        for keys in (
            ("1", "down"),
            ("5", "H"),
            ("1", "down"),
            ("5",),
            ("8",),
            ("?",),
            ("escape",),
        ):
            await looker.go(*keys)
            assert "\x1b" not in looker.text
        assert looker.app.is_running


async def test_what_nobody_looks_on_at_is_listed_above_the_prompt(tmp_path: Path) -> None:
    other = udp(b"abc", target=("10.0.0.7", 3000))
    async with on_a_capture(tmp_path, [*handshake(), other, *stream(12)], project(tmp_path)) as looker:
        assert "unassigned: C2 (no CONNECT of the project fits" in looker.pane("position")
