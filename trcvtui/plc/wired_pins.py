"""The pins of a block on a ComBuffer that the project file wires, as readers ask for them."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.parameters import BUFFER_PIN, DATA_PIN, POINTERS, TIMES

BUFFER_PINS: Final = frozenset(BUFFER_PIN.values())
DATA_PINS: Final = frozenset(DATA_PIN.values())
MARKS: Final = ("prefix", "suffix")


def buffer_pin(block: str) -> str:
    """Return what a block calls its ComBuffer, "" where it has none."""
    return BUFFER_PIN.get(block, "")


def data_pin(block: str) -> str:
    """Return what a block calls the variable of its bytes, "" where that is DATA or none."""
    return DATA_PIN.get(block, "")


def mark_pins(block: str) -> dict[str, str]:
    """Return the pins of prefix and suffix, and which is which; none for a block without."""
    return dict(zip(POINTERS.get(block, ()), MARKS, strict=False))


def is_time(pin: str) -> bool:
    """Return whether a pin is a TIME, in whole milliseconds."""
    return pin in TIMES
