"""The whole screen as drawn: each pane at 120x40, three stops smaller and larger, dark and light; some more.

UPDATE_SNAPSHOTS=1 writes them anew. Look at them before you commit: `python -m tests.tui.tour FOLDER`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from difflib import unified_diff
from itertools import zip_longest
from pathlib import Path
from typing import Final

import pytest
from msgspec.structs import replace
from rich.color_triplet import ColorTriplet
from rich.style import Style

from tests.tui.fakes import armed, connecting, picture, received, receiving, story, written
from tests.tui.looking import SNAPSHOTS, UPDATE, WIDE, looking, same_as_snapshot
from tests.tui.tour import HERE, SIZES, STOPS, THEMES, Seen, Size, tour
from trcvtui.scenario import scenario as scenario_files

PULSE = written((880, armed()), (902, received(8)), (903, armed()))
PANES: Final = SNAPSHOTS / "panes"
LETTERS: Final = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
PLAIN, STYLES, KEY = " ", "-- style of each character --", "-- styles: dark, light --"
FRAMES: Final = frozenset("╭╮╰╯│─┏┓┗┛┃━▁▔▂▃▄▅▆▇█")  # drawn around words, or a scrollbar
READABLE: Final = 4.5  # to 1: what WCAG 2 asks of small text

# The stops whose drawing is kept; at 120x40 all.
KEPT: Final = {
    (80, 24): ("bench", "stream", "help"),
    (120, 40): tuple(stop.name for stop in STOPS),
    (200, 60): ("bench", "frozen", "scenarios"),
}
WORDS_ONLY: Final = frozenset(("palette",))  # its colours are Textual's


# -- every pane ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
async def test_every_pane_stands_as_drawn_in_dark_and_light(
    size: Size, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(HERE)
    monkeypatch.setattr(scenario_files, "configs_path", lambda: Path("nowhere"))
    dark, light = [await walked(size, theme) for theme in THEMES]
    folder, changes = PANES / f"{size[0]}x{size[1]}", []
    for one, other in zip(dark, light, strict=True):
        assert one.lines == other.lines, f"{one.name}: another theme says the same"
        path, found = folder / f"{one.name}.txt", drawn(one, other)
        if os.environ.get(UPDATE):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(found, encoding="utf-8")
        expected = path.read_text(encoding="utf-8") if path.exists() else ""
        if found != expected:
            (tmp_path / path.name).write_text(found, encoding="utf-8")
            lines = unified_diff(
                expected.splitlines(), found.splitlines(), str(path), "now", lineterm="", n=0
            )
            changes += list(lines)[:40]
    assert not changes, "\n".join([f"{UPDATE}=1 accepts it; kept in {tmp_path}", *changes])


async def walked(size: Size, theme: str) -> list[Seen]:
    async with tour(size, theme) as walk:
        return [stop async for stop in walk.stops([stop for stop in STOPS if stop.name in KEPT[size]])]


def drawn(dark: Seen, light: Seen) -> str:
    words = [line.rstrip() for line in dark.lines]
    if dark.name in WORDS_ONLY:
        return "\n".join([*words, ""])
    pairs = [
        [(bare(d, c), bare(b, c)) for c, d, b in zip(line, one, other, strict=True)]
        for line, one, other in zip(dark.lines, dark.styles, light.styles, strict=True)
    ]
    every = [pair for row in pairs for pair in row]
    plain = max(dict.fromkeys(every), key=every.count)
    letters = dict(zip((p for p in dict.fromkeys(every) if p != plain), LETTERS, strict=False)) | {
        plain: PLAIN
    }
    assert len(letters) == len(set(every)), "more styles than letters"
    styles = ["".join(letters[pair] for pair in row).rstrip() for row in pairs]
    key = [f"{letters[pair]} {' | '.join(pair)}" for pair in (plain, *(p for p in letters if p != plain))]
    return "\n".join([*words, STYLES, *styles, KEY, *key, ""])


def bare(style: str, character: str) -> str:
    """Return a style; that of a blank without what cannot be seen of it."""
    known = Style.parse(style)
    if character != " " or known.reverse or known.underline:
        return style
    return f"on {known.bgcolor.name}" if known.bgcolor else "nothing"


def test_no_drawing_is_kept_of_what_is_not_there() -> None:
    for (width, height), names in KEPT.items():
        assert {path.stem for path in (PANES / f"{width}x{height}").glob("*.txt")} == {*names}


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
@pytest.mark.parametrize("theme", THEMES)
def test_every_word_can_be_read_on_its_background(size: Size, theme: str) -> None:
    pale = []
    for path in sorted((PANES / f"{size[0]}x{size[1]}").glob("*.txt")):
        for style, text in words_of(path, THEMES.index(theme)):
            if (found := contrast(Style.parse(style))) < READABLE:
                pale.append(f"{path.stem}: {found:.1f} to 1, {style}: {text[:40]!r}")
    assert not pale, "\n".join(pale)


def words_of(path: Path, theme: int) -> Iterator[tuple[str, str]]:
    if path.stem in WORDS_ONLY:
        return
    words, _, rest = path.read_text(encoding="utf-8").partition(f"{STYLES}\n")
    styles, _, key = rest.partition(f"{KEY}\n")
    names = {line[0]: line[2:].split(" | ")[theme] for line in key.splitlines()}
    found = dict.fromkeys(names, "")
    for line, letters in zip(words.splitlines(), styles.splitlines(), strict=True):
        for character, letter in zip_longest(line, letters[: len(line)], fillvalue=PLAIN):
            found[letter] += "" if character in FRAMES or character == " " else character
    yield from ((names[letter], text) for letter, text in found.items() if text)


def contrast(style: Style) -> float:
    """Return how far ink and paper are apart, 1 to 21."""
    assert style.color is not None and style.bgcolor is not None
    one, other = (luminance(colour.get_truecolor()) for colour in (style.color, style.bgcolor))
    return (max(one, other) + 0.05) / (min(one, other) + 0.05)


def luminance(colour: ColorTriplet) -> float:
    red, green, blue = (
        (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4) for c in colour.normalized
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


# -- more of the main screen -----------------------------------------------------------------------------


async def test_a_pulse_stands_on_the_screen_as_drawn(tmp_path: Path) -> None:
    job = replace(receiving(have=1, need=8), data="small", last_done_scan=902, last_rcvd_len=8)
    seen = picture(job, connecting(), lines=PULSE, data=bytes(range(8)), partial=b"A")
    async with looking(WIDE, seen) as looker:
        same_as_snapshot(looker, "pulse-140x45", tmp_path)


@pytest.mark.parametrize("size", [(w, h) for w in (80, 100, 116, 140, 200) for h in (24, 34, 45, 60)])
async def test_no_word_is_cut_without_a_sign_at_any_size(size: tuple[int, int]) -> None:
    async with looking(size, picture(lines=story())) as looker:
        await looker.press("2", "1")
        text = looker.text
    assert max(len(line) for line in text.splitlines()) <= size[0]
    for words in ("TRCV_C_1", "7006 receiving", "RUN", "scan 920", "EN_R ─┤", "RCVD_LEN", "? help", "q quit"):
        assert words in text, f"{words!r} is not whole at {size}:\n{text}"
