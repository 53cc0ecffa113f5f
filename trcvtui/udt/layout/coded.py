"""What every coding of a leaf is made of: the `struct` code, both changes, and what is odd about its bytes.

Rule: to_value never fails, whatever the bytes are; to_raw raises Refused for every value that does not fit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

Value = bool | int | float | str


class Refused(Exception):
    """A value that the type cannot hold; the text says what it can hold."""


class Coding(NamedTuple):
    """How one leaf is stored: `struct` code without byte order, and both changes (None: as it is).

    `odd` says what is strange about the bytes of the leaf, such as ` (16#05)` of a BOOL; "" is nothing.
    """

    code: str
    to_value: Callable[[Any], Value] | None
    to_raw: Callable[[object], Any]
    odd: Callable[[bytes], str] | None = None


def hex_text(raw: bytes) -> str:
    """Return bytes as they lie in memory, such as `16#9912130706058881`."""
    return f"16#{raw.hex().upper()}"


def parse_hex_text(value: object, size: int) -> bytes | None:
    """Return the bytes of `16#...` with all its digits; None when it is none of that size."""
    if not isinstance(value, str) or not value.startswith("16#") or len(value) != 3 + 2 * size:
        return None
    try:
        raw = bytes.fromhex(value[3:])
    except ValueError:
        return None
    return raw if len(raw) == size else None
