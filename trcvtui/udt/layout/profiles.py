"""The profiles that a sender may have: layout x byte order x STRING form, and which mean the same for a type.

Rule: two profiles are one when every leaf lies at the same place and is stored in the same way.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.layout.layout import BYTE_ORDERS, LAYOUTS, Layout, lay_out, rules_for
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.layout.stored_form import stored_form
from trcvtui.udt.types import Array, Kind, Struct, Text, Type, Union

# Which STRING forms occur with a layout: a layout of Baosky's size may be that of a C program, too.
FORMS: Final = {
    "s7-standard": ("s7",),
    **dict.fromkeys(("baosky", "baosky-slot4", "baosky-pack4"), ("s7", "cstr")),
    **dict.fromkeys(("natural8", "packed"), ("s7", "cstr", "nul")),
}
OWN_FORM: Final = ("nul",)  # of any other


class Profile(NamedTuple):
    """How a sender stores a type; `text` is the STRING form, "" where the type has no STRING."""

    layout: str
    byte_order: str
    text: str = ""

    @property
    def rules(self) -> LayoutRules:
        """Return the rules of the profile."""
        return rules_for(self.layout, self.byte_order, self.text or None)

    def __str__(self) -> str:
        """Return the profile as a person names it."""
        return f"{self.layout}, {self.byte_order}-endian" + (f", STRING {self.text}" if self.text else "")


def profiles_for(type_: Type) -> tuple[Profile, ...]:
    """Return every profile that makes sense for a type, the default layout first."""
    with_text = has_text(type_)
    found = []
    for layout, rules in LAYOUTS.items():
        forms = FORMS.get(layout, OWN_FORM) if with_text else ("",)
        orders = sorted(BYTE_ORDERS, key=lambda order, own=rules.byte_order: order != own)  # type: ignore[misc]
        found += [Profile(layout, order, form) for order in orders for form in forms]
    return tuple(found)


def same_layouts(
    type_: Type, profiles: tuple[Profile, ...], name: str = "", own: LayoutRules | None = None
) -> list[tuple[tuple[Profile, ...], Layout]]:
    """Return the type laid out in each profile, those that mean the same together.

    A profile in which the type cannot be laid out is left out. `own` has what our side says beside a profile.
    """
    found: dict[object, tuple[list[Profile], Layout]] = {}
    for profile in profiles:
        try:
            layout = lay_out(type_, _beside(profile.rules, own), name)
        except UserError:
            continue
        found.setdefault(shape(layout), ([], layout))[0].append(profile)
    return [(tuple(same), layout) for same, layout in found.values()]


def _beside(rules: LayoutRules, own: LayoutRules | None) -> LayoutRules:
    """Return the rules with our size of a pointer and, in our own layout, our room of a STRING."""
    if own is None:
        return rules
    even = own.string_even if own.name == rules.name else rules.string_even
    return replace(rules, pointer_size=own.pointer_size, string_even=even)


def shape(layout: Layout, *, by_bytes: bool = False) -> object:
    """Return a value that is equal for two layouts of one type in which all bytes mean the same.

    `by_bytes`: it is also equal where only the sign of a duration, or the room after a text, differs.
    """
    return layout.size, _Shapes(layout.rules, by_bytes).of(layout.root)


class _Shapes:
    def __init__(self, rules: LayoutRules, by_bytes: bool) -> None:
        self.rules, self.by_bytes = rules, by_bytes
        self._known: dict[int, object] = {}

    def of(self, node: Node) -> object:
        if id(node) not in self._known:
            self._known[id(node)] = self._of(node)
        return self._known[id(node)]

    def _of(self, node: Node) -> object:
        if isinstance(node, PlacedLeaf):
            return self._leaf(node)
        if isinstance(node, PlacedArray):  # a single element has no next one
            return node.pitch if node.count > 1 and node.leaves else 0, self.of(node.element)
        parts = zip(node.offsets, node.bits, node.nodes, strict=True)
        return tuple((offset, bit, self.of(child)) for offset, bit, child in parts if child.leaves)

    def _leaf(self, node: PlacedLeaf) -> object:
        type_, rules = node.type, self.rules
        if isinstance(type_, Text):
            is_bytes = not type_.wide
        else:
            row = rules.stored(type_)
            is_bytes = node.size == 1 or (row.name, row.code) == ("DT", "8s")
        form, size = stored_form(type_, rules), node.size
        if self.by_bytes and isinstance(type_, Text):
            size = 0
        elif self.by_bytes and row.kind is Kind.DURATION:
            form = (row.name, row.size, row.unit_ns)
        return size, node.is_bit, form, "" if is_bytes else rules.byte_order


def has_text(type_: Type) -> bool:
    """Return whether a STRING or WSTRING is in the type."""
    return _has_text(type_, set())


def _has_text(type_: Type, seen: set[int]) -> bool:
    match type_:
        case Text():
            return True
        case Array(element=element):
            return _has_text(element, seen)
        case Struct() | Union():
            if id(type_) in seen:
                return False
            seen.add(id(type_))
            parts = [member.type for member in type_.members] + ([type_.base] if type_.base else [])
            return any(_has_text(part, seen) for part in parts)
        case _:
            return False
