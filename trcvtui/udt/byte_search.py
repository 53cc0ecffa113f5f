"""What can be looked for in bytes: hex, a text in quotes, or a number in either byte order.

Rule: `29 00` is hex, `"abc"` a text, `=41` and `=-1.5` a number in all sizes that hold it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from trcvtui.errors import mistake
from trcvtui.udt.hexadecimal import parse_hex

WHERE: Final = "find"
EXPECTED: Final = 'hex such as 29 00, a text such as "abc", or a number such as =41 or =1234.5'
LONGEST: Final = 256
_WHOLE: Final = (("INT", "h", "H"), ("DINT", "i", "I"), ("LINT", "q", "Q"))
_REALS: Final = (("REAL", "f"), ("LREAL", "d"))


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is looked for: any of `patterns`; `about` says it in words."""

    patterns: tuple[bytes, ...]
    about: str


def wanted(text: str) -> Wanted:
    """Return what a text asks for; raise UserError where it is none of the three."""
    text = text.strip()
    if text[:1] in ('"', "'"):
        found = _text(text)
    elif text[:1] == "=":
        found = _number(text[1:].strip())
    else:
        content = parse_hex(text, WHERE)
        found = Wanted((content,), f"hex {content[:16].hex(' ')}")
    if not all(found.patterns):
        raise mistake(WHERE, "nothing", EXPECTED)
    if max(map(len, found.patterns)) > LONGEST:
        raise mistake(WHERE, f"{max(map(len, found.patterns))} bytes", f"at most {LONGEST}")
    return found


def _text(text: str) -> Wanted:
    inside = text[1:-1] if len(text) > 1 and text.endswith(text[0]) else text[1:]
    return Wanted((inside.encode(),), f"text {len(inside.encode())} B")


def _number(text: str) -> Wanted:
    try:
        value = int(text.replace("16#", "0x"), 0)
    except ValueError:
        return _real(text)
    found = [
        (name, struct.pack(order + (signed if value < 0 else plain), value))
        for name, signed, plain in _WHOLE
        for order in "<>"
        if _fits(value, 8 * struct.calcsize(plain))
    ]
    if not found:
        raise mistake(WHERE, text, "a number of at most 64 bits")
    if value == 0:
        found = found[:2]  # a LINT 0 is found where an INT 0 is
    return _in_words(found)


def _fits(value: int, bits: int) -> bool:
    return bool(-(1 << bits - 1) <= value < 1 << bits)


def _real(text: str) -> Wanted:
    try:
        value = float(text)
        return _in_words(
            [(name, struct.pack(order + code, value)) for name, code in _REALS for order in "<>"]
        )
    except (ValueError, OverflowError):
        raise mistake(WHERE, f"'{text[:20]}'", EXPECTED) from None


def _in_words(found: list[tuple[str, bytes]]) -> Wanted:
    patterns = tuple(dict.fromkeys(pattern for _, pattern in found))
    names = list(dict.fromkeys(name for name, _ in found))
    return Wanted(patterns, f"{', '.join(names)} in either byte order")


# -- in bytes ------------------------------------------------------------------------------------------------


def first_in(content: bytes, patterns: tuple[bytes, ...], start: int = 0) -> int | None:
    """Return the first place from `start` on at which one of the patterns stands."""
    found = [place for pattern in patterns if (place := content.find(pattern, max(0, start))) >= 0]
    return min(found, default=None)


def last_in(content: bytes, patterns: tuple[bytes, ...], before: int) -> int | None:
    """Return the last place before `before` at which one of the patterns stands."""
    if before <= 0:
        return None
    found = [place for p in patterns if (place := content.rfind(p, 0, before - 1 + len(p))) >= 0]
    return max(found, default=None)


def all_in(content: bytes, patterns: tuple[bytes, ...]) -> Iterator[range]:
    """Return the bytes of every place, for one pattern after the other."""
    for pattern in patterns:
        place = content.find(pattern)
        while place >= 0:
            yield range(place, place + len(pattern))
            place = content.find(pattern, place + 1)
