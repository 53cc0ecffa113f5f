"""What the XML formats have in common: bounds and lengths in attributes, and how deep a type may nest."""

from __future__ import annotations

from trcvtui.errors import mistake
from trcvtui.udt.ast import Number, TextSpec
from trcvtui.udt.formula import read_number
from trcvtui.udt.sources.xml_source import Element
from trcvtui.udt.type_set import MOST_NESTED
from trcvtui.udt.types import Text


def deeper(depth: int, element: Element) -> int:
    """Return the depth inside an element; raise UserError when no tool in the field follows so deep."""
    if depth >= MOST_NESTED:
        raise mistake(
            element.where, "a type nested deeper", f"at most {MOST_NESTED} levels of STRUCT and ARRAY"
        )
    return depth + 1


def bounds(low: str, high: str, where: str) -> tuple[Number, Number]:
    """Return the bounds of an array or subrange."""
    lowest, highest = read_number(low, where), read_number(high, where)
    if isinstance(lowest, int) and isinstance(highest, int) and highest < lowest:
        raise mistake(where, f"'{highest}'", f"a number from {lowest} upwards")
    return lowest, highest


def text_type(length: str, wide: bool, where: str) -> Text | TextSpec:
    """Return STRING or WSTRING; an empty length is the default one."""
    if not length.strip():
        return Text(None, wide)
    longest = read_number(length, where)
    if not isinstance(longest, int):
        return TextSpec(longest, wide)
    if longest < 1:
        raise mistake(where, f"'{longest}'", "a length of 1 or more")
    return Text(longest, wide)
