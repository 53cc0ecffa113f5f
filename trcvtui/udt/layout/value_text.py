"""The stored form of a leaf, and its value as text: hex beside bit strings, names beside numbers.

Rule: bytes are data, so control codes are escaped and odd bytes are marked.
"""

from __future__ import annotations

import math
import struct
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.types import (
    DAY,
    MS,
    SECOND,
    Elementary,
    Enumeration,
    LeafType,
    Pointer,
    StringType,
    Subrange,
    ValueKind,
)

UNIT_NAMES: Final = {DAY: "days", SECOND: "s", MS: "ms", 1: "ns"}
EPOCH_YEARS: Final = {0: "1970", 7305 * DAY: "1990"}


def stored_form(type_: LeafType, rules: LayoutRules) -> tuple[object, ...]:
    """Return a value that is equal for leaves that are stored alike."""
    if isinstance(type_, StringType):
        return type_.wide, type_.utf8, rules.text.header, rules.text.length(type_)
    row = rules.storage(type_)
    return row.name, row.code, row.unit_ns, row.epoch_ns


def stored_form_text(type_: LeafType, rules: LayoutRules) -> str:
    """Return the stored form in words, such as `TIME in ms with sign`."""
    if isinstance(type_, StringType):
        word = "WSTRING" if type_.wide else "STRING"
        where = "two lengths before it" if rules.text.header else "a NUL after it"
        return f"{word}[{rules.text.length(type_)}] with {where}"
    row = rules.storage(type_)
    if row.code.endswith("s"):
        return f"{row.name} of {row.size} bytes, digit by digit"
    return row.name + _unit_text(row)


def _unit_text(row: Elementary) -> str:
    if row.unit_ns not in UNIT_NAMES:
        return f" of {row.size} bytes"
    unit = UNIT_NAMES[row.unit_ns]
    if row.kind is ValueKind.DURATION:
        return f" in {unit} {'with' if row.code.islower() else 'without'} sign"
    if row.kind in (ValueKind.DATE, ValueKind.DATE_AND_TIME):
        return f" in {unit} since {EPOCH_YEARS[row.epoch_ns]}"
    return f" in {unit}"


NO_DATA: Final = "no data"


def value_text(leaf: Leaf, value: Value | None, raw: bytes = b"") -> str:
    """Return the text of a leaf's value, with a mark if the leaf's own bytes `raw` are odd."""
    if value is None:
        return NO_DATA
    text, mark = _plain_text(leaf.type, leaf.size, value), odd_text(leaf, raw)
    return f"{text} ({mark})" if mark else text


def odd_text(leaf: Leaf, raw: bytes) -> str:
    """Return what is odd in the leaf's own bytes, such as `no NUL`, or ""."""
    return leaf.coding.odd(raw) if leaf.coding.odd is not None and len(raw) == leaf.size else ""


def _plain_text(type_: LeafType, size: int, value: Value) -> str:
    match type_:
        case StringType():
            return _quote(value)
        case Enumeration():
            return f"{value} ({_enumeration_name(type_, value)})"
        case Subrange(base=base, low=low, high=high):
            inside = isinstance(value, int) and low <= value <= high
            return _plain_text(base, size, value) + ("" if inside else f" (not {low}..{high})")
        case Pointer():
            return str(value)
    match type_.kind:
        case ValueKind.BOOL:
            return str(value).upper()
        case ValueKind.BITS:
            return f"{value} (16#{value:0{2 * size}X})"
        case ValueKind.REAL:
            return real_text(float(value), size)
        case ValueKind.CHARACTER:
            return _quote(value)
        case _:
            return str(value)


def real_text(value: float, size: int) -> str:
    """Return the shortest digits that read back as the same REAL (size 4) or LREAL (size 8)."""
    if not math.isfinite(value):
        return special_text(value)
    if size == 8:
        return repr(value)
    stored = struct.pack("<f", value)
    for digits in range(6, 9):  # nine are always exact
        number = float(f"{value:.{digits}g}")
        if _pack_real(number) == stored:
            return repr(number)  # Python's form: 1e+06 reads 1000000.0
    return repr(value)


def special_text(value: float) -> str:
    """Return the text of a value that is not a number: NaN, Infinity or -Infinity."""
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _pack_real(number: float) -> bytes:
    try:
        return struct.pack("<f", number)
    except OverflowError:  # rounded beyond the largest REAL
        return b""


def _quote(value: Value) -> str:
    return f"'{one_line(str(value))}'"


def _enumeration_name(type_: Enumeration, value: Value) -> str:
    return next((name for name, number in type_.values if number == value), "no name")
