"""Read hex as people write it: blanks, commas and line breaks between the bytes, `0x` or `16#` before them.

Rule: the first thing that is no hex is named with its place; nothing is guessed.
"""

from __future__ import annotations

import re
from typing import Final

from trcvtui.errors import UserError, mistake

EXPECTED: Final = "hex bytes such as 01 02 0A"
_GROUP: Final = re.compile(r"[^\s,]+")
_MARK: Final = re.compile(r"(?:0x|16#)", re.IGNORECASE)
_NO_DIGIT: Final = re.compile(r"[^0-9a-f]", re.IGNORECASE)
_LONGEST_SHOWN: Final = 20


def parse_hex(text: str, where: str = "hex") -> bytes:
    """Return the bytes of hex text; raise UserError with the position of the first thing that is no hex.

    A group is whole bytes, two digits each; a lone digit (`0x1`, or `1` between blanks) is one byte.
    """
    try:
        return bytes.fromhex(text)
    except ValueError:
        return b"".join(_group(text, found, where) for found in _GROUP.finditer(text))


def _group(text: str, group: re.Match[str], where: str) -> bytes:
    mark = _MARK.match(group[0])
    start = 0 if mark is None else mark.end()
    digits = group[0][start:]
    wrong = _NO_DIGIT.search(digits)
    if wrong is not None:
        place = group.start() + start + wrong.start()
        raise _mistake(text, place, where, f"'{wrong[0]}'")
    if not digits or (len(digits) % 2 and len(digits) != 1):
        shown = group[0] if len(group[0]) <= _LONGEST_SHOWN else group[0][:_LONGEST_SHOWN] + "..."
        raise _mistake(text, group.start(), where, f"'{shown}' with {len(digits)} digits")
    return bytes.fromhex(digits if len(digits) != 1 else "0" + digits)


def _mistake(text: str, place: int, where: str, found: str) -> UserError:
    line_start = text.rfind("\n", 0, place) + 1
    column = place - line_start + 1
    if "\n" not in text.strip():
        return mistake(f"{where}, position {column}", found, EXPECTED)
    return mistake(f"{where}, line {text.count(chr(10), 0, place) + 1}, column {column}", found, EXPECTED)
