"""A type with names that a language can carry: types, members, values of enumerations, each in its scope.

Rule: what is legal stays, and a type in which nothing has to change is the same type.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from trcvtui.udt.exports.naming import Taken, ascii_word
from trcvtui.udt.types import ELEMENTARY, Array, Enumeration, Member, Struct, Type, Union

# IEC 61131-3, third edition, with what CODESYS and TIA add to it.
WORDS: Final = """
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
ST_WORDS: Final = frozenset(WORDS.upper().split()) | {name.upper() for name in ELEMENTARY}


def st_word(name: str) -> str:
    """Return the name as IEC ST can carry it: a keyword, in any case, gets `_` behind it."""
    word = ascii_word(name)
    if word != name:  # CODESYS takes no two underscores in a row
        word = re.sub("_+", "_", word)
    if not word or word[0].isdigit():
        word = "_" + word
    return word + "_" if is_st_word(word) else word


def is_st_word(name: str) -> bool:
    """Return whether the name is a keyword, or an elementary type."""
    return name.upper() in ST_WORDS


def st_renamed(type_: Type) -> Type:
    """Return the type with names for IEC ST."""
    return Renaming(st_word, str.casefold).of(type_)


class Renaming:
    """One renaming; `escaped` and `fold` as in Taken. Types are renamed once, and know each other's names."""

    def __init__(self, escaped: Callable[[str], str], fold: Callable[[str], str] = str) -> None:
        self.escaped, self.fold = escaped, fold
        self.names = Taken(escaped, fold)  # of types
        self._made: dict[int, tuple[Type, Type]] = {}  # the old one is kept, so that its id stays its own

    def of(self, type_: Type) -> Type:
        """Return the type renamed."""
        match type_:
            case Array(bounds=bounds, element=element):
                made = self.of(element)
                return type_ if made is element else Array(bounds, made)
            case Struct() | Union() | Enumeration():
                if id(type_) not in self._made:
                    made = self.enumeration(type_) if isinstance(type_, Enumeration) else self.struct(type_)
                    self._made[id(type_)] = type_, made
                return self._made[id(type_)][1]
            case _:
                return type_

    def struct(self, type_: Struct | Union) -> Struct | Union:
        base = None if type_.base is None else self.of(type_.base)
        taken = Taken(self.escaped, self.fold)
        for name in _names(base):
            taken(name)
        members = tuple(Member(taken(member.name), self.of(member.type)) for member in type_.members)
        name = self.names(type_.name) if type_.name else ""
        pairs = zip(members, type_.members, strict=True)
        is_same = all((new.name, id(new.type)) == (old.name, id(old.type)) for new, old in pairs)
        if is_same and base is type_.base and name == type_.name:
            return type_
        made = Struct if isinstance(type_, Struct) else Union
        return made(name, members, base, type_.pack)  # type: ignore[arg-type]  # a base is of its own kind

    def enumeration(self, type_: Enumeration) -> Enumeration:
        taken = Taken(self.escaped, self.fold)
        values = tuple((taken(name), number) for name, number in type_.values)
        name = self.names(type_.name) if type_.name else ""
        return (
            type_
            if (name, values) == (type_.name, type_.values)
            else replace(type_, name=name, values=values)
        )


def _names(base: Type | None) -> list[str]:
    if not isinstance(base, Struct | Union):
        return []
    return [*_names(base.base), *(member.name for member in base.members)]
