"""How the screen writes values, and cuts texts to a width."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from functools import lru_cache
from typing import Final

from rich.cells import cell_len

from trcvtui.errors import one_line

US: Final = 1_000
MS: Final = 1_000_000
SECOND: Final = 1_000_000_000

ON_SIGN, OFF_SIGN, GLOW_SIGN = "■", "□", "◆"


def status_word(status: int) -> str:
    """Return a STATUS word in the notation `16#7006`."""
    return f"16#{status:04X}"


def lamp(on: bool, glowing: bool = False) -> str:
    """Return the sign of a lamp. If `glowing`, the lamp was lit a moment ago."""
    return ON_SIGN if on else GLOW_SIGN if glowing else OFF_SIGN


def measure(text: str) -> int:
    """Return how many columns a text takes: a wide character takes two, a combining one takes none."""
    return len(text) if text.isascii() else cell_len(text)


def clip(text: str, width: int) -> str:
    """Return text in at most `width` columns; `…` shows a cut."""
    if measure(text) <= width:
        return text
    return _cut_to_width(text, width - 1) + "…" if width > 0 else ""


def pad(text: str, width: int, right: bool = False) -> str:
    """Return text padded to `width` columns: blanks follow the text, or precede it if `right`."""
    blanks = " " * max(0, width - measure(text))
    return blanks + text if right else text + blanks


def _cut_to_width(text: str, width: int) -> str:
    if text.isascii():
        return text[: max(0, width)]
    end = used = 0
    while end < len(text) and (used := used + cell_len(text[end])) <= width:
        end += 1
    return text[:end]


def clip_middle(text: str, width: int) -> str:
    """Return a name in at most `width` columns. The end stays, because names often differ there."""
    if measure(text) <= width or width < 5:
        return clip(text, width)
    tail = (width - 1) // 2
    end = _cut_to_width(text[::-1], tail)[::-1]
    return f"{_cut_to_width(text, width - 1 - tail)}…{end}"


plain: Final = one_line  # a text from outside: one line, control characters spelled out


@lru_cache(maxsize=64)
def wrap_text(text: str, width: int) -> tuple[str, ...]:
    """Return text broken at blanks into lines of at most `width` columns."""
    text, width = plain(text), max(8, width)
    lines = textwrap.wrap(text, width) if text.isascii() else _wrap_wide_text(text, width)
    return tuple(lines) or ("",)


def _wrap_wide_text(text: str, width: int) -> Iterator[str]:
    line = gap = ""
    for piece in re.findall(r" +|[^ ]+", text):
        if piece[0] == " ":
            gap = piece
            continue
        if line and measure(line + gap) + measure(piece) > width:
            yield line
            line = gap = ""
        while measure(piece) > width:  # a script without blanks
            yield (part := _cut_to_width(piece, width))
            piece = piece[len(part) :]
        line, gap = line + (gap if line else "") + piece, ""
    if line:
        yield line


def bar(have: int, need: int, width: int) -> tuple[str, str]:
    """Return the filled and the empty part of a progress bar of `width` characters."""
    filled = min(width, have * width // need) if need else 0
    if have and not filled:  # the first byte shows at once
        filled = 1
    return "━" * filled, "─" * (width - filled)
