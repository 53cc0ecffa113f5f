"""Conversion code for the receiver: values out of the raw bytes of a corrective type, in ST or SCL.

Rule: in ST the bytes of a number go through a UNION, in the order that the receiver stores them; TIA has no
UNION, there they are shifted to their places in a bit string, which then becomes the number.
"""

from __future__ import annotations

import re
from itertools import islice
from typing import Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.cure.padded_type import Corrective
from trcvtui.udt.cure.swap import BITS, SCL_VIA, Language
from trcvtui.udt.layout.layout import Layout, Leaf, lay_out
from trcvtui.udt.layout.stored_form import stored_form
from trcvtui.udt.renaming import st_renamed, st_word
from trcvtui.udt.st_write import scl_name
from trcvtui.udt.types import ELEMENTARY, Array, Elementary, Kind, Text

MOST_SHOWN: Final = 256  # members that are converted; a longer text helps nobody


class Unpacking(NamedTuple):
    """UNIONs as types, statements, and the members that need a conversion of their own."""

    types: str
    code: str
    left_out: tuple[str, ...]


def unpack_code(
    found: Corrective,
    wanted: Layout,
    language: Language = "st",
    source: str = "msg",
    target: str = "value",
) -> Unpacking:
    """Return what fills `target`, of the plain type, from what is raw in `source`, of the corrective type."""
    have, plain = _renamed(found.layout), _renamed(wanted)
    missing = [
        number
        for number, leaf in enumerate(islice(plain.leaves(), 64 * MOST_SHOWN))
        if _place(_same(have, leaf)) != _place(leaf)
    ]
    is_st = language == "st"
    write = (
        _Writing(have, plain, source, target) if is_st else _SclWriting(found.layout, wanted, source, target)
    )
    for number in missing[:MOST_SHOWN]:
        write.leaf(write.wanted.leaf(number), wanted.leaf(number).path)
    if len(missing) > MOST_SHOWN:
        write.left_out.append(f"{len(missing) - MOST_SHOWN} more members")
    types = "".join(_union(name) for name in sorted(write.unions))
    lines = [write.head(), *write.lines] if write.lines else []
    return Unpacking(types, "".join(line + "\n" for line in lines), tuple(write.left_out))


def _renamed(layout: Layout) -> Layout:
    return lay_out(st_renamed(layout.type), layout.rules, st_word(layout.name))


def _same(layout: Layout, leaf: Leaf) -> Leaf | None:
    """Return the leaf of the same path; None where the layout has it not, or as raw bytes."""
    try:
        return layout.leaf(layout.number_of(leaf.path))
    except UserError:
        return None


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
        self.has_loop = False

    def head(self) -> str:
        """Return the comment that declares the variables."""
        names = [(self.source, self.layout.name), (self.target, self.wanted.name)]
        names += [("i", "DINT")] if self.has_loop else []
        names += [(f"u_{name}", f"U_{name}") for name in sorted(self.unions)]
        return "// " + "; ".join(f"{name} : {type_}" for name, type_ in names)

    def leaf(self, leaf: Leaf, declared: str) -> None:
        """Write the statements of one member; `declared` is its path as it was declared."""
        at = self.layout.leaf_at(leaf.offset)
        place = "" if at is None else self.layout.leaf(at).path
        if at is None or isinstance(leaf.type, Text):
            self.left_out.append(declared)
            return
        theirs, ours = self.wanted.rules, self.layout.rules
        own = ours.stored(leaf.type)
        to, of = self.variable(self.target, leaf.path), self.variable(self.source, place)
        if leaf.bit is not None:
            self.lines.append(f"{to} := ({of} AND 16#{1 << leaf.bit:02X}) <> 0;")
        elif stored_form(leaf.type, theirs) != stored_form(leaf.type, ours) or own.code.endswith("s"):
            self.left_out.append(declared)
        else:
            self.number(own, leaf.size, to, of)

    def variable(self, name: str, path: str) -> str:
        """Return how the language writes a member of a variable."""
        return _join(name, path)

    def number(self, row: Elementary, size: int, to: str, of: str) -> None:
        """Write the statements of a number."""
        name = row.name
        array, bracket, first = of.rpartition("[")
        if not bracket or name == "BYTE":
            self.lines.append(f"{to} := {of};")
            return
        self.unions.add(name)
        self.has_loop = True
        start = int(first[:-1])
        index = f"{size - 1} - i" if self.is_swapped else "i"
        shift = f"{start} + i" if start else "i"
        self.lines += [
            f"FOR i := 0 TO {size - 1} DO",
            f"    u_{name}.b[{index}] := {array}[{shift}];",
            "END_FOR;",
            f"{to} := u_{name}.v;",
        ]


class _SclWriting(_Writing):
    """The same for TIA."""

    def variable(self, name: str, path: str) -> str:
        if name == self.source and isinstance(self.layout.type, Array):
            path = f"raw{path}"  # TIA has no type that is an ARRAY
        return "#" + _join(name, re.sub(r"[^.\[\]]+(?![^\[]*\])", lambda found: scl_name(found[0]), path))

    def number(self, row: Elementary, size: int, to: str, of: str) -> None:
        array, bracket, first = of.rpartition("[")
        if not bracket or row.name == "BYTE":
            self.lines.append(f"{to} := {of};")
            return
        if row.kind is Kind.BOOL:
            self.lines.append(f"{to} := ({of} AND 16#FF) <> 0;")
            return
        parts = [f"{array}[{int(first[:-1]) + number}]" for number in range(size)]
        if self.wanted.rules.byte_order == "big":
            parts.reverse()
        bits = {1: "BYTE", **BITS}[size]
        value = of if size == 1 else " OR ".join(_shifted(part, bits, 8 * n) for n, part in enumerate(parts))
        for name in (SCL_VIA.get(row.name), row.name):
            if name and name != bits:
                value, bits = f"{bits}_TO_{name}({value})", name
        self.lines.append(f"{to} := {value};")


def _shifted(part: str, bits: str, places: int) -> str:
    value = f"BYTE_TO_{bits}({part})"
    return f"SHL(IN := {value}, N := {places})" if places else value


def _join(variable: str, path: str) -> str:
    return variable + path if not path or path.startswith("[") else f"{variable}.{path}"
