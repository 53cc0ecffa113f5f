"""What a type is made of, as far as the blocks ask: bits alone, elements of 8 bits, one text, or else."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.data_area import NO_TEXT, Elements, TextLens
from trcvtui.udt.types import Array, Elementary, Kind, Text, Type

LEAST: Final = 2  # siemens.md 4.1: LEN of a TRCV into a STRING, and into a WSTRING
LEAST_WIDE: Final = 5


def elements_of(type_: Type) -> Elements:
    """Return it for a variable's type; a STRUCT is something else, whatever stands in it."""
    while isinstance(type_, Array):
        type_ = type_.element
    if not isinstance(type_, Elementary):
        return Elements.OTHER
    if type_.kind is Kind.BOOL:
        return Elements.BITS
    return Elements.BYTES if type_.size == 1 else Elements.OTHER


def text_lens_of(type_: Type, size: int) -> TextLens:
    """Return the smallest LEN of a variable that is one text: all of its `size` bytes, or the header's."""
    if not isinstance(type_, Text):
        return NO_TEXT
    return TextLens(sent=size, received=LEAST_WIDE if type_.wide else LEAST)
