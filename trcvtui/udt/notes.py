"""What is to be told beside a type: the notes of its declaration, a packing that the layout leaves out."""

from __future__ import annotations

from collections.abc import Iterator

from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.type_set import TypeSet
from trcvtui.udt.types import Array, Enumeration, Struct, Type, Union


def notes_of(types: TypeSet, name: str, type_: Type, rules: LayoutRules) -> list[str]:
    """Return each note of a type and of all types in it once, with the name of its type before it."""
    found = {f"{name}: {note}": None for note in types.notes.get(name.casefold(), ())}
    for inner in _named(type_, set()):
        own = inner.name or name
        for note in (*types.notes.get(own.casefold(), ()), *_empty(inner), *_packing(inner, rules)):
            found[f"{own}: {note}"] = None
    return list(found)


def _empty(type_: Struct | Union | Enumeration) -> Iterator[str]:
    if not isinstance(type_, Enumeration) and not type_.members and type_.base is None:
        word = "UNION" if isinstance(type_, Union) else "STRUCT"
        yield f"an empty {word}: 0 bytes here; a partner's compiler may refuse it or give it a byte"


def _packing(type_: Struct | Union | Enumeration, rules: LayoutRules) -> Iterator[str]:
    pack = None if isinstance(type_, Enumeration) else type_.pack
    if pack is None or rules.takes_pack or (max(pack, 1) == rules.cap and rules.struct_floor == 1):
        return
    yield f"its packing ({pack}) is not applied by the layout {rules.name}; codesys-N and c apply it"


def _named(type_: Type, seen: set[Struct | Union | Enumeration]) -> Iterator[Struct | Union | Enumeration]:
    """Yield every structure, union and enumeration in a type once."""
    while isinstance(type_, Array):
        type_ = type_.element
    if not isinstance(type_, Struct | Union | Enumeration) or type_ in seen:
        return
    seen.add(type_)
    yield type_
    if isinstance(type_, Enumeration):
        return
    if type_.base is not None:
        yield from _named(type_.base, seen)
    for member in type_.members:
        yield from _named(member.type, seen)
