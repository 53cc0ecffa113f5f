"""Values of pins, counts and durations in bench commands."""

from __future__ import annotations

import re
from typing import Final

from trcvtui.blocks.parameters import Pin
from trcvtui.errors import mistake
from trcvtui.project.parts import kind_of
from trcvtui.project.tables import DELAY, TRUTH_WORDS, Kind, T, shown

_WORD: Final = re.compile(r"(?:(?:W#|WORD#)?16#|0x)?([0-9A-F]{1,4})", re.IGNORECASE)


def pin_value(pin: Pin, text: str, where: str) -> bool | int:
    """Return the value of a pin: 0 1 TRUE FALSE, a number, or a STATUS word in hex."""
    if pin.is_bool:
        truth = TRUTH_WORDS.get(text.upper())
        if truth is None:
            raise mistake(where, f"{pin.name}={shown(text)}", f"{pin.name}=0 or {pin.name}=1")
        return truth
    if pin.iec_type == "WORD":
        found = _WORD.fullmatch(text)
        if found is None:
            raise mistake(where, f"{pin.name}={shown(text)}", "four hex digits such as 7006")
        return int(found[1], 16)
    number: int = value_of(kind_of(pin), text, f"{pin.name}=", where)
    return number


def value_of(kind: Kind[T], text: str, before: str, where: str) -> T:
    """Return a text read as a kind; `before` is what stands in front of it, such as `gap=`."""
    found = kind.from_text(text)
    if found is None:
        raise mistake(where, f"{before}{shown(text)}", kind.wanted(text))
    return found


def duration(text: str, before: str, where: str) -> int:
    """Return the ns of a duration such as T#20ms, not negative."""
    return value_of(DELAY, text, before, where)
