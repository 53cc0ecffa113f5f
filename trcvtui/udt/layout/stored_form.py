"""How a leaf is stored, beside its place and byte order: leaves of one form and order mean the same bytes."""

from __future__ import annotations

from typing import Final

from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.types import DAY, MS, SECOND, Elementary, Kind, LeafType, Text

UNITS: Final = {DAY: "days", SECOND: "s", MS: "ms", 1: "ns"}
EPOCHS: Final = {0: "1970", 7305 * DAY: "1990"}


def stored_form(type_: LeafType, rules: LayoutRules) -> tuple[object, ...]:
    """Return a value that is equal for leaves that are stored alike."""
    if isinstance(type_, Text):
        return type_.wide, type_.utf8, rules.text.header, rules.text.length(type_)
    row = rules.stored(type_)
    return row.name, row.code, row.unit_ns, row.epoch_ns


def form_text(type_: LeafType, rules: LayoutRules) -> str:
    """Return the same in words, such as `TIME in ms, with a sign`."""
    if isinstance(type_, Text):
        word = "WSTRING" if type_.wide else "STRING"
        where = "two lengths before it" if rules.text.header else "a NUL behind it"
        return f"{word}[{rules.text.length(type_)}] with {where}"
    row = rules.stored(type_)
    if row.code.endswith("s"):
        return f"{row.name} of {row.size} bytes, digit by digit"
    return row.name + _count_text(row)


def _count_text(row: Elementary) -> str:
    if row.unit_ns not in UNITS:
        return f" of {row.size} bytes"
    unit = UNITS[row.unit_ns]
    if row.kind is Kind.DURATION:
        return f" in {unit}, {'with' if row.code.islower() else 'without'} a sign"
    if row.kind in (Kind.DATE, Kind.DATE_AND_TIME):
        return f" in {unit} since {EPOCHS[row.epoch_ns]}"
    return f" in {unit}"
