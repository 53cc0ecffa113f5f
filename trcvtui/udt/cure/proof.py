"""The proof of a corrective type: laid out again, every member lies where it is wanted, or its raw bytes do.

Rule: both trees are walked side by side, an ARRAY's element and a shared STRUCT once; names are whole names.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct
from trcvtui.udt.layout.padding import Unreachable

RawMember = tuple[int, str]  # the wanted node of its STRUCT (`id`), its name


def prove(wanted: Node, found: Node, raw: Collection[RawMember]) -> None:
    """Raise Unreachable unless every member lies as wanted, those in `raw` as bytes (of a bit: anything)."""
    if found.size != wanted.size:
        raise Unreachable("", f"{found.size} bytes in place of {wanted.size}")
    _Proof(raw).node(wanted, found, "")


class _Proof:
    def __init__(self, raw: Collection[RawMember]) -> None:
        self.raw = raw
        self._proved: set[tuple[int, int]] = set()

    def node(self, wanted: Node, found: Node, path: str) -> None:
        key = id(wanted), id(found)
        if key in self._proved:
            return
        if isinstance(wanted, PlacedStruct) and isinstance(found, PlacedStruct):
            self.struct(wanted, found, path)
        elif isinstance(wanted, PlacedArray) and isinstance(found, PlacedArray):
            ours, theirs = found, wanted
            if (ours.bounds, ours.pitch, ours.row_size) != (theirs.bounds, theirs.pitch, theirs.row_size):
                raise Unreachable(path, "its elements come to lie elsewhere")
            self.node(wanted.element, found.element, path + "[]")
        elif not (isinstance(wanted, PlacedLeaf) and isinstance(found, PlacedLeaf)) or (
            (wanted.size, wanted.is_bit) != (found.size, found.is_bit)
        ):
            raise Unreachable(path, "it has another size")
        self._proved.add(key)

    def struct(self, wanted: PlacedStruct, found: PlacedStruct, path: str) -> None:
        own = {name.casefold(): (at, bit, node) for name, at, bit, node in flat(found)}
        for name, offset, bit, node in flat(wanted):
            below = f"{path}.{name}" if path else name
            is_raw = (id(wanted), name) in self.raw
            if is_raw and (bit is not None or not node.size):
                continue
            at, own_bit, lies = own.get(name.casefold(), (-1, None, node))
            if at != offset or (is_raw and lies.size != node.size):
                raise Unreachable(below, "it comes to lie elsewhere")
            if not is_raw:
                if own_bit != bit:
                    raise Unreachable(below, "it comes to lie at another bit")
                self.node(node, lies, below)


def flat(node: PlacedStruct, at: int = 0) -> Iterator[tuple[str, int, int | None, Node]]:
    """Yield name, offset, bit and node of every member, what the type EXTENDS as members of its own."""
    for name, offset, bit, child in zip(node.names, node.offsets, node.bits, node.nodes, strict=True):
        if name or not isinstance(child, PlacedStruct):
            is_bit = isinstance(child, PlacedLeaf) and child.is_bit
            yield name, at + offset, bit if is_bit else None, child
        else:
            yield from flat(child, at + offset)
