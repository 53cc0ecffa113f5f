"""Bytes 00 to FF, escapes, markup and bidi characters arrive: they change nothing but the bytes shown."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest
from rich.cells import cell_len

from tests.tui.tour import HERE, STOPS, Seen, Story, tour

SIZE: Final = (80, 24)
NAMES: Final = {"instances", "block", "status", "history", "why", "received", "stream", "members", "peer"}
WALK: Final = tuple(stop for stop in STOPS if stop.name in NAMES | {"bench", "timing", "yank"})
SHOW_BYTES: Final = frozenset(("bench", "received", "stream", "members", "peer", "yank"))
NOT_SHOWN: Final = "\x1b\x9b\x07\u202e\u2066\u200f"
FRAME: Final = 24  # bytes of a Telegram
TAG: Final = 12  # where its STRING[8] begins: room, length, characters
PLAIN: Final = bytes(range(0x30, 0x30 + FRAME))

CALM: Final[dict[int, list[Seen]]] = {}  # how so many frames of digits look


def telling(frames: list[bytes]) -> Story:
    """Return a story in which P1 sends these frames, the last one of them in part."""
    *whole, last = frames
    sent = [(6, f"peer P1 send hex {frame.hex()}") for frame in whole]
    return [
        (0, "set TRCV_C_1 CONT=1 EN_R=1"),
        (5, "peer P1 connect"),
        *sent,
        (6, f"peer P1 send hex {last[:17].hex()}"),
        (40, "expect TRCV_C_1 STATUS=7006"),
    ]


def in_tag(text: bytes) -> bytes:
    return (PLAIN[:TAG] + bytes((8, len(text))) + text).ljust(FRAME, b"\0")


EVERY: Final = [bytes(b % 256 for b in range(at, at + FRAME)) for at in range(0, 264, FRAME)]
HOSTILE: Final = {
    "00 to FF": EVERY,
    "escapes": [b"\x1b[31;1m\x1b]0;x\x07\x1b[2J\x9b1mabcd\r\n"[:FRAME], *[in_tag(b"\x1b[1m\x9b2J")] * 2],
    "markup": [b"[red]x[/][@click=quit()]y"[:FRAME], *[in_tag(b"[b]x[/b]")] * 2],
    "bidi": ["a\u202eb\u2066c\u200fd\u2069ef\u202cgh".encode().ljust(FRAME), *[in_tag(b"\xe2\x80\xaex")] * 2],
}  # fmt: skip


async def walked(frames: list[bytes]) -> list[Seen]:
    async with tour(SIZE, "dark", telling(frames)) as walk:
        return [stop async for stop in walk.stops(WALK)]


@pytest.mark.parametrize("kind", HOSTILE)
async def test_they_change_nothing_but_the_panes_that_show_bytes(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(HERE)
    frames = HOSTILE[kind]
    if len(frames) not in CALM:
        CALM[len(frames)] = await walked([PLAIN] * len(frames))
    calm, hostile = CALM[len(frames)], await walked(frames)
    assert [stop.name for stop in hostile] == [stop.name for stop in WALK]
    for before, now in zip(calm, hostile, strict=True):
        if before.name == "received":
            assert frames[-2][:8].hex(" ") in "".join(now.lines), "they have arrived"
        if before.name not in SHOW_BYTES:
            assert now.lines == before.lines and now.styles == before.styles, now.name
        text = "".join(now.lines)
        assert text.isprintable() and not set(text) & set(NOT_SHOWN), now.name
        assert {cell_len(line) for line in now.lines} == {cell_len(now.lines[0])}, "no frame is pushed aside"
        assert any(set("╭╮│┏┓┃") & set(line) for line in now.lines)


@pytest.mark.parametrize("kind", HOSTILE)
async def test_a_saved_session_holds_them_as_hex_alone(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(HERE)
    saved = tmp_path / "seen.toml"
    async with tour(SIZE, "dark", [*telling(HOSTILE[kind]), (0, f"save scenario {saved}")]):
        text = saved.read_text(encoding="utf-8")
    assert HOSTILE[kind][0].hex() in text.replace(" ", "")
    assert not set(text) & set(NOT_SHOWN) and all(line.isprintable() for line in text.splitlines())
