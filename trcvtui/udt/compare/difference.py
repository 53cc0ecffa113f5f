"""In what two layouts of one type differ: size, places, byte order, stored forms, in words.

Rule: the walk is over the declaration, an ARRAY's element once; what lies alike in both is not entered.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Final, NamedTuple

from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, index_text
from trcvtui.udt.layout.profiles import has_text
from trcvtui.udt.layout.stored_form import form_text, stored_form
from trcvtui.udt.types import Text

NAMED: Final = 3  # members that a sentence names
MOST_FOUND: Final = 256  # differences that are counted


class Apart(NamedTuple):
    """A member that differs, with both sides in words; `is_place`: in its place, else in its stored form."""

    path: str
    ours: str
    theirs: str
    is_place: bool


def difference(a: Layout, b: Layout) -> str:
    """Return in what two layouts of one type differ; of the elements of an ARRAY the first is named."""
    parts = []
    if a.size != b.size:
        parts.append(f"the size, {a.size} and {b.size} bytes")
    other_text = a.rules.text.name != b.rules.text.name and has_text(a.type)
    found = list(islice(_Walk(a, b, not other_text).apart(a.root, b.root, "", (0, 0), (0, 0)), MOST_FOUND))
    for words, is_place in (("the place of", True), ("the stored form of", False)):
        members = [one for one in found if one.is_place is is_place]
        if members:
            shown = [f"{one.path or a.name} ({one.ours} and {one.theirs})" for one in members[:NAMED]]
            more = f" and {len(members) - NAMED} more" if len(members) > NAMED else ""
            parts.append(f"{words} {', '.join(shown)}{more}")
    if a.rules.byte_order != b.rules.byte_order:
        parts.append("the byte order")
    if other_text:
        parts.append(f"the STRING form, {a.rules.text.name} and {b.rules.text.name}")
    return "; ".join(parts) or "nothing"


class _Walk:
    def __init__(self, a: Layout, b: Layout, with_texts: bool) -> None:
        self.a, self.b, self.with_texts = a.rules, b.rules, with_texts
        self._alike: dict[tuple[int, int], bool] = {}

    def apart(
        self, a: Node, b: Node, path: str, at: tuple[int, int], bits: tuple[int, int]
    ) -> Iterator[Apart]:
        """Yield what differs in two nodes at these two offsets."""
        if not a.leaves or (at[0] == at[1] and bits[0] == bits[1] and self.alike(a, b)):
            return
        if isinstance(a, PlacedLeaf) and isinstance(b, PlacedLeaf):
            yield from self.leaf(a, b, path, at, bits)
        elif isinstance(a, PlacedArray) and isinstance(b, PlacedArray):
            found = False
            for number in range(min(a.count, 2)):  # the second one shows a distance
                (our, our_bit), (their, their_bit) = a.place(number), b.place(number)
                below, places = path + index_text(a, number), (at[0] + our, at[1] + their)
                for one in self.apart(a.element, b.element, below, places, (our_bit, their_bit)):
                    found = True
                    yield one
                if found:
                    return
        elif isinstance(a, PlacedStruct) and isinstance(b, PlacedStruct):
            for number, (name, our_node, their_node) in enumerate(
                zip(a.names, a.nodes, b.nodes, strict=True)
            ):
                below = f"{path}.{name}" if path and name else name or path
                places = at[0] + a.offsets[number], at[1] + b.offsets[number]
                yield from self.apart(our_node, their_node, below, places, (a.bits[number], b.bits[number]))

    def leaf(
        self, a: PlacedLeaf, b: PlacedLeaf, path: str, at: tuple[int, int], bits: tuple[int, int]
    ) -> Iterator[Apart]:
        ours, theirs = _place(a, at[0], bits[0]), _place(b, at[1], bits[1])
        if ours != theirs:
            yield Apart(path, ours, theirs, is_place=True)
        if not self.same_form(a, b):
            yield Apart(path, form_text(a.type, self.a), form_text(b.type, self.b), is_place=False)

    def alike(self, a: Node, b: Node) -> bool:
        """Return whether all below lies alike relative to the nodes, and is stored alike."""
        key = id(a), id(b)
        if key not in self._alike:
            self._alike[key] = self._are_alike(a, b)
        return self._alike[key]

    def _are_alike(self, a: Node, b: Node) -> bool:
        if isinstance(a, PlacedLeaf) and isinstance(b, PlacedLeaf):
            return a.is_bit == b.is_bit and self.same_form(a, b)
        if isinstance(a, PlacedArray) and isinstance(b, PlacedArray):
            return (a.pitch == b.pitch or a.count == 1) and self.alike(a.element, b.element)
        if isinstance(a, PlacedStruct) and isinstance(b, PlacedStruct):
            same = (a.offsets, a.bits) == (b.offsets, b.bits)
            return same and all(map(self.alike, a.nodes, b.nodes))
        return False

    def same_form(self, a: PlacedLeaf, b: PlacedLeaf) -> bool:
        if isinstance(a.type, Text) and not self.with_texts:
            return True
        return stored_form(a.type, self.a) == stored_form(b.type, self.b)


def _place(leaf: PlacedLeaf, offset: int, bit: int) -> str:
    return f"{offset}.{bit}" if leaf.is_bit else str(offset)
