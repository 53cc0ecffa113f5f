"""The cure of a mismatch as source text: padding members for one side, or swap code for the sender."""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.tui.formatting import plain
from trcvtui.udt.cure.padded_type import list_notes, padded_type
from trcvtui.udt.cure.swap import Language, swap_code
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.st_write import scl_text, st_text
from trcvtui.udt.types import Array, Struct, Type, Union, all_members, all_parts

RECEIVER, SENDER, SWAP = "receiver", "sender", "swap"
CURE_KINDS: Final = (RECEIVER, SENDER, SWAP)
MOST_UNIONS: Final = 8
CURE_LANGUAGES: Final[tuple[Language, ...]] = ("st", "scl")
KIND_TITLES: Final = {
    RECEIVER: "type for our side",
    SENDER: "type for the sender's side",
    SWAP: "swap code for the sender",
}


class Cure(NamedTuple):
    """Comment lines and the source text below them, ready to paste. If `text` is empty, no cure exists."""

    comments: tuple[str, ...]
    text: str

    @property
    def source(self) -> str:
        return "\n".join([*(f"// {line}" for line in self.comments), self.text.rstrip("\n")]) + "\n"


def make_cure(wanted: Layout, own: LayoutRules, kind: str, language: Language) -> Cure:
    """Return the cure of this `kind`: a type with the layout `wanted` under `own`, or the swap code."""
    try:
        return _swap_cure(wanted, own, language) if kind == SWAP else _type_cure(wanted, own, kind, language)
    except UserError as refused:
        return Cure((refused.lines()[0],), "")


def format_cures(ours: LayoutRules, theirs: Layout, form: str) -> str:
    """Return the output of `udt cure`: the type for our side, and the swap code if byte orders differ.

    `form` is the language `st` or `scl`, or `padded`: only the type, in the language of our side.
    """
    from trcvtui.udt.cure.swap import language_of

    if form == "padded":
        return make_cure(theirs, ours, RECEIVER, language_of(ours)).source
    language: Language = "scl" if form == "scl" else "st"
    kinds = (RECEIVER,) if ours.byte_order == theirs.rules.byte_order else (RECEIVER, SWAP)
    return "\n".join(make_cure(theirs, ours, kind, language).source for kind in kinds)


def _type_cure(wanted: Layout, own: LayoutRules, kind: str, language: Language) -> Cure:
    is_scl = language == "scl"
    found = padded_type(wanted, own, is_scl)
    name = plain(wanted.name)
    reached = "laid out as under" if found.is_possible else "laid out as closely as possible to"
    comments = [f"{name} for {own.name}, {found.layout.size} bytes, {reached} {wanted.rules.name}"]
    if found.layout.size > wanted.size > 0:  # not 0: LEN 0 means the whole variable
        block, act = ("receiving", "waits for") if kind == RECEIVER else ("sending", "sends")
        without = f"without LEN it {act} {found.layout.size} bytes"
        comments.append(f"LEN := {wanted.size} at the {block} block: {without}")
    comments += [plain(line) for line in list_notes(found)]
    if own.byte_order != wanted.rules.byte_order:
        comments.append("the byte order differs, too: the sender needs the swap code")
    if found.type is wanted.type:
        comments.append("no change needed: the gaps are the same")
    if is_scl and (unions := _find_unions(wanted.type)):
        names = ", ".join(map(plain, unions[:MOST_UNIONS])) + ", ..." * (len(unions) > MOST_UNIONS)
        comments.append(f"SCL has no UNION, so these are bytes: {names}")
    name = found.layout.name
    text = scl_text(found.type, name, own) if is_scl else st_text(found.type, name)
    return Cure(tuple(comments), text)


def _find_unions(type_: Type) -> list[str]:
    """Return the names of members that are UNIONs or ARRAYs of UNIONs. Inner names are `STRUCT.member`."""
    found = ["all of it"] if isinstance(type_, Union) else []
    for one in (part for part in all_parts(type_) if isinstance(part, Struct)):
        for member in all_members(one):
            inner = member.type
            while isinstance(inner, Array):
                inner = inner.element
            if isinstance(inner, Union):
                found.append(member.name if one is type_ else f"{one.name or 'STRUCT'}.{member.name}")
    return found


def _swap_cure(theirs: Layout, ours: LayoutRules, language: Language) -> Cure:
    order = theirs.rules.byte_order
    if ours.byte_order == order:
        return Cure((f"both sides are {order}-endian: nothing to swap",), "")
    if not isinstance(theirs.type, Struct):
        return Cure(("swap code is written for a STRUCT",), "")
    found = swap_code(theirs, language)
    comments = [f"{plain(theirs.name)} from {order}-endian to {ours.byte_order}-endian, before it is sent"]
    comments += [f"not swapped: {plain(line)}" for line in found.left_out]
    return Cure(tuple(comments), found.text)
