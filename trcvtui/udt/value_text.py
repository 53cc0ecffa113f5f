"""A decoded value as a person reads it: hex beside bit strings, names beside the numbers of an enumeration.

Rule: bytes are data, so no control code passes; and what is odd about them is shown (udt.md U11, U12).
"""

from __future__ import annotations

import math
import struct
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.coding import Value
from trcvtui.udt.placed import Leaf
from trcvtui.udt.types import Enumeration, Kind, Text

NO_DATA: Final = "no data"
PLAIN_BOOLS: Final = (b"", b"\x00", b"\x01")


def value_text(leaf: Leaf, value: Value | None, raw: bytes = b"") -> str:
    """Return the text of a leaf's value; with the leaf's own bytes as `raw` oddities are told too."""
    if value is None:
        return NO_DATA
    if isinstance(leaf.type, Text):
        return _quoted(value) + _overlong(leaf, raw)
    if isinstance(leaf.type, Enumeration):
        return f"{value} ({_name(leaf.type, value)})"
    match leaf.type.kind:
        case Kind.BOOL:
            return str(value).upper() + ("" if raw in PLAIN_BOOLS else f" (16#{raw.hex().upper()})")
        case Kind.BITS:
            return f"{value} (16#{value:0{2 * leaf.size}X})"
        case Kind.REAL:
            return real_text(float(value), leaf.size)
        case Kind.CHARACTER:
            return _quoted(value)
        case _:
            return str(value)


def real_text(value: float, size: int) -> str:
    """Return the shortest digits that give the same REAL (size 4) or LREAL (size 8) again."""
    if not math.isfinite(value):
        return special_text(value)
    if size == 8:
        return repr(value)
    stored = struct.pack("<f", value)
    return next(text for text in _digits(value) if _packed(text) == stored)


def special_text(value: float) -> str:
    """Return the name of a number that is none: NaN, Infinity or -Infinity."""
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _digits(value: float) -> list[str]:
    # Nine digits tell any two REALs apart; Python writes the last form, so that 1e+06 reads 1000000.0.
    return [repr(float(f"{value:.{digits}g}")) for digits in range(6, 9)] + [repr(value)]


def _packed(text: str) -> bytes:
    try:
        return struct.pack("<f", float(text))
    except OverflowError:  # rounded up to beyond the largest REAL
        return b""


def _quoted(value: Value) -> str:
    return f"'{one_line(str(value))}'"


def _overlong(leaf: Leaf, raw: bytes) -> str:
    # Header [longest][actual]; the field itself says how many characters there can be.
    most = leaf.size - 2
    wide = isinstance(leaf.type, Text) and leaf.type.wide
    return f" (length {raw[1]} of {most})" if raw and not wide and raw[1] > most else ""


def _name(type_: Enumeration, value: Value) -> str:
    return next((name for name, number in type_.values if number == value), "no name")
