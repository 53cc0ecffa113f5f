"""Layout rules as data: alignment, form of STRING and byte order, one row a layout."""

from __future__ import annotations

from dataclasses import dataclass, replace

from trcvtui.errors import mistake
from trcvtui.udt.types import Elementary, Text

DEFAULT_LAYOUT = "baosky"
BYTE_ORDERS = {"little": "<", "big": ">"}


@dataclass(frozen=True, slots=True)
class TextForm:
    """How STRING lies in memory: header [longest][actual] before the characters, lengths in characters."""

    header: int = 2
    default: int = 80
    longest: int = 254

    def length(self, text: Text) -> int:
        """Return the number of characters that the text may have."""
        return self.default if text.length is None else text.length

    def size(self, text: Text) -> int:
        """Return the size in bytes, header included."""
        return (self.header + self.length(text)) * (2 if text.wide else 1)


@dataclass(frozen=True, slots=True)
class LayoutRules:
    """Where members of a STRUCT lie; alignments in bytes, each a power of two.

    `cap` is the largest alignment, `member_floor` the smallest start of a member, `struct_floor` the smallest
    alignment of a STRUCT as a whole. `rows` replaces elementary types that this layout stores in its own way;
    `unverified` names the types whose bytes no page of the vendor describes.
    """

    name: str
    cap: int
    member_floor: int = 1
    struct_floor: int = 1
    byte_order: str = "little"
    text: TextForm = TextForm()
    rows: tuple[Elementary, ...] = ()
    unverified: frozenset[str] = frozenset()

    def row(self, type_: Elementary) -> Elementary:
        """Return the elementary type as this layout stores it."""
        for row in self.rows:
            if row.name == type_.name:
                return row
        return type_


# baosky.md section 9 and udt.md 3.3: the manual prints one example, {DINT, DINT, CHAR} = 12 bytes, and each
# of these readings but `packed` fits it; cap4 is the decision. STRING: 82 bytes for 80 characters [M].
BAOSKY_UNVERIFIED = frozenset({"STRING", "WSTRING", "WCHAR", "DATE", "LDATE", "TOD", "LTOD", "DT", "LDT"})
LAYOUTS = {
    rules.name: rules
    for rules in (
        LayoutRules("baosky", cap=4, struct_floor=4, unverified=BAOSKY_UNVERIFIED),
        LayoutRules("baosky-slot4", cap=4, member_floor=4, struct_floor=4, unverified=BAOSKY_UNVERIFIED),
        LayoutRules("baosky-pack4", cap=4, unverified=BAOSKY_UNVERIFIED),
        LayoutRules("natural8", cap=8, struct_floor=4, unverified=BAOSKY_UNVERIFIED),
        LayoutRules("packed", cap=1, unverified=BAOSKY_UNVERIFIED),
    )
}
LAYOUT_ALIASES = {"cap4": "baosky"}


def rules_for(layout: str = DEFAULT_LAYOUT, byte_order: str | None = None) -> LayoutRules:
    """Return the rules of a layout by name, in another byte order if one is given; refuse unknown names."""
    rules = LAYOUTS.get(LAYOUT_ALIASES.get(layout, layout))
    if rules is None:
        raise mistake("layout", f"'{layout}'", "one of " + ", ".join([*LAYOUTS, *LAYOUT_ALIASES]))
    if byte_order is None:
        return rules
    if byte_order not in BYTE_ORDERS:
        raise mistake("byte order", f"'{byte_order}'", "one of " + ", ".join(BYTE_ORDERS))
    return replace(rules, byte_order=byte_order)
