"""Layout rules as data, one row a layout: alignment, form of STRING, byte order, elementary types."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeVar

from trcvtui.errors import mistake
from trcvtui.udt.types import (
    ADDRESS,
    DAY,
    MS,
    SECOND,
    Elementary,
    Enumeration,
    Pointer,
    StringType,
    Subrange,
    ValueKind,
)

DEFAULT_LAYOUT = "baosky"
BYTE_ORDERS = {"little": "<", "big": ">"}
POINTER_SIZES: Final = (4, 8)

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class StringForm:
    """How a STRING is stored. `extra` counts units besides the characters: bytes, or words in a WSTRING.

    With `header` the units are [longest][actual] before the characters, else NULs after them. `default` is
    the length of a STRING without a length. `longest` and `longest_wide` limit STRING and WSTRING.
    """

    name: str
    header: bool
    extra: int
    default: int
    longest: int
    longest_wide: int

    def length(self, text: StringType) -> int:
        return self.default if text.length is None else text.length

    def largest_length(self, text: StringType) -> int:
        return self.longest_wide if text.wide else self.longest

    def size(self, text: StringType) -> int:
        """Return the size in bytes, header or NUL included."""
        return (self.extra + self.length(text)) * (2 if text.wide else 1)


# `s7` and `cstr` have the same size, so a Baosky layout is the same with either. A header has one byte for
# the length and limits it; without a header only the limit of a whole type applies.
TEXT_FORMS = {
    form.name: form
    for form in (
        StringForm("s7", header=True, extra=2, default=80, longest=254, longest_wide=254),
        StringForm("cstr", header=False, extra=2, default=80, longest=1 << 22, longest_wide=1 << 21),
        StringForm("nul", header=False, extra=1, default=80, longest=1 << 22, longest_wide=1 << 21),
    )
}


@dataclass(frozen=True, slots=True)
class LayoutRules:
    """How members of a STRUCT are placed. Alignments are in bytes, each a power of two.

    `cap` is the largest alignment. The smallest alignment is `member_floor` of a member, `struct_floor` of
    a whole STRUCT, `array_floor` of an ARRAY and its end, and `text_floor` of a STRING. With `string_even`
    a STRING of odd size takes one byte more. If `takes_pack`, the pack_mode of a type replaces `cap`.
    `bits` names the types that are one bit. `rows` replaces elementary types that this layout stores
    differently. `unverified` names the types whose bytes no page of the vendor describes. `text_forms` are
    the STRING forms that a sender with this layout may use.
    """

    name: str
    cap: int
    member_floor: int = 1
    struct_floor: int = 1
    array_floor: int = 1
    text_floor: int = 1
    string_even: bool = False
    takes_pack: bool = False
    byte_order: str = "little"
    text: StringForm = TEXT_FORMS["s7"]
    bits: frozenset[str] = frozenset({"BIT"})
    rows: tuple[Elementary, ...] = ()
    unverified: frozenset[str] = frozenset()
    pointer_size: int = 8
    text_forms: tuple[str, ...] = ("nul",)

    def own_type(self, type_: Elementary) -> Elementary:
        for row in self.rows:
            if row.name == type_.name:
                return row
        if type_.kind is ValueKind.ADDRESS and self.pointer_size != type_.size:
            return replace(type_, size=self.pointer_size, align=self.pointer_size, code="I")
        return type_

    def storage(self, type_: Elementary | Subrange | Pointer | Enumeration) -> Elementary:
        """Return the elementary type in which this layout stores the values of a type."""
        match type_:
            case Elementary():
                return self.own_type(type_)
            case Subrange(base=base) | Enumeration(base=base):
                return self.own_type(base)
            case Pointer():
                return self.own_type(ADDRESS)


# Baosky's manual prints one example, {DINT, DINT, CHAR} = 12 bytes. All its readings below but `packed` fit
# it; the default is cap4. STRING: 82 bytes for 80 characters (Baosky library manual 7.15.2).
BAOSKY_UNVERIFIED = frozenset({"STRING", "WSTRING", "WCHAR", "DATE", "LDATE", "TOD", "LTOD", "DT", "LDT"})
BAOSKY = LayoutRules("baosky", cap=4, struct_floor=4, unverified=BAOSKY_UNVERIFIED, text_forms=("s7", "cstr"))
ALL_TEXT_FORMS: Final = ("s7", "cstr", "nul")

# Durations are unsigned, DATE counts seconds.
CODESYS = LayoutRules(
    "codesys-8",
    cap=8,
    takes_pack=True,
    text=TEXT_FORMS["nul"],
    rows=(
        Elementary("TIME", 4, 4, "I", ValueKind.DURATION, MS),
        Elementary("LTIME", 8, 8, "Q", ValueKind.DURATION, 1),
        Elementary("DATE", 4, 4, "I", ValueKind.DATE, SECOND),
    ),
)

# STEP 7 help, standard access: alignment 2 at most, BOOL in bits, big-endian.
S7 = LayoutRules(
    "s7-standard",
    cap=2,
    struct_floor=2,
    array_floor=2,
    text_floor=2,
    string_even=True,
    byte_order="big",
    text=replace(TEXT_FORMS["s7"], default=254, longest_wide=16382),
    bits=frozenset({"BIT", "BOOL"}),
    rows=(
        Elementary("DATE", 2, 2, "H", ValueKind.DATE, DAY, epoch_ns=7305 * DAY),  # days since 1990-01-01
        Elementary("DT", 8, 2, "8s", ValueKind.DATE_AND_TIME),
    ),
    text_forms=("s7",),
)

LAYOUTS = {
    rules.name: rules
    for rules in (
        BAOSKY,
        replace(BAOSKY, name="baosky-slot4", member_floor=4),
        replace(BAOSKY, name="baosky-pack4", struct_floor=1),
        replace(BAOSKY, name="natural8", cap=8, text_forms=ALL_TEXT_FORMS),
        replace(BAOSKY, name="packed", cap=1, struct_floor=1, text_forms=ALL_TEXT_FORMS),
        *(replace(CODESYS, name=f"codesys-{pack}", cap=pack) for pack in (8, 4, 2, 1)),
        S7,
    )
}
# gcc on 64 bits and CODESYS 8 agree on every offset, with `#pragma pack` or without (`make oracle`).
LAYOUT_ALIASES = {"cap4": "baosky", "c": "codesys-8"}


def layout_names() -> list[str]:
    return [*LAYOUTS, *LAYOUT_ALIASES]


def rules_for(
    layout: str | LayoutRules = DEFAULT_LAYOUT,
    byte_order: str | None = None,
    text: str | None = None,
    *,
    pointer_size: int | None = None,
    string_even: bool | None = None,
) -> LayoutRules:
    """Return the rules of a layout, or the given rules, changed by the settings; raise UserError."""
    rules = layout
    if isinstance(rules, str):
        rules = _look_up("layout", LAYOUT_ALIASES.get(rules, rules), LAYOUTS, layout_names())
    if byte_order is not None:
        _look_up("byte order", byte_order, BYTE_ORDERS)
        rules = replace(rules, byte_order=byte_order)
    if text is not None:
        form = _look_up("STRING form", text, TEXT_FORMS)
        if form.name != rules.text.name:  # the default length is the vendor's, whatever the form
            rules = replace(rules, text=replace(form, default=min(rules.text.default, form.longest)))
    if pointer_size is not None:
        if pointer_size not in POINTER_SIZES:
            raise mistake("pointer size", str(pointer_size), "4 or 8")
        rules = replace(rules, pointer_size=pointer_size)
    if string_even is not None:
        rules = replace(rules, string_even=string_even)
    return rules


class LayoutChoice(NamedTuple):
    """The layout options. If an option is None, the caller or the layout itself decides it."""

    layout: str | None = None
    byte_order: str | None = None
    text: str | None = None
    pointer_size: int | None = None
    string_even: bool | None = None

    def rules(self, own: str | LayoutRules = DEFAULT_LAYOUT) -> LayoutRules:
        """Return the chosen rules, by default based on `own`; raise UserError for an unknown name."""
        chosen = own if self.layout is None else self.layout
        return rules_for(
            chosen, self.byte_order, self.text, pointer_size=self.pointer_size, string_even=self.string_even
        )

    def __str__(self) -> str:
        """Return the options as a line of the bench: `layout=packed byte_order=big`."""
        words = [{True: "yes", False: "no"}[one] if isinstance(one, bool) else one for one in self]
        given = zip(self._fields, words, strict=True)
        return " ".join(f"{name}={word}" for name, word in given if word is not None)


NO_CHOICE: Final = LayoutChoice()


def parse_choice(name: str, text: str, where: str = "") -> str | int | bool:
    """Return the value of one option from its text; raise UserError with the possible ones."""
    choices: dict[str, dict[str, str | int | bool]] = {
        "layout": {name: name for name in layout_names()},
        "byte_order": {name: name for name in BYTE_ORDERS},
        "text": {name: name for name in TEXT_FORMS},
        "pointer_size": {str(size): size for size in POINTER_SIZES},
        "string_even": {"yes": True, "no": False},
    }
    return _look_up(where or name, text, choices[name])


def _look_up(what: str, name: str, table: dict[str, _T], names: list[str] | None = None) -> _T:
    if name not in table:
        raise mistake(what, f"'{name}'", "one of " + ", ".join(names or table))
    return table[name]
