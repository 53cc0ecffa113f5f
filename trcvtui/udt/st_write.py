"""Types written down as source text: IEC ST, and the TYPE of a TIA source (SCL).

Rule: the text stands alone: every type that the written one uses is in it, before its first use.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.renaming import is_st_word, st_renamed, st_word
from trcvtui.udt.types import (
    Array,
    Enumeration,
    Member,
    Pointer,
    Struct,
    Subrange,
    Text,
    Type,
    Union,
    type_text,
)

INDENT: Final = "    "
_PLAIN: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def st_text(type_: Type, name: str = "") -> str:
    """Return `TYPE ... END_TYPE` of a type and of every type in it; `name` for one that has none.

    A name that ST cannot carry is changed: `struct` becomes `struct_`, `a b` becomes `a_b`.
    """
    return "\n".join(_st_type(each, st_word(name)) for each in named_types(st_renamed(type_)))


def scl_text(type_: Type, name: str = "") -> str:
    """Return the same for TIA: names in quotes, no enumerations and subranges, a UNION as its bytes."""
    found = [each for each in named_types(type_) if isinstance(each, Struct)]
    if not found:  # TIA has no type that is an ARRAY
        found = [Struct(name, (Member("raw", type_),))]
    return "\n".join(_scl_type(each, name) for each in found)


# -- IEC ST --------------------------------------------------------------------------------------------------


def _st_type(type_: Type, name: str) -> str:
    base = getattr(type_, "base", None)
    extends = f" EXTENDS {base.name}" if isinstance(base, Struct | Union) else ""
    head = f"TYPE {getattr(type_, 'name', '') or name}{extends} :"
    match type_:
        case Struct() | Union():
            pack = "" if type_.pack is None else f"{{attribute 'pack_mode' := '{type_.pack}'}}\n"
            return f"{pack}{head}\n{_st_body(type_, '')}\nEND_TYPE\n"
        case Enumeration():
            return f"{head} {_st_enumeration(type_)}; END_TYPE\n"
        case _:
            return f"{head} {_st_spec(type_, '')}; END_TYPE\n"


def _st_body(type_: Struct | Union, indent: str) -> str:
    word = "STRUCT" if isinstance(type_, Struct) else "UNION"
    inner = indent + INDENT
    lines = [f"{indent}{word}"]
    lines += [
        f"{inner}{_mark(member.type, inner)}{member.name} : {_st_spec(member.type, inner)};"
        for member in type_.members
    ]
    return "\n".join([*lines, f"{indent}END_{word}"])


def _mark(type_: Type, indent: str) -> str:
    """Return the attribute before a member that is a STRING in UTF-8, or an ARRAY of such."""
    if isinstance(type_, Array):
        return _mark(type_.element, indent)
    is_utf8 = isinstance(type_, Text) and type_.utf8
    return f"{{attribute 'TcEncoding' := 'UTF-8'}}\n{indent}" if is_utf8 else ""


def _st_spec(type_: Type, indent: str) -> str:
    match type_:
        case Array(bounds=bounds, element=element):
            return f"ARRAY[{_ranges(bounds)}] OF {_st_spec(element, indent)}"
        case Struct() | Union() if not type_.name:
            return _st_body(type_, indent).lstrip()
        case Enumeration() if not type_.name:
            return _st_enumeration(type_)
        case Struct(name=name) | Union(name=name) | Enumeration(name=name):
            return name
        case _:
            return type_text(type_)


def _st_enumeration(type_: Enumeration) -> str:
    values = ", ".join(name if number is None else f"{name} := {number}" for name, number in type_.values)
    return f"({values})" + (f" {type_.base.name}" if type_.is_named else "")


# -- SCL -----------------------------------------------------------------------------------------------------


def scl_name(name: str) -> str:
    """Return the name of a member as TIA takes it: in quotes where it is no plain word or a keyword."""
    return name if _PLAIN.fullmatch(name) and not is_st_word(name) else _scl_quoted(name)


def _scl_quoted(name: str) -> str:
    # A character that nobody sees, or that a terminal obeys, is not handed on.
    return '"' + "".join(c if c.isprintable() and c != '"' else "_" for c in name) + '"'


def _scl_type(type_: Struct, name: str) -> str:
    head = f"TYPE {_scl_quoted(type_.name or name)}\nVERSION : 0.1\n{INDENT}STRUCT\n"
    return f"{head}{_scl_body(type_, INDENT)}{INDENT}END_STRUCT;\n\nEND_TYPE\n"


def _scl_body(type_: Struct, indent: str) -> str:
    inner = indent + INDENT
    lines = [
        f"{inner}{scl_name(member.name)} : {_scl_spec(member.type, inner)};\n"
        for member in _all_members(type_)
    ]
    return "".join(lines)


def _scl_spec(type_: Type, indent: str) -> str:
    match type_:
        case Array(bounds=bounds, element=element):
            return f"Array[{_ranges(bounds)}] of {_scl_spec(element, indent)}"
        case Struct(name=""):
            return f"Struct\n{_scl_body(type_, indent)}{indent}END_STRUCT"
        case Struct(name=name):
            return _scl_quoted(name)
        case Union():
            return f"Array[0..{max(lay_out(type_, S7).size, 1) - 1}] of Byte"
        case Enumeration(base=base):
            return base.name
        case Subrange(base=base):
            return base.name
        case Text(length=None, wide=wide):
            return "WString" if wide else "String"
        case Text(length=length, wide=wide):
            return f"{'WString' if wide else 'String'}[{length}]"
        case Pointer():
            return "LWORD"
        case _:
            return type_text(type_)


def _all_members(type_: Struct) -> tuple[Member, ...]:
    """Return the members, before them those of what the type EXTENDS: TIA has no such word."""
    return (_all_members(type_.base) if type_.base else ()) + type_.members


def _ranges(bounds: tuple[tuple[int, int], ...]) -> str:
    return ",".join(f"{low}..{high}" for low, high in bounds)


def named_types(type_: Type) -> list[Type]:
    """Return the named types of a declaration, each once, before its first use; itself last."""
    found: dict[int, Type] = {}
    for each in _named(type_, set()):
        found.setdefault(id(each), each)
    if id(type_) not in found:
        found[id(type_)] = type_
    return list(found.values())


def _named(type_: Type, seen: set[int]) -> Iterator[Type]:
    match type_:
        case Array(element=element):
            yield from _named(element, seen)
        case Struct() | Union():
            if id(type_) in seen:
                return
            seen.add(id(type_))
            if type_.base is not None:
                yield from _named(type_.base, seen)
            for member in type_.members:
                yield from _named(member.type, seen)
            if type_.name:
                yield type_
        case Enumeration(name=name):
            if name:
                yield type_
        case _:
            return
