"""Values as the screen writes them: pure functions, value in, text out."""

from __future__ import annotations

import textwrap
from functools import lru_cache
from typing import Final

from trcvtui.errors import one_line

US: Final = 1_000
MS: Final = 1_000_000
SECOND: Final = 1_000_000_000

ON, OFF, GLOW = "■", "□", "◆"


def status_word(status: int) -> str:
    """Return a STATUS word as the field writes it: `16#7006`."""
    return f"16#{status:04X}"


def lamp(on: bool, glowing: bool = False) -> str:
    """Return the glyph of a lamp: lit, lit a moment ago, dark."""
    return ON if on else GLOW if glowing else OFF


def age(ns: int) -> str:
    """Return how long ago something was, as coarse as a glance needs: `1.2 s`, `48 s`, `12 min`, `3 h`."""
    seconds = max(0, ns) / SECOND
    if seconds < 10:
        return f"{int(seconds * 10) / 10:.1f} s"
    if seconds < 100:
        return f"{int(seconds)} s"
    if seconds < 6000:
        return f"{int(seconds / 60)} min"
    return f"{int(seconds / 3600)} h"


def moment(ns: int) -> str:
    """Return a time of the run in seconds with milliseconds: `12.330`."""
    return f"{ns // SECOND}.{ns % SECOND // MS:03d}"


def short_time(ns: int) -> str:
    """Return a measured time: `80 us`, `0.3 ms`, `12 ms`."""
    if ns < 100 * US:
        return f"{ns // US} us"
    return f"{ns / MS:.1f} ms" if ns < 10 * MS else f"{ns // MS} ms"


def clip(text: str, width: int) -> str:
    """Return text in at most `width` characters; what is cut is shown to be cut."""
    if len(text) <= width:
        return text
    return text[: max(0, width - 1)] + "…" if width > 0 else ""


def squeeze(text: str, width: int) -> str:
    """Return a name in at most `width` characters; it keeps its end, where names differ."""
    if len(text) <= width or width < 5:
        return clip(text, width)
    tail = (width - 1) // 2
    return f"{text[: width - 1 - tail]}…{text[-tail:]}"


def plain(text: str) -> str:
    """Return text with every control character spelled out: what came from outside stays one line."""
    return one_line(text)


@lru_cache(maxsize=64)
def wrapped(text: str, width: int) -> tuple[str, ...]:
    """Return text broken at blanks into lines of at most `width` characters."""
    return tuple(textwrap.wrap(plain(text), max(8, width))) or ("",)


def bar(have: int, need: int, width: int) -> tuple[str, str]:
    """Return the filled and the empty part of a progress bar of `width` characters."""
    filled = min(width, have * width // need) if need else 0
    if have and not filled:
        filled = 1
    return "━" * filled, "─" * (width - filled)


def count(number: int, one: str, many: str = "") -> str:
    """Return `1 byte`, `2 bytes`."""
    return f"{number} {one if number == 1 else many or one + 's'}"
