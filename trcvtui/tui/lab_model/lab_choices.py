"""What can be chosen in the lab by a list: types, layouts, bytes; and the line that a choice makes."""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.tui.lab_model.lab import Lab
from trcvtui.tui.lab_model.lab_bytes import ABOUT, SOURCES
from trcvtui.tui.lab_words import UDT
from trcvtui.udt.layout.rules import LAYOUTS


class Choice(NamedTuple):
    """Names with what is to be known of them; `line` takes the name in place of {}."""

    title: str
    rows: list[tuple[str, str]]
    now: str
    line: str
    is_bytes: bool = False


def types_of(lab: Lab) -> Choice:
    """Return the types that can be looked at."""
    rows = [(name, "") for name in lab.type_names()]
    return Choice(f"Types of {lab.files.name}", rows, lab.type_name, f"{UDT} type {{}}")


def layouts_of(lab: Lab, side: str) -> Choice:
    """Return the layouts that one side may have."""
    rows = [
        (name, f"{rules.byte_order}-endian, STRING {rules.text.name}, alignment up to {rules.cap}")
        for name, rules in LAYOUTS.items()
    ]
    return Choice(f"Layout of {side}", rows, lab.profiles[side].layout, f"{UDT} {side} {{}}")


def bytes_of(lab: Lab) -> Choice:
    """Return the bytes that there are."""
    rows = [(name, ABOUT[name]) for name in SOURCES]
    return Choice("Bytes", rows, lab.bytes.source, f"{UDT} bytes {{}}", is_bytes=True)
