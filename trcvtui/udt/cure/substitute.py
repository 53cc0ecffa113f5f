"""What stands for a leaf of another layout: its own type where the bytes mean the same, else a bit string.

Rule: a stand-in has exactly the size of the leaf, and what then is to be converted is told.
"""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.udt.layout.layout_tree import PlacedLeaf
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.layout.stored_form import stored_form
from trcvtui.udt.types import ELEMENTARY, Enumeration, LeafType, Text, type_text

BIT_STRINGS = {1: "BYTE", 2: "WORD", 4: "DWORD", 8: "LWORD"}


class Note(NamedTuple):
    """What is to be known of a member."""

    path: str
    text: str


def stand_in(
    node: PlacedLeaf, theirs: LayoutRules, ours: LayoutRules, path: str
) -> tuple[LeafType | None, str]:
    """Return the type under our rules for a leaf under theirs, and a note; None and why there is none."""
    if node.is_bit:
        return _bit(theirs, ours)
    if isinstance(node.type, Text):
        return _text(node.type, node.size, theirs, ours)
    stored, own = theirs.stored(node.type), ours.stored(node.type)
    if own.name in ours.bits:
        return ELEMENTARY["BYTE"], f"a BOOL of one byte in {theirs.name}, a bit in {ours.name}: here a BYTE"
    if stored_form(node.type, theirs) == stored_form(node.type, ours):
        return node.type, ""
    if isinstance(node.type, Enumeration):
        name = type_text(node.type)
        return ELEMENTARY[stored.name], f"{name} has {stored.size} bytes in {theirs.name}: here {stored.name}"
    bits = BIT_STRINGS.get(node.size)
    if bits is None:
        return None, f"{stored.name} is stored in its own way in {theirs.name}"
    return ELEMENTARY[
        bits
    ], f"{stored.name} is stored in its own way in {theirs.name}: here {bits}, to convert"


def _bit(theirs: LayoutRules, ours: LayoutRules) -> tuple[LeafType | None, str]:
    if "BOOL" in ours.bits:
        return ELEMENTARY["BOOL"], ""
    if ours.takes_pack:  # only CODESYS has BIT
        return ELEMENTARY["BIT"], ""
    return None, f"one bit in {theirs.name}, and {ours.name} has no member of one bit"


def _text(type_: Text, size: int, theirs: LayoutRules, ours: LayoutRules) -> tuple[LeafType | None, str]:
    if theirs.text.header != ours.text.header:
        forms = ("a NUL behind", "two lengths before")
        there, here = forms[theirs.text.header], forms[ours.text.header]
        return None, f"a STRING with {there} its characters in {theirs.name}, with {here} them in {ours.name}"
    declared = theirs.text.length(type_)
    length = size // (2 if type_.wide else 1) - ours.text.extra
    found = Text(length, type_.wide, type_.utf8)
    if length < declared or length > ours.text.most(found):
        name = type_text(Text(declared, type_.wide))
        return None, f"{name} of {size} bytes: {ours.name} has none of that size and length"
    return (type_ if ours.text.length(type_) == length else found), ""
