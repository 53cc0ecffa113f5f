"""What a type is made of, as far as the blocks ask: bits alone, elements of 8 bits, or something else."""

from __future__ import annotations

from trcvtui.blocks.data_area import Elements
from trcvtui.udt.types import Array, Elementary, Kind, Type


def elements_of(type_: Type) -> Elements:
    """Return it for a variable's type; a STRUCT is something else, whatever stands in it."""
    while isinstance(type_, Array):
        type_ = type_.element
    if not isinstance(type_, Elementary):
        return Elements.OTHER
    if type_.kind is Kind.BOOL:
        return Elements.BITS
    return Elements.BYTES if type_.size == 1 else Elements.OTHER
