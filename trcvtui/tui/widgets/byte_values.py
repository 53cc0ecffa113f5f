"""The numbers that begin with a byte, in both byte orders, whatever type the bytes are."""

from __future__ import annotations

import struct
from typing import Final

# In the order of their worth: what has no room is left out.
NUMBERS: Final = (
    ("u8", "B"), ("i8", "b"), ("u16", "H"), ("i16", "h"), ("REAL", "f"), ("u32", "I"), ("i32", "i"),
    ("LREAL", "d"), ("u64", "Q"), ("i64", "q"),
)  # fmt: skip
MOST_OF_NUMBER: Final = 8  # bytes


def numbers_at(content: bytes, width: int) -> str:
    """Return as many as fit a line, `little|big`; a signed one only where it differs from the unsigned."""
    line, before = "LE|BE", ""
    for name, code in NUMBERS:
        size = struct.calcsize(code)
        if len(content) < size:
            continue
        values = [struct.unpack(order + code, content[:size])[0] for order in ("<>" if size > 1 else "<")]
        text = "|".join(f"{value:.6g}" if isinstance(value, float) else str(value) for value in values)
        if text != before and len(line) + len(name) + len(text) + 3 <= width:
            line += f"  {name} {text}"
        before = text
    return line if content else ""
