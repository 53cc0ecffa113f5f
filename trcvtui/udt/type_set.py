"""Declared types looked up and joined: the good ones as types, the bad ones with all that is wrong in them.

Rule: a bad type never hides a good one. Duplicates, recursion and unknown types are found together.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from trcvtui.errors import MOST_SHOWN, Problem, UserError, mistake
from trcvtui.udt.declared import (
    ArraySpec,
    Declaration,
    Declarations,
    EnumSpec,
    Reference,
    Spec,
    StructSpec,
)
from trcvtui.udt.types import ELEMENTARY, Array, Elementary, Enumeration, Kind, Member, Struct, Text, Type

# Baosky allows 6 or 8 levels (baosky.md section 8); beyond this no tool in the field follows.
MOST_NESTED = 32


@dataclass(frozen=True, slots=True)
class TypeSet:
    """The types of one or more files; `types` and `broken` by casefolded name, `problems` of all in order."""

    where: str
    types: dict[str, tuple[str, Type]]
    broken: dict[str, tuple[Problem, ...]]
    problems: tuple[Problem, ...]

    def names(self) -> list[str]:
        """Return the names of the good types, as declared, in declared order."""
        return [name for name, _ in self.types.values()]

    def named(self, name: str, where: str = "type") -> Type:
        """Return a type by name (in any case); raise UserError if it is bad, with all that is, or unknown."""
        key = name.casefold()
        if key in self.types:
            return self.types[key][1]
        if key in self.broken:
            raise UserError(self.broken[key])
        known = ", ".join(self.names()[:8]) or "no type"
        raise mistake(where, f"'{name}'", f"a type of {self.where}: {known}")

    def only(self) -> str:
        """Return the name of the only type; raise UserError when there are none, several or bad ones."""
        if self.problems:
            raise UserError(self.problems)
        if len(self.types) == 1:
            return self.names()[0]
        found = f"{len(self.types)} types: {', '.join(self.names()[:8])}" if self.types else "no type"
        raise mistake(self.where, found, "one type, or its name" if self.types else "TYPE ... END_TYPE")


NO_TYPES = TypeSet("the project", {}, {}, ())


def join(files: Iterable[Declarations], where: str) -> TypeSet:
    """Return the types of all files together; they may use each other in any order."""
    files = tuple(files)
    joining = _Joining(NO_TYPES)
    for file in files:
        for declaration in file.types:
            joining.declare(declaration)
    joining.build_all()
    found = {problem: None for bad in joining.bad.values() for problem in bad}
    found |= {problem: None for file in files for problem in file.problems}
    types = {key: (joining.declared[key].name, type_) for key, type_ in joining.types.items()}
    broken = {key: tuple(bad) for key, bad in joining.bad.items() if key not in types}
    in_order = {key: types[key] for key in joining.declared if key in types}
    return TypeSet(where, in_order, broken, tuple(sorted(found, key=_reading_order)))


def _reading_order(problem: Problem) -> list[str | int]:
    # Text and numbers alternate, so that line 9 comes before line 10.
    return [int(part) if part.isdigit() else part for part in re.split("([0-9]{1,18})", problem.where)]


def build(spec: Spec, types: TypeSet) -> Type:
    """Return the type that a specification means among these types; raise UserError with all its problems."""
    joining = _Joining(types)
    type_, _ = joining.build(spec, "", "")
    if type_ is None:
        raise UserError(joining.bad[""])
    return type_


class _Joining:
    """One joining: what is declared, what became of it, and what is wrong with it (an ordered set each)."""

    def __init__(self, known: TypeSet) -> None:
        self.known = known
        self.declared: dict[str, Declaration] = {}
        self.types: dict[str, Type] = {}
        self.depths: dict[str, int] = {}
        self.bad: dict[str, dict[Problem, None]] = {}

    def declare(self, declaration: Declaration) -> None:
        key = declaration.name.casefold()
        first = self.declared.setdefault(key, declaration)
        for problem in declaration.problems:
            self.refuse(key, problem)
        if first is not declaration:
            expected = f"one declaration of it; the first is at {first.where}"
            self.refuse(key, Problem(declaration.where, f"'{declaration.name}' a second time", expected))
        if declaration.name.upper() in ELEMENTARY:
            self.refuse(
                key, Problem(declaration.where, f"'{declaration.name}'", "a name that no IEC type has")
            )

    def refuse(self, key: str, *problems: Problem) -> None:
        bad = self.bad.setdefault(key, {})
        for problem in problems:
            # What a type only inherits from the types it uses is bounded: a chain of bad types stays cheap.
            if len(bad) < 2 * MOST_SHOWN or len(problems) == 1:
                bad[problem] = None

    def build_all(self) -> None:
        for key in self.in_order():
            declaration = self.declared[key]
            if declaration.spec is None:
                continue
            type_, depth = self.build(declaration.spec, declaration.name, key)
            if depth > MOST_NESTED:
                found, expected = f"'{declaration.name}' nested {depth} deep", f"at most {MOST_NESTED} levels"
                self.refuse(key, Problem(declaration.where, found, expected))
            if type_ is not None and key not in self.bad:
                self.types[key], self.depths[key] = type_, depth

    def in_order(self) -> list[str]:
        """Return all declared keys, each after the ones it uses, without recursion: chains may be long."""
        order: list[str] = []
        seen: set[str] = set()
        for root in self.declared:
            path = [] if root in seen else [(root, self.uses(root))]
            seen.add(root)
            while path:
                key, rest = path[-1]
                used = next((used for used in rest if used not in seen), None)
                if used is None:
                    order.append(key)
                    path.pop()
                else:
                    seen.add(used)
                    path.append((used, self.uses(used)))
        return order

    def uses(self, key: str) -> Iterator[str]:
        spec = self.declared[key].spec
        names = (reference.name.casefold() for reference in references(spec)) if spec else ()
        return (name for name in names if name in self.declared)

    def build(self, spec: Spec, name: str, user: str) -> tuple[Type | None, int]:
        """Return the type of a specification and how deep it nests; None when something in it is bad."""
        match spec:
            case Text():
                return spec, 0
            case Reference():
                return self.look_up(spec, user)
            case ArraySpec(bounds, inner):
                element, depth = self.build(inner, "", user)
                return None if element is None else Array(bounds, element), depth + 1
            case EnumSpec():
                return self.build_enum(spec, name, user), 0
            case StructSpec():
                return self.build_struct(spec, name, user)

    def build_struct(self, spec: StructSpec, name: str, user: str) -> tuple[Type | None, int]:
        members: list[Member] = []
        firsts: dict[str, str] = {}
        deepest = 0
        for member in spec.members:
            first = firsts.setdefault(member.name.casefold(), member.where)
            if first is not member.where:
                expected = f"a new name; the first is at {first}"
                self.refuse(user, Problem(member.where, f"member '{member.name}' a second time", expected))
            type_, depth = self.build(member.spec, "", user)
            deepest = max(deepest, depth)
            if type_ is not None:
                members.append(Member(member.name, type_))
        return Struct(name, tuple(members)) if len(members) == len(spec.members) else None, deepest + 1

    def build_enum(self, spec: EnumSpec, name: str, user: str) -> Type | None:
        base = ELEMENTARY["INT"] if spec.base is None else self.look_up(spec.base, user)[0]
        if isinstance(base, Elementary) and base.kind in (Kind.INTEGER, Kind.BITS):
            return Enumeration(name, base, spec.values)
        if base is not None and spec.base is not None:
            self.refuse(user, Problem(spec.base.where, f"'{spec.base.name}'", "an integer type such as INT"))
        return None

    def look_up(self, reference: Reference, user: str) -> tuple[Type | None, int]:
        key = reference.name.casefold()
        row = ELEMENTARY.get(reference.name.upper())
        if row is not None:
            return row, 0
        if key in self.types:
            return self.types[key], self.depths[key]
        if key in self.known.types:
            return self.known.types[key][1], 0
        if key in self.bad or key in self.known.broken:
            self.refuse(user, *(self.bad.get(key) or self.known.broken[key]))
        elif key in self.declared:
            found = f"'{reference.name}', which contains this member"
            self.refuse(user, Problem(reference.where, found, "a type that does not contain itself"))
        else:
            self.refuse(user, Problem(reference.where, f"'{reference.name}'", "a known type"))
        return None, 0


def references(spec: Spec) -> Iterator[Reference]:
    """Yield every name of a type in a specification."""
    match spec:
        case Reference():
            yield spec
        case ArraySpec(_, element):
            yield from references(element)
        case EnumSpec(base=Reference() as base):
            yield base
        case StructSpec(members):
            for member in members:
                yield from references(member.spec)
