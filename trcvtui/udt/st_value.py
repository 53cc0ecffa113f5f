"""Bytes of a type as its initial value in ST: `[16#0D, 16#0A]`, `(speed := 1.5, name := 'abc')`."""

from __future__ import annotations

from itertools import groupby
from typing import Final

from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Leaf, Node, PlacedArray, PlacedLeaf, PlacedUnion
from trcvtui.udt.layout.value_text import real_text
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.literals import quote_text
from trcvtui.udt.types import Elementary, LeafType, StringType, ValueKind

FEWEST_REPEATED: Final = 4  # equal elements in a row that become `4(16#00)`


# The initial value of a Siemens date that was never written: 8 or 12 zero bytes are not a date.
NO_DATES: Final = {"16#" + "00" * 8: "DT#1990-01-01-00:00:00", "16#" + "00" * 12: "DTL#1970-01-01-00:00:00"}


def initial_value(layout: Layout, content: bytes, is_scl: bool = False) -> str:
    """Return the value in ST, or in SCL, where double quotes enclose names."""

    def text_of(node: Node, at: int, bit: int | None = None) -> str:
        if isinstance(node, PlacedLeaf):
            leaf = Leaf("", node.type, at, node.size, node.coding, (bit or 0) if node.is_bit else None)
            value = decode_leaf(layout, leaf, content[at : at + node.size])
            return _literal(node.type, node.size, value, is_scl)
        if isinstance(node, PlacedArray):
            places = map(node.element_place, range(node.count))
            texts = [text_of(node.element, at + place, bit) for place, bit in places]
            return f"[{', '.join(_join_repeated(texts))}]"
        members = list(node.flat_members(at))
        if isinstance(node, PlacedUnion):  # only one member may be initialised: the largest
            members = [max(members, key=lambda one: one.node.size)]
        return f"({', '.join(f'{one.name} := {text_of(one.node, one.offset, one.bit)}' for one in members)})"

    return text_of(layout.root, 0)


def _join_repeated(values: list[str]) -> list[str]:
    found = [(value, len([*same])) for value, same in groupby(values)]
    each = ([f"{n}({value})"] if n >= FEWEST_REPEATED else [value] * n for value, n in found)
    return [value for some in each for value in some]


def _literal(type_: LeafType, size: int, value: Value, is_scl: bool) -> str:
    kind = type_.kind if isinstance(type_, Elementary) else None
    if isinstance(type_, StringType) or kind is ValueKind.CHARACTER:
        if not (type_.wide if isinstance(type_, StringType) else size > 1):
            return quote_text(str(value))
        name = "WSTRING#" if kind is None else "WCHAR#"
        return name + quote_text(str(value), "'", 4) if is_scl else quote_text(str(value), '"', 4)
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, float):
        text = real_text(value, size)
        return text if "." in text else text.replace("e", ".0e")
    if kind is ValueKind.DATE_AND_TIME:
        return NO_DATES.get(str(value), str(value))
    return f"16#{value:0{2 * size}X}" if kind is ValueKind.BITS else str(value)
