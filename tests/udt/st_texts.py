"""Small ST texts as types, for the tests of the grammar table of udt.md section 5."""

from __future__ import annotations

from tests.udt.udt_strategies import types_of
from trcvtui.errors import Problem
from trcvtui.udt.ast import Declarations, Formula, MemberSpec, TypeName
from trcvtui.udt.sources import parse_source
from trcvtui.udt.type_set import TypeSet, join_declarations
from trcvtui.udt.types import ELEMENTARY, Struct, Type, Union, type_text

INT, BOOL, BYTE = ELEMENTARY["INT"], ELEMENTARY["BOOL"], ELEMENTARY["BYTE"]


def read(suffix: str, text: str) -> TypeSet:
    """Return the types of a text as of a file of that suffix."""
    types = join_declarations([parse_source(text, f"f{suffix}", suffix)], f"f{suffix}")
    assert [str(problem) for problem in types.problems] == []
    return types


def good(text: str) -> TypeSet:
    return read(".st", text)


def members(types: TypeSet, name: str) -> dict[str, str]:
    type_ = types.get_type(name)
    assert isinstance(type_, Struct | Union)
    return {member.name: type_text(member.type) for member in type_.members}


def member(text: str) -> Type:
    type_ = good(f"TYPE T : STRUCT {text} END_STRUCT END_TYPE").get_type("T")
    assert isinstance(type_, Struct)
    (only,) = type_.members
    return only.type


def lines(text: str) -> list[str]:
    return [str(problem) for problem in types_of(text, "f.st").problems]


def bare(read: Declarations) -> tuple[tuple[str, object], ...]:
    """Return types and their specifications without the places where they stand."""
    return tuple((type_.name, _bare(type_.spec)) for type_ in read.types)


def _bare(value: object) -> object:
    match value:
        case TypeName(name, _):
            return name.upper().removeprefix("_.")
        case Formula(text, _):
            return text.replace(" ", "")
        case MemberSpec(name, spec, _):
            return name, _bare(spec)
        case tuple() if hasattr(value, "_fields"):
            return (type(value).__name__, *(_bare(part) for part in value))
        case tuple():
            return tuple(_bare(part) for part in value)
    return value


def problems_of(read: Declarations) -> tuple[Problem, ...]:
    """Return what is wrong in the types, and beside them."""
    return (*(problem for type_ in read.types for problem in type_.problems), *read.problems)


def lines_of(read: Declarations) -> list[str]:
    return [str(problem) for problem in problems_of(read)]
