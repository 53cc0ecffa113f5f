"""Types as source text: IEC ST, the TYPE of a TIA source (SCL), and names that are legal in them.

Rules: a legal name stays unchanged. A text contains every type that it uses, before the type is used.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from trcvtui.errors import mistake
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import LayoutRules
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Enumeration,
    Member,
    Pointer,
    StringType,
    Struct,
    Subrange,
    Type,
    Union,
    all_members,
    direct_parts,
    type_text,
)


def ascii_word(name: str) -> str:
    """Return the name in ASCII letters, digits and `_`: `Größe` is `Gro_e`, `é` loses its accent."""
    plain = unicodedata.normalize("NFKD", name)
    plain = "".join(c for c in plain if not unicodedata.combining(c))
    return re.sub(r"\W", "_", plain, flags=re.ASCII)


class NameScope:
    """The names given so far in one scope. A name that is taken gets a number.

    Names are compared as `fold` returns them, because a language may ignore case.
    """

    def __init__(self, escaped: Callable[[str], str], fold: Callable[[str], str] = str) -> None:
        self._escaped, self._fold = escaped, fold
        self._names: set[str] = set()

    def __call__(self, name: str) -> str:
        word = start = self._escaped(name)
        number = 2
        while self._fold(word) in self._names:
            word = f"{start}_{number}"
            number += 1
        self._names.add(self._fold(word))
        return word


# IEC 61131-3, third edition, with what CODESYS and TIA add to it.
KEYWORD_TEXT: Final = """
abstract action and and_then array at begin bool by case class configuration const constant continue do else
elsif end_action end_case end_class end_configuration end_for end_function end_function_block end_if
end_interface end_method end_namespace end_program end_property end_repeat end_resource end_step end_struct
end_transition end_type end_union end_var end_while exit extends f_edge false final for from function
function_block goto if implements initial_step interface internal jmp method mod namespace not null of on or
or_else overlap override persistent pointer private program property protected public r_edge read_only
read_write ref ref_to reference region repeat resource retain return single step string struct super task
then this to transition true type union until using var var_access var_config var_constant var_external
var_global var_in_out var_input var_output var_temp version while with wstring xor
"""
ST_WORDS: Final = frozenset(KEYWORD_TEXT.upper().split()) | {name.upper() for name in ELEMENTARY}


def st_name(name: str) -> str:
    """Return a name that is legal in IEC ST. A keyword, in any case, gets `_` after it."""
    word = ascii_word(name)
    if word != name:  # CODESYS refuses two underscores in a row
        word = re.sub("_+", "_", word)
    if not word or word[0].isdigit():
        word = "_" + word
    return word + "_" if is_st_keyword(word) else word


def is_st_keyword(name: str) -> bool:
    """Return whether the name is a keyword, or an elementary type."""
    return name.upper() in ST_WORDS


def rename_for_st(type_: Type) -> Type:
    return _StRenamer().rename(type_)


class _StRenamer:
    """Renames a type and all types in it, each once."""

    def __init__(self) -> None:
        self.names = NameScope(st_name, str.casefold)  # of types
        self._made: dict[int, tuple[Type, Type]] = {}  # keeps the old one, so that its id is not reused

    def rename(self, type_: Type) -> Type:
        match type_:
            case Array(bounds=bounds, element=element):
                return Array(bounds, self.rename(element))
            case Struct() | Union() | Enumeration():
                if id(type_) not in self._made:
                    made = self.enumeration(type_) if isinstance(type_, Enumeration) else self.struct(type_)
                    self._made[id(type_)] = type_, made
                return self._made[id(type_)][1]
            case _:
                return type_

    def struct(self, type_: Struct | Union) -> Struct | Union:
        base = None if type_.base is None else self.rename(type_.base)
        taken = NameScope(st_name, str.casefold)
        for member in all_members(base if isinstance(base, Struct | Union) else None):
            taken(member.name)
        members = tuple(Member(taken(member.name), self.rename(member.type)) for member in type_.members)
        name = self.names(type_.name) if type_.name else ""
        # The base of a STRUCT is a STRUCT, of a UNION a UNION.
        return replace(type_, name=name, members=members, base=base)  # type: ignore[arg-type]

    def enumeration(self, type_: Enumeration) -> Enumeration:
        taken = NameScope(st_name, str.casefold)
        values = tuple((taken(name), number) for name, number in type_.values)
        return replace(type_, name=self.names(type_.name) if type_.name else "", values=values)


INDENT: Final = "    "
_PLAIN_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def st_text(type_: Type, name: str = "") -> str:
    """Return `TYPE ... END_TYPE` of a type and of every type in it. A type without a name gets `name`.

    A name that is illegal in ST is changed: `struct` becomes `struct_`, `a b` becomes `a_b`.
    """
    return "\n".join(_st_type(each, st_name(name)) for each in named_types(rename_for_st(type_)))


def scl_text(type_: Type, name: str, rules: LayoutRules) -> str:
    """Return TYPE blocks for TIA with quoted names, no enumerations or subranges, and a UNION as its bytes.

    Under `rules` the members have the same offsets, except where a UNION aligned them.
    """
    found = [each for each in named_types(type_) if isinstance(each, Struct)]
    if not found:  # in TIA only a STRUCT is a type: an ARRAY becomes a member of one
        found = [Struct(name, (Member("raw", type_),))]
    head, end = f"VERSION : 0.1\n{INDENT}STRUCT", f"{INDENT}END_STRUCT;\n\nEND_TYPE\n"
    return "\n".join(
        f"TYPE {_quote_scl(one.name or name)}\n{head}\n{_scl_body(one, INDENT, rules)}{end}" for one in found
    )


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
        f"{inner}{_utf8_attribute(member.type, inner)}{member.name} : {_st_spec(member.type, inner)};"
        for member in type_.members
    ]
    return "\n".join([*lines, f"{indent}END_{word}"])


def _utf8_attribute(type_: Type, indent: str) -> str:
    """Return the attribute in front of a member that is a STRING in UTF-8, or an ARRAY of them."""
    if isinstance(type_, Array):
        return _utf8_attribute(type_.element, indent)
    is_utf8 = isinstance(type_, StringType) and type_.utf8
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
    """Return the name of a member for TIA: in quotes unless it is a plain word and no keyword."""
    return name if _PLAIN_NAME.fullmatch(name) and not is_st_keyword(name) else _quote_scl(name)


def _quote_scl(name: str) -> str:
    # Invisible characters and terminal control codes are replaced.
    return '"' + "".join(c if c.isprintable() and c != '"' else "_" for c in name) + '"'


def _scl_body(type_: Struct, indent: str, rules: LayoutRules) -> str:
    inner = indent + INDENT
    return "".join(
        f"{inner}{scl_name(one.name)} : {_scl_spec(one.type, inner, rules)};\n" for one in all_members(type_)
    )


def join_arrays(type_: Array, rules: LayoutRules) -> Array:
    """Join an ARRAY of ARRAYs into one ARRAY with all bounds, for SCL, unless that moves elements."""
    if not isinstance(type_.element, Array):
        return type_
    inner = join_arrays(type_.element, rules)
    found = Array((*type_.bounds, *inner.bounds), inner.element)
    return found if lay_out(found, rules).size == lay_out(type_, rules).size else Array(type_.bounds, inner)


def _scl_spec(type_: Type, indent: str, rules: LayoutRules) -> str:
    match type_:
        case Array():
            one = join_arrays(type_, rules)
            return f"Array[{_ranges(one.bounds, ', ')}] of {_scl_spec(one.element, indent, rules)}"
        case Struct(name=""):
            return f"Struct\n{_scl_body(type_, indent, rules)}{indent}END_STRUCT"
        case Struct(name=name):
            return _quote_scl(name)
        case Union():
            return f"Array[0..{max(lay_out(type_, rules).size, 1) - 1}] of Byte"
        case Enumeration(base=base) | Subrange(base=base):
            return base.name
        case StringType():
            return type_text(type_).replace("STRING", "String")
        case Pointer():
            return "LWORD" if rules.pointer_size == 8 else "DWORD"
        case _:
            return type_text(type_)


def _ranges(bounds: tuple[tuple[int, int], ...], comma: str = ",") -> str:
    return comma.join(f"{low}..{high}" for low, high in bounds)


def named_types(type_: Type) -> list[Type]:
    """Return the named types of a declaration, each once and before its first use, the type itself last."""
    found: dict[int, Type] = {}
    seen: set[int] = set()

    def collect(one: Type) -> None:
        if id(one) in seen:
            return
        seen.add(id(one))
        for part in direct_parts(one):
            collect(part)
        if isinstance(one, Struct | Union) and one.bit_fields:
            raise mistake(one.name or "STRUCT", "bit-fields or an open array of C", "a type without")
        if isinstance(one, Struct | Union | Enumeration) and one.name:
            found[id(one)] = one

    collect(type_)
    found.setdefault(id(type_), type_)
    return list(found.values())
