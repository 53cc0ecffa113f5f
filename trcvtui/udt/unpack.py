"""Conversion code for the receiver: values out of the raw bytes of a corrective type, in ST.

Rule: the bytes of a number go through a UNION, in the order that the receiver stores them.
"""

from __future__ import annotations

from itertools import islice
from typing import Final, NamedTuple

from trcvtui.udt.corrective import Corrective
from trcvtui.udt.layout import Layout, Leaf
from trcvtui.udt.types import ELEMENTARY, Text

MOST_SHOWN: Final = 256  # members that are converted; a longer text helps nobody


class Unpacking(NamedTuple):
    """UNIONs as types, statements, and the members that need a conversion of their own."""

    types: str
    code: str
    left_out: tuple[str, ...]


def unpack_code(found: Corrective, wanted: Layout, source: str = "msg", target: str = "value") -> Unpacking:
    """Return what fills `target`, of the plain type, from what is raw in `source`, of the corrective type."""
    write = _Writing(found.layout, wanted, source, target)
    raw = {leaf.path: leaf for leaf in islice(found.layout.leaves(), 64 * MOST_SHOWN)}
    missing = [
        leaf
        for leaf in islice(wanted.leaves(), 64 * MOST_SHOWN)
        if _place(raw.get(leaf.path)) != _place(leaf)
    ]
    for leaf in missing[:MOST_SHOWN]:
        write.leaf(leaf)
    if len(missing) > MOST_SHOWN:
        write.left_out.append(f"{len(missing) - MOST_SHOWN} more members")
    types = "".join(_union(name) for name in sorted(write.unions))
    return Unpacking(types, "".join(line + "\n" for line in write.lines), tuple(write.left_out))


def _place(leaf: Leaf | None) -> tuple[int, int, int | None] | None:
    return None if leaf is None else (leaf.offset, leaf.size, leaf.bit)


def _union(name: str) -> str:
    size = ELEMENTARY[name].size
    body = f"    b : ARRAY[0..{size - 1}] OF BYTE;\n    v : {name};\n"
    return f"TYPE U_{name} :\nUNION\n{body}END_UNION\nEND_TYPE\n"


class _Writing:
    def __init__(self, layout: Layout, wanted: Layout, source: str, target: str) -> None:
        self.layout, self.wanted, self.source, self.target = layout, wanted, source, target
        self.is_swapped = layout.rules.byte_order != wanted.rules.byte_order
        self.unions: set[str] = set()
        self.lines: list[str] = []
        self.left_out: list[str] = []

    def leaf(self, leaf: Leaf) -> None:
        """Write the statements of one member."""
        at = self.layout.leaf_at(leaf.offset)
        place = "" if at is None else self.layout.leaf(at).path
        if at is None or isinstance(leaf.type, Text):
            self.left_out.append(leaf.path)
            return
        stored = self.wanted.rules.stored(leaf.type)
        own = self.layout.rules.stored(leaf.type)
        to, of = _join(self.target, leaf.path), _join(self.source, place)
        if leaf.bit is not None:
            self.lines.append(f"{to} := ({of} AND 16#{1 << leaf.bit:02X}) <> 0;")
        elif (stored.code, stored.unit_ns) != (own.code, own.unit_ns) or stored.code.endswith("s"):
            self.left_out.append(leaf.path)
        else:
            self._number(own.name, leaf.size, to, of)

    def _number(self, name: str, size: int, to: str, of: str) -> None:
        array, bracket, first = of.rpartition("[")
        if not bracket or name == "BYTE":
            self.lines.append(f"{to} := {of};")
            return
        self.unions.add(name)
        start = int(first[:-1])
        index = f"{size - 1} - i" if self.is_swapped else "i"
        shift = f"{start} + i" if start else "i"
        self.lines += [
            f"FOR i := 0 TO {size - 1} DO",
            f"    u_{name}.b[{index}] := {array}[{shift}];",
            "END_FOR;",
            f"{to} := u_{name}.v;",
        ]


def _join(variable: str, path: str) -> str:
    return variable + path if not path or path.startswith("[") else f"{variable}.{path}"
