"""Bytes of a type as its initial value in ST: `[16#0D, 16#0A]`, `(speed := 1.5, name := 'abc')`."""

from __future__ import annotations

import re
from itertools import groupby
from typing import Final

from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Leaf, Node, PlacedArray, PlacedLeaf, PlacedUnion
from trcvtui.udt.layout.value_text import real_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import Elementary, Enumeration, LeafType, StringType, Subrange, ValueKind

FEWEST_REPEATED: Final = 4  # `4(16#00)`, and fewer one by one


def initial_value(layout: Layout, content: bytes) -> str:
    def of(node: Node, at: int, bit: int | None = None) -> str:
        if isinstance(node, PlacedLeaf):
            leaf = Leaf("", node.type, at, node.size, node.coding, (bit or 0) if node.is_bit else None)
            return _literal(node.type, node.size, decode_leaf(layout, leaf, content[at : at + node.size]))
        if isinstance(node, PlacedArray):
            places = map(node.place, range(node.count))
            return f"[{', '.join(_repeated([of(node.element, at + place, bit) for place, bit in places]))}]"
        members = list(node.flat(at))
        if isinstance(node, PlacedUnion):  # one member alone has a value
            members = [max(members, key=lambda one: one.node.size)]
        return f"({', '.join(f'{one.name} := {of(one.node, one.offset, one.bit)}' for one in members)})"

    return of(layout.root, 0)


def _repeated(values: list[str]) -> list[str]:
    found = [(value, len([*same])) for value, same in groupby(values)]
    each = ([f"{n}({value})"] if n >= FEWEST_REPEATED else [value] * n for value, n in found)
    return [value for some in each for value in some]


def _literal(type_: LeafType, size: int, value: Value) -> str:
    match type_, value:
        case StringType(wide=wide), _:
            return quoted(str(value), wide)
        case Enumeration(), _:
            name = next((name for name, number in type_.values if number == value), "")
            return f"{type_.name}.{name}" if type_.name and name else str(value)
        case Subrange(base=base), _:
            return _literal(base, size, value)
        case Elementary(kind=ValueKind.BITS), int():
            return f"16#{value:0{2 * size}X}"
        case Elementary(kind=ValueKind.BOOL), _:
            return str(value).upper()
        case Elementary(kind=ValueKind.CHARACTER), _:
            return quoted(str(value), size > 1)
        case Elementary(kind=ValueKind.REAL), float():
            text = real_text(value, size)
            return text if "." in text else text.replace("e", ".0e")
    return str(value)


def quoted(text: str, wide: bool = False) -> str:
    """Return a STRING or WSTRING; in a comment of ST, too, it begins and ends none."""
    mark, digits = ('"', 4) if wide else ("'", 2)
    escaped = (
        one if one.isprintable() and one not in f"${mark}" else f"${ord(one) % 16**digits:0{digits}X}"
        for one in text
    )
    return mark + re.sub(r"(?<=\()\*|\*(?=\))", f"${ord('*'):0{digits}X}", "".join(escaped)) + mark
