"""Leaves that overlap, written so that all of them still read as their own values.

Rule: first the leaves of which every bit counts; then BOOL, texts and the like, which several byte strings
say, by changing as little as their value needs.
"""

from __future__ import annotations

from itertools import product

from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.decode import decode_leaf
from trcvtui.udt.layout.layout import Layout, Leaf
from trcvtui.udt.types import Text


class Overlay:
    """The bytes of a layout as they are written, and the bits in them that somebody's value needs."""

    def __init__(self, layout: Layout, data: bytearray) -> None:
        self._layout, self._data = layout, data
        self._taken = bytearray(len(data))
        self._exact: list[tuple[Leaf, bytes]] = []
        self._loose: list[tuple[Leaf, bytes]] = []

    def add(self, leaf: Leaf, part: bytes) -> None:
        """Keep the bytes of a leaf until all are known."""
        value = decode_leaf(self._layout, leaf, part)
        (self._loose if _is_loose(leaf, value) else self._exact).append((leaf, part))

    def write(self) -> None:
        """Write all leaves."""
        texts_first = sorted(self._loose, key=lambda row: _order(row[0]))
        firm = bytes(len(self._data))
        for number, (leaf, part) in enumerate((*self._exact, *texts_first)):
            if number == len(self._exact):
                firm = bytes(self._taken)
            place = slice(leaf.offset, leaf.offset + leaf.size)
            own = bytes([1 << leaf.bit]) if leaf.bit is not None else b"\xff" * leaf.size
            needed = self._needed(leaf, part) if isinstance(leaf.type, Text) else own
            now, taken = self._data[place], self._taken[place]
            free = bytes(ours & ~theirs for ours, theirs in zip(own, taken, strict=True))
            forced = bytes(ours | theirs for ours, theirs in zip(free, needed, strict=True))
            value = decode_leaf(self._layout, leaf, part)
            gentle = bytes(ours & ~theirs for ours, theirs in zip(forced, firm[place], strict=True))
            forms = (part, self._beyond(leaf, part))
            for mask, form in (*product((free, gentle, forced), forms), (own, part)):
                written = _masked(now, form, mask)
                if _same(decode_leaf(self._layout, leaf, written), value):
                    break
            self._data[place] = written
            self._taken[place] = bytes(ours | theirs for ours, theirs in zip(needed, taken, strict=True))

    def _beyond(self, leaf: Leaf, part: bytes) -> bytes:
        """Return other bytes that say the same: a full text has a length beyond its field, TRUE all bits."""
        if not isinstance(leaf.type, Text):
            return b"\xff" * len(part) if any(part) and leaf.coding.code == "?" else part
        if not self._layout.rules.text.header:
            return part
        unit = 2 if leaf.type.wide else 1
        return part[:unit] + b"\xff" * unit + part[2 * unit :]

    def _needed(self, leaf: Leaf, part: bytes) -> bytes:
        """Return which bytes of a text say what it is: not the longest length, nor what is behind the end."""
        assert isinstance(leaf.type, Text)
        unit = 2 if leaf.type.wide else 1
        text = str(decode_leaf(self._layout, leaf, part))
        length = len(text.encode("utf-16-le", "surrogatepass")) // 2
        if leaf.type.utf8:
            length = len(text.encode("utf-8", "surrogateescape"))
        first = unit if self._layout.rules.text.header else 0
        last = min(first + (length + 1) * unit, len(part))
        return bytes(255 if first <= at < last else 0 for at in range(len(part)))


def _is_loose(leaf: Leaf, value: Value) -> bool:
    """Return whether other bytes may say the same value."""
    if isinstance(leaf.type, Text) or leaf.coding.code.endswith("s"):
        return True
    return (value is True and leaf.bit is None) or value != value


def _order(leaf: Leaf) -> int:
    """Return a number: STRING before WSTRING, which has more ways to say a full text; BOOL last."""
    return (2 if leaf.type.wide else 1) if isinstance(leaf.type, Text) else 3


def _masked(below: bytes | bytearray, part: bytes, mask: bytes) -> bytes:
    return bytes(b & ~m | p & m for b, p, m in zip(below, part, mask, strict=True))


def _same(one: Value, other: Value) -> bool:
    return one == other or (one != one and other != other)
